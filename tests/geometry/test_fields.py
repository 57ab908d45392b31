"""All that ingest keeps of a mesh: registration, mirror axis, preview."""

from __future__ import annotations

import dataclasses
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from pnabs.geometry.fields import Fields, compute_fields, interpolate_sdf
from pnabs.geometry.load import InvalidMeshError, parse_mesh
from pnabs.geometry.mirror import detect_mirror, mirror_iou
from pnabs.geometry.preview import preview
from pnabs.geometry.types import THETA_D, Mesh, grid_points
from pnabs.settings import Ingest, Solid
from tests.geometry.soups import CELL, as_mesh, box, box_distance, chair_parts, iou, merged, sheet

SMALL = Ingest(surface_points=800, interior_points=300, preview_faces=100)


def fields_of(mesh: Mesh, settings: Ingest = SMALL, layout: str = "folder") -> Fields:
    return compute_fields(mesh, settings, layout, np.random.default_rng(0))


def test_a_known_box_comes_back_where_it_was() -> None:
    sides, centre = np.array([4.0, 2.0, 1.0]), np.array([1000.0, -20.0, 7.0])
    found = fields_of(box(tuple(sides), tuple(centre)))
    for occupancy in (found.occupancy, found.occupancy_64):
        points = grid_points(len(occupancy)) @ found.transform[:3, :3].T + found.transform[:3, 3]
        expected = box_distance(points, tuple(sides), centre)
        np.testing.assert_array_equal(occupancy.ravel(), expected < 0)
    expected = box_distance(grid_points(32), tuple(sides / 4), np.zeros(3))
    band = np.abs(expected) < THETA_D + CELL
    np.testing.assert_allclose(found.sdf.ravel()[band], expected[band], atol=1e-6)
    np.testing.assert_array_equal(found.sdf < 0, found.occupancy)
    assert np.abs(interpolate_sdf(found.sdf, found.surface[:, :3])).max() < CELL / 2
    inside = box_distance(found.interior.astype(np.float64), tuple(sides / 4), np.zeros(3))
    assert inside.max() < CELL / 2
    back = found.surface[:, :3] @ found.transform[:3, :3].T + found.transform[:3, 3]
    np.testing.assert_allclose(box_distance(back, tuple(sides), centre), 0, atol=1e-5)


def test_shapes_types_and_determinism() -> None:
    first, again = fields_of(merged(*chair_parts())), fields_of(merged(*chair_parts()))
    assert first.occupancy.shape == first.sdf.shape == (32, 32, 32)
    assert first.occupancy_64.shape == (64, 64, 64)
    assert first.surface.shape == (800, 6)
    assert first.interior.shape == (300, 3)
    assert first.preview.shape == (72, 3, 3)
    assert {first.occupancy.dtype, first.occupancy_64.dtype} == {np.dtype(bool)}
    assert {first.sdf.dtype, first.surface.dtype, first.interior.dtype} == {np.dtype(np.float32)}
    assert first.transform.dtype == np.float64
    assert first.preview.dtype == np.float16
    for field in dataclasses.fields(Fields):
        a, b = (getattr(found, field.name) for found in (first, again))
        assert pickle.dumps(a) == pickle.dumps(b), field.name


def test_size_and_place_of_the_input_don_t_matter() -> None:
    chair = merged(*chair_parts())
    moved = Mesh(chair.vertices * 512 + [1024, -2048, 4096], chair.faces)
    a, b = fields_of(chair), fields_of(moved)
    np.testing.assert_array_equal(a.occupancy, b.occupancy)
    np.testing.assert_allclose(a.sdf, b.sdf, atol=1e-6)
    np.testing.assert_allclose(a.surface[:, :3], b.surface[:, :3], atol=1e-6)


def test_a_mesh_without_area_is_invalid() -> None:
    with pytest.raises(InvalidMeshError, match="area"):
        fields_of(Mesh(np.eye(3), np.array([[0, 1, 1]])))


def test_the_coarse_and_the_fine_solid_agree() -> None:
    found = fields_of(as_mesh(trimesh.creation.torus(0.35, 0.13)))
    pooled = found.occupancy_64.reshape(32, 2, 32, 2, 32, 2).mean(axis=(1, 3, 5)) >= 0.5
    assert iou(pooled, found.occupancy) > 0.9


def turned(mesh: Mesh) -> Mesh:
    """A quarter turn about y: left and right come to lie along z."""
    return Mesh(mesh.vertices[:, [2, 1, 0]] * [1, 1, -1] + [3, 4, 5], mesh.faces)


def test_the_mirror_axis_of_a_shifted_chair() -> None:
    chair = merged(*chair_parts())
    shifted = Mesh(chair.vertices + np.array([0.3, -7, 2]), chair.faces)
    assert fields_of(shifted, layout="shapenet-v1").mirror == 0
    assert fields_of(turned(chair), layout="shapenet-v2").mirror == 2


def test_mirror_settings() -> None:
    chair = fields_of(merged(*chair_parts())).occupancy
    lopsided = chair.copy()
    lopsided[:14] = False
    cube = np.ones((4, 4, 4), dtype=bool)
    assert detect_mirror(lopsided, Solid(), "folder") == -1
    assert detect_mirror(lopsided, Solid(mirror_threshold=0.0), "folder") in (0, 2)
    assert detect_mirror(lopsided, Solid(mirror="layout"), "shapenet-v1") == 2
    assert detect_mirror(lopsided, Solid(mirror="layout"), "shapenet-v2") == 0
    assert detect_mirror(chair, Solid(mirror="layout"), "folder") == 0
    assert [detect_mirror(chair, Solid(mirror=m), "folder") for m in ("x", "y", "z", "none")] == [
        0,
        1,
        2,
        -1,
    ]
    assert [detect_mirror(cube, Solid(), f"shapenet-v{v}") for v in (1, 2)] == [2, 0]
    assert mirror_iou(chair, 0) == 1
    assert mirror_iou(np.zeros((4, 4, 4), dtype=bool), 0) == 0


@pytest.mark.parametrize("limit", [1, 2, 7, 100, 1000])
def test_a_preview_keeps_to_its_limit_and_to_the_shape(limit: int) -> None:
    mesh = as_mesh(trimesh.creation.torus(0.35, 0.13, 64, 32))
    light = preview(mesh, limit)
    assert 1 <= len(light.faces) <= limit
    assert (np.abs(light.vertices) <= np.abs(mesh.vertices).max(axis=0) + 1e-12).all()
    if limit == 1000:
        assert len(light.faces) > 300
        area = trimesh.Trimesh(light.vertices, light.faces, process=False).area
        assert area == pytest.approx(4 * np.pi**2 * 0.35 * 0.13, rel=0.1)


def test_a_light_mesh_is_its_own_preview() -> None:
    mesh = sheet()
    assert preview(mesh, 2) is mesh


WARM = """
import numpy as np
from benchmarks.known_solids import spoil
from pnabs.dataset.samples.collection import make_model
from pnabs.geometry import columns, disorder, distance, holes, obj, off, patches
from pnabs.geometry import pieces, ply, polygon, shell, solid, stl, visibility, words
from pnabs.geometry.fields import compute_fields, warm_up
from pnabs.geometry.load import parse_mesh
from pnabs.settings import Ingest

warm_up()
kernels = [
    (module.__name__, name, kernel)
    for module in (
        *(columns, disorder, distance, holes, obj, off, patches),
        *(pieces, ply, polygon, shell, solid, stl, visibility, words),
    )
    for name, kernel in vars(module).items()
    if hasattr(kernel, "signatures")
]
assert len(kernels) > 20
before = [(*names, len(kernel.signatures)) for *names, kernel in kernels]
options = Ingest(surface_points=800, interior_points=300, preview_faces=100)
rng = np.random.default_rng(0)
for ways in ("unweld", "flip+tear", "bottom", "double"):
    mesh = parse_mesh(make_model("chair", 1, 0).obj.encode(), ".obj", options.limits)
    compute_fields(spoil(mesh, ways, rng), options, "folder", rng)
after = [(*names, len(kernel.signatures)) for *names, kernel in kernels]
assert before == after, set(after) - set(before)
"""


def test_every_kernel_is_warm_afterwards() -> None:
    # in a process of its own: other tests call kernels in their own ways
    done = subprocess.run([sys.executable, "-c", WARM], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif("PNABS_DEV_CORPUS" not in os.environ, reason="PNABS_DEV_CORPUS names no folder")
def test_real_meshes_have_solids() -> None:
    files = sorted(Path(os.environ["PNABS_DEV_CORPUS"]).glob("*/*/models/model_normalized.obj"))
    assert files
    for file in files[::40]:
        mesh = parse_mesh(file.read_bytes(), ".obj", SMALL.limits)
        found = fields_of(mesh)
        assert found.occupancy.any(), file
        np.testing.assert_array_equal(found.sdf < 0, found.occupancy, err_msg=str(file))
