"""One box on a grid: the cells whose centres it holds, counted or set, column by column.

Lengths are cells, and the centre of cell (i, j, k) is the point (i, j, k).  A box is its
centre (3,), its axes (3, 3) as columns of a rotation, and half its sides (3,).

A column meets any convex solid in one interval.  `bounds_of`, `rows_of` and `chords` are all that
the search knows of a box's form; another kind of solid needs its own three.
"""

from __future__ import annotations

import math

import numpy as np

from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import Float64, Int64

SLACK = 1e-9
"""A centre on a side is inside, whatever rounding says."""

_FAR = 1e15
_STEEP = 1e-3
"""Pairs of sides that the columns meet more steeply don't bound a row."""


@kernel
def is_aligned(axes: Float64) -> bool:
    """Whether the box's axes are the grid's, in any order."""
    for i in range(3):
        for k in range(3):
            size = abs(axes[i, k])
            if SLACK < size < 1 - SLACK:
                return False
    return True


@kernel
def bounds_of(centre: Float64, axes: Float64, half: Float64) -> Int64:
    """First and last plane of cells along each axis, (3, 2), were the grid endless."""
    bounds = np.empty((3, 2), dtype=np.int64)
    for i in range(3):
        extent = 0.0
        for k in range(3):
            extent += abs(axes[i, k]) * half[k]
        bounds[i, 0] = math.ceil(centre[i] - extent - SLACK)
        bounds[i, 1] = math.floor(centre[i] + extent + SLACK)
    return bounds


@kernel
def slabs_of(axes: Float64, half: Float64) -> Float64:
    """For each pair of sides: how their part of a column moves with x and y, and half of it.

    Sides along the columns have a part so long, or so far away, that it is all or nothing.
    """
    slabs = np.empty((3, 3))
    for k in range(3):
        slope = axes[2, k]
        stretch = 1.0 / slope if abs(slope) > SLACK else _FAR
        slabs[k, 0], slabs[k, 1] = axes[0, k] * stretch, axes[1, k] * stretch
        slabs[k, 2] = (half[k] + SLACK) * abs(stretch)
    return slabs


@kernel
def chords(
    centre: Float64,
    slabs: Float64,
    x: int,
    first: int,
    final: int,
    bottom: int,
    top: int,
    low: Float64,
    high: Float64,
) -> None:
    """Where the columns in plane x, with y from `first` to `final`, meet the box of those slabs.

    Parameters
    ----------
    bottom, top : int
        Cells beyond these don't count.
    low, high : (G,) float64
        Out, from `first` on: the lowest and the highest point, the lowest above the highest where
        there is none.
    """
    dx = x - centre[0]
    middle0, slope0, reach0 = slabs[0, 0] * dx, slabs[0, 1], slabs[0, 2]
    middle1, slope1, reach1 = slabs[1, 0] * dx, slabs[1, 1], slabs[1, 2]
    middle2, slope2, reach2 = slabs[2, 0] * dx, slabs[2, 1], slabs[2, 2]
    least, most = bottom - centre[2], top - centre[2]
    for y in range(first, final + 1):
        dy = y - centre[1]
        a, b, c = middle0 + slope0 * dy, middle1 + slope1 * dy, middle2 + slope2 * dy
        under, over = -reach0 - a, reach0 - a
        other = -reach1 - b
        under = other if other > under else under
        other = reach1 - b
        over = other if other < over else over
        other = -reach2 - c
        under = other if other > under else under
        other = reach2 - c
        over = other if other < over else over
        low[y - first] = centre[2] + (least if least > under else under)
        high[y - first] = centre[2] + (most if most < over else over)


@kernel
def cells_of(low: float, high: float) -> tuple[int, int]:
    """First and last cell of a chord; the first is above the last where there is none."""
    if low > high + SLACK:
        return 1, 0
    return math.ceil(low - SLACK), math.floor(high + SLACK)


@kernel
def rows_of(
    centre: Float64, axes: Float64, half: Float64, x: int, first: int, last: int
) -> tuple[int, int]:
    """The y, between two bounds, of the columns in plane x that the box may meet.

    Each pair of sides leaves a strip of the plane, seen along the columns.
    """
    height = 0.0
    for k in range(3):
        height += abs(axes[2, k]) * half[k]
    dx = x - centre[0]
    low, high = float(first), float(last)
    for k in range(3):
        slope = abs(axes[1, k])
        if slope > _STEEP:
            middle = centre[1] - axes[0, k] * dx / axes[1, k]
            width = (half[k] + SLACK + abs(axes[2, k]) * height) / slope
            low, high = max(low, middle - width), min(high, middle + width)
    return math.ceil(low - SLACK), math.floor(high + SLACK)


@kernel
def outside(
    centre: Float64, axes: Float64, half: Float64, room: tuple[float, float, float], side: int
) -> tuple[float, bool]:
    """How far a box stands out of its room, in cells, and whether it leaves the grid.

    Parameters
    ----------
    centre, axes, half
        The box.
    room : three floats
        How far corners may be from the grid's centre along each axis, if that isn't one of the
        box's own axes.
    side : int
        Cells along the grid.
    """
    middle = (side - 1) / 2
    most, leaves = 0.0, False
    for i in range(3):
        a, b, c = abs(axes[i, 0]), abs(axes[i, 1]), abs(axes[i, 2])
        far = abs(centre[i] - middle) + a * half[0] + b * half[1] + c * half[2]
        leaves = leaves or far > middle + 1 - SLACK
        if a + b + c > 1 + SLACK:  # else it is one of the box's own axes
            most = max(most, far - room[i])
    return most, leaves


@kernel
def cells_beyond(centre: Float64, axes: Float64, half: Float64, side: int) -> int:
    """Cells of the box outside the grid, if the grid went on without end."""
    bounds = bounds_of(centre, axes, half)
    last = side - 1
    if bounds.min() >= 0 and bounds.max() <= last:
        return 0
    if is_aligned(axes):
        whole, part = 1, 1
        for i in range(3):
            whole *= max(0, bounds[i, 1] - bounds[i, 0] + 1)
            kept = min(bounds[i, 1], last) - max(bounds[i, 0], 0) + 1
            part *= max(0, kept)
        return whole - part
    slabs = slabs_of(axes, half)
    first, final = bounds[1, 0], bounds[1, 1]
    lows, highs = np.empty(final - first + 1), np.empty(final - first + 1)
    beyond = 0
    for x in range(bounds[0, 0], bounds[0, 1] + 1):
        chords(centre, slabs, x, first, final, bounds[2, 0], bounds[2, 1], lows, highs)
        for y in range(first, final + 1):
            low, high = cells_of(lows[y - first], highs[y - first])
            beyond += max(0, high - low + 1)
            if 0 <= x <= last and 0 <= y <= last:
                beyond -= max(0, min(high, last) - max(low, 0) + 1)
    return beyond
