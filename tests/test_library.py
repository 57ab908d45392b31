"""The library's front door."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

import pnabs
import pnabs.formats
from pnabs.formats import FormatError
from pnabs.geometry.load import InvalidMeshError
from tests.weights import untrained

QUICK = {"abstract": {"metric_samples": 300}, "ingest": {"surface_points": 500}}


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return untrained(tmp_path_factory.mktemp("weights"))


def test_importing_loads_nothing_heavy() -> None:
    code = "import pnabs, sys; print([m for m in ('numpy', 'torch', 'ray') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_files_meshes_and_scenes_are_the_same(weights: Path, tmp_path: Path) -> None:
    mesh = trimesh.creation.box((1, 2, 3))
    mesh.apply_translation((10, 0, 0))
    scene = trimesh.Scene()
    scene.add_geometry(
        trimesh.creation.box((1, 2, 3)),
        transform=trimesh.transformations.translation_matrix((10, 0, 0)),
    )
    mesh.export(tmp_path / "mesh.stl")
    (tmp_path / "link.stl").symlink_to(tmp_path / "mesh.stl")
    bounds = []
    for given in (mesh, scene, tmp_path / "mesh.stl", str(tmp_path / "link.stl")):
        made = pnabs.abstract(given, weights=weights, settings=QUICK)
        assert made.model_id in ("mesh", "link")
        np.testing.assert_allclose(made.transform[:3, 3], [10, 0, 0], atol=1e-6)
        bounds.append(made.positives.as_vector())
    for other in bounds[1:]:
        np.testing.assert_allclose(other, bounds[0], atol=1e-4)


def test_the_callers_threads_are_left_alone(weights: Path) -> None:
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        pnabs.abstract(trimesh.creation.box((1, 1, 1)), weights=weights, settings=QUICK)
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)


def test_wrong_input_is_told(weights: Path, tmp_path: Path) -> None:
    (tmp_path / "mesh.obj").write_text("no mesh")
    with pytest.raises(FileNotFoundError, match="there is no mesh"):
        pnabs.abstract(tmp_path / "nothing.obj", weights=weights)
    with pytest.raises(InvalidMeshError):
        pnabs.abstract(tmp_path / "mesh.obj", weights=weights)
    with pytest.raises(ValueError, match="abstract.nothing"):
        pnabs.abstract(tmp_path / "mesh.obj", settings={"abstract": {"nothing": 1}})
    with pytest.raises(FormatError):
        pnabs.load(tmp_path / "mesh.obj")
    with pytest.raises(AttributeError, match="nothing"):
        pnabs.nothing  # noqa: B018


IN_A_THREAD = """
import sys, threading
import trimesh, pnabs
settings = {"abstract": {"metric_samples": 300}, "ingest": {"surface_points": 500}}
abstract = pnabs.abstract
mesh = trimesh.creation.box((1, 1, 1))
done = []


def work():
    done.append(abstract(mesh, weights=sys.argv[1], settings=settings))


thread = threading.Thread(target=work)
thread.start()
thread.join()
print(len(done))
"""


def test_it_works_in_a_thread(weights: Path) -> None:
    command = [sys.executable, "-c", IN_A_THREAD, str(weights)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "1\n"), done.stderr


def test_a_name_decides_nothing(weights: Path, tmp_path: Path) -> None:
    """The same mesh under other names, in other folders, gives the same bytes but the name."""
    shape = trimesh.creation.capsule(0.4, 0.2, count=(8, 8))
    texts = []
    for name in ("upperarm", "ur5/upperarm", "zz/03001627"):
        path = tmp_path / f"{name}.ply"
        path.parent.mkdir(exist_ok=True)
        shape.export(path)
        made = pnabs.abstract(path, weights=weights, settings=QUICK)
        texts.append(pnabs.formats.to_json(dataclasses.replace(made, model_id="")))
    assert len(set(texts)) == 1
