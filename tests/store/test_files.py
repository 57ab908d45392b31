"""Atomic files, the ledger, the lock, events, metrics and the run's identity."""

from __future__ import annotations

import hashlib
import json
import os
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from pnabs.store import atomic, lock, sealed
from pnabs.store.events import EventLog, read_events
from pnabs.store.ledger import Ledger, LedgerError, ModelVerdict, Record
from pnabs.store.lock import LockedError, NotHeldError, check_held, run_lock
from pnabs.store.metrics import read_metrics, write_metrics
from pnabs.store.run import RunFolder, RunFolderError


def test_atomic_write_leaves_the_old_file_when_it_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "deep" / "file"
    atomic.write_atomic(path, b"old")

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic.os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        atomic.write_atomic(path, b"new")
    assert path.read_bytes() == b"old"
    assert [p.name for p in path.parent.iterdir()] == ["file"]


def test_digests_have_one_spelling() -> None:
    assert atomic.digest({"b": 1, "a": [1.5, "é"]}) == atomic.digest({"a": [1.5, "é"], "b": 1})
    assert atomic.digest({"a": 1}) != atomic.digest({"a": 2})
    with pytest.raises(ValueError, match="Out of range"):
        atomic.digest({"a": float("nan")})


def record(**changes: object) -> Record:
    values = {
        "stage": "ingest",
        "shard": "03001627-00002",
        "fingerprint": "f" * 64,
        "models": (
            ModelVerdict("a", "ok", note={"source_sha256": "0"}),
            ModelVerdict("b", "crash", "the process died of SIGSEGV", 2, "File x, line 3"),
        ),
        "outputs": {},
    }
    return Record(**(values | changes))  # type: ignore[arg-type]


def test_ledger_round_trip_and_quarantine(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path)
    assert ledger.read("ingest", "03001627-00002") is None
    ledger.commit(record())
    assert ledger.read("ingest", "03001627-00002") == record()
    assert ledger.shards("ingest") == ["03001627-00002"]
    assert ledger.stages() == ["ingest"]
    ledger.write_quarantine("ingest")
    lines = ledger.quarantine_path("ingest").read_text().splitlines()
    assert [json.loads(line) for line in lines] == [
        {
            "model_id": "b",
            "category": "03001627",
            "kind": "crash",
            "reason": "the process died of SIGSEGV",
            "attempts": 2,
            "traceback": "File x, line 3",
        }
    ]
    ledger.withdraw("ingest", "03001627-00002")
    assert ledger.read("ingest", "03001627-00002") is None


def test_ledger_schema_is_as_documented(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path)
    ledger.commit(record(outputs={"fields.zarr/x": {"bytes": 3, "sha256": "1"}}))
    value = json.loads(ledger.path("ingest", "03001627-00002").read_bytes())
    assert len(value.pop("sha256")) == 64
    assert value == {
        "format": "pnabs/ledger",
        "version": 2,
        "stage": "ingest",
        "shard": "03001627-00002",
        "fingerprint": "f" * 64,
        "models": [
            {"model_id": "a", "verdict": "ok", "note": {"source_sha256": "0"}},
            {
                "model_id": "b",
                "verdict": "crash",
                "reason": "the process died of SIGSEGV",
                "attempts": 2,
                "traceback": "File x, line 3",
            },
        ],
        "outputs": {"fields.zarr/x": {"bytes": 3, "sha256": "1"}},
    }


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "damaged"),
        ("", "damaged"),
        ('{"format": "other"}', "damaged"),
        ('{"format": "pnabs/ledger", "version": 1}', "version 1, this pnabs reads 2"),
        (sealed.seal({"format": "pnabs/ledger", "version": 9}).decode(), "version 9"),
    ],
)
def test_ledger_refuses_what_it_does_not_know(tmp_path: Path, text: str, says: str) -> None:
    ledger = Ledger(tmp_path)
    ledger.commit(record())
    ledger.path("ingest", "03001627-00002").write_text(text)
    with pytest.raises(LedgerError, match=says):
        ledger.read("ingest", "03001627-00002")


VALUE = {"format": "pnabs/test", "text": 'Gehäuse \\ "x"', "list": [1.5, None], "sha256x": {}}


def test_sealed_json_is_json(tmp_path: Path) -> None:
    data = sealed.seal(VALUE)
    loaded = json.loads(data)
    assert len(loaded.pop("sha256")) == 64
    assert loaded == VALUE == sealed.unseal(data)
    assert sealed.seal(dict(reversed(VALUE.items()))) == data


def test_no_byte_of_sealed_json_changes_unnoticed() -> None:
    data = sealed.seal(VALUE)
    for place in range(len(data)):
        for bit in range(8):
            changed = bytearray(data)
            changed[place] ^= 1 << bit
            with pytest.raises(sealed.SealError):
                sealed.unseal(bytes(changed))
        with pytest.raises(sealed.SealError):
            sealed.unseal(data[:place])
    with pytest.raises(sealed.SealError):
        sealed.unseal(data + b"\n")


def test_what_later_stages_take_leaves_out_how_a_model_failed() -> None:
    fallen = ModelVerdict("b", "timeout", "no result within 3 s", 2, "another stack")
    assert record(models=(record().models[0], fallen)).digest == record().digest
    assert record(models=record().models[:1]).digest != record().digest
    assert record(fingerprint="0").digest != record().digest
    assert record(outputs={"x": {"bytes": 1, "sha256": "2"}}).digest != record().digest


def test_the_index_follows_the_records(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ledger = Ledger(tmp_path)
    for number in range(5):
        ledger.commit(record(shard=f"c-{number:05d}", fingerprint=str(number)))
    ledger.save_index("ingest")
    expected = dict(ledger.index("ingest"))
    assert [entry.fingerprint for entry in expected.values()] == list("01234")
    assert expected["c-00003"].fallen == (("b", "crash"),)

    read = []
    original = Ledger.read
    monkeypatch.setattr(Ledger, "read", lambda *a: read.append(a[2]) or original(*a))
    # Another process takes all from the index; what isn't in it, or changed, from the records.
    assert Ledger(tmp_path).index("ingest") == expected
    assert read == []
    other = Ledger(tmp_path)
    other.commit(record(shard="c-00005", fingerprint="new"))
    other.commit(record(shard="c-00001", fingerprint="changed"))
    other.withdraw("ingest", "c-00002")
    assert Ledger(tmp_path).index("ingest") == other.index("ingest")
    assert sorted(read) == ["c-00001", "c-00005"]
    assert Ledger(tmp_path).lost("ingest") == ["c-00002"]


@pytest.mark.parametrize("damage", ["delete", "flip", "empty", "version"])
def test_a_lost_index_is_made_from_the_records(tmp_path: Path, damage: str) -> None:
    ledger = Ledger(tmp_path)
    ledger.commit(record())
    ledger.save_index("ingest")
    path = ledger.index_path("ingest")
    data = bytearray(path.read_bytes())
    if damage == "delete":
        path.unlink()
    elif damage == "version":
        body = bytes(data).partition(b"\n")[2].replace(b'"version":1', b'"version":9')
        path.write_bytes(hashlib.sha256(body).hexdigest().encode() + b"\n" + body)
    else:
        data[-40] ^= 1
        path.write_bytes(data if damage == "flip" else b"")
    assert Ledger(tmp_path).index("ingest") == ledger.index("ingest")


def test_a_damaged_record_counts_as_not_there(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path)
    ledger.commit(record())
    path = ledger.path("ingest", "03001627-00002")
    path.write_bytes(path.read_bytes()[:-9])
    assert Ledger(tmp_path).index("ingest") == {}


def test_damaged_outputs_are_named(tmp_path: Path) -> None:
    (tmp_path / "kept").write_bytes(b"12")
    (tmp_path / "flipped").write_bytes(b"12")
    outputs = {name: atomic.file_digest(tmp_path / name) for name in ("kept", "flipped")}
    outputs["gone"] = outputs["kept"]
    (tmp_path / "flipped").write_bytes(b"13")
    assert Ledger(tmp_path).damaged_outputs(record(outputs=outputs)) == ["flipped", "gone"]


HOLD = """
import sys, time
from pathlib import Path
from pnabs.store.lock import run_lock
with run_lock(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_two_drivers_never_write_one_run(tmp_path: Path) -> None:
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert holder.stdin is not None
    assert holder.stdout is not None
    try:
        assert holder.stdout.readline() == "held\n"
        says = f"process {holder.pid} on {socket.gethostname()}, for [0-9]+ seconds"
        with pytest.raises(LockedError, match=says), run_lock(tmp_path):
            pass
        found = lock.holder(tmp_path)
        assert found is not None
        assert found.pid == holder.pid
    finally:
        holder.kill()
        holder.communicate()
    assert lock.holder(tmp_path) is None
    # A dead holder's lock is free.
    with run_lock(tmp_path) as token:
        assert json.loads((tmp_path / "lock").read_text())["pid"] == os.getpid()
        check_held(tmp_path, token)
        with pytest.raises(NotHeldError, match=f"held by process {os.getpid()}"):
            check_held(tmp_path, "another")
    with pytest.raises(NotHeldError, match="held by nobody"):
        check_held(tmp_path, token)
    with pytest.raises(NotHeldError, match="out of reach"):
        check_held(tmp_path / "elsewhere", token)


@pytest.mark.parametrize("alive", [True, False])
def test_a_holder_on_another_machine_is_watched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, alive: bool
) -> None:
    """Where `flock` doesn't reach across machines: a stranger's entry, kept up or not."""
    monkeypatch.setattr(lock, "BEAT_SECONDS", 0.1)
    entry = {"host": "elsewhere", "pid": 7, "since": time.time() - 600, "token": "t", "beat": 0}
    path = tmp_path / "lock"
    path.write_text(json.dumps(entry))
    stop = threading.Event()

    def beat() -> None:
        while not stop.wait(0.05):
            path.write_text(json.dumps({**entry, "beat": time.time()}))

    beating = threading.Thread(target=beat)
    if alive:
        beating.start()
    try:
        if alive:
            says = "process 7 on elsewhere, for 10 minutes"
            with pytest.raises(LockedError, match=says), run_lock(tmp_path):
                pass
        else:
            with run_lock(tmp_path):
                assert lock.holder(tmp_path) is not None
    finally:
        stop.set()
        if alive:
            beating.join()


def test_what_a_killed_writer_left_is_swept(tmp_path: Path) -> None:
    run = RunFolder(tmp_path)
    run.ledger.commit(record())
    names = ("ledger/ingest/.x.json.0a1b.partial", ".run.json.0a1b.partial")
    for name in names:
        (tmp_path / name).write_bytes(b"half")
    run.sweep()
    assert not list(tmp_path.rglob("*.partial"))
    assert run.ledger.shards("ingest") == ["03001627-00002"]


def test_events_append_and_a_torn_line_is_passed_over(tmp_path: Path) -> None:
    for number in range(2):
        log = EventLog(tmp_path, "driver")
        log("shard", number=number)
        log.close()
    with (tmp_path / "events" / "driver" / "00001.jsonl").open("a") as stream:
        stream.write('{"event": "sha')
    assert [event["number"] for event in read_events(tmp_path, "driver")] == [0, 1]


def test_metrics_round_trip(tmp_path: Path) -> None:
    row = {"category": "c", "model_id": "m", "split": "test", "status": "ok", "iou_64": 0.5}
    failed = {"category": "c", "model_id": "n", "split": "test", "status": "crash"}
    path = tmp_path / "metrics" / "c-00000.parquet"
    outputs = write_metrics(tmp_path, path, [row, failed])
    assert list(outputs) == ["metrics/c-00000.parquet"]
    table = read_metrics([path, path])
    assert table["iou_64"].to_pylist() == [0.5, None, 0.5, None]
    assert table["positive_cuboids"].null_count == 4


def test_a_folder_of_something_else_is_refused(tmp_path: Path) -> None:
    assert RunFolder(tmp_path).read_identity() is None
    (tmp_path / "thesis.tex").write_text("x")
    with pytest.raises(RunFolderError, match="neither empty nor a run"):
        RunFolder(tmp_path).read_identity()
