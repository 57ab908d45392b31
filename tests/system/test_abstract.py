"""`pnabs abstract`: folders of meshes, without Ray: killed, stopped, changed, and run again."""

from __future__ import annotations

import contextlib
import ctypes
import dataclasses
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import trimesh
from click.testing import CliRunner, Result

import pnabs
from pnabs.cli import main
from pnabs.dataset.samples import write_collection
from pnabs.formats import FORMATS
from pnabs.stages import writing
from pnabs.stages.file_state import Item
from pnabs.stages.file_work import FileTask, FileWork
from pnabs.store.atomic import write_atomic
from tests.weights import untrained

NAMES = ["bench/one", "bench/two", "chair/one", "chair/three", "chair/two", "top"]
QUICK = ("--set", "abstract.metric_samples=500", "--set", "ingest.surface_points=1000")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six meshes below `meshes`, and weights."""
    root = tmp_path_factory.mktemp("abstract")
    write_collection(root / "samples", per_category=3, categories=["chair", "bench"])
    found = sorted((root / "samples").glob("*/*/models/*.obj"))
    for name, path in zip(NAMES, found, strict=True):
        (root / "meshes" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, root / "meshes" / f"{name}.obj")
    untrained(root / "weights")
    return root


def arguments(place: Path, out: Path, *more: str, meshes: Path | None = None) -> list[str]:
    weights = str(place / "weights")
    where = str(meshes or place / "meshes")
    return ["abstract", where, "--out", str(out), "--weights", weights, *QUICK, *more]


def run(place: Path, out: Path, *more: str, meshes: Path | None = None) -> Result:
    return CliRunner().invoke(main, arguments(place, out, *more, meshes=meshes))


@pytest.fixture(scope="module")
def finished(place: Path) -> Path:
    """Results that nothing disturbed; read-only for tests."""
    result = run(place, place / "finished", "--jobs", "2")
    assert result.exit_code == 0, result.output
    assert all(f"{place / 'finished' / name}: " in result.stdout for name in NAMES)
    return place / "finished"


def tree(out: Path) -> dict[str, bytes]:
    return {
        path.relative_to(out).as_posix(): path.read_bytes()
        for path in sorted(out.rglob("*"))
        if path.is_file() and ".pnabs" not in path.parts
    }


def times(out: Path) -> dict[str, int]:
    return {
        path.parent.relative_to(out).as_posix(): path.stat().st_mtime_ns
        for path in out.rglob("abstraction.json")
    }


def test_each_mesh_has_its_files(finished: Path) -> None:
    expected = {f"{name}/abstraction.{suffix}" for name in NAMES for suffix in ("json", "glb")}
    assert set(tree(finished)) == expected
    assert all(pnabs.load(finished / name / "abstraction.json").check["ok"] for name in NAMES)


def test_the_library_gives_the_same(place: Path, finished: Path) -> None:
    options = {"abstract": {"metric_samples": 500}, "ingest": {"surface_points": 1000}}
    mesh = place / "meshes/top.obj"
    made = pnabs.abstract(mesh, weights=place / "weights", settings=options)
    stored = pnabs.load(finished / "top/abstraction.json")
    made = dataclasses.replace(made, provenance=stored.provenance)
    assert FORMATS["json"].write(made, "a") == FORMATS["json"].write(stored, "a")


def test_run_again_does_nothing(place: Path, finished: Path) -> None:
    before = times(finished)
    result = run(place, finished)
    assert result.exit_code == 0
    assert times(finished) == before
    assert "done=6/6 meshes" in result.stderr


class Crashing(FileTask):
    """One of the meshes crashes native code."""

    def __call__(self, item: Item) -> dict[str, bytes]:
        """Crash, or do it."""
        if item.model_id == "chair/two":
            ctypes.string_at(0)
        return super().__call__(item)


@pytest.fixture
def crashing(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    with monkeypatch.context() as patched:
        patched.setattr(FileWork, "task", property(lambda self: Crashing(self.job, self.recipe)))
        yield


def test_one_that_crashes_costs_no_other(
    place: Path, finished: Path, tmp_path: Path, crashing: None
) -> None:
    out = tmp_path / "out"
    result = run(place, out, "--jobs", "2")
    assert result.exit_code == 3  # one of six is more than 5 %
    assert "chair/two: crash: the process died of SIGSEGV" in result.stdout
    (line,) = (out / "quarantine.jsonl").read_text().splitlines()
    entry = json.loads(line)
    assert (entry["model_id"], entry["kind"], entry["attempts"]) == ("chair/two", "crash", 2)
    ours, theirs = tree(out), tree(finished)
    del ours["quarantine.jsonl"]
    assert ours == {name: data for name, data in theirs.items() if "chair/two" not in name}
    # It is not tried again, unless asked for.
    before = times(out)
    assert run(place, out, "--max-failed", "50").exit_code == 0
    assert times(out) == before


def test_what_fell_out_is_tried_again_when_asked_for(
    place: Path, finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    with monkeypatch.context() as patched:
        patched.setattr(FileWork, "task", property(lambda self: Crashing(self.job, self.recipe)))
        run(place, out)
    before = times(out)
    assert run(place, out, "--retry").exit_code == 0
    assert tree(out) == tree(finished)
    assert before.items() < times(out).items()


def test_formats_asked_for_later_follow_from_what_is_there(
    place: Path, finished: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    shutil.copytree(finished, out)
    before = tree(out)
    more = [part for name in FORMATS for part in ("--format", name)]
    assert run(place, out, *more).exit_code == 0
    after = tree(out)
    assert before.items() < after.items()
    for name in NAMES:
        expected = {}
        for known in FORMATS.values():
            abstraction = pnabs.load(out / name / "abstraction.json")
            expected |= known.write(abstraction, "abstraction")
        mine = {
            path.removeprefix(f"{name}/"): data
            for path, data in after.items()
            if path.startswith(f"{name}/")
        }
        assert mine == expected


def test_levels_and_a_budget(place: Path, tmp_path: Path) -> None:
    mesh = place / "meshes" / "chair"
    more = ("--levels", "2,1", "--boxes", "4", "--format", "urdf", "--format", "glb")
    assert run(place, tmp_path, *more, meshes=mesh).exit_code == 0
    before = tree(tmp_path)
    for name in ("one", "two", "three"):
        made = pnabs.load(tmp_path / name / "abstraction.json")
        assert len(made.positives) + len(made.negatives) <= 4
        assert list(made.levels) == [2, 1]
        for stem in ("abstraction", "abstraction.level2", "abstraction.level1"):
            assert f"{name}/{stem}.glb" in before
            assert f"{name}/{stem}.urdf" in before
    # a file of a level that is lost comes back, from the record
    for lost in ("abstraction.glb", "abstraction.level1.glb"):
        (tmp_path / "one" / lost).unlink()
    assert run(place, tmp_path, *more, meshes=mesh).exit_code == 0
    assert tree(tmp_path) == before
    # without levels nothing of them stays
    assert run(place, tmp_path, "--boxes", "4", meshes=mesh).exit_code == 0
    assert not [name for name in tree(tmp_path) if ".level" in name]


def test_only_what_changed_is_done_again(place: Path, finished: Path, tmp_path: Path) -> None:
    out, meshes = tmp_path / "out", tmp_path / "meshes"
    shutil.copytree(finished, out)
    shutil.copytree(place / "meshes", meshes)
    before, content = times(out), tree(out)
    shutil.copy(meshes / "bench/one.obj", meshes / "chair/new.obj")
    (meshes / "bench/two.obj").write_text("no mesh\n")
    with (meshes / "chair/three.obj").open("a") as stream:
        stream.write("# other bytes\n")
    (meshes / "top.obj").unlink()
    result = run(place, out, "--max-failed", "20", meshes=meshes)
    assert result.exit_code == 0, result.output
    assert "bench/two: invalid: bench/two.obj" in result.stdout
    assert {name for name, time in times(out).items() if before.get(name) != time} == {
        "chair/new",
        "chair/three",
    }
    # What a mesh had before it broke is gone; results without a mesh stay.
    assert not (out / "bench/two").exists()
    assert (out / "top/abstraction.glb").read_bytes() == content["top/abstraction.glb"]
    assert run(place, out, "--seed", "1", "--max-failed", "20", meshes=meshes).exit_code == 0
    assert times(out)["bench/one"] != before["bench/one"]


def start(place: Path, out: Path, **options: bool) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "pnabs.cli", *arguments(place, out, "--jobs", "1")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parents[2],
        env=os.environ | {"HOME": str(out.parent), "PNABS_TEST": str(out)},
        **options,
    )


def wait_for_results(out: Path, count: int) -> None:
    deadline = time.monotonic() + 120
    while len(list(out.rglob("abstraction.json"))) < count:
        assert time.monotonic() < deadline
        time.sleep(0.02)


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
    wait_for_results(out, 2)
    driver.kill()
    driver.communicate()
    deadline = time.monotonic() + 60
    while processes_of(out):
        assert time.monotonic() < deadline, processes_of(out)
        time.sleep(0.05)
    before = times(out)
    assert len(before) < len(NAMES)
    assert run(place, out).exit_code == 0
    assert before.items() < times(out).items()
    assert tree(out) == tree(finished)


@pytest.mark.parametrize(
    "number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)]
)
def test_stopped_in_good_order(place: Path, tmp_path: Path, number: signal.Signals) -> None:
    out = tmp_path / "out"
    driver = start(place, out)
    wait_for_results(out, 1)
    other = run(place, out)
    assert other.exit_code == 4
    assert "is being written by process" in other.stderr
    driver.send_signal(number)
    _, said = driver.communicate(timeout=60)
    assert driver.returncode == 128 + number
    assert "of 6 meshes" in said
    assert f"To go on: pnabs abstract {place / 'meshes'}" in said
    assert not processes_of(out)
    assert not list(out.rglob("*.partial"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (["--weights", "/nowhere"], "weights: there is no positive.safetensors in /nowhere"),
        (["--set", "abstract.debri=0"], "unknown key abstract.debri; did you mean debris?"),
        (["/nowhere/mesh.obj"], "there is no /nowhere/mesh.obj"),
        (["--set", "out=/elsewhere"], "only settings of ingest, difference, abstract, runtime"),
        (["--set", "abstract.formats=[glb]"], "json must be among them"),
        (["--seed", "-1"], "Invalid value for '--seed'"),
    ],
)
def test_wrong_use_is_told(place: Path, tmp_path: Path, change: list[str], message: str) -> None:
    result = run(place, tmp_path / "out", *change)
    assert result.exit_code == 2
    assert message in result.stderr
    assert not (tmp_path / "out").exists()


def test_networks_that_cannot_be_loaded_are_no_meshs_fault(
    place: Path, finished: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    shutil.copytree(finished, out)
    shutil.copytree(place / "weights", tmp_path / "weights")
    (tmp_path / "weights/positive.safetensors").write_bytes(b"garbage")
    result = run(place, out, "--weights", str(tmp_path / "weights"))
    assert result.exit_code == 3
    assert "the networks can't be loaded" in result.stderr
    assert not (out / "quarantine.jsonl").exists()
    # Nothing was written, and nothing lost.
    assert tree(out) == tree(finished)


def test_a_result_cut_short_does_not_count(place: Path, finished: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    shutil.copytree(finished, out)
    folder = out / "top"
    made = {path.name: path.read_bytes() for path in folder.iterdir()}
    with pytest.MonkeyPatch.context() as patched:
        # Killed between the two files of another making.
        patched.setattr(writing, "write_atomic", killed_at("abstraction.json"))
        with pytest.raises(KeyboardInterrupt):
            writing.write_files(folder, {"abstraction.glb": b"other"} | {"abstraction.json": b""})
    assert (folder / "abstraction.glb").read_bytes() != made["abstraction.glb"]
    assert run(place, out).exit_code == 0
    assert tree(out) == tree(finished)


def killed_at(name: str) -> Callable[[Path, bytes], None]:
    def write(path: Path, data: bytes) -> None:
        if path.name == name:
            raise KeyboardInterrupt
        write_atomic(path, data)

    return write


def test_a_urdf_counts_when_all_of_it_is_there(place: Path, finished: Path, tmp_path: Path) -> None:
    out, whole = tmp_path / "out", tmp_path / "whole"
    for folder in (out, whole):
        shutil.copytree(finished, folder)
    assert run(place, whole, "--format", "urdf").exit_code == 0
    order = list(FORMATS["urdf"].write(pnabs.load(out / "top/abstraction.json"), "abstraction"))
    assert order[-1] == "abstraction.urdf"
    (out / "top/abstraction.convex").mkdir()
    (out / "top/abstraction.convex/999.obj").write_text("left by a killed writer")
    assert run(place, out, "--format", "urdf").exit_code == 0
    assert tree(out) == tree(whole)


def test_a_record_that_is_damaged_is_made_again(
    place: Path, finished: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    shutil.copytree(finished, out)
    record = out / "top/abstraction.json"
    record.write_bytes(record.read_bytes().replace(b'"positives": [', b'"positives": [7, ', 1))
    assert run(place, out).exit_code == 0
    assert tree(out) == tree(finished)


def test_a_gltf_is_known_by_its_buffers_too(place: Path, tmp_path: Path) -> None:
    meshes, out = tmp_path / "meshes", tmp_path / "out"
    meshes.mkdir()
    for name, data in trimesh.exchange.gltf.export_gltf(trimesh.creation.box((1, 2, 1))).items():
        (meshes / name).write_bytes(data)
    assert run(place, out, meshes=meshes).exit_code == 0
    (before,) = times(out).items()
    assert pnabs.load(out / before[0] / "abstraction.json").provenance["siblings"]
    assert run(place, out, meshes=meshes).exit_code == 0
    assert dict([before]) == times(out)
    buffer = max(meshes.glob("*.bin"), key=lambda path: path.stat().st_size)
    buffer.write_bytes(buffer.read_bytes()[:-4] + bytes(4))
    run(place, out, meshes=meshes)
    assert dict([before]) != times(out)


def test_stopped_while_it_loads(place: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    driver = start(place, out, start_new_session=True)
    # The server that children are forked from is there, and importing.
    deadline = time.monotonic() + 60
    while len(processes_of(out)) < 3:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    os.killpg(driver.pid, signal.SIGINT)  # as a terminal does
    _, said = driver.communicate(timeout=60)
    assert driver.returncode == 130, said
    assert "Traceback" not in said
    assert "stopped" in said
