"""Points on and in solids."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy import stats

from benchmarks.known_solids import spoil
from pnabs.geometry.orient import prepare
from pnabs.geometry.sampling import draw_on_triangles, sample_interior, sample_surface
from pnabs.geometry.types import GRID_SIDE, Mesh, cell_centres
from tests.geometry.soups import CELL, as_mesh, box, box_distance, chair_parts, merged, sheet


def generator(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_strata_share_the_area() -> None:
    triangles = np.array(
        [
            [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
            [[5, 0, 0], [5, 0, 0], [5, 1, 0]],
            [[0, 0, 1], [3, 0, 1], [0, 1, 1]],
            [[7, 0, 0], [7, 0, 0], [7, 0, 0]],
        ],
        dtype=np.float64,
    )
    points, face = draw_on_triangles(triangles, 4000, generator())
    assert np.bincount(face, minlength=4).tolist() == [1000, 0, 3000, 0]
    assert (np.diff(face) >= 0).all()
    np.testing.assert_allclose(points[face == 2].mean(axis=0), [1, 1 / 3, 1], atol=0.03)
    assert (points[face == 0].sum(axis=1) <= 1).all()


def test_points_are_uniform_on_the_surface_and_normals_point_out() -> None:
    sides = (1.0, 0.5, 0.25)
    samples = sample_surface(prepare(box(sides)), 5000, generator())
    assert samples.shape == (5000, 6)
    assert samples.dtype == np.float32
    points, normals = samples[:, :3].astype(np.float64), samples[:, 3:].astype(np.float64)
    np.testing.assert_allclose(box_distance(points, sides, np.zeros(3)), 0, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)
    assert (box_distance(points + 1e-3 * normals, sides, np.zeros(3)) > 0).all()
    area = np.array([0.5 * 0.25, 1 * 0.25, 1 * 0.5])
    share = (np.abs(normals) > 0.5).mean(axis=0)
    np.testing.assert_allclose(share, area / area.sum(), atol=0.001)
    top = points[normals[:, 2] > 0.5]
    assert stats.kstest(top[:, 0] + 0.5, "uniform").pvalue > 1e-3
    assert stats.kstest(points[:, 0][normals[:, 2] > 0.5][:100] + 0.5, "uniform").pvalue > 1e-3


@pytest.mark.parametrize("ways", ["flip", "invert", "double", "unweld+flip"])
def test_normals_point_out_of_spoilt_shapes(ways: str) -> None:
    shape = as_mesh(trimesh.creation.torus(0.35, 0.13))
    samples = sample_surface(prepare(spoil(shape, ways, generator(3))), 2000, generator())
    points, normals = samples[:, :3], samples[:, 3:]
    ring = points * [1, 1, 0]
    ring *= 0.35 / np.linalg.norm(ring, axis=1, keepdims=True)
    assert (((points - ring) * normals).sum(axis=1) > 0).all()


def test_walls_inside_the_solid_get_no_points() -> None:
    a, b = box((0.6, 0.5, 0.5), (-0.2, 0, 0)), box((0.6, 0.3, 0.3), (0.2, 0, 0))
    samples = sample_surface(prepare(merged(a, b)), 4000, generator()).astype(np.float64)
    inner = np.minimum(
        box_distance(samples[:, :3], (0.6, 0.5, 0.5), np.array([-0.2, 0, 0])),
        box_distance(samples[:, :3], (0.6, 0.3, 0.3), np.array([0.2, 0, 0])),
    )
    assert inner.min() > -CELL / 2
    assert (inner < -1e-6).mean() < 0.02, "only within the look-up's cell of the outer surface"
    # the wall of the small box between x = -0.1 and 0.1 is buried, its end is not
    assert (samples[:, 0] > 0.49).any()


def test_a_sheet_has_normals_to_both_sides() -> None:
    normals = sample_surface(prepare(sheet()), 4000, generator())[:, 4]
    assert set(normals.tolist()) == {-1.0, 1.0}
    assert abs(normals.mean()) < 0.06


def test_a_closed_plate_thinner_than_a_cell_keeps_its_own_normals() -> None:
    thickness = 0.1 * CELL
    samples = sample_surface(prepare(box((1, thickness, 1))), 2000, generator())
    faces_up = samples[np.abs(samples[:, 4]) > 0.5]
    assert (np.sign(faces_up[:, 1]) == np.sign(faces_up[:, 4])).all()


def test_a_solid_with_hardly_any_open_surface_still_gives_all_points() -> None:
    prepared = prepare(box((0.5, 0.5, 0.5)))
    everywhere = np.ones((64, 64, 64), dtype=bool)
    assert sample_surface(prepared, 100, generator(), everywhere).shape == (100, 6)


def test_the_generator_decides() -> None:
    prepared = prepare(merged(*chair_parts()))
    first, again, other = (sample_surface(prepared, 500, generator(s)) for s in (1, 1, 2))
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != other.tobytes()
    occupancy = np.zeros((8, 8, 8), dtype=bool)
    occupancy[2:5, 3, 1:7] = True
    first, again, other = (sample_interior(occupancy, 50, generator(s)) for s in (1, 1, 2))
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != other.tobytes()


def test_interior_points_fill_the_occupied_cells_evenly() -> None:
    occupancy = np.zeros((16, 16, 16), dtype=bool)
    occupancy[2:6, 9, 4:6] = True
    occupancy[15, 0, 15] = True
    points = sample_interior(occupancy, 900, generator())
    assert points.dtype == np.float32
    cell = GRID_SIDE / 16
    index = np.floor((points.astype(np.float64) + GRID_SIDE / 2) / cell).astype(int)
    assert occupancy[tuple(index.T)].all()
    counts = np.unique(index, axis=0, return_counts=True)[1]
    assert counts.tolist() == [100] * 9
    within = (points - cell_centres(16)[index]) / cell + 0.5
    assert all(stats.kstest(within[:, axis], "uniform").pvalue > 1e-3 for axis in range(3))


def test_an_empty_grid_has_no_interior() -> None:
    with pytest.raises(ValueError, match="no cell"):
        sample_interior(np.zeros((4, 4, 4), dtype=bool), 1, generator())


def test_one_triangle_is_enough() -> None:
    corners = np.array([[-0.5, 0, 0], [0.5, 0, 0], [0, 0.2, 0.1]])
    samples = sample_surface(prepare(Mesh(corners, np.array([[0, 1, 2]]))), 64, generator())
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    np.testing.assert_allclose((samples[:, :3] - corners[0]) @ normal, 0, atol=1e-7)
