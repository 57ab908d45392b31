"""Metrics against brute force and known distances."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as law
from hypothesis import strategies as st
from scipy.spatial import Delaunay
from scipy.spatial.distance import cdist

from pnabs.geometry import cuboid, metrics
from pnabs.geometry.types import Cuboids, cell_centres, grid_points
from tests.geometry.boxes import axis_aligned, random_cuboids, surface_of


def test_iou_counts_cells() -> None:
    a, b = np.zeros((2, 4, 4, 4), dtype=np.bool_)
    a[:2], b[1:3] = True, True
    assert metrics.iou(a, b) == pytest.approx(1 / 3)
    assert metrics.iou(a, a) == 1
    assert metrics.iou(np.zeros_like(a), np.zeros_like(a)) == 0


@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.integers(1, 40))
def test_chamfer_is_as_defined(seed: int, n: int, m: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(n, 3)), rng.normal(size=(m, 3))
    gaps = cdist(a, b)
    there, back = gaps.min(axis=1), gaps.min(axis=0)
    l1, l2 = metrics.chamfer(a, b)
    assert l1 == pytest.approx(1000 * (there.mean() + back.mean()) / 2, rel=1e-12)
    assert l2 == pytest.approx(1000 * ((there**2).mean() + (back**2).mean()), rel=1e-12)


def test_prediction_raises_positives_but_not_negatives() -> None:
    between = float(cell_centres(32)[16] + cell_centres(32)[17]) / 2
    plate = axis_aligned(([0.9, 0.004, 0.9], [0, between, 0]))
    block = axis_aligned(([0.9, 0.9, 0.9], [0, 0, 0]))
    none = Cuboids.empty()
    assert metrics.predicted_occupancy(plate, none, 32, 2e-3).any()
    assert not metrics.predicted_occupancy(plate, none, 32, 5e-3).any()
    np.testing.assert_array_equal(
        metrics.predicted_occupancy(block, plate, 32, 2e-3),
        metrics.predicted_occupancy(block, none, 32, 2e-3),
    )


@law(deadline=None, max_examples=8)
@given(st.integers(0, 2**32 - 1))
def test_distance_to_a_sampled_surface(seed: int) -> None:
    shape = random_cuboids(seed, 2, low=0.2, high=0.6)
    surface = surface_of(shape, 8000, seed)
    original = metrics.OriginalSurface(surface)
    rng = np.random.default_rng(seed)
    points = surface_of(shape, 500, seed + 1)[:, :3].astype(np.float64)
    points += rng.normal(0, 0.02, points.shape)
    dense = surface_of(shape, 50_000, seed + 2)
    expected, _ = metrics._nearest(metrics._tree(dense[:, :3].astype(np.float64)), points)
    nearest, index = metrics._nearest(original.tree, points)
    found = original.to_surface(points, nearest, index)
    assert np.all(found <= nearest + 1e-12)
    assert 1000 * found.mean() == pytest.approx(1000 * expected.mean(), abs=1.0)


@law(deadline=None, max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_hull_holds_the_centres_in_the_hull_of_whole_cells(seed: int) -> None:
    occupancy = cuboid.voxelise(random_cuboids(seed, 2), 12, raise_thin=True)
    half = (cell_centres(12)[1] - cell_centres(12)[0]) / 2
    centres = grid_points(12)
    corners = centres[occupancy.ravel()][:, None] + half * np.array(
        [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    )
    inside = Delaunay(corners.reshape(-1, 3)).find_simplex(centres, tol=1e-9) >= 0
    np.testing.assert_array_equal(metrics.hull_occupancy(occupancy).ravel(), inside)


def test_hull_of_one_cell_is_that_cell() -> None:
    occupancy = np.zeros((8, 8, 8), dtype=np.bool_)
    occupancy[3, 4, 5] = True
    np.testing.assert_array_equal(metrics.hull_occupancy(occupancy), occupancy)
    assert not metrics.hull_occupancy(np.zeros_like(occupancy)).any()


def test_open_space_of_a_u() -> None:
    shape = np.zeros((8, 8, 8), dtype=np.bool_)
    shape[1:7, 1, 1:7] = shape[1, 1:7, 1:7] = shape[6, 1:7, 1:7] = True
    gap = np.zeros_like(shape)
    gap[2:6, 2:7, 1:7] = True
    assert metrics.open_space(shape, shape) == 1
    assert metrics.open_space(shape, shape | gap) == 0
    half = shape.copy()
    half[2:4, 2:7, 1:7] = True
    assert metrics.open_space(shape, half) == 0.5
    block = gap  # convex: there is nothing to leave open
    assert metrics.open_space(block, np.ones_like(block)) == 1
