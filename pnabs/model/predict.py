"""From occupancies to cuboids."""

from __future__ import annotations

import numpy as np
import torch

from pnabs.geometry.types import Bool, Cuboids
from pnabs.model.network import CuboidNetwork

DECIMALS = 5
"""Decimals that predicted parameters keep: a hundredth of a per mille of the shape."""


@torch.no_grad()
def predict(
    network: CuboidNetwork,
    occupancy: Bool,
    iterations: int,
    device: torch.device | str = "cpu",
) -> list[Cuboids]:
    """Cuboids of each shape.

    Each shape goes through the network alone, because kernels may round differently with the
    size of a batch: so a shape's cuboids are the same bits whatever shapes it comes with.  The
    rounding to `DECIMALS` guarantees nothing more; it makes differences between machines rare.

    Parameters
    ----------
    network : CuboidNetwork
        Put into evaluation mode on `device`.
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
    network = network.to(device).eval()
    results = []
    for volume in occupancy:
        tensor = torch.from_numpy(volume.astype(np.float32))[None, None].to(device)
        vector = network(tensor, iterations)[-1][0].cpu().numpy()
        results.append(Cuboids.from_vector(np.round(vector, DECIMALS)))
    return results
