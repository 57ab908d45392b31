"""The command line without Ray: help, usage, exit codes, streams."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest
from click.testing import CliRunner, Result

from pnabs import settings
from pnabs.cli import FORMATS, STAGES, main
from pnabs.formats import registry
from pnabs.stages import plan

JOB = "dataset: {root: ROOT, layout: folder}\nout: OUT\n"


def invoke(*arguments: str) -> Result:
    return CliRunner().invoke(main, arguments)


@pytest.fixture
def job(tmp_path: Path) -> Path:
    """A job over two meshes of one category."""
    folder = tmp_path / "meshes" / "wedge"
    folder.mkdir(parents=True)
    for name in ("a", "b"):
        (folder / f"{name}.off").write_text("OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
                                            "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n")  # fmt: skip
    path = tmp_path / "job.yaml"
    text = JOB.replace("ROOT", str(tmp_path / "meshes")).replace("OUT", str(tmp_path / "run"))
    path.write_text(text)
    return path


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import sys, pnabs, pnabs.cli\n"
        "try: pnabs.cli.main(['run', '--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'torch', 'ray', 'numpy', 'numba', 'trimesh', 'zarr', 'pyarrow', 'pydantic'}\n"
        "print(sorted(heavy & set(sys.modules)), file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "[]\n"
    assert "--dry-run" in done.stdout


def test_stages_and_formats_are_those_there_are() -> None:
    assert STAGES == plan.STAGES
    assert tuple(registry.FORMATS) == get_args(settings.FormatName) == FORMATS


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["run"], "Missing argument"),
        (["run", "none.yaml"], "can't read the job file"),
        (["rnu"], "No such command"),
        (["run", "JOB", "--stages", "ingets"], "did you mean ingest?"),
        (["run", "JOB", "--set", "training.epoch=3"], "did you mean epochs?"),
        (["run", "JOB", "--set", "dataset.root=/nowhere"], "/nowhere"),
        (["run", "JOB", "--set", "dataset.layout=shapenet-v1"], "layout: folder"),
        (["run", "JOB", "--dry-run", "--category", "wedgie"], "wedge"),
        (["run", "JOB", "--max-failed", "101"], "max-failed"),
    ],
)
def test_wrong_usage_ends_with_2(job: Path, arguments: list[str], says: str) -> None:
    result = invoke(*(str(job) if word == "JOB" else word for word in arguments))
    assert result.exit_code == 2, result.output
    assert says in result.stderr
    assert result.stdout == ""


def test_old_names_of_settings_are_told_on_stderr(job: Path, tmp_path: Path) -> None:
    job.write_text(job.read_text() + "abstract: {price: 0.01}\n")
    override = "training.begin=shipped"
    for more in (["--dry-run"], ["--stages", "scan"]):
        result = invoke("run", str(job), "--set", override, *more)
        assert result.exit_code == 0, result.output
        assert [line for line in result.stderr.splitlines() if "now; rename it" in line] == [
            f"{job}, line 3: abstract.price is called abstract.min_gain now; rename it",
            f"--set {override}: training.begin is called training.init_from now; rename it",
        ]
        assert "rename" not in result.stdout
    stored = json.loads((tmp_path / "run" / "run.json").read_text())
    assert stored["settings"]["abstract"]["min_gain"] == 0.01
    assert "price" not in stored["settings"]["abstract"]
    assert set(stored["weights"]) == {"main/init_from/positive", "main/init_from/negative"}
    result = invoke("run", str(job), "--set", "abstract.min_gain=0.01", "--set", "abstract.price=1")
    assert result.exit_code == 2
    assert "abstract.price is called abstract.min_gain now, which is given too" in result.stderr


def test_dry_run_tells_and_writes_nothing(job: Path, tmp_path: Path) -> None:
    result = invoke("run", str(job), "--dry-run")
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("2 models in 1 categories")
    assert "0/1 shards" in result.stdout
    assert not (tmp_path / "run").exists()


def test_status_and_report_of_no_run(tmp_path: Path) -> None:
    for command in ("status", "report", "verify"):
        result = invoke(command, str(tmp_path))
        assert result.exit_code == 2
        assert "not a run folder" in result.stderr


def test_a_folder_of_something_else_is_refused(job: Path, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "thesis.tex").write_text("x")
    result = invoke("run", str(job), "--stages", "scan")
    assert result.exit_code == 4
    assert "--out" in result.stderr


def test_scan_then_status(job: Path, tmp_path: Path) -> None:
    assert invoke("run", str(job), "--stages", "scan").exit_code == 0
    result = invoke("status", str(tmp_path / "run"), "--json")
    stages = json.loads(result.stdout)
    assert [item["stage"] for item in stages][:2] == ["ingest", "train positive-initial"]
    assert stages[0]["total"] == 1
    assert stages[0]["done"] == 0
    assert "ingest" in invoke("status", str(tmp_path / "run")).stdout


def test_samples(tmp_path: Path) -> None:
    result = invoke("samples", str(tmp_path / "s"), "--per-category", "2", "--category", "chair")
    assert result.exit_code == 0
    assert len(list((tmp_path / "s" / "03001627").glob("*/models/model_normalized.obj"))) == 2
    assert result.stdout == ""
    wrong = invoke("samples", str(tmp_path / "t"), "--category", "chiar")
    assert wrong.exit_code == 2


def test_an_interrupt_ends_a_command_whatever_swallows_it() -> None:
    """Libraries import each other with `except BaseException: pass`."""
    code = """
import os, signal
from pnabs.cli import main

@main.command()
def load():
    try:
        os.kill(os.getpid(), signal.SIGINT)
    except BaseException:
        pass
    print("went on", flush=True)

main(["load"])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "stopped\n")
