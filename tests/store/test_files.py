"""Atomic files, the ledger, the lock, events, metrics and the run's identity."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from pnabs.store import atomic
from pnabs.store.events import EventLog, read_events
from pnabs.store.ledger import Ledger, LedgerError, ModelVerdict, Record
from pnabs.store.lock import LockedError, run_lock
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
    lines = ledger.write_quarantine("ingest").read_text().splitlines()
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
    assert json.loads(ledger.path("ingest", "03001627-00002").read_bytes()) == {
        "format": "pnabs/ledger",
        "version": 1,
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
        ("{", "not a ledger record"),
        ('{"format": "other"}', "not a ledger record"),
        ('{"format": "pnabs/ledger", "version": 2}', "version 2"),
    ],
)
def test_ledger_refuses_what_it_does_not_know(tmp_path: Path, text: str, says: str) -> None:
    ledger = Ledger(tmp_path)
    ledger.commit(record())
    ledger.path("ingest", "03001627-00002").write_text(text)
    with pytest.raises(LedgerError, match=says):
        ledger.read("ingest", "03001627-00002")


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
        with pytest.raises(LockedError, match=f"process {holder.pid} on"), run_lock(tmp_path):
            pass
    finally:
        holder.kill()
        holder.communicate()
    # A dead holder's lock is free.
    with run_lock(tmp_path):
        assert json.loads((tmp_path / "lock").read_text())["pid"]


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
