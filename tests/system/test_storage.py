"""Nodes that don't see the run folder, in mount namespaces of their own."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pnabs.stages.run import Result
from tests.system.conftest import Launcher
from tests.system.test_faults import ingested
from tests.system.test_processes import environment

SCRIPT = """
import json, subprocess, sys, time
from pathlib import Path
import ray
from ray.cluster_utils import Cluster
from pnabs.stages.errors import RunError
from pnabs.stages.job import load_job
from pnabs.stages.progress import Reporter
from pnabs.stages.options import Options
from pnabs.stages.run import run_job
from pnabs.stages.sharded import _Progress

job, blocked = Path(sys.argv[1]), sys.argv[2]
cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})

def blind_node():
    start = f"mount -t tmpfs tmpfs {blocked} && exec {sys.argv[3]} start --block --num-cpus=1 "
    return subprocess.Popen(
        ["unshare", "-m", "sh", "-c", start + f"--address={cluster.address}"],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )

def wait_for_nodes(count):
    while sum(node["Alive"] for node in ray.nodes()) != count:
        time.sleep(0.2)

said = {}
settings = load_job(job, ("runtime.actors=2",))
options = Options(address=cluster.address, max_failed=50, stages=("scan", "ingest"))
node = blind_node()
ray.init(cluster.address)
wait_for_nodes(2)
ray.shutdown()
try:
    run_job(settings, options, Reporter())
except RunError as error:
    said["refused"] = [error.exit_code, str(error)]
node.terminate()
node.wait()
ray.init(cluster.address)
wait_for_nodes(1)
ray.shutdown()

# Another comes under way, and its worker is left out.
started, warn, nodes, warnings = _Progress.started, _Progress.warn, [], []

def join_late(progress, shard, where):
    started(progress, shard, where)
    if not nodes:
        nodes.append(blind_node())
        wait_for_nodes(2)
    time.sleep(2)

def note(progress, message):
    warn(progress, message)
    warnings.append(message)

_Progress.started, _Progress.warn = join_late, note
run_job(settings, options, Reporter())
nodes[0].terminate()
said["warnings"] = warnings
print(json.dumps(said))
"""


@pytest.mark.slow
@pytest.mark.skipif(os.geteuid() != 0 or not shutil.which("unshare"), reason="no right to mount")
def test_a_node_that_does_not_see_the_run_folder(
    finished: tuple[Path, Result], launch: Launcher, tmp_path: Path
) -> None:
    shared = tmp_path / "shared"
    shared.mkdir()
    run = shared / "run"
    launch.job(run)
    ray = Path(sys.executable).with_name("ray")
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, f"{run}.yaml", str(shared), str(ray)],
        cwd=Path(__file__).parents[2], env=environment(tmp_path / "home"),
        capture_output=True, text=True, timeout=400, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-5000:]
    said = json.loads(done.stdout.splitlines()[-1])
    code, refusal = said["refused"]
    assert code == 4
    assert f"the run folder {run} is not on storage that all nodes share" in refusal
    assert "Put `out` on a shared disk" in refusal
    (warning,) = said["warnings"]
    assert f"is left out: the run folder {run} is out of reach" in warning
    assert ingested(run) == ingested(finished[0])
