"""Distance fields against analytic ones and an exact library."""

from __future__ import annotations

import igl
import numpy as np
import pytest
import trimesh
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pnabs.geometry.distance import signed_distance, unsigned_distance
from pnabs.geometry.fields import interpolate_sdf
from pnabs.geometry.orient import Open, prepare
from pnabs.geometry.solid import voxelise, voxelise_parts
from pnabs.geometry.types import GRID_SIDE, THETA_D, Mesh, cell_centres, grid_points
from tests.geometry.soups import CELL, as_mesh, box, box_distance, chair_parts, merged, sheet, tube

SIDES = (0.9, 0.5, 0.3)
CENTRE = np.array([0.03, -0.1, 0.17])


@pytest.mark.parametrize("resolution", [32, 64])
def test_the_field_of_an_off_centre_box_is_exact(resolution: int) -> None:
    field = signed_distance(prepare(box(SIDES, tuple(CENTRE))), resolution)
    expected = box_distance(grid_points(resolution), SIDES, CENTRE)
    band = np.abs(expected) <= THETA_D + GRID_SIDE / resolution
    assert field.dtype == np.float32
    np.testing.assert_allclose(field.ravel()[band], expected[band], atol=1e-6)
    np.testing.assert_allclose(field.ravel(), expected, atol=0.05 * CELL)


@settings(max_examples=25, deadline=None)
@given(
    sides=st.tuples(*[st.floats(0.15, 0.5)] * 3),
    centre=st.tuples(*[st.floats(-0.1, 0.1)] * 3),
    turn=st.integers(0, 1000),
)
def test_the_field_of_a_turned_box_is_exact(
    sides: tuple[float, float, float], centre: tuple[float, float, float], turn: int
) -> None:
    matrix = Rotation.random(rng=np.random.default_rng(turn)).as_matrix()
    upright = box(sides)
    mesh = Mesh(upright.vertices @ matrix.T + centre, upright.faces)
    prepared = prepare(mesh)
    parts = voxelise_parts(prepared, 32)
    # a corner that sticks out more than a cell beyond the last centre inside is a thin part
    assume(not parts.thin.any())
    field = signed_distance(prepared, 32, voxels=parts).ravel()
    expected = box_distance((grid_points(32) - centre) @ matrix, sides, np.zeros(3))
    # a ray misses at most what lies within the columns' offset of the surface
    clear = (np.abs(expected) <= THETA_D + CELL) & (np.abs(expected) > 1e-6)
    np.testing.assert_allclose(field[clear], expected[clear], atol=1e-6)


def test_a_sphere() -> None:
    mesh = as_mesh(trimesh.creation.icosphere(4, 0.45))
    expected = np.linalg.norm(grid_points(32), axis=1) - 0.45
    # a facet of this sphere lies up to 0.0012 inside of it
    np.testing.assert_allclose(signed_distance(prepare(mesh), 32).ravel(), expected, atol=0.003)


@pytest.mark.parametrize("resolution", [32, 64])
def test_unsigned_distance_is_exact_in_the_band_and_close_beyond(resolution: int) -> None:
    prepared = prepare(merged(*chair_parts()))
    found = unsigned_distance(prepared, resolution).ravel()
    squared, _, _ = igl.point_mesh_squared_distance(
        grid_points(resolution), prepared.mesh.vertices, prepared.mesh.faces
    )
    exact = np.sqrt(squared)
    band = exact <= THETA_D + GRID_SIDE / resolution
    np.testing.assert_allclose(found[band], exact[band], atol=1e-6)
    assert (found >= exact - 1e-6).all()
    assert (found - exact).max() < 0.3 * CELL
    assert (found - exact).mean() < 0.001 * CELL


def test_a_sheet_has_an_inside_half_a_cell_deep() -> None:
    layer = 20
    field = signed_distance(prepare(sheet(height=float(cell_centres(32)[layer]))), 32)
    steps = np.arange(32) - layer
    np.testing.assert_allclose(field[16, :, 16], (np.abs(steps) - 0.5) * CELL, atol=1e-6)
    # between two layers the field is zero from one to the other
    between = signed_distance(prepare(sheet()), 32)
    assert (between[16, 15:17, 16] < 0).all()
    np.testing.assert_allclose(between[16, 17, 16], CELL, atol=1e-6)


def test_thick_parts_are_not_thickened() -> None:
    thick = box((0.4, 0.4, 0.4), (0.25, 0, 0))
    both = merged(thick, Mesh(sheet(0.3).vertices - [0.3, 0, 0], sheet().faces))
    alone, together = (signed_distance(prepare(mesh), 32) for mesh in (thick, both))
    right = cell_centres(32) > 0.1
    np.testing.assert_allclose(together[right], alone[right], atol=1e-6)
    assert (together < 0).sum() > (alone < 0).sum()


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 30))
def test_negative_exactly_where_occupied(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    # corners on a lattice that has cell centres and cell borders among its planes
    corners = rng.integers(-14, 15, (3 * count, 3)) * (CELL / 2)
    mesh = Mesh(corners, np.arange(3 * count).reshape(-1, 3))
    openings: tuple[Open, ...] = ("fill", "shell")
    for open in openings:
        prepared = prepare(mesh, open)
        field = signed_distance(prepared, 32)
        assert np.isfinite(field).all()
        np.testing.assert_array_equal(field < 0, voxelise(prepared, 32))


def test_an_open_tube_as_a_shell_is_hollow() -> None:
    axis = (slice(16, 17), slice(16, 17), slice(11, 21))
    assert (signed_distance(prepare(tube()), 32)[axis] < -0.3).all()
    assert (signed_distance(prepare(tube(), "shell"), 32)[axis] > 0.3).all()


def test_interpolation_agrees_with_the_analytic_field() -> None:
    field = signed_distance(prepare(box(SIDES, tuple(CENTRE))), 32)
    np.testing.assert_allclose(
        interpolate_sdf(field, grid_points(32)), field.ravel(), atol=1e-6, err_msg="at the centres"
    )
    points = np.random.default_rng(0).uniform(-0.8, 0.8, (5000, 3))
    expected = box_distance(points, SIDES, CENTRE)
    hull = GRID_SIDE / 2 - CELL / 2
    within = (np.abs(points) <= hull).all(axis=1)
    found = interpolate_sdf(field, points)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found[within], expected[within], atol=0.5 * CELL)
    # beyond the hull: its nearest point's value plus the way there, an upper bound
    clamped = points.clip(-hull, hull)
    way = np.linalg.norm(points - clamped, axis=1)
    np.testing.assert_allclose(found, interpolate_sdf(field, clamped) + way, atol=1e-6)
    assert (found >= expected - 0.5 * CELL)[~within].all()


def test_interpolation_is_exact_for_linear_fields() -> None:
    slope, level = np.array([1.0, -2.0, 0.5]), 0.3
    field = (grid_points(8) @ slope + level).reshape(8, 8, 8).astype(np.float32)
    hull = GRID_SIDE / 2 - GRID_SIDE / 16
    points = np.random.default_rng(1).uniform(-hull, hull, (500, 3))
    np.testing.assert_allclose(interpolate_sdf(field, points), points @ slope + level, atol=1e-6)
