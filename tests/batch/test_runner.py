"""The shard runner without Ray: verdicts, one solitary retry, innocent neighbours."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

from pnabs.batch import InlineExecutor, ShardDone, ShardFailed, Watcher, WorkerLimits
from tests.batch.tasks import ScriptedWork

LIMITS = WorkerLimits(deadline=3.0, memory=2**30)


def run(folder: Path, shards: dict[str, dict[str, str]]) -> dict[str, ShardDone]:
    work = ScriptedWork(str(folder), shards)
    results = list(InlineExecutor(LIMITS).map(work, list(shards), Watcher()))
    assert all(isinstance(result, ShardDone) for result in results), results
    return {result.shard: result for result in results if isinstance(result, ShardDone)}


def test_each_fault_is_charged_to_its_model_alone(tmp_path: Path) -> None:
    scripts = {
        "a": "ok",
        "b": "crash",
        "c": "abort",
        "d": "exit",
        "e": "hang",
        "f": "raise",
        "g": "invalid",
        "h": "memory",
        "i": "ok",
    }
    outcomes = {o.model_id: o for o in run(tmp_path, {"s": scripts})["s"].outcomes}
    kinds = {model_id: outcome.kind for model_id, outcome in outcomes.items()}
    assert kinds == {
        "a": "ok",
        "b": "crash",
        "c": "crash",
        "d": "crash",
        "e": "timeout",
        "f": "error",
        "g": "invalid",
        "h": "memory",
        "i": "ok",
    }
    assert "SIGSEGV" in outcomes["b"].reason
    assert "SIGABRT" in outcomes["c"].reason
    assert "exit code 7" in outcomes["d"].reason
    assert "misbehave" in outcomes["b"].traceback
    assert "misbehave" in outcomes["e"].traceback
    assert "a bad model" in outcomes["f"].reason
    assert (tmp_path / "s.txt").read_text() == "a done\ni done\n"
    invocations = {model_id: (tmp_path / model_id).stat().st_size for model_id in scripts}
    assert invocations == dict.fromkeys(scripts, 2) | {"a": 1, "g": 1, "i": 1}


def test_a_second_chance_counts(tmp_path: Path) -> None:
    done = run(tmp_path, {"s": {"a": "crash,ok", "b": "ok", "c": "hang,ok"}})["s"]
    assert [(o.model_id, o.kind, o.attempts) for o in done.outcomes] == [
        ("a", "ok", 2),
        ("b", "ok", 1),
        ("c", "ok", 2),
    ]
    assert (tmp_path / "s.txt").read_text() == "a done\nb done\nc done\n"


def test_a_shard_that_cannot_be_written_fails_by_name(tmp_path: Path) -> None:
    work = ScriptedWork(str(tmp_path), {"s": {"a": "ok"}, "t": {"b": "ok"}})
    (tmp_path / "s.txt").mkdir()
    results = list(InlineExecutor(LIMITS).map(work, ["s", "t"], Watcher()))
    assert isinstance(results[0], ShardFailed)
    assert results[0].shard == "s"
    assert "IsADirectoryError" in results[0].reason
    assert isinstance(results[1], ShardDone)


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
