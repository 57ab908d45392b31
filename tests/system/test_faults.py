"""What others do to a run: bad models, full disks, datasets that vanish, a second driver."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from pnabs.cli import main
from pnabs.settings import Settings
from pnabs.stages.errors import (
    InterruptedRunError,
    ShardsFailedError,
    StorageError,
    TooManyFailedError,
)
from pnabs.stages.run import Result
from pnabs.stages.sharded import _Progress
from pnabs.store.events import read_events
from pnabs.store.ledger import Ledger
from pnabs.store.run import RunFolder
from tests.batch.tasks import FAULTS, VERDICTS, invocations
from tests.system.conftest import Launcher, tree
from tests.system.faults import wrapped

INGEST = ("scan", "ingest")


def ingested(run: Path) -> dict[str, bytes]:
    """The part of a run's results that ingest makes."""
    parts = ("catalogue.parquet", "fields.zarr/", "ledger/ingest/", "quarantine/ingest")
    return {name: data for name, data in tree(run).items() if name.startswith(parts)}


def models(run: Path) -> list[tuple[str, str, int]]:
    """Shard, id and row of every model."""
    ledger = Ledger(run)
    out = []
    for shard in ledger.shards("ingest"):
        record = ledger.read("ingest", shard)
        assert record
        out += [(shard, model.model_id, row) for row, model in enumerate(record.models)]
    return out


def patch_work(monkeypatch: pytest.MonkeyPatch, counts: Path, table: dict[str, str]) -> None:
    for name, value in wrapped(counts, table).items():
        monkeypatch.setattr(name, value)


def on_start(monkeypatch: pytest.MonkeyPatch, number: int, act: Callable[[Any], None]) -> None:
    """Do something in the driver when the n-th shard is given out."""
    left = [number]
    started = _Progress.started

    def watched(progress: Any, shard: str, where: str) -> None:
        started(progress, shard, where)
        left[0] -= 1
        if left[0] == 0:
            act(progress)

    monkeypatch.setattr(_Progress, "started", watched)


def test_bad_models_fall_out_alone_and_their_neighbours_are_as_without_them(
    finished: tuple[Path, Result],
    launch: Launcher,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    run, counts = tmp_path / "run", tmp_path / "counts"
    known = [item for item in models(finished[0]) if item[1] != "f" * 32]
    # Every other model misbehaves, so that each has sound neighbours; the last two recover.
    bad = dict(zip([name for _, name, _ in known[::2]], FAULTS, strict=False))
    again = {known[1][1]: "crash,ok", known[3][1]: "slow"}
    patch_work(monkeypatch, counts, {**{name: FAULTS[key] for name, key in bad.items()}, **again})
    launch(run, "runtime.deadline=6", "runtime.memory=4000000000", stages=INGEST)

    lines = (run / "quarantine/ingest.jsonl").read_text().splitlines()
    quarantine = {entry["model_id"]: entry for entry in map(json.loads, lines)}
    assert quarantine.keys() == bad.keys() | {"f" * 32}
    for name, key in bad.items():
        kind, reason, trace = VERDICTS[key]
        assert quarantine[name]["kind"] == kind
        assert reason in quarantine[name]["reason"]
        assert trace in quarantine[name]["traceback"]
        assert quarantine[name]["attempts"] == (1 if key == "invalid" else 2)
    every = [name for _, name, _ in models(run)]
    twice = {name for name, key in bad.items() if key != "invalid"} | {known[1][1]}
    counted = invocations(counts / "ingest", every)
    assert counted == {name: 2 if name in twice else 1 for name in every}

    stores = [RunFolder(path).fields(job_of(path)) for path in (run, finished[0])]
    for shard, name, row in models(run):
        category, number = shard.rsplit("-", 1)
        for spec in stores[0].specs:
            ours, theirs = (s.read_shard(category, int(number), spec.name, row + 1) for s in stores)
            if name in bad:
                assert not ours[row].any()
            else:
                np.testing.assert_array_equal(ours[row], theirs[row])


def job_of(run: Path) -> Settings:
    identity = RunFolder(run).read_identity()
    assert identity
    return Settings.model_validate(identity["settings"])


def test_retry_tries_the_quarantined_again_and_nothing_else(
    finished: tuple[Path, Result],
    launch: Launcher,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    run = tmp_path / "run"
    known = models(finished[0])
    shard, name, _ = known[0]
    with monkeypatch.context() as faulty:
        patch_work(faulty, tmp_path / "counts", {name: "crash"})
        launch(run, stages=INGEST)
    assert name in (run / "quarantine/ingest.jsonl").read_text()
    monkeypatch.setattr("pnabs.stages.run.STAGES", INGEST)
    nothing = CliRunner().invoke(main, ["retry", str(run), "--kind", "timeout", "--max-failed=50"])
    assert nothing.exit_code == 0
    assert "0 quarantined models are tried again" in nothing.stderr
    wrong = CliRunner().invoke(main, ["retry", str(run), "--stage", "ingets"])
    assert wrong.exit_code == 2
    done = CliRunner().invoke(main, ["retry", str(run), "--kind", "crash", "--max-failed", "50"])
    assert done.exit_code == 0, done.output
    assert ingested(run) == ingested(finished[0])
    shards = [e["shard"] for e in read_events(run, "driver") if e["event"] == "shard-start"]
    assert shards.count(shard) == 2
    assert len(shards) == len(set(shards)) + 1


@pytest.mark.slow
def test_settings_that_are_set_back_leave_nothing_of_the_others(
    finished: tuple[Path, Result],
    launch: Launcher,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A change that is accepted, stopped half-way, and taken back."""
    run = tmp_path / "copy"
    shutil.copytree(finished[0], run)

    def stop(_: object) -> None:
        raise InterruptedRunError("stopped", 130)

    with monkeypatch.context() as once:
        on_start(once, 4, stop)
        with pytest.raises(InterruptedRunError):
            launch(run, "abstract.debris=0.2", accept=True)
    ours, theirs = tree(run), tree(finished[0])
    assert any(ours[name] != theirs[name] for name in theirs if name in ours)
    assert CliRunner().invoke(main, ["verify", str(run)]).exit_code == 0
    launch(run, accept=True)
    assert tree(run) == theirs


def test_a_run_whose_first_models_nearly_all_fail_stops_early(
    finished: tuple[Path, Result],
    launch: Launcher,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("pnabs.stages.sharded.FIRST_MODELS", 4)
    table = {name: "raise" for _, name, _ in models(finished[0])}
    patch_work(monkeypatch, tmp_path / "counts", table)
    with pytest.raises(TooManyFailedError, match="a bad model. --max-failed 100 goes on") as stop:
        launch(tmp_path / "run", stages=INGEST)
    assert stop.value.exit_code == 3
    assert "a bad model" in (tmp_path / "run/quarantine/ingest.jsonl").read_text()


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of one megabyte; needs the right to mount."""
    path = tmp_path / "disk"
    path.mkdir()
    if not mount(["-t", "tmpfs", "-o", "size=1m", "tmpfs", str(path)]):
        pytest.skip("no right to mount a file system")
    try:
        yield path
    finally:
        subprocess.run(["umount", "-l", str(path)], check=True)


def mount(arguments: list[str]) -> bool:
    return (
        os.geteuid() == 0
        and not subprocess.run(["mount", *arguments], capture_output=True, check=False).returncode
    )


def test_a_full_disk_is_told_and_the_run_goes_on_when_there_is_room(
    finished: tuple[Path, Result], launch: Launcher, disk: Path
) -> None:
    run = disk / "run"
    with pytest.raises((ShardsFailedError, StorageError), match="No space left on device") as full:
        launch(run, stages=INGEST)
    assert full.value.exit_code == 3
    before = set(Ledger(run).shards("ingest"))
    assert len(before) < 5
    for shard in before:
        record = Ledger(run).read("ingest", shard)
        assert record
        assert Ledger(run).damaged_outputs(record) == []
    assert mount(["-o", "remount,size=100m", str(disk)])
    launch(run, stages=INGEST)
    assert ingested(run) == ingested(finished[0])
    assert not list(run.rglob("*.partial"))


def test_an_output_that_becomes_read_only_is_told(
    finished: tuple[Path, Result], launch: Launcher, disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = disk / "run"
    assert mount(["-o", "remount,size=100m", str(disk)])
    launch.job(run)

    def read_only(_: object) -> None:
        # Over the same place, because what is open for writing can't be made read-only.
        assert mount(["--bind", str(disk), str(disk)])
        assert mount(["-o", "remount,bind,ro", str(disk)])

    with monkeypatch.context() as once:
        on_start(once, 3, read_only)
        with pytest.raises((ShardsFailedError, StorageError), match="Read-only file system"):
            launch(run, stages=INGEST)
    refused = CliRunner().invoke(main, ["run", f"{run}.yaml"])
    assert refused.exit_code == 2
    assert f"can't write {run}: Read-only file system" in refused.stderr
    subprocess.run(["umount", str(disk)], check=True)
    launch(run, stages=INGEST)
    assert ingested(run) == ingested(finished[0])


@pytest.mark.parametrize("how", [pytest.param("gone", marks=pytest.mark.slow), "empty"])
def test_a_dataset_that_vanishes_blames_no_model(
    finished: tuple[Path, Result],
    launch: Launcher,
    samples: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    how: str,
) -> None:
    data, away, run = tmp_path / "data", tmp_path / "away", tmp_path / "run"
    shutil.copytree(samples, data)

    def vanish(_: object) -> None:
        data.rename(away)
        if how == "empty":
            data.mkdir()

    with monkeypatch.context() as once:
        on_start(once, 3, vanish)
        with pytest.raises(ShardsFailedError, match=f"the dataset {data} ") as stopped:
            Launcher(data)(run, stages=INGEST)
    assert "could be finished any more" in str(stopped.value)
    verdicts = [m.kind for s in Ledger(run).shards("ingest") for m in read(run, s).models]
    assert set(verdicts) <= {"ok", "invalid"}
    assert verdicts.count("invalid") <= 1
    if how == "empty":
        data.rmdir()
    away.rename(data)
    Launcher(data)(run, stages=INGEST)
    ours, theirs = ingested(run), ingested(finished[0])
    # The copy's files have times of their own.
    del ours["catalogue.parquet"], theirs["catalogue.parquet"]
    assert ours == theirs


def read(run: Path, shard: str) -> Any:
    record = Ledger(run).read("ingest", shard)
    assert record
    return record


def test_shards_can_be_seen_and_run_resumes_exactly_the_failed_and_missing_ones(
    finished: tuple[Path, Result],
    launch: Launcher,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One shard can't be written, another loses its nodes, one runs, one is yet to come."""
    run = tmp_path / "run"
    names = sorted({shard for shard, _, _ in models(finished[0])})
    unwritable, lost = names[1], names[2]
    blocker = run / "fields.zarr" / unwritable.rsplit("-", 1)[0] / "occupancy" / "c" / "1"
    seen: list[dict[str, str]] = []

    def states(shards: bool = True) -> dict[str, str]:
        arguments = ["status", str(run), "--json", *(["--shards"] if shards else [])]
        found = CliRunner().invoke(main, arguments)
        assert found.exit_code == 0, found.output
        stage = json.loads(found.stdout)[0]
        assert stage["stage"] == "ingest"
        counts = dict.fromkeys(("done", "running", "failed", "pending"), 0)
        for item in stage["shards"]:
            counts[item["state"]] += 1
        assert not shards or stage["states"] == counts
        return {item["shard"]: item["state"] for item in stage["shards"]}

    started = _Progress.started

    def watched(progress: Any, shard: str, where: str) -> None:
        started(progress, shard, where)
        if shard == lost:
            os.kill(int(where.rpartition("(")[2][:-1]), signal.SIGKILL)
        seen.append(states())

    launch(run, stages=("scan",))
    with monkeypatch.context() as once:
        once.setattr(_Progress, "started", watched)
        blocker.parent.mkdir(parents=True)
        blocker.write_text("in the way")
        with pytest.raises(ShardsFailedError, match="2 of 5 shards could not be finished") as end:
            launch(run, "runtime.actors=1", stages=INGEST)
    assert f"{unwritable}: " in str(end.value)
    assert f"{lost}: its workers were lost 3 times" in str(end.value)
    assert any("running" in found.values() and "pending" in found.values() for found in seen)
    assert any("running" in found.values() and "done" in found.values() for found in seen)
    kinds = {unwritable: "failed", lost: "failed"}
    assert states() == {name: kinds.get(name, "done") for name in names}
    assert states(shards=False) == kinds
    text = CliRunner().invoke(main, ["status", str(run)]).stdout
    assert f"{unwritable}  failed" in text
    assert "occupancy/c/1" in text
    assert "its workers were lost 3 times" in text
    # A record that went missing is pending, and is done with the failed ones.
    Ledger(run).withdraw("ingest", names[4])
    assert states()[names[4]] == "pending"

    blocker.unlink()
    before = len(list(read_events(run, "driver")))
    launch(run, stages=INGEST)
    resumed = [e["shard"] for e in read_events(run, "driver") if e["event"] == "shard-start"]
    assert before
    assert sorted(resumed[-3:]) == sorted([unwritable, lost, names[4]])
    assert resumed[:-3].count(lost) == 3
    assert set(states().values()) == {"done"}
    assert ingested(run) == ingested(finished[0])
