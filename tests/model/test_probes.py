from __future__ import annotations

import numpy as np
import torch
from scipy.ndimage import uniform_filter

from pnabs.geometry.types import grid_points
from pnabs.model.probes import BLUR, MARGIN, PROBES, STATIONS, probe, pyramid
from tests.model.shapes import matrix, random_cuboids


def test_stations_lie_in_and_around_the_cuboid(rng: np.random.Generator) -> None:
    """A volume that holds its own coordinate gives back where it was probed."""
    cuboids = random_cuboids(rng, 2, 3) * torch.tensor([0.5] * 3 + [1.0] * 4 + [0.5] * 3)
    side = len(STATIONS)
    for axis in range(3):
        ramp = torch.from_numpy(grid_points(32)[:, axis]).view(1, 1, 32, 32, 32)
        found = probe(ramp.expand(2, 2, -1, -1, -1), cuboids).view(2, 3, 2, side, side, side)
        for b, n in np.ndindex(2, 3):
            c = cuboids[b, n].numpy()
            for i, j, k in np.ndindex(side, side, side):
                share, beyond = np.array([STATIONS[i], STATIONS[j], STATIONS[k]]).T
                point = matrix(c) @ (share * c[:3] + beyond * MARGIN) + c[7:]
                np.testing.assert_allclose(found[b, n, :, i, j, k], point[axis], atol=1e-9)
    assert found[0, 0].numel() == PROBES


def test_nothing_lies_outside_the_grid() -> None:
    cuboid = torch.tensor([[[0.1, 0.1, 0.1, 1, 0, 0, 0, 0.9, 0, 0]]])
    assert (probe(torch.ones((1, 2, 32, 32, 32)), cuboid) == 0).all()


def test_second_channel_is_blurred(rng: np.random.Generator) -> None:
    volume = rng.random((32, 32, 32))
    both = pyramid(torch.from_numpy(volume)[None, None])[0].numpy()
    np.testing.assert_array_equal(both[0], volume)
    np.testing.assert_allclose(both[1], uniform_filter(volume, BLUR, mode="constant"), atol=1e-9)
