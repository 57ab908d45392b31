"""Soups to solids: welding, orientation, thin parts."""

from __future__ import annotations

from collections.abc import Callable

import igl
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from benchmarks.known_solids import spoil
from pnabs.geometry.columns import LINE_OFFSET, inside_votes, trace
from pnabs.geometry.load import InvalidMeshError
from pnabs.geometry.normalise import normalise
from pnabs.geometry.orient import Open, OrientedMesh, prepare
from pnabs.geometry.shell import surface_cells
from pnabs.geometry.solid import voxelise, voxelise_parts
from pnabs.geometry.types import GRID_SIDE, Bool, Mesh, Signs, cell_centres, grid_points
from pnabs.geometry.weld import weld
from tests.geometry.soups import (
    CELL,
    as_mesh,
    box,
    box_distance,
    chair_parts,
    iou,
    merged,
    sheet,
    tube,
)

SHAPES: dict[str, Callable[[], Mesh]] = {
    "box": lambda: as_mesh(trimesh.creation.box((1, 0.6, 0.4)).subdivide().subdivide()),
    "sphere": lambda: as_mesh(trimesh.creation.icosphere(2, 0.5)),
    "torus": lambda: as_mesh(trimesh.creation.torus(0.35, 0.13)),
    "annulus": lambda: as_mesh(trimesh.creation.annulus(0.2, 0.5, 0.4)),
    "chair": lambda: merged(*chair_parts()),
}


def upright(mesh: Mesh) -> Signs:
    return np.ones(len(mesh.faces), dtype=np.int8)


def solid(mesh: Mesh, resolution: int = 32, open: Open = "fill") -> Bool:
    return voxelise(prepare(normalise(mesh)[0], open), resolution)


def test_normalise_centres_scales_and_leads_back() -> None:
    mesh = box((2, 1, 0.5), (100, -20, 7))
    # neither a vertex that no face uses nor a face without area belongs to the shape
    stray = Mesh(
        np.concatenate([mesh.vertices, [[1e4, 0, 0], [2e4, 0, 0]]]),
        np.concatenate([mesh.faces, [[8, 8, 9]]]),
    )
    normalised, transform = normalise(stray)
    np.testing.assert_allclose(np.abs(normalised.vertices).max(axis=0), [0.5, 0.25, 0.125])
    back = normalised.triangles @ transform[:3, :3].T + transform[:3, 3]
    np.testing.assert_allclose(back, mesh.triangles, atol=1e-12)
    with pytest.raises(InvalidMeshError, match="no face"):
        normalise(Mesh(mesh.vertices, mesh.faces[:, [0, 0, 1]]))


def test_weld_joins_drops_and_keeps_positions() -> None:
    mesh = box((1, 0.6, 0.4))
    spoilt = spoil(mesh, "double+repeat+unweld", np.random.default_rng(0))
    shaken = np.random.default_rng(1).uniform(-1e-8, 1e-8, spoilt.vertices.shape)
    welded = weld(Mesh(spoilt.vertices + shaken, spoilt.faces))
    assert welded.vertices.shape == (8, 3)
    assert welded.faces.shape == (12, 3)
    np.testing.assert_allclose(np.abs(welded.vertices), np.abs(mesh.vertices), atol=1e-8)


def test_a_mesh_thinner_than_the_weld_is_kept() -> None:
    needle = np.array([[-0.5, 0, 0], [0.5, 0, 0], [0, 1e-9, 0]])
    mesh = Mesh(needle, np.array([[0, 1, 2]], dtype=np.int64))
    assert len(weld(mesh).faces) == 1
    assert np.count_nonzero(voxelise(prepare(mesh), 32)) >= 30


def test_winding_of_overlapping_parts_agrees_with_the_exact_one() -> None:
    mesh = merged(*chair_parts())
    votes = inside_votes(trace(mesh, 16), upright(mesh))
    exact = igl.winding_number(mesh.vertices, mesh.faces, grid_points(16)).reshape(16, 16, 16)
    assert exact.max() > 1.5, "parts overlap"
    np.testing.assert_array_equal(votes, np.where(exact > 0.5, 6, 0))


def test_a_ray_along_an_edge_meets_one_of_its_faces() -> None:
    ticks = cell_centres(16)[[2, 5, 8, 11, 13]]
    shape = trimesh.creation.box((4, 4, 4)).subdivide().subdivide()
    place = np.rint(np.array(shape.vertices)).astype(int) + 2
    # rays along x run exactly through the lattice of vertices of the faces they meet
    vertices = np.stack([ticks[place[:, k]] + (0.0, *LINE_OFFSET)[k] for k in range(3)], axis=1)
    mesh = Mesh(vertices, np.array(shape.faces))
    votes = inside_votes(trace(mesh, 16), upright(mesh))
    assert votes[3:13, 3:13, 3:13].min() == 6
    assert votes[:2].max() == votes[14:].max() == 0


@pytest.mark.parametrize("resolution", [32, 64])
def test_cells_of_an_off_centre_box(resolution: int) -> None:
    # the small box makes the shape differ from every mirror image and turn of itself
    centres = np.array([[0, 0, 0], [0.35, 0.2, 0.1]])
    sides = ((1.0, 0.3, 0.2), (0.3, 0.2, 0.1))
    mesh = merged(*(box(s, tuple(c + 50.0)) for s, c in zip(sides, centres, strict=True)))
    low, high = np.array([-0.5, -0.15, -0.1]), np.array([0.5, 0.3, 0.15])
    points = grid_points(resolution) + (low + high) / 2
    expected = np.min([box_distance(points, s, c) for s, c in zip(sides, centres, strict=True)], 0)
    found = solid(mesh, resolution)
    np.testing.assert_array_equal(found.ravel(), expected < 0)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize(
    "ways",
    ["flip", "invert", "repeat", "double", "shuffle", "unweld", "tear", "flip+repeat+unweld"],
)
def test_spoilt_shapes_keep_their_solid(name: str, ways: str) -> None:
    mesh = SHAPES[name]()
    spoilt = spoil(mesh, ways, np.random.default_rng(5))
    truth = igl.winding_number(*_arrays(normalise(mesh)[0]), grid_points(32)) > 0.5
    assert iou(solid(spoilt).ravel(), truth) >= 0.98


def _arrays(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    return mesh.vertices, mesh.faces


def test_faces_end_up_looking_outwards() -> None:
    spoilt = spoil(SHAPES["torus"](), "flip+unweld", np.random.default_rng(2))
    prepared = prepare(normalise(spoilt)[0])
    triangles = prepared.mesh.triangles
    a, b, c = np.moveaxis(triangles, 1, 0)
    volume = (a * np.cross(b, c)).sum() / 6
    assert volume == pytest.approx(as_trimesh(normalise(SHAPES["torus"]())[0]).volume)
    assert not prepared.open_faces().any()


def as_trimesh(mesh: Mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def test_a_sealed_cavity_stays_hollow_if_its_faces_say_so() -> None:
    outer, inner = box((1, 1, 1)), box((0.6, 0.6, 0.6))
    hollow = merged(outer, Mesh(inner.vertices, inner.faces[:, ::-1]))
    deep = box_distance(grid_points(32), (0.6, 0.6, 0.6), np.zeros(3)) < 0
    assert not solid(hollow).ravel()[deep].any()
    assert solid(merged(outer, inner)).ravel()[deep].all(), "an inner part is solid"
    ring = ~deep & (box_distance(grid_points(32), (1, 1, 1), np.zeros(3)) < 0)
    assert solid(hollow).ravel()[ring].all()


def test_a_hidden_part_is_turned_by_its_volume() -> None:
    outer = as_mesh(trimesh.creation.box((1, 1, 1)).subdivide().subdivide())
    inner = box((0.6, 0.6, 0.6))
    # faces that contradict each other give the file's own orientation away
    spoilt = spoil(outer, "flip", np.random.default_rng(4))
    mesh = merged(spoilt, Mesh(inner.vertices, inner.faces[:, ::-1]))
    assert np.count_nonzero(solid(mesh)) == np.count_nonzero(solid(outer))


def sheet_layers(height: float) -> list[int]:
    prepared = prepare(sheet(height=height))
    cells = np.argwhere(voxelise(prepared, 32))
    return sorted(set(cells[:, 1].tolist()))


def test_a_lone_sheet_is_the_cells_it_passes() -> None:
    assert sheet_layers(float(cell_centres(32)[20])) == [20]
    assert sheet_layers(float(cell_centres(32)[20]) + 0.4 * CELL) == [20]
    # between two cells it is in both, so that a symmetric shape gives a symmetric solid
    assert sheet_layers(0.0) == [15, 16]
    assert np.count_nonzero(voxelise(prepare(sheet(height=0.3)), 32)) == 30 * 30


def test_a_plate_thinner_than_a_cell_is_kept_whole() -> None:
    plate = solid(box((1, 0.15 * CELL, 1), (0, 3, 0)))
    assert plate[1:31, 15:17, 1:31].all()
    assert np.count_nonzero(plate) == 2 * 30 * 30


def test_a_sheet_seat_on_solid_legs_is_kept() -> None:
    legs = [box((0.12, 0.6, 0.12), (x, -0.35, z)) for x in (-0.4, 0.4) for z in (-0.4, 0.4)]
    parts = voxelise_parts(prepare(normalise(merged(sheet(), *legs))[0]), 32)
    seat_row = parts.thin.any(axis=(0, 2)).nonzero()[0]
    assert len(seat_row) in (1, 2)
    assert parts.core[:, : seat_row[0]].any()
    assert parts.thin[10:22, seat_row[0], 10:22].all()
    assert not (parts.core & parts.thin).any()


def test_an_open_tube_is_filled_or_a_shell() -> None:
    x, y, z = np.meshgrid(*[cell_centres(32)] * 3, indexing="ij")
    inside = (np.hypot(x, y) < 0.4) & (np.abs(z) < 0.5)
    assert iou(solid(tube()), inside) > 0.97
    assert iou(solid(spoil(tube(), "double", np.random.default_rng(0))), inside) > 0.97
    shell = solid(tube(), open="shell")
    touched = surface_cells(normalise(tube())[0], 32)
    assert not (shell & ~touched).any()
    assert not shell[np.hypot(x, y) < 0.4 - 2 * CELL].any()
    # every cell of the wall is kept or has a neighbour that is
    assert np.count_nonzero(shell) > 0.4 * np.count_nonzero(touched)
    closed = box((1, 0.5, 0.5))
    np.testing.assert_array_equal(solid(closed, open="shell"), solid(closed))


def test_surface_cells_are_those_a_dense_sampling_hits() -> None:
    mesh = normalise(as_mesh(trimesh.creation.icosphere(1, 0.5)))[0]
    marked = surface_cells(mesh, 16)
    points, _ = trimesh.sample.sample_surface(as_trimesh(mesh), 400_000, seed=0)
    hit = np.zeros_like(marked)
    hit[tuple(np.floor((points + GRID_SIDE / 2) * 16 / GRID_SIDE).astype(int).T)] = True
    assert not (hit & ~marked).any()
    # corners that a face only grazes are what a sampling misses
    assert np.count_nonzero(marked & ~hit) < 0.03 * np.count_nonzero(marked)


coordinates = st.integers(-8, 8).map(lambda i: i / 16)


@settings(max_examples=60, deadline=None)
@given(
    hnp.arrays(
        np.float64, st.tuples(st.integers(1, 12), st.just(3), st.just(3)), elements=coordinates
    )
)
def test_no_soup_with_area_ends_empty(triangles: np.ndarray) -> None:
    a, b, c = np.moveaxis(triangles, 1, 0)
    mesh = Mesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))
    if not np.cross(b - a, c - a).any():
        with pytest.raises(InvalidMeshError):
            normalise(mesh)
        return
    openings: tuple[Open, ...] = ("fill", "shell")
    for open in openings:
        prepared: OrientedMesh = prepare(normalise(mesh)[0], open)
        parts = voxelise_parts(prepared, 16)
        assert parts.occupancy.any()
        # no surface is farther than a cell from the solid
        centres = prepared.mesh.triangles.mean(axis=1)
        index = np.floor((centres + GRID_SIDE / 2) * 16 / GRID_SIDE).astype(int)
        for i, j, k in index:
            near = parts.occupancy[
                max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2, max(k - 1, 0) : k + 2
            ]
            assert near.any()
