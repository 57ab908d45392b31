"""Several workers in one process: the same verdicts, one at a time or many, and a quick end."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest

from pnabs.batch import ShardDone, ShardFailed, Unavailable, Watcher, WorkerLimits
from pnabs.batch.thread_executor import ThreadExecutor
from tests.batch.tasks import FAULTS, VERDICTS, ScriptedWork, invocations

LIMITS = WorkerLimits(deadline=3.0, memory=2**30)


def test_each_fault_is_charged_to_its_model_alone(tmp_path: Path) -> None:
    tables = {name: {name: script} for name, script in FAULTS.items()}
    tables |= {f"good{number}": {f"good{number}": "ok"} for number in range(8)}
    work = ScriptedWork(str(tmp_path), tables)
    results = list(ThreadExecutor(LIMITS, 3).map(work, list(tables), Watcher()))
    assert sorted(result.shard for result in results) == sorted(tables)
    outcomes = {}
    for result in results:
        assert isinstance(result, ShardDone)
        (outcomes[result.shard],) = result.outcomes
    for name, (kind, reason, _) in VERDICTS.items():
        assert outcomes[name].kind == kind
        assert reason in outcomes[name].reason
    assert all(outcomes[name].kind == "ok" for name in tables if name.startswith("good"))
    expected = dict.fromkeys(tables, 1) | dict.fromkeys(set(FAULTS) - {"invalid"}, 2)
    assert invocations(tmp_path, tables) == expected


def test_workers_work_at_the_same_time(tmp_path: Path) -> None:
    tables = {name: {name: "slow"} for name in "abcd"}
    places: set[str] = set()

    class Places(Watcher):
        def started(self, shard: str, where: str) -> None:
            places.add(shard)

    results = ThreadExecutor(LIMITS, 4).map(
        ScriptedWork(str(tmp_path), tables), list(tables), Places()
    )
    next(results)
    # All had begun before the first, which takes a second, was done.
    assert places == set(tables)
    assert len(list(results)) == 3


def test_what_a_watcher_raises_ends_all_at_once(tmp_path: Path) -> None:
    tables = {"quick": {"quick": "ok"}, **{name: {name: "hang"} for name in "abc"}}

    class Stop(Watcher):
        def progress(self, models: int) -> None:
            if (tmp_path / "a").exists() and (tmp_path / "b").exists():
                raise KeyboardInterrupt

    limits = WorkerLimits(deadline=600.0, memory=2**30)
    before = threading.active_count()
    with pytest.raises(KeyboardInterrupt):
        list(
            ThreadExecutor(limits, 2).map(ScriptedWork(str(tmp_path), tables), list(tables), Stop())
        )
    assert threading.active_count() == before
    # Neither retried nor begun.
    assert invocations(tmp_path, tables) == {"quick": 1, "a": 1, "b": 1, "c": 0}
    child = Path("/proc") / (tmp_path / "pid").read_text()
    deadline = time.monotonic() + 30
    while child.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not child.exists()


def test_a_shard_that_cannot_be_written_fails_by_name(tmp_path: Path) -> None:
    tables = {"s": {"a": "ok"}, "t": {"b": "ok"}}
    (tmp_path / "s.txt").mkdir()
    results = ThreadExecutor(LIMITS, 2).map(
        ScriptedWork(str(tmp_path), tables), list(tables), Watcher()
    )
    found = {result.shard: result for result in results}
    assert isinstance(found["s"], ShardFailed)
    assert isinstance(found["t"], ShardDone)


def test_work_ends_when_what_it_needs_is_out_of_reach(tmp_path: Path) -> None:
    tables = {name: {name: "ok"} for name in "abcdef"}
    (tmp_path / "gone").write_text("the folder is gone")
    results = ThreadExecutor(LIMITS, 2).map(
        ScriptedWork(str(tmp_path), tables), list(tables), Watcher()
    )
    with pytest.raises(Unavailable, match="the folder is gone"):
        list(results)
    assert sum(invocations(tmp_path, "abcdef").values()) == 0
