"""Killed by SIGKILL: the driver at named points, workers, a node; then run to the end."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from safetensors.numpy import load_file

from pnabs.stages.errors import TrainingError
from pnabs.stages.run import Result
from pnabs.store.events import read_events
from pnabs.store.ledger import Ledger
from tests.batch.tasks import invocations
from tests.system.conftest import Launcher, tree
from tests.system.faults import STAGES, wrapped
from tests.system.test_processes import environment, processes_of

ROOT = Path(__file__).parents[2]

FEW = (
    ("epoch:positive-initial", 1),
    ("after:*/ledger/abstract/*.json", 1),
)
"""Two points, in the order of the run: one is reached after the other."""

TWENTY = (
    ("before:*/run.json", 1),  # scan
    ("before:*/catalogue.parquet", 1),
    ("ray", 1),
    ("begun:ingest", 2),  # ingest
    ("before:*/ledger/ingest/*.json", 2),
    ("after:*/ledger/ingest/*.json", 1),
    ("before:*/index/ingest.json", 1),
    ("event:phase-start/positive-initial", 1),  # train-positive
    ("epoch:positive-initial", 3),
    ("epoch:positive-refinement", 3),
    ("begun:difference", 1),  # difference
    ("after:*/ledger/difference/*.json", 1),
    ("epoch:negative-initial", 3),  # train-negative
    ("epoch:negative-refinement", 3),
    ("begun:abstract", 3),  # abstract
    ("before:*/ledger/abstract/*.json", 1),
    ("after:*/ledger/abstract/*.json", 2),
    ("before:*/quarantine/abstract.jsonl", 1),
    ("before:*/report/tables.json", 1),  # report
    ("before:*/report/index.html", 1),
)
"""At least two in each stage, in the order of the run."""


def killed_again_and_again(
    points: tuple[tuple[str, int], ...], launch: Launcher, folder: Path, *overrides: str
) -> Path:
    """Run the job with a kill at each point, then to the end; no committed model runs again."""
    run, counts = folder / "run", folder / "counts"
    launch.job(run)
    settings = [word for override in overrides for word in ("--set", override)]
    environ = environment(folder / "home")
    ledger = Ledger(run)

    def session(point: str, number: int) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "tests.system.faults", point, str(number), str(counts)]
        return subprocess.run(
            [*command, "run", f"{run}.yaml", "--max-failed", "50", *settings],
            cwd=ROOT, env=environ, capture_output=True, text=True, timeout=300, check=False,
        )  # fmt: skip

    committed: dict[str, dict[str, int]] = {}
    for point, number in points:
        done = session(point, number)
        assert done.returncode == -signal.SIGKILL, (point, done.stderr)
        wait_until(lambda: not processes_of(folder / "home"), 60)
        for stage in ledger.stages():
            records = [ledger.read(stage, shard) for shard in ledger.shards(stage)]
            models = [model.model_id for record in records if record for model in record.models]
            now = invocations(counts / stage, models)
            before = committed.get(stage, {})
            assert {name: now[name] for name in before} == before, (point, stage)
            committed[stage] = now
    done = session("never", 1)
    assert done.returncode == 0, done.stderr
    for stage, before in committed.items():
        assert invocations(counts / stage, before) == before
    assert not list(run.rglob("*.partial"))
    return run


def assert_equal(run: Path, expected: Path) -> None:
    """The same bytes; weights the same tensors."""
    ours, theirs = tree(run), tree(expected)
    assert ours.keys() == theirs.keys()
    weights = {name for name in theirs if name.endswith(".safetensors")}
    for name in weights:
        a, b = load_file(run / name), load_file(expected / name)
        assert a.keys() == b.keys()
        assert all((a[key] == b[key]).all() for key in a), name
    assert [name for name in theirs if ours[name] != theirs[name]] == []


def wait_until(done: Callable[[], bool], seconds: float) -> None:
    deadline = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < deadline
        time.sleep(0.1)


@pytest.mark.slow
def test_a_driver_killed_in_two_stages_gives_the_same_bytes(
    finished: tuple[Path, Result], launch: Launcher, tmp_path: Path
) -> None:
    assert_equal(killed_again_and_again(FEW, launch, tmp_path), finished[0])


@pytest.mark.slow
def test_a_driver_killed_twenty_times_gives_the_same_bytes(
    ray_session: None, launch: Launcher, tmp_path: Path
) -> None:
    """With phases that take longer than workers outlive their driver."""
    assert len(TWENTY) == 20
    longer = "training.epochs=40"
    launch(tmp_path / "expected", longer)
    run = killed_again_and_again(TWENTY, launch, tmp_path, longer)
    assert_equal(run, tmp_path / "expected")
    for folder in run.glob("events/train-*-0"):
        epochs = [e["epoch"] for e in read_events(run, folder.name) if e["event"] == "epoch"]
        assert epochs.count(0) == 1, "a phase went on from its checkpoint"
        assert epochs[-1] == 39


def process_of(where: str) -> int:
    match = re.fullmatch(r".+ \((\d+)\)", where)
    assert match
    return int(match[1])


@pytest.mark.slow
def test_killed_workers_give_the_same_bytes(
    finished: tuple[Path, Result],
    launch: Launcher,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One actor in each sharded stage, and one worker of each module's training."""
    from pnabs.stages.sharded import _Progress
    from pnabs.stages.train import _Watch

    run, killed = tmp_path / "run", set()
    for name, value in wrapped(tmp_path / "counts").items():
        monkeypatch.setattr(name, value)
    started, look = _Progress.started, _Watch.look

    def kill_second(progress: Any, shard: str, where: str) -> None:
        started(progress, shard, where)
        begun = [e for e in read_events(run, "driver") if e["event"] == "shard-start"]
        of_stage = [event for event in begun if event["stage"] == progress.stage]
        if len(of_stage) == 2 and progress.stage not in killed:
            killed.add(progress.stage)
            os.kill(process_of(where), signal.SIGKILL)

    def kill_trainer(watch: Any) -> Any:
        epoch = look(watch)
        if epoch is not None and epoch["epoch"] == 1 and epoch["phase"] not in killed:
            killed.add(epoch["phase"])
            os.kill(epoch["pid"], signal.SIGKILL)
        return epoch

    monkeypatch.setattr(_Progress, "started", kill_second)
    monkeypatch.setattr(_Watch, "look", kill_trainer)
    launch(run)
    assert {"ingest", "difference", "abstract"} < killed
    assert any("-" in name for name in killed)
    assert_equal(run, finished[0])
    starts = [e for e in read_events(run, "driver") if e["event"] == "shard-start"]
    for stage in STAGES:
        shards = [event["shard"] for event in starts if event["stage"] == stage]
        assert len(shards) == len(set(shards)) + 1
    warnings = [e["message"] for e in read_events(run, "driver") if e["event"] == "warning"]
    assert sum("was lost with shard" in message for message in warnings) == 3


NODES = """
import json, sys
from pathlib import Path
from ray.cluster_utils import Cluster
from pnabs.stages.job import load_job
from pnabs.stages.progress import Reporter
from pnabs.stages.options import Options
from pnabs.stages.run import run_job
from pnabs.stages.sharded import _Progress
from pnabs.stages.train import _Watch

cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
nodes = [cluster.add_node(num_cpus=1)]
lost = []
started, look = _Progress.started, _Watch.look

def replace_node(what):
    if what not in lost:
        lost.append(what)
        cluster.remove_node(nodes.pop(), allow_graceful=False)
        nodes.append(cluster.add_node(num_cpus=1))

def kill_node(progress, shard, where):
    started(progress, shard, where)
    if progress.shards >= 1:
        replace_node(progress.stage)

def kill_node_of_trainer(watch):
    epoch = look(watch)
    if epoch is not None and epoch["epoch"] >= 1:
        replace_node("training")
    return epoch

_Progress.started, _Watch.look = kill_node, kill_node_of_trainer
options = Options(address=cluster.address, max_failed=50, command="pnabs run job.yaml")
run_job(load_job(Path(sys.argv[1])), options, Reporter())
print(json.dumps(lost))
"""


@pytest.mark.slow
def test_killed_nodes_give_the_same_bytes(
    finished: tuple[Path, Result], launch: Launcher, tmp_path: Path
) -> None:
    """Two nodes; one is lost, and another comes, in each sharded stage and in training."""
    run = tmp_path / "run"
    launch.job(run)
    done = subprocess.run(
        [sys.executable, "-c", NODES, f"{run}.yaml"],
        cwd=ROOT, env=environment(tmp_path / "home"), capture_output=True, text=True,
        timeout=900, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-5000:]
    lost = json.loads(done.stdout.splitlines()[-1])
    assert sorted(lost) == ["abstract", "difference", "ingest", "training"]
    assert_equal(run, finished[0])


@pytest.mark.slow
def test_training_that_gets_nowhere_is_told_of_and_given_up(
    launch: Launcher,
    ray_session: None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A training worker that is stopped, as one on a disk that hangs is."""
    from pnabs.stages import train

    run, stopped = tmp_path / "run", []
    look = train._Watch.look

    def stop_trainer(watch: Any) -> Any:
        epoch = look(watch)
        if epoch is not None and not stopped:
            stopped.append(epoch["pid"])
            os.kill(epoch["pid"], signal.SIGSTOP)
        return epoch

    monkeypatch.setattr(train._Watch, "look", stop_trainer)
    monkeypatch.setattr(train, "QUIET_SECONDS", 5.0)
    monkeypatch.setattr(train, "START_SECONDS", 40.0)
    long = ("runtime.stall=1", "training.epochs=1000")
    try:
        with pytest.raises(TrainingError, match="got nowhere: nothing has moved for 4") as end:
            launch(run, *long, stages=("scan", "ingest", "train-positive"))
    finally:
        for process in stopped:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
    assert end.value.exit_code == 3
    assert f"last heard from {socket.gethostname()} ({stopped[0]}): epoch" in str(end.value)
    assert "train positive-initial: nothing has moved for 5 s" in capsys.readouterr().err
