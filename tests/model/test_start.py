from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from pnabs.geometry.types import grid_points
from pnabs.model.start import start_points


def test_octants() -> None:
    points = start_points(np.ones((32, 32, 32)), 8, "octants").numpy()
    assert len(np.unique(np.sign(points), axis=0)) == 8
    assert (np.abs(points) == 0.25).all()


def test_octants_are_eight() -> None:
    with pytest.raises(ValueError, match="exactly 8"):
        start_points(np.ones((32, 32, 32)), 7, "octants")


def test_farthest_points_lie_apart_in_the_common_part(rng: np.random.Generator) -> None:
    mean = np.zeros((32, 32, 32))
    mean[4:28, 10:14, 4:28] = 0.5
    mean[0, 0, 0] = 0.01
    points = start_points(mean, 10).numpy().astype(np.float64)
    occupied = grid_points(32)[(mean >= 0.05).reshape(-1)]
    assert all(np.abs(occupied - p).max(axis=1).min() < 1e-6 for p in points)
    random = [
        pdist(occupied[rng.choice(len(occupied), 10, replace=False)]).min() for _ in range(50)
    ]
    assert pdist(points).min() > max(random)
    np.testing.assert_array_equal(points, start_points(mean, 10).numpy())
    np.testing.assert_allclose(points[:4], start_points(mean, 4).numpy())


def test_more_cuboids_than_cells() -> None:
    mean = np.zeros((32, 32, 32))
    mean[3, 4, 5] = 1
    assert start_points(mean, 3).shape == (3, 3)


def test_nothing_occupied() -> None:
    with pytest.raises(ValueError, match="no training shape"):
        start_points(np.zeros((32, 32, 32)), 3)
