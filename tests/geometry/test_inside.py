"""Inside tests of closed meshes."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from pnabs.geometry import cuboid
from pnabs.geometry.inside import inside_grid, winding_number
from pnabs.geometry.types import cell_centres, grid_points
from tests.geometry.boxes import axis_aligned, random_cuboids


def test_winding_number_of_a_sphere_and_its_inverse() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=2)
    triangles = np.asarray(sphere.triangles)
    points = np.array([[0, 0, 0], [0.5, 0.2, -0.3], [2, 0, 0], [0, -1.1, 0]])
    np.testing.assert_allclose(winding_number(triangles, points), [1, 1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(
        winding_number(triangles[:, ::-1], points), [-1, -1, 0, 0], atol=1e-12
    )


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_grid_holds_the_centres_inside_a_box(seed: int) -> None:
    one = random_cuboids(seed, 1, high=0.9)
    depth = cuboid.union_sdf(grid_points(20), one)
    found = inside_grid(cuboid.to_mesh(one).triangles, 20).ravel()
    clear = np.abs(depth) > 1e-7
    np.testing.assert_array_equal(found[clear], depth[clear] < 0)


def test_grid_agrees_with_the_winding_number_on_a_concave_mesh() -> None:
    torus = trimesh.creation.torus(0.3, 0.12, major_sections=16, minor_sections=8)
    torus.apply_transform(trimesh.transformations.rotation_matrix(0.7, [1, 2, 3]))
    triangles = np.asarray(torus.triangles)
    expected = winding_number(triangles, grid_points(12)) > 0.5
    np.testing.assert_array_equal(inside_grid(triangles, 12).ravel(), expected)


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
def test_rays_through_edges_and_vertices_count_once(order: tuple[int, int, int]) -> None:
    # An octahedron whose corners and edges run through columns of cell centres.
    axis = cell_centres(16)
    middle, radius = axis[8], axis[12] - axis[8]
    corners = middle + radius * np.array(
        [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]
    )
    faces = [
        (x, y, z) if (x + y + z) % 2 == 0 else (y, x, z)
        for x in (0, 1)
        for y in (2, 3)
        for z in (4, 5)
    ]
    triangles = corners[np.array(faces)][:, :, order]
    distance = np.abs(grid_points(16) - middle).sum(axis=1)
    found = inside_grid(triangles, 16).ravel()
    clear = np.abs(distance - radius) > 1e-9
    np.testing.assert_array_equal(found[clear], distance[clear] < radius)


def test_sealed_voids_are_outside() -> None:
    outer = cuboid.to_mesh(axis_aligned(([0.8] * 3, [0, 0, 0]))).triangles
    inner = cuboid.to_mesh(axis_aligned(([0.3] * 3, [0, 0, 0]))).triangles[:, ::-1]
    found = inside_grid(np.concatenate([outer, inner]), 32)
    expected = cuboid.voxelise(axis_aligned(([0.8] * 3, [0, 0, 0])), 32, raise_thin=False)
    void = cuboid.voxelise(axis_aligned(([0.3] * 3, [0, 0, 0])), 32, raise_thin=False)
    np.testing.assert_array_equal(found, expected & ~void)


def test_nothing_has_no_inside() -> None:
    assert not inside_grid(np.zeros((0, 3, 3)), 8).any()
