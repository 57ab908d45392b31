"""The installed command as users have it: signals, and jobs sent to a cluster."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

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
    """Processes that were started with this home: a command's, Ray's, workers'."""
    found = []
    mark = f"HOME={home}".encode()
    for path in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):
            if mark in path.read_bytes().split(b"\0"):
                found.append(int(path.parent.name))
    return found


def test_ctrl_c_stops_in_good_order_and_names_the_command_that_goes_on(
    launch: Launcher, tmp_path: Path
) -> None:
    run = tmp_path / "run"
    launch.job(run)
    command = [*PNABS, "run", f"{run}.yaml", "--max-failed", "50"]
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(tmp_path / "home"),
    )
    ledger = Ledger(run)
    deadline = time.monotonic() + 120
    while not ledger.shards("ingest") and time.monotonic() < deadline:
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert out == ""
    assert "To go on: pnabs run" in err
    assert not list(run.rglob("*.partial"))
    for shard in ledger.shards("ingest"):
        record = ledger.read("ingest", shard)
        assert record is not None
        assert ledger.damaged_outputs(record) == []


@pytest.fixture
def head(tmp_path: Path) -> Iterator[str]:
    """A Ray head with its dashboard on loopback; ends with the test."""
    ports = []
    for _ in range(2):
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            ports.append(probe.getsockname()[1])
    # A short path: Ray puts sockets below it.
    folder = Path("/tmp") / f"pnabs-head-{os.getpid()}"
    ray = Path(sys.executable).with_name("ray")
    process = subprocess.Popen(
        [str(ray), "start", "--head", "--block", f"--port={ports[0]}", "--num-cpus=2",
         "--include-dashboard=true", "--dashboard-host=127.0.0.1", f"--dashboard-port={ports[1]}",
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
