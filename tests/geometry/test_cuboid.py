"""Cuboids against trimesh boxes, brute force and Monte Carlo."""

from __future__ import annotations

import igl
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from pnabs.geometry import cuboid
from pnabs.geometry.types import GRID_SIDE, Cuboids, cell_centres, grid_points
from tests.geometry.boxes import axis_aligned, random_cuboids

SEEDS = st.integers(0, 2**32 - 1)


def oracle(cuboids: Cuboids, index: int) -> trimesh.Trimesh:
    """The same box made by trimesh."""
    vector = cuboids.as_vector()[index].astype(np.float64)
    placed = trimesh.transformations.quaternion_matrix(vector[3:7])
    placed[:3, 3] = vector[7:]
    return trimesh.creation.box(extents=vector[:3], transform=placed)


def test_corners_and_volumes_are_those_of_trimesh() -> None:
    cuboids = random_cuboids(0, 6)
    for i in range(len(cuboids)):
        box = oracle(cuboids, i)
        found = cuboid.corners(cuboids)[i]
        gaps = np.linalg.norm(found[:, None] - box.vertices[None], axis=-1)
        assert gaps.min(axis=1).max() < 1e-7
        assert sorted(gaps.argmin(axis=1)) == list(range(8))
        assert cuboid.volumes(cuboids)[i] == pytest.approx(box.volume, rel=1e-6)


def test_signed_distances_are_those_to_a_mesh() -> None:
    cuboids = random_cuboids(1, 5)
    points = np.random.default_rng(2).uniform(-0.6, 0.6, (300, 3))
    depth = cuboid.depth(points, cuboids)
    for i in range(len(cuboids)):
        box = oracle(cuboids, i)
        squared = igl.point_mesh_squared_distance(points, box.vertices, box.faces)[0]
        inside = Delaunay(box.vertices).find_simplex(points) >= 0
        expected = np.where(inside, -1, 1) * np.sqrt(squared)
        np.testing.assert_allclose(depth[i], expected, atol=1e-6)
    np.testing.assert_allclose(cuboid.distance(points, cuboids), np.maximum(depth, 0), atol=1e-15)
    np.testing.assert_array_equal(cuboid.contains(points, cuboids), depth <= 0)


@settings(deadline=None)
@given(SEEDS)
def test_local_coordinates_lead_back(seed: int) -> None:
    cuboids = random_cuboids(seed, 3)
    points = np.random.default_rng(seed).normal(size=(5, 3))
    unit = cuboid.local(points, cuboids) / cuboids.scale[:, None].astype(np.float64)
    np.testing.assert_allclose(
        cuboid.to_world(unit, cuboids), np.broadcast_to(points, (3, 5, 3)), atol=1e-9
    )


@settings(deadline=None)
@given(SEEDS)
def test_union_field_is_the_least_depth(seed: int) -> None:
    cuboids = random_cuboids(seed, 4)
    points = np.random.default_rng(seed).uniform(-0.6, 0.6, (40, 3))
    np.testing.assert_allclose(
        cuboid.union_sdf(points, cuboids), cuboid.depth(points, cuboids).min(axis=0), atol=1e-14
    )


def test_union_field_bounds_the_distance_within() -> None:
    two = axis_aligned(([0.4, 0.4, 0.4], [-0.1, 0, 0]), ([0.4, 0.4, 0.4], [0.1, 0, 0]))
    # In the middle the union reaches 0.2 in y, each box alone 0.1 in x.
    assert cuboid.union_sdf(np.zeros((1, 3)), two)[0] == pytest.approx(-0.1, abs=1e-7)
    assert np.isinf(cuboid.union_sdf(np.zeros((1, 3)), Cuboids.empty())).all()


@settings(deadline=None)
@given(SEEDS, st.integers(0, 2))
def test_mirror_reflects_and_is_its_own_inverse(seed: int, axis: int) -> None:
    cuboids = random_cuboids(seed, 3)
    reflected = cuboid.mirror(cuboids, axis)
    points = np.random.default_rng(seed).uniform(-0.6, 0.6, (30, 3))
    there = points.copy()
    there[:, axis] *= -1
    np.testing.assert_allclose(
        cuboid.depth(there, reflected), cuboid.depth(points, cuboids), atol=1e-7
    )
    np.testing.assert_array_equal(cuboid.mirror(reflected, axis).as_vector(), cuboids.as_vector())


def test_volume_samples_are_uniform() -> None:
    cuboids = random_cuboids(3, 4)
    points = cuboid.sample_volume(cuboids, 4000, np.random.default_rng(0))
    for i in range(len(cuboids)):
        unit = cuboid.local(points[i], cuboids[i : i + 1])[0] / cuboids.scale[i]
        assert np.abs(unit).max() <= 0.5 + 1e-5
        counts, _ = np.histogramdd(unit, bins=(4, 4, 4), range=[(-0.5, 0.5)] * 3)
        assert counts.min() > 62.5 - 6 * np.sqrt(62.5)
        assert counts.max() < 62.5 + 6 * np.sqrt(62.5)


def test_surface_samples_spread_by_area_with_outward_normals() -> None:
    one = random_cuboids(4, 1)
    samples = cuboid.sample_surface(one, 20_000, np.random.default_rng(0))[0].astype(np.float64)
    points, normals = samples[:, :3], samples[:, 3:]
    assert np.abs(cuboid.depth(points, one)).max() < 1e-6
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)
    np.testing.assert_allclose(cuboid.depth(points + 0.01 * normals, one)[0], 0.01, atol=1e-6)
    side = one.scale[0].astype(np.float64)
    areas = side.prod() / side
    faces = np.abs(normals @ cuboid.rotation_matrices(one)[0]).argmax(axis=1)
    share = np.bincount(faces, minlength=3) / len(faces)
    np.testing.assert_allclose(share, areas / areas.sum(), atol=0.02)


def test_surface_samples_of_a_point_are_the_point() -> None:
    point = axis_aligned(([0, 0, 0], [0.1, 0.2, 0.3]))
    samples = cuboid.sample_surface(point, 10, np.random.default_rng(0))[0]
    np.testing.assert_allclose(samples[:, :3], np.tile([[0.1, 0.2, 0.3]], (10, 1)), atol=1e-7)
    np.testing.assert_allclose(np.linalg.norm(samples[:, 3:], axis=1), 1, atol=1e-6)


def test_boxes_are_closed_and_face_outward() -> None:
    cuboids = random_cuboids(5, 3)
    mesh = cuboid.to_mesh(cuboids)
    found = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert found.is_watertight
    assert found.is_winding_consistent
    assert found.volume == pytest.approx(cuboid.volumes(cuboids).sum(), rel=1e-9)


@settings(deadline=None)
@given(SEEDS, st.sampled_from([8, 16, 21]), st.booleans())
def test_voxels_are_the_cell_centres_in_a_cuboid(
    seed: int, resolution: int, raise_thin: bool
) -> None:
    cuboids = random_cuboids(seed, 5, low=0.0, high=0.7, spread=0.6)
    raised = cuboids
    if raise_thin:
        scale = np.maximum(cuboids.scale.astype(np.float64), GRID_SIDE / resolution)
        raised = Cuboids(scale, cuboids.rotation, cuboids.translation)  # type: ignore[arg-type]
    depth = cuboid.union_sdf(grid_points(resolution), raised)
    found = cuboid.voxelise(cuboids, resolution, raise_thin=raise_thin).ravel()
    clear = np.abs(depth) > 1e-9
    np.testing.assert_array_equal(found[clear], depth[clear] < 0)


def test_a_thin_plate_is_voxelised_where_it_is_raised() -> None:
    centres = cell_centres(32)
    plate = axis_aligned(([0.5, 1e-3, 0.5], [0, float(centres[20]) + 0.01, 0]))
    assert not cuboid.voxelise(plate, 32, raise_thin=False).any()
    raised = cuboid.voxelise(plate, 32, raise_thin=True)
    np.testing.assert_array_equal(np.flatnonzero(raised.any(axis=(0, 2))), [20])


def test_no_cuboids() -> None:
    none = Cuboids.empty()
    assert cuboid.contains(np.zeros((4, 3)), none).shape == (0, 4)
    assert not cuboid.voxelise(none, 8, raise_thin=True).any()
    assert len(cuboid.to_mesh(none).faces) == 0
