"""OBJ, PLY, STL, parts, URDF and MJCF, read back by programs that know nothing of pnabs."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

from pnabs.formats import FORMATS, Abstraction, FormatError, written
from pnabs.geometry.types import Cuboids
from tests.formats.test_glb import abstraction
from tests.geometry.boxes import axis_aligned, random_cuboids

FAR = np.array([[0.7, 0, 0, 1e6], [0, 0.7, 0, -2e6], [0, 0, 0.7, 3], [0, 0, 0, 1.0]])
"""A metre-sized shape a thousand kilometres from the origin."""

TURNED = np.array([[0, -40.0, 0, 5], [40.0, 0, 0, 6], [0, 0, 40.0, 7], [0, 0, 0, 1]])

SHAPES = {
    "random": (random_cuboids(0, 8), random_cuboids(1, 4)),
    "window": (
        axis_aligned(([0.6, 0.6, 0.2], [0, 0, 0])),
        axis_aligned(([0.2, 0.2, 1.0], [0.05, 0, 0])),
    ),
    "boxes": (random_cuboids(2, 5), Cuboids.empty()),
    "jittered": (
        axis_aligned(([0.5, 0.5, 0.5], [0.25, 0.25, 0]), ([0.5, 0.5, 0.5], [-0.25, -0.25, 0])),
        Cuboids.empty(),
    ),
}


@pytest.fixture(params=[(name, place) for name in SHAPES for place in ("unit", "far", "turned")])
def one(request: pytest.FixtureRequest) -> Abstraction:
    name, place = request.param
    transform = {"unit": np.eye(4), "far": FAR, "turned": TURNED}[place]
    return abstraction(*SHAPES[name], transform)


def expected(one: Abstraction) -> trimesh.Trimesh:
    mesh = one.mesh()
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def centred(mesh: trimesh.Trimesh, about: np.ndarray) -> trimesh.Trimesh:
    """Moved to the origin, where volumes keep their digits."""
    return trimesh.Trimesh(mesh.vertices - about, mesh.faces, process=False)


@pytest.mark.parametrize("name", ["obj", "ply", "stl"])
def test_plain_meshes_read_back_closed(one: Abstraction, name: str) -> None:
    (data,) = FORMATS[name].write(one, "a").values()
    mesh = trimesh.load_mesh(io.BytesIO(data), file_type=name, process=False)
    mesh.merge_vertices(digits_vertex=12)
    mesh = trimesh.util.concatenate(mesh) if isinstance(mesh, list) else mesh
    whole = expected(one)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert len(mesh.faces) == len(whole.faces)
    np.testing.assert_array_equal(mesh.bounds, whole.bounds)
    centre = whole.bounds.mean(axis=0)
    assert centred(mesh, centre).volume == pytest.approx(centred(whole, centre).volume, rel=1e-9)


def test_ply_and_obj_name_the_positive_of_each_face() -> None:
    one = abstraction(*SHAPES["random"])
    ply = trimesh.load_mesh(
        io.BytesIO(FORMATS["ply"].write(one, "a")["a.ply"]), file_type="ply", process=False
    )
    raw = ply.metadata["_ply_raw"]["face"]["data"]["positive"]
    np.testing.assert_array_equal(np.ravel(raw), one.solid.source)
    text = FORMATS["obj"].write(one, "a")["a.obj"].decode()
    groups = [line.split("_")[1] for line in text.splitlines() if line.startswith("g ")]
    assert groups == [str(source) for source in np.unique(one.solid.source)]


def test_parts_are_closed_and_their_union_is_the_result(one: Abstraction) -> None:
    data = FORMATS["parts"].write(one, "a")["a.parts.glb"]
    scene = trimesh.load_scene(io.BytesIO(data), file_type="glb")
    assert len(scene.graph.nodes_geometry) == len(scene.geometry)
    whole = expected(one)
    np.testing.assert_allclose(scene.bounds, whole.bounds, rtol=1e-9)
    for mesh in scene.geometry.values():
        assert mesh.is_volume
    frame = np.linalg.inv(one.transform)
    union = trimesh.boolean.union([mesh.copy() for mesh in scene.geometry.values()])
    placed = expected(one).apply_transform(frame)
    assert union.volume == pytest.approx(placed.volume, rel=1e-5)


def test_urdf_and_mjcf_are_the_result(one: Abstraction, tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco")
    whole = expected(one)
    centre = whole.bounds.mean(axis=0)
    volume = centred(whole, centre).volume
    for name, suffix in (("mjcf", ".xml"), ("urdf", ".urdf")):
        for file, data in written(one, [name], "shape").items():
            (tmp_path / file).parent.mkdir(exist_ok=True)
            (tmp_path / file).write_bytes(data)
        model = mujoco.MjModel.from_xml_path(str(tmp_path / f"shape{suffix}"))
        state = mujoco.MjData(model)
        mujoco.mj_forward(model, state)
        pieces = [placed_geom(mujoco, model, state, geom) for geom in range(model.ngeom)]
        bounds = np.array(
            [
                np.min([piece.bounds[0] for piece in pieces], axis=0),
                np.max([piece.bounds[1] for piece in pieces], axis=0),
            ]
        )
        size = np.ptp(whole.bounds, axis=0).max()
        np.testing.assert_allclose(
            (bounds - centre) / size, (whole.bounds - centre) / size, atol=2e-6
        )
        union = trimesh.boolean.union([centred(piece, centre) for piece in pieces])
        assert union.volume == pytest.approx(volume, rel=2e-5)
        if name == "mjcf":
            body = model.body("abstraction")
            assert body.mass[0] == pytest.approx(1000 * volume, rel=1e-6)
            np.testing.assert_allclose(
                (state.xipos[body.id] - centre) / size,
                centred(whole, centre).center_mass / size,
                atol=1e-6,
            )


def placed_geom(mujoco: Any, model: Any, state: Any, geom: int) -> trimesh.Trimesh:
    """A geom as MuJoCo has it, in the world."""
    kind = model.geom_type[geom]
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        mesh = trimesh.creation.box(2 * model.geom_size[geom])
    else:
        number = model.geom_dataid[geom]
        first, count = model.mesh_vertadr[number], model.mesh_vertnum[number]
        vertices = model.mesh_vert[first : first + count].astype(np.float64)
        mesh = trimesh.convex.convex_hull(vertices)
    rotation = state.geom_xmat[geom].reshape(3, 3)
    vertices = mesh.vertices @ rotation.T + state.geom_xpos[geom]
    return trimesh.Trimesh(vertices, mesh.faces, process=False)


def test_a_window_is_open_in_the_simulator() -> None:
    mujoco = pytest.importorskip("mujoco")
    one = abstraction(*SHAPES["window"])
    model = mujoco.MjModel.from_xml_string(FORMATS["mjcf"].write(one, "a")["a.xml"].decode())
    state = mujoco.MjData(model)
    mujoco.mj_forward(model, state)

    def hit(start: list[float]) -> float:
        geom = np.zeros(1, dtype=np.int32)
        return float(
            mujoco.mj_ray(model, state, np.array(start), np.array([0, 0, -1.0]), None, 1, -1, geom)
        )

    assert hit([0.05, 0.0, 1.0]) == -1  # through the window
    assert hit([0.25, 0.0, 1.0]) == pytest.approx(0.9)


def test_boxes_need_a_transform_that_keeps_them_boxes() -> None:
    skewed = np.eye(4)
    skewed[0, 1] = 0.2
    one = abstraction(*SHAPES["boxes"], skewed)
    for name in ("urdf", "mjcf"):
        with pytest.raises(FormatError, match="scale evenly"):
            FORMATS[name].write(one, "a")


def test_an_empty_result_has_files_without_pieces(tmp_path: Path) -> None:
    one = abstraction(SHAPES["window"][0], axis_aligned(([2, 2, 2], [0, 0, 0])))
    files = written(one, FORMATS)
    assert set(files) == {f"abstraction{known.suffix}" for known in FORMATS.values()}
    mujoco = pytest.importorskip("mujoco")
    assert mujoco.MjModel.from_xml_string(files["abstraction.xml"].decode()).ngeom == 0


@pytest.mark.parametrize("size", [1e-5, 1e-3, 1e3, 1e6])
@pytest.mark.parametrize("name", SHAPES)
def test_small_and_large_bodies_load(name: str, size: float) -> None:
    mujoco = pytest.importorskip("mujoco")
    one = abstraction(*SHAPES[name], np.diag([size, size, size, 1.0]))
    model = mujoco.MjModel.from_xml_string(FORMATS["mjcf"].write(one, "a")["a.xml"].decode())
    assert model.ngeom >= len(SHAPES[name][0])
    volume = float(np.linalg.det(one.solid.triangles).sum() / 6) * size**3
    if size >= 1:
        assert model.body("abstraction").mass[0] == pytest.approx(1000 * volume, rel=1e-6)


def test_names_that_xml_cannot_hold_are_written_without(tmp_path: Path) -> None:
    one = replace(abstraction(*SHAPES["boxes"]), model_id='<&">\uffff\x01chair')
    for name in ("urdf", "mjcf"):
        data = written(one, [name], "a")[f"a{FORMATS[name].suffix}"]
        root = ElementTree.fromstring(data)
        assert '<&">__chair' in (root.get("name"), root.get("model"))


def test_a_urdf_saved_over_another_leaves_none_of_it(tmp_path: Path) -> None:
    abstraction(*SHAPES["random"]).save(tmp_path / "a.urdf")
    assert list((tmp_path / "a.convex").iterdir())
    abstraction(*SHAPES["boxes"]).save(tmp_path / "a.urdf")
    assert not (tmp_path / "a.convex").exists()
