"""`pnabs evaluate` as it is used: killed, resumed, with wrong paths, broken results and on Ray."""

from __future__ import annotations

import contextlib
import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from click.testing import CliRunner, Result

import pnabs
from pnabs import settings
from pnabs.batch import InlineExecutor
from pnabs.cli import FRAMES, LAYOUTS, SPLITS, main
from pnabs.dataset.samples import write_collection
from pnabs.evaluation.reading import Frame
from pnabs.evaluation.rows import METRICS
from pnabs.evaluation.work import EvaluateWork
from pnabs.stages.job import load_job
from pnabs.stages.options import Options
from pnabs.stages.progress import Reporter
from pnabs.stages.run import run_job
from pnabs.store.sealed import seal, unseal
from tests.evaluate.faulty import Faulty
from tests.evaluate.solids import QUICK, box, joined, write
from tests.weights import untrained

FILES = {"models.csv", "tables.csv", "tables.json", "tables.tex"}
COUNT = 8


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Boxes; halves of them, and all of them in two parts."""
    root = tmp_path_factory.mktemp("evaluate")
    for number in range(COUNT):
        name, sides = f"m{number:02}", np.array([1, 2, 1 + number / 10])
        write(root / "shapes" / f"{name}.obj", box(sides))
        write(root / "half" / f"{name}.obj", box(sides / (1, 2, 1), (0, -0.5, 0)))
        for side in (-0.5, 0.5):
            part = box(sides / (1, 2, 1), (0, side, 0))
            write(root / "parts" / name / f"{side}.obj", part)
    return root


def run(place: Path, out: Path, *more: str) -> Result:
    return CliRunner().invoke(main, arguments(place, out, *more))


def arguments(place: Path, out: Path, *more: str) -> list[str]:
    sets = [str(place / name) for name in ("half", "parts")]
    return ["evaluate", str(place / "shapes"), *sets, "--out", str(out), *QUICK, *more]


@pytest.fixture(scope="module")
def finished(place: Path) -> Path:
    """An evaluation that nothing disturbed; read-only for tests."""
    result = run(place, place / "finished", "--jobs", "2")
    assert result.exit_code == 0, result.output
    return place / "finished"


def written(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in out.iterdir() if path.is_file()}


def rows(out: Path) -> list[dict[str, str]]:
    with (out / "models.csv").open() as stream:
        return list(csv.DictReader(stream))


def records(out: Path) -> dict[str, int]:
    folder = out / ".evaluation/ledger/evaluate"
    return {path.name: path.stat().st_mtime_ns for path in folder.glob("*.json")}


def test_choices_are_those_there_are() -> None:
    assert get_args(settings.Layout) == LAYOUTS
    assert get_args(Frame) == FRAMES
    assert set(SPLITS) < set(get_args(settings.Report.model_fields["split"].annotation))


def test_figures_are_those_of_the_boxes(finished: Path) -> None:
    assert written(finished).keys() == FILES
    found = rows(finished)
    assert len(found) == 2 * COUNT
    for row in found:
        expected = 0.5 if row["name"] == "half" else 1.0
        assert float(row["volume_iou"]) == pytest.approx(expected)
        assert row["parts"] == ("1" if row["name"] == "half" else "2")
        assert row["status"] == "ok"
    tables = json.loads((finished / "tables.json").read_text())
    assert tables["variants"] == ["half", "parts"]
    assert {"volume_iou", "variants/volume_iou"} <= {table["name"] for table in tables["tables"]}
    assert "\\begin{tabular}" in (finished / "tables.tex").read_text()
    assert (finished / "tables.csv").read_text().startswith("table,")


def test_run_again_does_nothing(place: Path, finished: Path) -> None:
    before, content = records(finished), written(finished)
    result = run(place, finished)
    assert result.exit_code == 0
    assert "half minus parts" in result.stdout
    assert (records(finished), written(finished)) == (before, content)


def start(place: Path, out: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "pnabs.cli", *arguments(place, out, "--jobs", "1")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parents[2],
        env=os.environ | {"PNABS_TEST": str(out)},
    )


def wait_for_records(driver: subprocess.Popen[str], out: Path) -> None:
    deadline = time.monotonic() + 120
    while not records(out):
        assert time.monotonic() < deadline
        assert driver.poll() is None
        time.sleep(0.01)


def processes_of(out: Path) -> list[str]:
    mark = f"PNABS_TEST={out}".encode()
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):
            if mark in path.read_bytes().split(b"\0"):
                found.append(path.parent.name)
    return found


def test_killed_and_run_again(place: Path, finished: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    driver = start(place, out)
    wait_for_records(driver, out)
    driver.kill()
    driver.communicate()
    deadline = time.monotonic() + 60
    while processes_of(out):
        assert time.monotonic() < deadline, processes_of(out)
        time.sleep(0.05)
    before = records(out)
    assert not written(out)
    assert run(place, out).exit_code == 0
    assert before.items() <= records(out).items()
    assert written(out) == written(finished)


def test_stopped_in_good_order(place: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    driver = start(place, out)
    wait_for_records(driver, out)
    other = run(place, out)
    assert other.exit_code == 4
    assert "is being written by process" in other.stderr
    driver.send_signal(signal.SIGINT)
    _, said = driver.communicate(timeout=60)
    assert driver.returncode == 130, said
    assert "are committed, and stay. To go on: pnabs evaluate" in said
    assert not processes_of(out)


def test_damaged_and_lost_rows_are_made_again(place: Path, finished: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    shutil.copytree(finished, out)
    first, second, third, *_ = sorted((out / ".evaluation/rows").glob("*.parquet"))
    first.write_bytes(first.read_bytes()[:-100])
    second.unlink()
    record = out / ".evaluation/ledger/evaluate" / f"{third.stem}.json"
    record.write_bytes(record.read_bytes()[:50])
    (out / "models.csv").unlink()
    assert run(place, out).exit_code == 0
    assert written(out) == written(finished)


def copied(place: Path, tmp_path: Path) -> Path:
    for name in ("shapes", "half", "parts"):
        shutil.copytree(place / name, tmp_path / name)
    return tmp_path


def fingerprints(out: Path) -> set[str]:
    import pyarrow.parquet as pq

    folder = out / ".evaluation/rows"
    return {
        name for path in folder.glob("*.parquet")
        for name in pq.read_table(path)["fingerprint"].to_pylist()
    }  # fmt: skip


def test_only_what_changed_is_done_again(place: Path, tmp_path: Path) -> None:
    root = copied(place, tmp_path)
    assert run(root, root / "out").exit_code == 0
    before = fingerprints(root / "out")
    write(root / "half/m03.obj", box((1, 1.5, 1.3), (0, -0.25, 0)))
    assert run(root, root / "out").exit_code == 0
    new = fingerprints(root / "out") - before
    assert len(new) == 1
    changed = [row for row in rows(root / "out") if row["volume_iou"] not in ("0.5", "1.0")]
    (mine,) = (row for row in changed if row["name"] == "half" and row["model_id"] == "m03")
    assert float(mine["volume_iou"]) == pytest.approx(0.75)
    # another set of results leaves those that are there
    result = run(
        root, root / "out", str(root / "half"), "--name", "a", "--name", "b", "--name", "c"
    )
    assert result.exit_code == 0, result.output
    assert fingerprints(root / "out") == fingerprints(root / "out") | new
    assert {row["name"] for row in rows(root / "out")} == {"a", "b", "c"}


@pytest.fixture
def faulty(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    with monkeypatch.context() as patched:
        patched.setattr(EvaluateWork, "task", property(lambda self: Faulty(self.measuring)))
        yield


def test_one_that_fails_costs_no_other(
    place: Path, finished: Path, tmp_path: Path, faulty: None
) -> None:
    root = copied(place, tmp_path)
    out = root / "out"
    (root / "half/m00.obj").write_text("no mesh\n")
    (root / "half/m04.obj").unlink()
    (root / "shapes/m05.obj").write_text("no mesh\n")
    result = run(root, out, "--set", "runtime.deadline=2", "--jobs", "2")
    assert result.exit_code == 3, result.output
    assert (
        f"1 of {COUNT} shapes can't be measured against and are left out, such as m05"
        in result.stderr
    )
    assert (
        f"results of 'half': 1 of {COUNT - 1} shapes have none and count as 0: m04" in result.stderr
    )
    assert "couldn't be measured, more than 5 %" in result.stderr
    found = {(row["name"], row["model_id"]): row for row in rows(out)}
    status = {model: row["status"] for (name, model), row in found.items() if name == "half"}
    assert status == {
        **{f"m{number:02}": "ok" for number in range(COUNT) if number != 5},
        **{"m00": "invalid", "m01": "crash", "m02": "timeout", "m03": "error", "m04": "missing"},
    }
    assert found["half", "m03"]["reason"] == "RuntimeError: a mistake of ours"
    theirs = {(row["name"], row["model_id"]): row for row in rows(finished)}
    assert all(found[key] == theirs[key] for key in found if found[key]["status"] == "ok")
    lines = [json.loads(line) for line in (out / "quarantine.jsonl").read_text().splitlines()]
    assert {(line["name"], line["model_id"], line["kind"]) for line in lines} == {
        (None, "m05", "invalid"),
        *(("half", model, kind) for model, kind in status.items() if kind not in ("ok", "missing")),
    }


def test_what_failed_is_tried_again_when_asked_for(
    place: Path, finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    with monkeypatch.context() as patched:
        patched.setattr(EvaluateWork, "task", property(lambda self: Faulty(self.measuring)))
        first = run(place, out, "--set", "runtime.deadline=2", "--max-failed", "50")
    assert first.exit_code == 0
    before = written(out)
    assert before.keys() == FILES | {"quarantine.jsonl"}
    assert run(place, out, "--max-failed", "50").exit_code == 0
    assert written(out) == before
    assert run(place, out, "--retry").exit_code == 0
    assert written(out) == written(finished)
    # and stays so
    assert run(place, out).exit_code == 0
    assert written(out) == written(finished)


def test_too_many_parts_are_a_failure(place: Path, finished: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    shutil.copytree(finished, out)
    before = records(out)
    result = run(place, out, "--max-parts", "1")
    # what is not our failing is none of the command's
    assert result.exit_code == 0
    assert f"results of 'parts': {COUNT} of {COUNT} failed and count as 0" in result.stderr
    (row, *_) = (row for row in rows(out) if row["name"] == "parts")
    assert row["status"] == "invalid"
    assert row["reason"] == "too many parts: 2, of at most 1"
    assert (row["parts"], row["volume_iou"]) == ("2", "")
    assert records(out) == before


def test_boxes_and_a_table_of_them(place: Path, tmp_path: Path) -> None:
    lines = ["model_id,sx,sy,sz,qw,qx,qy,qz,tx,ty,tz"]
    lines += [f"m{n:02},1,2,{1 + n / 10},1,0,0,0,0,0,0" for n in range(COUNT - 1)]
    lines += ["../m07,1,1,1,1,0,0,0,0,0,0", "m07,nan,1,1,1,0,0,0,0,0,0"]
    (tmp_path / "boxes.csv").write_text("\n".join(lines))
    out = tmp_path / "out"
    given = ["evaluate", str(place / "shapes"), str(tmp_path / "boxes.csv"), "--out", str(out)]
    result = CliRunner().invoke(main, [*given, *QUICK, "--max-failed", "20"])
    # `../m07` ends in the id of a shape as `m07` does
    assert result.exit_code == 2
    assert "both ../m07 and m07 have the id of m07" in result.stderr
    (tmp_path / "boxes.csv").write_text(
        "\n".join([*lines[:-2], "../zz,1,1,1,1,0,0,0,0,0,0", lines[-1]])
    )
    result = CliRunner().invoke(main, [*given, *QUICK, "--max-failed", "20"])
    assert result.exit_code == 0, result.output
    assert "1 belong to no shape: ../zz" in result.stderr
    found = {row["model_id"]: row for row in rows(out)}
    assert float(found["m00"]["volume_iou"]) == pytest.approx(1)
    assert found["m07"]["reason"] == "boxes.csv, line 10: sx is not a finite number"
    assert not (tmp_path.parent / "zz").exists()


def test_one_mesh_and_its_result_need_no_ids(tmp_path: Path) -> None:
    shape = write(tmp_path / "chair.obj", box())
    result = write(tmp_path / "boxes.obj", joined(box((1, 0.5, 1), (0, 0.25, 0))))
    out = str(tmp_path / "out")
    done = CliRunner().invoke(main, ["evaluate", str(shape), str(result), "--out", out, *QUICK])
    assert done.exit_code == 0, done.output
    (row,) = rows(tmp_path / "out")
    assert (row["name"], row["model_id"]) == ("boxes", "chair")
    assert float(row["volume_iou"]) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (["/nowhere"], "there are no results /nowhere"),
        (["--name", "x"], "1 names for 2 sets of results"),
        (["--name", "x", "--name", "x"], "two sets of results are called 'x'"),
        (["--set", "network.hidden=3"], "only settings of ingest"),
        (["--set", "ingest.surfacepoints=3"], "did you mean surface_points?"),
        (["--layout", "shapenet-v1"], "layout shapenet-v1 looks for"),
        (["--category", "chair"], "no category 'chair'"),
        (["--split", "/nowhere.csv", "--only", "test"], "isn't a readable csv"),
        (["--max-parts", "0"], "Invalid value for '--max-parts'"),
        (["--frame", "world"], "Invalid value for '--frame'"),
    ],
)
def test_wrong_use_is_told(place: Path, tmp_path: Path, more: list[str], says: str) -> None:
    result = run(place, tmp_path / "out", *more)
    assert result.exit_code == 2, result.output
    assert says in result.stderr
    assert result.stdout == ""
    assert not (tmp_path / "out" / "models.csv").exists()


def test_shapes_that_are_not_there(place: Path, tmp_path: Path) -> None:
    given = ["evaluate", str(tmp_path / "none"), str(place / "half"), "--out", str(tmp_path / "o")]
    result = CliRunner().invoke(main, given)
    assert result.exit_code == 2
    assert "there is no" in result.stderr


def test_files_of_others_are_not_written_over(place: Path, tmp_path: Path) -> None:
    (tmp_path / "models.csv").write_text("mine")
    result = run(place, tmp_path)
    assert result.exit_code == 2
    assert "models.csv is there and of no evaluation" in result.stderr
    assert (tmp_path / "models.csv").read_text() == "mine"


def test_it_loads_no_networks() -> None:
    code = (
        "import sys, pnabs.evaluation.run, pnabs.evaluation.output, pnabs.evaluation.warm\n"
        "print(sorted({'torch', 'ray'} & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


@pytest.mark.usefixtures("ray_session")
def test_on_ray_it_says_the_same(place: Path, finished: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = run(place, out, "--address", "local", "--set", "runtime.actors=2")
    assert result.exit_code == 0, result.output
    assert written(out) == written(finished)


JOB = """
dataset: {{root: {root}, layout: shapenet-v2, shard_size: 2}}
out: {out}
weights: {weights}
ingest: {{surface_points: 500, interior_points: 50, preview_faces: 50}}
abstract: {{metric_samples: 500, boxes: 6}}
report: {{pictures: 1, split: all}}
"""


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of two categories of three models, and one without a readable mesh; its dataset."""
    root = tmp_path_factory.mktemp("run")
    write_collection(root / "samples", per_category=3, categories=["chair", "bench"])
    (root / "samples/03001627/zz/models").mkdir(parents=True)
    (root / "samples/03001627/zz/models/model_normalized.obj").write_text("this is no mesh\n")
    untrained(root / "weights")
    text = JOB.format(root=root / "samples", out=root / "run", weights=root / "weights")
    (root / "job.yaml").write_text(text)
    options = Options(max_failed=50, command="")
    run_job(load_job(root / "job.yaml"), options, Reporter(quiet=True), InlineExecutor)
    return root


def plain(row: dict[str, str]) -> dict[str, str]:
    return {name: value for name, value in row.items() if name != "split"}


def test_a_run_is_measured_as_it_measured_itself(job: Path, tmp_path: Path) -> None:
    evaluate = ["evaluate", str(job / "run"), str(job / "run"), "--name", "main"]
    out = tmp_path / "out"
    result = CliRunner().invoke(main, [*evaluate, "--out", str(out), "--max-failed", "50"])
    assert result.exit_code == 0, result.output
    assert "03001627/zz: invalid: ingest: invalid" in result.stderr
    found = {(row["category"], row["model_id"]): row for row in rows(out)}
    paths = sorted((job / "run/variants/main/abstractions").rglob("abstraction.json"))
    assert len(paths) == len(found) == 6
    for path in paths:
        stored = pnabs.load(path)
        row = found[stored.category, stored.model_id]
        compared = [name for name in METRICS if name in stored.metrics]
        assert {"iou_32", "iou_128", "coverage", "out_99", "cd_l1", "bodies"} <= set(compared)
        for name in compared:
            assert row[name] != "", name
            # Those of sampled points differ by the samples.
            slack = 0.2 if name.startswith(("cd_", "out_")) else 0
            assert float(row[name]) == pytest.approx(stored.metrics[name], rel=slack, abs=0), name


def test_a_dataset_says_the_same_as_the_run_of_it(job: Path, tmp_path: Path) -> None:
    given = [str(job / "run/variants/main"), *QUICK, "--max-failed", "50"]
    for name in ("run", "samples"):
        shapes = [str(job / name), str(job / "run/variants/main"), "--out", str(tmp_path / name)]
        options = given[1:] if name == "samples" else ["--max-failed", "50"]
        result = CliRunner().invoke(main, ["evaluate", *shapes, *options])
        assert result.exit_code == 0, result.output
    assert [plain(row) for row in rows(tmp_path / "run")] == [
        plain(row) for row in rows(tmp_path / "samples")
    ]


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (["--layout", "folder"], "is a run, which has its own"),
        (["--split", "hash"], "is a run, which has its own"),
        (["--set", "ingest.surface_points=3"], "is a run, whose shapes are ingested already"),
    ],
)
def test_a_runs_shapes_are_as_they_are(
    job: Path, tmp_path: Path, more: list[str], says: str
) -> None:
    given = ["evaluate", str(job / "run"), str(job / "run"), "--out", str(tmp_path / "o")]
    result = CliRunner().invoke(main, [*given, *more])
    assert result.exit_code == 2
    assert says in result.stderr


def test_a_run_of_another_version_is_refused(job: Path, tmp_path: Path) -> None:
    shutil.copytree(job / "run", tmp_path / "run")
    path = tmp_path / "run/run.json"
    identity = unseal(path.read_bytes())
    identity["stage_versions"]["ingest"] -= 1
    path.write_bytes(seal(identity))
    given = [str(tmp_path / "run"), str(job / "run"), "--out", str(tmp_path / "o")]
    result = CliRunner().invoke(main, ["evaluate", *given])
    assert result.exit_code == 4
    assert "was ingested by another pnabs" in result.stderr


def test_a_run_that_was_moved_is_measured_all_the_same(job: Path, tmp_path: Path) -> None:
    shutil.copytree(job / "run", tmp_path / "moved")
    for name, run_folder in (("a", job / "run"), ("b", tmp_path / "moved")):
        given = [str(run_folder), str(job / "run"), "--out", str(tmp_path / name)]
        result = CliRunner().invoke(main, ["evaluate", *given, "--max-failed", "50"])
        assert result.exit_code == 0, result.output
    assert rows(tmp_path / "a") == rows(tmp_path / "b")
