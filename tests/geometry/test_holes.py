"""Patches, their rims, and the caps that close them."""

from __future__ import annotations

import igl
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.known_solids import spoil
from pnabs.geometry.holes import Caps, close_rims, doubled_areas, enclosed_faces
from pnabs.geometry.orient import prepare
from pnabs.geometry.patches import join
from pnabs.geometry.polygon import LONGEST_EXACT
from pnabs.geometry.solid import voxelise
from pnabs.geometry.types import Mesh, grid_points
from pnabs.geometry.weld import weld
from tests.geometry.soups import as_mesh, box, chair_parts, iou, merged, sheet, tube


def capped(mesh: Mesh) -> tuple[Caps, Mesh, float]:
    """Caps, the mesh with them, and its volume."""
    patches = join(weld(mesh).faces)
    caps = close_rims(weld(mesh).vertices, patches)
    whole = Mesh(caps.vertices, np.concatenate([patches.faces, caps.faces]))
    a, b, c = np.moveaxis(whole.triangles, 1, 0)
    return caps, whole, float((a * np.cross(b, c)).sum() / 6)


def kept(mesh: Mesh) -> list[bool]:
    """Which rims are closed in the end, by rim."""
    patches = join(weld(mesh).faces)
    caps, _, volume = capped(mesh)
    flip = np.full(patches.count, volume < 0)
    oriented = Mesh(weld(mesh).vertices, patches.faces)
    found = enclosed_faces(oriented, patches.patch, np.array([volume]), flip, caps)
    return [bool(found[caps.rim == rim].all()) for rim in np.unique(caps.rim)]


@pytest.mark.parametrize("seed", range(6))
def test_patches_agree_along_every_edge_of_two_faces(seed: int) -> None:
    rng = np.random.default_rng(seed)
    torn = weld(spoil(as_mesh(trimesh.creation.torus(0.35, 0.13)), "flip+tear+shuffle", rng))
    patches = join(torn.faces)
    reference, label = igl.bfs_orient(torn.faces)
    assert patches.count == label.max() + 1
    # a patch as a whole may be turned either way
    same = patches.faces == np.where(patches.given[:, None] < 0, torn.faces[:, ::-1], torn.faces)
    assert same.all()
    for part in range(patches.count):
        own = patches.patch == part
        turns = {
            bool((np.sort(a) == np.sort(b)).all() and parity(a) == parity(b))
            for a, b in zip(patches.faces[own], reference[own], strict=True)
        }
        assert len(turns) == 1
    mates = np.flatnonzero(patches.mate >= 0)
    assert (patches.mate[patches.mate[mates]] == mates).all()
    start, end = patches.faces.reshape(-1), patches.faces[:, [1, 2, 0]].reshape(-1)
    assert (start[mates] == end[patches.mate[mates]]).all()
    edges = np.sort(np.stack([start, end], axis=1), axis=1)
    _, place, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    np.testing.assert_array_equal(patches.free, count[place.reshape(-1)] == 1)


def parity(face: np.ndarray) -> bool:
    first = int(np.argmin(face))
    return bool(face[(first + 1) % 3] < face[(first + 2) % 3])


def test_a_twisted_band_ends_somewhere() -> None:
    around = np.arange(24) * (2 * np.pi / 24)
    half = np.stack([np.cos(around / 2) * np.cos(around), np.cos(around / 2) * np.sin(around)], 1)
    middle = np.stack([np.cos(around), np.sin(around), 0 * around], axis=1) * 0.4
    tilt = np.concatenate([half, np.sin(around / 2)[:, None]], axis=1) * 0.1
    vertices = np.concatenate([middle - tilt, middle + tilt])
    i, j = np.arange(24), (np.arange(24) + 1) % 24
    low, high = (np.where(np.arange(24) == 23, j + 24, j), np.where(np.arange(24) == 23, j, j + 24))
    faces = np.concatenate([np.stack([i, low, i + 24], 1), np.stack([low, high, i + 24], 1)])
    patches = join(faces)
    assert patches.count == 1
    assert np.count_nonzero(patches.mate < 0) == 2 * 24 + 2
    assert voxelise(prepare(Mesh(vertices, faces)), 32).any()


def test_a_wrong_join_of_two_parts_is_cut_where_the_file_contradicts_itself() -> None:
    # boxes that touch along an edge, where each has lost the face beside it
    one, other = box((0.4, 0.4, 0.4), (-0.2, -0.2, 0)), box((0.4, 0.4, 0.4), (0.2, 0.2, 0))
    touching = weld(merged(one, other))
    on_edge = np.abs(touching.vertices[:, :2]).max(axis=1) < 1e-9
    beside = on_edge[touching.faces].sum(axis=1) == 2
    upward = touching.triangles.mean(axis=1)[:, 1] > 0
    # of the four faces at the edge, the left box's right one and the right box's left one stay
    normals = np.cross(*np.moveaxis(np.diff(touching.triangles, axis=1), 1, 0))
    gone = beside & (np.abs(normals[:, 1]) > np.abs(normals[:, 0]))
    torn = Mesh(touching.vertices, touching.faces[~gone])
    assert np.count_nonzero(gone) == 2
    assert upward.any()
    assert join(torn.faces).count == 2
    whole = voxelise(prepare(merged(one, other)), 32)
    assert iou(voxelise(prepare(torn), 32), whole) > 0.9


@pytest.mark.parametrize("missing", [1, 2, 3])
def test_a_box_with_a_hole_is_a_box(missing: int) -> None:
    whole = box((1, 0.6, 0.4))
    torn = Mesh(whole.vertices, whole.faces[missing:])
    caps, closed, volume = capped(torn)
    assert len(caps.faces) == missing
    assert abs(volume) == pytest.approx(0.24)
    assert kept(torn) == [True]
    assert trimesh.Trimesh(closed.vertices, closed.faces, process=False).is_watertight
    np.testing.assert_array_equal(voxelise(prepare(torn), 32), voxelise(prepare(whole), 32))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.02, 0.15))
def test_a_torn_ball_keeps_its_volume(seed: int, share: float) -> None:
    ball = as_mesh(trimesh.creation.icosphere(3, 0.5))
    rng = np.random.default_rng(seed)
    torn = Mesh(ball.vertices, ball.faces[rng.random(len(ball.faces)) > share])
    turned = spoil(torn, "flip", rng)
    solid = voxelise(prepare(turned), 32)
    exact = np.linalg.norm(grid_points(32), axis=1).reshape(32, 32, 32) < 0.5
    assert iou(solid, exact) > 0.9


def test_a_long_rim_is_closed_about_its_centre() -> None:
    bowl = trimesh.creation.cylinder(0.4, 1.0, sections=3 * LONGEST_EXACT)
    up = bowl.face_normals[:, 2] > 0.5
    open_top = Mesh(np.array(bowl.vertices), np.array(bowl.faces[~up], dtype=np.int64))
    caps, _, volume = capped(open_top)
    assert len(caps.faces) == 3 * LONGEST_EXACT
    assert len(caps.vertices) == len(weld(open_top).vertices) + 1
    assert abs(volume) == pytest.approx(np.pi * 0.16, rel=1e-3)


def test_what_encloses_nothing_stays_open() -> None:
    assert kept(sheet()) == [False]
    # a seat folded into a back
    fold = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1], [1, 0, 1], [0, 1, 0], [1, 1, 0]]) - 0.5
    faces = np.array([[0, 2, 1], [1, 2, 3], [0, 1, 4], [1, 5, 4]])
    assert kept(Mesh(fold, faces)) == [False]
    # a frame: a sheet with a window
    outer = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    ring = np.concatenate([outer, outer / 2])
    around = np.arange(4)
    following = (around + 1) % 4
    frame = np.concatenate(
        [
            np.stack([around, following, around + 4], axis=1),
            np.stack([following, following + 4, around + 4], axis=1),
        ]
    )
    mesh = Mesh(np.column_stack([ring, np.zeros(8)]), frame)
    assert kept(mesh) == [False, False]
    assert not voxelise(prepare(mesh), 32)[12:20, 12:20].any()


def test_the_ends_of_a_tube_are_closed_unless_open_shapes_stay_open() -> None:
    assert kept(tube()) == [True, True]
    area = doubled_areas(prepare(tube()).mesh.triangles).sum() / 2
    assert area == pytest.approx(2 * np.pi * 0.4 * (1 + 0.4), rel=0.01)
    alone = doubled_areas(prepare(tube(), "shell").mesh.triangles).sum() / 2
    assert alone == pytest.approx(2 * np.pi * 0.4, rel=0.01)


def test_a_basket_of_two_walls_isn_t_closed_over_its_hollow() -> None:
    walls = []
    for radius, low in ((0.4, -0.4), (0.36, -0.36)):
        shape = trimesh.creation.cylinder(radius, 0.4 - low, sections=32)
        shape.apply_translation((0, 0, (0.4 + low) / 2))
        open_top = shape.face_normals[:, 2] < 0.5
        mesh = Mesh(np.array(shape.vertices), np.array(shape.faces[open_top], dtype=np.int64))
        walls.append(mesh)
    outer, inner = walls
    basket = merged(outer, Mesh(inner.vertices, inner.faces[:, ::-1]))
    solid = voxelise(prepare(basket), 32)
    x, y, z = grid_points(32).T
    hollow = ((np.hypot(x, y) < 0.3) & (np.abs(z) < 0.3)).reshape(32, 32, 32)
    assert not solid[hollow].any()
    lid = ((np.hypot(x, y) < 0.3) & (z > 0.35)).reshape(32, 32, 32)
    assert not solid[lid].any()


def test_touching_parts_have_no_holes_where_they_meet() -> None:
    patches = join(weld(merged(*chair_parts())).faces)
    shelf = merged(box((1, 0.1, 0.4)), box((0.1, 0.5, 0.4), (-0.45, 0.3, 0)))
    assert not patches.free.any()
    assert not join(weld(shelf).faces).free.any()
    assert len(prepare(shelf).mesh.faces) == 24
