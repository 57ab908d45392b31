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
from pnabs.model.cuboids import rotation_matrices, split

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
    # One axis after the other, and sums of shifted copies: a seventh of avg_pool3d's time.
    for axis in (2, 3, 4):
        side = blurred.shape[axis]
        padded = F.pad(blurred, [0, 0] * (4 - axis) + [BLUR // 2] * 2)
        total = padded.narrow(axis, 0, side).clone()
        for shift in range(1, BLUR):
            total += padded.narrow(axis, shift, side)
        blurred = total / BLUR
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
    share, beyond = cuboids.new_tensor(STATIONS).unbind(-1)
    scale, _, translation = split(cuboids)
    local = share * scale.unsqueeze(-1) + MARGIN * beyond
    # Points in grid_sample's units and its order of coordinates, the last axis first.
    turn = rotation_matrices(cuboids).flip(-2) * (2 / GRID_SIDE)
    x, y, z = (local.unsqueeze(-1) * turn.transpose(-1, -2).unsqueeze(-2)).unbind(2)
    centre = translation.flip(-1) * (2 / GRID_SIDE)
    plane = (x + centre.unsqueeze(-2)).unsqueeze(3) + y.unsqueeze(2)
    points = plane.unsqueeze(4) + z[:, :, None, None]
    where = points.view(batch, 1, 1, -1, 3)
    values = F.grid_sample(
        volumes, where, mode="bilinear", padding_mode="zeros", align_corners=False
    )
    return values.view(batch, CHANNELS, count, -1).transpose(1, 2).flatten(2)
