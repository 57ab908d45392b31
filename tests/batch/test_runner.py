"""The shard runner without Ray: verdicts, one solitary retry, innocent neighbours."""

from __future__ import annotations

import errno
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from pnabs.batch import (
    InlineExecutor,
    ShardDone,
    ShardFailed,
    Unavailable,
    Watcher,
    WorkerLimits,
)
from pnabs.batch.child import IsolatedChild
from pnabs.batch.work import Committed
from tests.batch.tasks import FAULTS, VERDICTS, ScriptedWork, Table, invocations

LIMITS = WorkerLimits(deadline=3.0, memory=2**30)


def run(folder: Path, shards: dict[str, Table]) -> dict[str, ShardDone]:
    work = ScriptedWork(str(folder), shards)
    results = list(InlineExecutor(LIMITS).map(work, list(shards), Watcher()))
    assert all(isinstance(result, ShardDone) for result in results), results
    return {result.shard: result for result in results if isinstance(result, ShardDone)}


def test_each_fault_is_charged_to_its_model_alone(tmp_path: Path) -> None:
    scripts = {"a": "ok", **FAULTS, "z": "slow"}
    outcomes = {o.model_id: o for o in run(tmp_path, {"s": scripts})["s"].outcomes}
    assert list(outcomes) == list(scripts)
    assert outcomes["a"].kind == outcomes["z"].kind == "ok"
    for name, (kind, reason, trace) in VERDICTS.items():
        assert outcomes[name].kind == kind
        assert reason in outcomes[name].reason
        assert trace in outcomes[name].traceback
        assert outcomes[name].attempts == (1 if name == "invalid" else 2)
    assert (tmp_path / "s.txt").read_text() == "a done\nz done\n"
    expected = dict.fromkeys(scripts, 2) | {"a": 1, "invalid": 1, "z": 1}
    assert invocations(tmp_path, scripts) == expected


def test_a_second_chance_counts(tmp_path: Path) -> None:
    done = run(tmp_path, {"s": {"a": "crash,ok", "b": "ok", "c": "hang,ok"}})["s"]
    assert [(o.model_id, o.kind, o.attempts) for o in done.outcomes] == [
        ("a", "ok", 2),
        ("b", "ok", 1),
        ("c", "ok", 2),
    ]
    assert (tmp_path / "s.txt").read_text() == "a done\nb done\nc done\n"


def test_without_a_child_what_raises_is_charged_alone(tmp_path: Path) -> None:
    work = ScriptedWork(str(tmp_path), {"s": {"a": "raise", "b": "ok", "c": "invalid"}})
    limits = WorkerLimits(3.0, 2**30, isolated=False)
    (done,) = InlineExecutor(limits).map(work, ["s"], Watcher())
    assert isinstance(done, ShardDone)
    assert [(o.kind, o.attempts) for o in done.outcomes] == [
        ("error", 2),
        ("ok", 1),
        ("invalid", 1),
    ]


def test_a_shard_that_cannot_be_written_fails_by_name(tmp_path: Path) -> None:
    work = ScriptedWork(str(tmp_path), {"s": {"a": "ok"}, "t": {"b": "ok"}})
    (tmp_path / "s.txt").mkdir()
    results = list(InlineExecutor(LIMITS).map(work, ["s", "t"], Watcher()))
    assert isinstance(results[0], ShardFailed)
    assert results[0].shard == "s"
    assert "IsADirectoryError" in results[0].reason
    assert isinstance(results[1], ShardDone)


def test_what_is_no_models_fault_ends_the_shard_without_a_verdict(tmp_path: Path) -> None:
    work = ScriptedWork(str(tmp_path), {"s": {"a": "ok", "b": "unavailable"}, "t": {"c": "ok"}})
    results = list(InlineExecutor(LIMITS).map(work, ["s", "t"], Watcher()))
    assert results[0] == ShardFailed("s", "the disk is gone")
    assert isinstance(results[1], ShardDone)
    assert invocations(tmp_path, "abc") == {"a": 1, "b": 1, "c": 1}


def test_work_ends_when_what_it_needs_is_out_of_reach(tmp_path: Path) -> None:
    work = ScriptedWork(str(tmp_path), {"s": {"a": "ok"}, "t": {"b": "ok"}, "u": {"c": "ok"}})
    results = InlineExecutor(LIMITS).map(work, ["s", "t", "u"], Watcher())
    assert isinstance(next(results), ShardDone)
    (tmp_path / "gone").write_text("the run folder is gone")
    assert next(results) == ShardFailed("t", "the run folder is gone")
    with pytest.raises(Unavailable, match="the run folder is gone"):
        next(results)
    assert invocations(tmp_path, "abc") == {"a": 1, "b": 1, "c": 0}
    assert not (tmp_path / "t.txt").exists()


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EDQUOT])
def test_work_ends_when_nothing_can_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def commit(*_: object) -> Committed:
        raise OSError(number, "No way", "/run/fields.zarr")

    monkeypatch.setattr(ScriptedWork, "commit", commit)
    work = ScriptedWork(str(tmp_path), {"s": {"a": "ok"}, "t": {"b": "ok"}})
    results = InlineExecutor(LIMITS).map(work, ["s", "t"], Watcher())
    failed = next(results)
    assert isinstance(failed, ShardFailed)
    assert "No way: '/run/fields.zarr'" in failed.reason
    with pytest.raises(Unavailable, match="No way"):
        next(results)


def test_a_watcher_ends_the_work_and_is_no_failure(tmp_path: Path) -> None:
    class Enough(Watcher):
        def progress(self, models: int) -> None:
            if models == 2:
                raise RuntimeError("enough")

    work = ScriptedWork(str(tmp_path), {"s": dict.fromkeys("abc", "ok")})
    with pytest.raises(RuntimeError, match="enough"):
        list(InlineExecutor(LIMITS).map(work, ["s"], Enough()))
    assert invocations(tmp_path, "abc") == {"a": 1, "b": 1, "c": 0}


DRIVER = """
import sys
from pnabs.batch import InlineExecutor, Watcher, WorkerLimits
from tests.batch.tasks import ScriptedWork
work = ScriptedWork(sys.argv[1], {"s": {"a": "hang"}})
list(InlineExecutor(WorkerLimits(600, 2**30)).map(work, ["s"], Watcher()))
"""


def test_a_hanging_child_ends_with_its_worker(tmp_path: Path) -> None:
    root = Path(__file__).parents[2]
    driver = subprocess.Popen([sys.executable, "-c", DRIVER, str(tmp_path)], cwd=root)
    deadline = time.monotonic() + 60
    while not (tmp_path / "pid").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    child = Path("/proc") / (tmp_path / "pid").read_text()
    assert child.exists()
    driver.kill()
    driver.wait()
    while child.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not child.exists()


def test_a_child_that_dies_while_it_sends_is_charged_to_its_model(tmp_path: Path) -> None:
    work = ScriptedWork(str(tmp_path), {"s": {"a": "ok"}})
    child = IsolatedChild(work.task, LIMITS, work.preload)
    assert child.run("a", ("a", "a")).kind == "ok"

    class Cut:
        """The connection of a child that ended between the two halves of a message."""

        def send(self, _: object) -> None:
            child._process.kill()

        def poll(self, _: float) -> bool:
            return True

        def recv(self) -> object:
            raise OSError("got end of file during message")

        def close(self) -> None:
            """Nothing to close."""

    child._connection = Cut()  # type: ignore[assignment]
    outcome = child.run("b", ("b", "b"))
    assert (outcome.kind, outcome.reason) == ("crash", "the process died of SIGKILL")
    assert child.run("a", ("a", "a")).kind == "ok"
    child.close()


def test_nothing_is_left_in_the_folder_for_temporary_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    work = ScriptedWork(str(tmp_path), {"s": {"a": "crash", "b": "ok"}})
    for _ in InlineExecutor(LIMITS).map(work, ["s"], Watcher()):
        assert not list((tmp_path / "tmp").glob("pnabs-*"))
