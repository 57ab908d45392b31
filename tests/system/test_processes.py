"""The installed command as users have it: signals, and jobs sent to a cluster."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from pnabs.store import lock
from pnabs.store.ledger import Ledger
from tests.system.conftest import Launcher

PNABS = [sys.executable, "-m", "pnabs.cli"]


def environment(home: Path) -> dict[str, str]:
    home.mkdir(parents=True, exist_ok=True)
    clean = {name: value for name, value in os.environ.items() if not name.startswith("RAY_")}
    return clean | {
        "HOME": str(home),
        "RAY_AUTH_MODE": "disabled",
        "RAY_USAGE_STATS_ENABLED": "0",
        "PYTHONPATH": str(Path(__file__).parents[2]),
        # As in an activated environment: a job's `python` is this one.
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    }


def processes_of(home: Path) -> list[int]:
    """Processes that were started with this home: a command's, workers', Ray's.

    Not Ray's own two agents: when the rest was killed they try for a minute to tell so.
    """
    found = []
    mark = f"HOME={home}".encode()
    for path in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):
            agent = re.match(
                rb"ray::(DashboardAgent|RuntimeEnvAgent)", (path.parent / "cmdline").read_bytes()
            )
            if not agent and mark in path.read_bytes().split(b"\0"):
                found.append(int(path.parent.name))
    return found


class Started:
    """A run of the small job as a process of its own, from the command line."""

    def __init__(self, launch: Launcher, folder: Path) -> None:
        self.run = folder / "run"
        self.home = folder / "home"
        launch.job(self.run)
        self.ledger = Ledger(self.run)
        self.process = subprocess.Popen(
            [*PNABS, "run", f"{self.run}.yaml", "--max-failed", "50"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment(self.home),
        )

    def wait_for(self, what: Callable[[], bool]) -> None:
        """Wait until something is true of the run."""
        deadline = time.monotonic() + 120
        while not what():
            assert self.process.poll() is None, self.process.communicate()
            assert time.monotonic() < deadline
            time.sleep(0.02)

    def end(self) -> tuple[str, str]:
        """What it printed; a few seconds must do, and nothing is left behind."""
        try:
            out, err = self.process.communicate(timeout=20)
            deadline = time.monotonic() + 20
            while processes_of(self.home):
                assert time.monotonic() < deadline, "processes are left"
                time.sleep(0.1)
        finally:
            self.process.kill()
        return out, err

    def assert_whole(self) -> None:
        """Nothing is half-written."""
        for stage in self.ledger.stages():
            for shard in self.ledger.shards(stage):
                record = self.ledger.read(stage, shard)
                assert record is not None
                assert self.ledger.damaged_outputs(record) == []


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_one_signal_stops_in_good_order_and_names_the_command_that_goes_on(
    launch: Launcher, tmp_path: Path, number: int, code: int
) -> None:
    started = Started(launch, tmp_path)
    started.wait_for(lambda: bool(started.ledger.shards("ingest")))
    started.process.send_signal(number)
    out, err = started.end()
    assert started.process.returncode == code, err
    assert out == ""
    assert re.search(r"stopped in ingest: \d+ of 17 models are committed, and stay", err), err
    assert f"To go on: pnabs run {started.run}.yaml --max-failed 50" in err
    assert "Traceback" not in err
    assert not list(started.run.rglob("*.partial"))
    assert (started.run / "quarantine/ingest.jsonl").exists()
    started.assert_whole()
    found = subprocess.run(
        [*PNABS, "status", str(started.run)], capture_output=True, text=True, check=True
    )
    assert "running" in found.stdout.splitlines()[0]
    assert lock.holder(started.run) is None


@pytest.mark.slow
def test_a_signal_while_ray_starts(launch: Launcher, tmp_path: Path) -> None:
    started = Started(launch, tmp_path)
    started.wait_for(lambda: bool(list(started.run.glob("events/driver/*"))))
    time.sleep(1)
    started.process.send_signal(signal.SIGTERM)
    _, err = started.end()
    assert started.process.returncode == 143, err
    assert "stopped while Ray was starting. To go on: pnabs run" in err
    assert "Traceback" not in err


def test_two_signals_end_it_now(launch: Launcher, tmp_path: Path) -> None:
    started = Started(launch, tmp_path)
    started.wait_for(lambda: bool(started.ledger.shards("ingest")))
    started.process.send_signal(signal.SIGINT)
    time.sleep(0.05)
    started.process.send_signal(signal.SIGINT)
    started.end()
    assert started.process.returncode == 130
    started.assert_whole()


def test_a_second_driver_is_told_who_holds_the_run_and_a_dead_ones_lock_is_taken(
    launch: Launcher, tmp_path: Path
) -> None:
    started = Started(launch, tmp_path)
    started.wait_for(lambda: bool(started.ledger.shards("ingest")))
    for command in (["run", f"{started.run}.yaml"], ["verify", str(started.run)]):
        second = subprocess.run(
            [*PNABS, *command], env=environment(started.home), capture_output=True, text=True,
            check=False, timeout=60,
        )  # fmt: skip
        assert second.returncode == 4
        assert re.search(
            f"{started.run} is being written by process {started.process.pid} on "
            rf"{socket.gethostname()}, for \d+ seconds. Wait for it, or stop it and run again: "
            "the lock goes with the process",
            second.stderr,
        ), second.stderr
    started.process.kill()
    started.end()
    third = subprocess.run(
        [*PNABS, "run", f"{started.run}.yaml", "--max-failed", "50", "--stages", "ingest"],
        env=environment(started.home), capture_output=True, text=True, check=False, timeout=240,
    )  # fmt: skip
    assert third.returncode == 0, third.stderr
    assert len(started.ledger.shards("ingest")) == 5
    started.assert_whole()


@pytest.fixture
def head(tmp_path: Path) -> Iterator[str]:
    """A Ray head with its dashboard on loopback; ends with the test."""
    ports = []
    for _ in range(3):
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            ports.append(probe.getsockname()[1])
    # A short path: Ray puts sockets below it.
    folder = Path("/tmp") / f"pnabs-head-{os.getpid()}"
    ray = Path(sys.executable).with_name("ray")
    process = subprocess.Popen(
        [str(ray), "start", "--head", "--block", f"--port={ports[0]}", "--num-cpus=2",
         "--include-dashboard=true", "--dashboard-host=127.0.0.1", f"--dashboard-port={ports[1]}",
         # Its default is one for the machine, and other tests' Rays have it.
         f"--dashboard-agent-listen-port={ports[2]}",
         f"--temp-dir={folder}", "--object-store-memory=100000000", "--disable-usage-stats"],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment(tmp_path / "home"),
        start_new_session=True,
    )  # fmt: skip
    address = f"http://127.0.0.1:{ports[1]}"
    try:
        deadline = time.monotonic() + 120
        while True:
            assert process.poll() is None, "the head ended"
            try:
                with urllib.request.urlopen(f"{address}/api/jobs/", timeout=2):
                    break
            except OSError:
                assert time.monotonic() < deadline, "the head's dashboard didn't come up"
                time.sleep(0.5)
        yield address
    finally:
        process.terminate()
        try:
            process.wait(30)
        finally:
            os.killpg(process.pid, signal.SIGKILL) if process.poll() is None else None
            shutil.rmtree(folder, ignore_errors=True)


def test_submit_runs_the_same_job_on_a_cluster(head: str, launch: Launcher, tmp_path: Path) -> None:
    run = tmp_path / "run"
    launch.job(run)
    environ = environment(tmp_path / "home")
    submit = [*PNABS, "submit", f"{run}.yaml", "--address", head]
    stages = ["--stages", "scan,ingest", "--max-failed", "50"]
    done = subprocess.run(
        [*submit, *stages], env=environ, capture_output=True, text=True, timeout=240, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert "submitted" in done.stderr
    assert len(Ledger(run).shards("ingest")) == 5
    assert json.loads((run / "run.json").read_text())["settings"]["out"] == str(run)

    # The job's own exit code comes back: too many models fell out.
    strict = [*submit, "--stages", "scan,ingest", "--max-failed", "1"]
    failed = subprocess.run(
        strict, env=environ, capture_output=True, text=True, timeout=240, check=False
    )
    assert failed.returncode == 3, failed.stderr
    assert "fell out" in failed.stderr


def test_submit_to_nobody(launch: Launcher, tmp_path: Path) -> None:
    run = tmp_path / "run"
    launch.job(run)
    done = subprocess.run(
        [*PNABS, "submit", f"{run}.yaml", "--address", "http://127.0.0.1:9"],
        env=environment(tmp_path / "home"),
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 1
    assert "no Ray head answers at http://127.0.0.1:9" in done.stderr
