"""The same over Ray's actors: faults, lost workers, blind ones, stuck ones; it always ends."""

from __future__ import annotations

import os
import re
import signal
from pathlib import Path

import pytest

from pnabs.batch import ShardDone, ShardFailed, Unavailable, Watcher, WorkerLimits, ray_executor
from tests.batch.tasks import FAULTS, VERDICTS, ScriptedWork, Table, invocations

pytestmark = pytest.mark.usefixtures("ray_session")


class Notes(Watcher):
    """Remembers what it was told, and may kill a worker that begins a shard."""

    def __init__(self, kill: tuple[str, ...] = ()) -> None:
        self.kill = list(kill)
        self.starts: list[str] = []
        self.warnings: list[str] = []
        self.most = 0

    def started(self, shard: str, where: str) -> None:
        """Kill the worker if it is its turn."""
        self.starts.append(shard)
        if shard in self.kill:
            self.kill.remove(shard)
            process = re.fullmatch(r".+ \((\d+)\)", where)
            assert process
            os.kill(int(process[1]), signal.SIGKILL)

    def progress(self, models: int) -> None:
        """Keep the most."""
        self.most = max(self.most, models)

    def warn(self, message: str) -> None:
        """Keep the message."""
        self.warnings.append(message)


def run(
    folder: Path, shards: dict[str, Table], notes: Notes, limits: WorkerLimits | None = None
) -> dict[str, ShardDone | ShardFailed]:
    limits = limits or WorkerLimits(deadline=3.0, memory=2**30)
    executor = ray_executor.RayExecutor(limits, 2, 1)
    results = list(executor.map(ScriptedWork(str(folder), shards), list(shards), notes))
    assert len({result.shard for result in results}) == len(results)
    return {result.shard: result for result in results}


def test_faults_cost_nobody_else_anything(tmp_path: Path) -> None:
    faults = list(FAULTS.items())
    shards = {
        "s": {"a": "slow", **dict(faults[:3]), "b": "ok"},
        "t": {"c": "ok", **dict(faults[3:]), "d": "ok"},
        "u": {"e": "crash,ok", "f": "memory,ok", "g": "hang,ok", "h": "slow"},
    }
    (tmp_path / "with").mkdir()
    (tmp_path / "without").mkdir()
    notes = Notes()
    done = run(tmp_path / "with", shards, notes)
    outcomes = {
        o.model_id: o for d in done.values() if isinstance(d, ShardDone) for o in d.outcomes
    }
    for name, (kind, reason, trace) in VERDICTS.items():
        assert (outcomes[name].kind, reason in outcomes[name].reason) == (kind, True)
        assert trace in outcomes[name].traceback
    counts = invocations(tmp_path / "with", outcomes)
    twice = set(FAULTS) - {"invalid"} | set("efg")
    assert counts == {name: 2 if name in twice else 1 for name in outcomes}
    assert notes.warnings == []
    # A run without the bad models, on new workers.
    good = {s: {m: "ok" for m in table if m not in FAULTS} for s, table in shards.items()}
    run(tmp_path / "without", good, Notes())
    for shard in shards:
        name = f"{shard}.txt"
        assert (tmp_path / "with" / name).read_bytes() == (tmp_path / "without" / name).read_bytes()


def test_a_killed_actors_shard_is_given_to_another(tmp_path: Path) -> None:
    shards = {name: {f"{name}{i}": "slow" for i in range(2)} for name in "stuv"}
    notes = Notes(kill=("t",))
    done = run(tmp_path, shards, notes)
    assert all(isinstance(result, ShardDone) for result in done.values())
    assert sorted(notes.starts) == ["s", "t", "t", "u", "v"]
    (warning,) = notes.warnings
    assert "was lost with shard t, which is given to another" in warning
    commits = invocations(tmp_path / "commits", shards)
    assert commits == dict.fromkeys(shards, 1)


def test_a_shard_that_loses_every_worker_fails_with_the_cause(tmp_path: Path) -> None:
    shards = {"s": {"a": "slow"}, "t": {"b": "slow"}}
    notes = Notes(kill=("t",) * ray_executor.LEASES)
    done = run(tmp_path, shards, notes)
    assert isinstance(done["s"], ShardDone)
    failed = done["t"]
    assert isinstance(failed, ShardFailed)
    assert failed.reason.startswith("its workers were lost 3 times, the last on ")
    assert re.search("died|kill|dead", failed.reason), failed.reason


def test_a_worker_that_sees_nothing_is_left_out_and_the_others_go_on(tmp_path: Path) -> None:
    (tmp_path / "blind").write_text("")
    shards = {name: {name.upper(): "ok"} for name in "stuvw"}
    notes = Notes()
    done = run(tmp_path, shards, notes)
    assert all(isinstance(result, ShardDone) for result in done.values())
    assert sorted(notes.starts) == list("stuvw")
    (warning,) = notes.warnings
    assert "is left out: this worker doesn't see the run folder" in warning


def test_work_ends_when_every_worker_sees_nothing(tmp_path: Path) -> None:
    (tmp_path / "gone").write_text("the run folder is gone")
    notes = Notes()
    with pytest.raises(Unavailable, match="the run folder is gone"):
        run(tmp_path, {"s": {"a": "ok"}, "t": {"b": "ok"}}, notes)
    assert notes.starts == []


def test_what_goes_away_under_way_ends_the_work_without_a_verdict(tmp_path: Path) -> None:
    shards = {name: {name.upper(): "slow"} for name in "stuvwx"}
    work = ScriptedWork(str(tmp_path), shards)
    executor = ray_executor.RayExecutor(WorkerLimits(3.0, 2**30), 2, 1)
    results = executor.map(work, list(shards), Notes())
    assert isinstance(next(results), ShardDone)
    (tmp_path / "gone").write_text("the disk was pulled")
    rest: list[ShardDone | ShardFailed] = []
    with pytest.raises(Unavailable, match="the disk was pulled"):
        rest.extend(results)
    assert 1 <= sum(invocations(tmp_path / "commits", shards).values()) <= 2


def test_a_stuck_worker_is_told_of_and_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ray_executor, "QUIET_SECONDS", 1.0)
    monkeypatch.setattr(ray_executor, "GRACE_SECONDS", 0.0)
    monkeypatch.setattr(ray_executor, "LEASES", 2)
    (tmp_path / "stuck-t").write_text("")
    notes = Notes()
    shards = {"s": {"a": "ok"}, "t": {"b": "ok"}}
    done = run(tmp_path, shards, notes, WorkerLimits(1.0, 2**30, stall=2.0))
    assert isinstance(done["s"], ShardDone)
    failed = done["t"]
    assert isinstance(failed, ShardFailed)
    assert "no progress for 3 s at reading" in failed.reason
    told = [text for text in notes.warnings if "nothing has moved" in text]
    assert any(re.search(r"in flight: t on .+, at reading for", text) for text in told), told


def test_a_hopeless_disk_ends_the_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shards = {name: {name.upper(): "ok"} for name in "stuvwxyz"}
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("no /dev/full")
    for name in shards:
        (tmp_path / f"{name}.txt").symlink_to(full)
    with pytest.raises(Unavailable, match="No space left on device"):
        run(tmp_path, shards, Notes())
    assert sum(invocations(tmp_path, "STUVWXYZ").values()) <= 4
