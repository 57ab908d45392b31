"""The largest box that points at most touch, against brute force."""

from __future__ import annotations

import itertools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pnabs.geometry.tangent import largest_half_sides


def is_free(points: np.ndarray, half: np.ndarray, touch: float) -> bool:
    return not np.any(np.all(points + touch < half - 1e-12, axis=1))


def best_volume(points: np.ndarray, low: np.ndarray, high: np.ndarray, touch: float) -> float:
    """Every maximal box has each half-side at a point's coordinate or at its bound."""
    choices = [
        np.concatenate([np.clip(points[:, k] + touch, low[k], high[k]), [high[k]]])
        for k in range(3)
    ]
    boxes = (np.array(half) for half in itertools.product(*choices))
    return max(float(half.prod()) for half in boxes if is_free(points, half, touch))


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 7))
def test_box_is_free_within_bounds_and_nearly_the_largest(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    low, touch = rng.uniform(0.05, 0.3, 3), 1e-4
    high = low + 0.034
    points = rng.uniform(low, high * 1.05, (count, 3))
    points[np.arange(count), rng.integers(3, size=count)] *= rng.uniform(1, 1.2, count)
    inner = np.all(points + touch < low, axis=1)
    points = np.where(inner[:, None], high, points)
    half = largest_half_sides(points, low, high, touch)
    assert np.all(half >= low)
    assert np.all(half <= high)
    assert is_free(points, half, touch)
    best = best_volume(points, low, high, touch)
    assert half.prod() - low.prod() >= 0.8 * (best - low.prod()) - 1e-12


def test_each_side_reaches_its_own_obstacle() -> None:
    low, high = np.full(3, 0.1), np.full(3, 0.13)
    points = np.array([[0.11, 0.0, 0.0], [0.0, 0.12, 0.0]])
    half = largest_half_sides(points, low, high, 0.0)
    np.testing.assert_allclose(half, [0.11, 0.12, 0.13], atol=1e-15)


def test_without_obstacles_it_is_the_upper_bound() -> None:
    low, high = np.array([0.1, 0.2, 0.0]), np.array([0.2, 0.3, 0.1])
    np.testing.assert_array_equal(largest_half_sides(np.zeros((0, 3)), low, high, 0.0), high)
    np.testing.assert_array_equal(largest_half_sides(np.ones((5, 3)), low, high, 0.0), high)
