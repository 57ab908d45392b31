"""What a cuboid sees around itself: the input volume, probed in the cuboid's own frame.

The error that iterative feedback is to correct lies between the current cuboids and the
volume.  A network that reads both as one vector each must learn to compare them; probes
show each cuboid where its faces stand in the volume, in the frame in which it moves them.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from pnabs.geometry.types import GRID_SIDE, THETA_D
from pnabs.model.cuboids import place

MARGIN = THETA_D
"""How far beyond its faces a cuboid probes, in normalised units: one voxel."""

BLUR = 5
"""Width in voxels of the box filter behind the second, wider-sighted channel."""

STATIONS = ((-0.5, -1), (-0.5, 0), (-0.25, 0), (0, 0), (0.25, 0), (0.5, 0), (0.5, 1))
"""Probed places along an axis: share of the side from the centre, margins beyond."""

CHANNELS = 2
PROBES = CHANNELS * len(STATIONS) ** 3
"""Numbers that `probe` gives a cuboid."""


def pyramid(volume: Tensor) -> Tensor:
    """The volume (B, 1, G, G, G) and its blurred copy, (B, 2, G, G, G)."""
    blurred = volume
    for axis in range(3):  # one axis after the other: 15 reads a voxel, not 125
        kernel = [BLUR if k == axis else 1 for k in range(3)]
        blurred = F.avg_pool3d(blurred, kernel, 1, [k // 2 for k in kernel])
    return torch.cat([volume, blurred], dim=1)


@torch.no_grad()
def probe(volumes: Tensor, cuboids: Tensor) -> Tensor:
    """Both volumes at the stations in and around each cuboid, interpolated trilinearly.

    Parameters
    ----------
    volumes : (B, 2, G, G, G)
        From `pyramid`; nothing lies outside the grid.
    cuboids : (B, N, 10)

    Returns
    -------
    (B, N, PROBES), without a gradient: the feedback is an observation
    """
    batch, count = cuboids.shape[:2]
    stations = cuboids.new_tensor(STATIONS)
    share = torch.cartesian_prod(*[stations[:, 0]] * 3)
    beyond = torch.cartesian_prod(*[stations[:, 1]] * 3) * MARGIN
    points = place(cuboids, share * cuboids[..., None, :3] + beyond)
    where = (points * (2 / GRID_SIDE)).flip(-1).view(batch, 1, 1, -1, 3)
    values = F.grid_sample(
        volumes, where, mode="bilinear", padding_mode="zeros", align_corners=False
    )
    return values.view(batch, CHANNELS, count, -1).transpose(1, 2).flatten(2)
