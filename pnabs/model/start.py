"""Where cuboids start before training moves them."""

from __future__ import annotations

from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from pnabs.geometry.types import cell_centres, grid_points

OCTANT_CENTRE = 0.25
"""Coordinate of an octant's centre, up to sign, in the normalised cube of side 1."""

COMMON = 0.1
"""A cell counts as part of the collection from this share of its mean occupancy's maximum."""


def start_points(
    mean_occupancy: NDArray[np.floating],
    count: int,
    kind: Literal["octants", "farthest"] = "farthest",
) -> Tensor:
    """Starting centres of the cuboids.

    Parameters
    ----------
    mean_occupancy : (G, G, G) float
        Mean of the training shapes' occupancies.
    count : int
        Cuboids.
    kind : {"octants", "farthest"}
        Octant centres, as POSPRIM starts its eight; or points of the mean shape, each the
        farthest from those before it, the first the one nearest to the mean's centroid.

    Returns
    -------
    (count, 3) float32

    Raises
    ------
    ValueError
        If `octants` is asked for another count than eight, or no training shape has a voxel.
    """
    if kind == "octants":
        if count != 8:
            raise ValueError(
                f"network.start: octants needs exactly 8 cuboids, not {count}; "
                "use start: farthest for other counts"
            )
        signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        return torch.from_numpy((OCTANT_CENTRE * signs).astype(np.float32))
    weight = np.asarray(mean_occupancy, dtype=np.float64)
    if weight.max(initial=0) <= 0:
        raise ValueError("no training shape has an occupied voxel: nowhere to start cuboids")
    candidates = grid_points(len(weight))[(weight >= COMMON * weight.max()).reshape(-1)]
    centroid = grid_points(len(weight)).T @ weight.reshape(-1) / weight.sum()
    chosen = [int(np.argmin(((candidates - centroid) ** 2).sum(axis=1)))]
    gap = ((candidates - candidates[chosen[0]]) ** 2).sum(axis=1)
    for _ in range(count - 1):
        chosen.append(int(np.argmax(gap)))
        gap = np.minimum(gap, ((candidates - candidates[chosen[-1]]) ** 2).sum(axis=1))
    points = candidates[chosen]
    # With fewer common cells than cuboids later ones repeat; half a cell keeps them apart.
    repeated = np.arange(count) >= len(candidates)
    points[repeated] += 0.5 * float(np.diff(cell_centres(len(weight)))[0])
    return torch.from_numpy(points.astype(np.float32))
