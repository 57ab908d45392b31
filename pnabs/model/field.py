"""Distance fields on the grid, looked up anywhere."""

from __future__ import annotations

import torch.nn.functional as F
from torch import Tensor

from pnabs.geometry.types import GRID_SIDE
from pnabs.model.cuboids import norm


def interpolate(field: Tensor, points: Tensor) -> Tensor:
    """A field of distances at arbitrary points (METHOD, shapes).

    Trilinear between the cell centres; beyond their hull the value at the nearest point of the
    hull plus the distance to it.

    Parameters
    ----------
    field : (B, 1, G, G, G)
        Signed distances at the cell centres, x slowest.
    points : (B, P, 3)
        Normalised frame.

    Returns
    -------
    (B, P)
    """
    # grid_sample puts -1 and 1 at the outer faces of the grid and names the last axis first.
    where = (points * (2 / GRID_SIDE)).flip(-1)[:, None, None]
    inside = F.grid_sample(
        field, where, mode="bilinear", padding_mode="border", align_corners=False
    )
    reach = GRID_SIDE / 2 * (1 - 1 / field.shape[-1])
    beyond = norm((points.abs() - reach).relu())
    return inside.view(points.shape[:2]) + beyond
