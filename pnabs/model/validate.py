"""How well a module under training covers shapes that it doesn't learn from."""

from __future__ import annotations

import torch
from torch import Tensor

from pnabs.geometry.types import GRID_SIDE
from pnabs.model import cuboids as geometry
from pnabs.model.network import CuboidNetwork

BATCH = 32
CELL = GRID_SIDE / 32
FAR = 10.0
"""A coordinate that no shape reaches."""


@torch.no_grad()
def validation_iou(
    network: CuboidNetwork,
    occupancy: Tensor,
    iterations: int,
    min_side: float,
    device: torch.device | str = "cpu",
) -> Tensor:
    """IoU of each shape with the union of its predicted cuboids, on the 32^3 grid.

    As `metrics.iou` of `metrics.predicted_occupancy` of thickened boxes, without a crop: the
    positive module is measured against solids, the negative one against difference volumes.
    The network is left in evaluation mode.

    Parameters
    ----------
    network : CuboidNetwork
    occupancy : (V, 32, 32, 32) bool
        What the module reads, and should cover.
    iterations : int
        Refinement iterations, 0 for the initial prediction.
    min_side : float
        Cuboids that are shorter in every direction are left out.

    Returns
    -------
    (V,) float64
    """
    network.eval()
    found = [torch.zeros(0, dtype=torch.float64)]
    for start in range(0, len(occupancy), BATCH):
        volume = occupancy[start : start + BATCH].unsqueeze(1).to(device)
        boxes = network(volume.float(), iterations)[-1]
        speck = (boxes[..., :3] < min_side).all(dim=-1, keepdim=True)
        scale = boxes[..., :3].clamp(min=CELL)
        centre = torch.where(speck, FAR, boxes[..., 7:])
        covered = geometry.coverage(torch.cat([scale, boxes[..., 3:7], centre], dim=-1)) >= 0.5
        either = (covered | volume).sum(dim=(1, 2, 3, 4))
        both = (covered & volume).sum(dim=(1, 2, 3, 4))
        found.append((both / either.clamp(min=1)).double().cpu())
    return torch.cat(found)
