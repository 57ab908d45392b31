"""Keeping boxes inside the shape's bounding box, which the cells know only to within a cell.

Lengths are cells, as in `pnabs.geometry.fit.box`; the bounding box lies about the grid's centre.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pnabs.geometry.fit.assembly import Box
from pnabs.geometry.fit.search import Room
from pnabs.geometry.types import Bool, Float64

_SLACK = 1e-9


class Bounds(NamedTuple):
    """Where boxes may be.

    Attributes
    ----------
    half : (3,) float64
        Half the sides of the shape's bounding box.
    least : float
        No side of a box becomes shorter.
    tolerance : float
        How far corners may stand out along axes that aren't the box's own.
    middle : float
        The grid's centre, along each axis.
    """

    half: Float64
    least: float
    tolerance: float
    middle: float

    def room(self) -> Room:
        """How far corners may be from the grid's centre along each axis."""
        x, y, z = (float(half) + self.tolerance for half in self.half)
        return x, y, z


def contain(box: Box, bounds: Bounds) -> Box | None:
    """A box cut down to what lies inside some bounds.

    Along an axis of the grid that is its own, and so in all if it isn't turned, it is cut off at
    the bounds exactly.  Else the ends that stand out are cut off one after the other, the
    furthest first, each by the cuts that cost the least volume.  No side becomes shorter than
    `bounds.least`, the box is moved in instead; where it is too large even so, it stands out
    alike on both sides.

    Parameters
    ----------
    box : Box
        One that is its own mirror image remains so.
    bounds : Bounds

    Returns
    -------
    Box or None
        The box itself if it is inside; None if it is beyond one of the bounds' sides.
    """
    own, middle = np.abs(box.axes).sum(axis=1) <= 1 + _SLACK, bounds.middle
    limit = bounds.half + np.where(own, 0.0, bounds.tolerance)
    low, high = box.bounds() - middle
    if np.all(low >= -limit - _SLACK) and np.all(high <= limit + _SLACK):
        return box
    if np.any(low >= limit + _SLACK) or np.any(high <= -limit - _SLACK):
        return None
    centre, half = box.centre.copy(), box.half.copy()
    least = np.minimum(half, bounds.least / 2)
    low, high = np.maximum(low, -limit), np.minimum(high, limit)
    for axis in np.flatnonzero(own):
        k = np.argmax(np.abs(box.axes[axis]))
        half[k] = max((high[axis] - low[axis]) / 2, least[k])
        centre[axis] = middle + (low[axis] + high[axis]) / 2
    cut = _cut(box._replace(centre=centre, half=half), middle, limit, least, own)
    spare = np.maximum(limit - np.abs(cut.axes) @ cut.half, 0.0)
    centre = np.clip(cut.centre, middle - spare, middle + spare)
    if box.centred:
        centre[0] = middle
    return cut._replace(centre=centre)


def _cut(box: Box, middle: float, limit: Float64, least: Float64, own: Bool) -> Box:
    """The box without its ends beyond the limits along axes that aren't its own."""
    centre, half = box.centre - middle, box.half
    todo = np.array([~own, ~own])
    while True:
        over = np.array([centre, -centre]) + np.abs(box.axes) @ half - limit
        over[~todo] = 0.0
        end, axis = np.unravel_index(np.argmax(over), over.shape)
        if over[end, axis] <= _SLACK:
            return box._replace(centre=centre + middle, half=half)
        outward = box.axes[axis] if end == 0 else -box.axes[axis]
        shorter = _shortened(np.abs(outward), half, least, float(over[end, axis]) / 2)
        centre = centre - box.axes @ (np.sign(outward) * (half - shorter))
        half, todo[end, axis] = shorter, False


def _shortened(slope: Float64, half: Float64, least: Float64, over: float) -> Float64:
    """Half-sides of a box that reaches less far in a direction, with the most volume.

    Parameters
    ----------
    slope : (3,) float64
        How much further the box reaches for each length of a half-side.
    half, least : (3,) float64
        The half-sides, and the shortest that they may become.
    over : float
        By how much less it is to reach, at most: where all are shortest, it reaches further.

    Returns
    -------
    (3,) float64
    """
    # The product is largest where the reach is shared alike by all half-sides that become
    # shorter: each share is cut down to the same level.
    share, floor = slope * half, slope * least
    levels = np.sort(np.concatenate([share, floor]))
    total = np.array([np.clip(level, floor, share).sum() for level in levels])
    level = np.interp(share.sum() - over, total, levels)  # the sum is linear between these
    turned = slope > _SLACK
    shorter = half.copy()
    shorter[turned] = np.clip(level, floor, share)[turned] / slope[turned]
    return shorter
