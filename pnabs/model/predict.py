"""From occupancies to cuboids."""

from __future__ import annotations

import numpy as np
import torch

from pnabs.geometry.types import Bool, Cuboids
from pnabs.model.network import CuboidNetwork

DECIMALS = 5
"""Decimals that predicted parameters keep: a hundredth of a per mille of the shape."""

BATCH = 4
"""Shapes that go through the network together; sixteen would be a fifth faster each, but a shape
alone pays for a whole batch."""


@torch.no_grad()
def predict(
    network: CuboidNetwork,
    occupancy: Bool,
    iterations: int,
    device: torch.device | str = "cpu",
) -> list[Cuboids]:
    """Cuboids of each shape.

    Shapes go through the network in batches of exactly `BATCH`, the last one filled up, because
    kernels round differently with the size of a batch and not with its content: so a shape's
    cuboids are the same bits whatever shapes it comes with.  The rounding to `DECIMALS`
    guarantees nothing more; it makes differences between machines rare.

    Parameters
    ----------
    network : CuboidNetwork
        Put on `device`.
    occupancy : (B, 32, 32, 32) bool
        Solids, or pre-processed V_delta.
    iterations : int
        Refinement iterations, 0 for the initial prediction.
    device : torch.device or str

    Returns
    -------
    list of Cuboids
        One entry of N cuboids a shape, sides non-negative, quaternions unit.
    """
    network = network.to(device).for_inference()
    results: list[Cuboids] = []
    batch = np.zeros((BATCH, 1, *occupancy.shape[1:]), np.float32)
    for first in range(0, len(occupancy), BATCH):
        volumes = occupancy[first : first + BATCH]
        batch[: len(volumes), 0] = volumes
        vectors = network(torch.from_numpy(batch).to(device), iterations)[-1].cpu().numpy()
        rounded = np.round(vectors[: len(volumes)], DECIMALS)
        results += [Cuboids.from_vector(vector) for vector in rounded]
    return results
