"""One box on the grid: the cells whose centres it holds, counted or set, column by column.

Lengths are cells, and the centre of cell (i, j, k) is the point (i, j, k).  A box is its
centre (3,), its axes (3, 3) as columns of a rotation, and half its sides (3,).
"""

from __future__ import annotations

import math

import numpy as np

from pnabs.geometry.fit.bits import Bits, ones, span
from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import Float64

_SLACK = 1e-9
"""A centre on a side is inside, whatever rounding says."""


@kernel
def _reach(centre: Float64, axes: Float64, half: Float64, axis: int, low: int) -> tuple[int, int]:
    """First and last plane of cells along an axis that the box's bounds hold."""
    extent = 0.0
    for k in range(3):
        extent += abs(axes[axis, k]) * half[k]
    first = max(low, math.ceil(centre[axis] - extent - _SLACK))
    last = min(63, math.floor(centre[axis] + extent + _SLACK))
    return first, last


@kernel
def is_aligned(axes: Float64) -> bool:
    """Whether the box's axes are the grid's, in any order."""
    for i in range(3):
        for k in range(3):
            size = abs(axes[i, k])
            if _SLACK < size < 1 - _SLACK:
                return False
    return True


@kernel
def _column(
    centre: Float64, axes: Float64, half: Float64, slope: Float64, x: int, y: int
) -> np.uint64:
    """The cells of a column in the box.

    `slope` is 1 / axes[2], or 0 where that is nearly 0.
    """
    low, high = -1e9, 1e9
    dx, dy = x - centre[0], y - centre[1]
    for k in range(3):
        along = axes[0, k] * dx + axes[1, k] * dy
        if slope[k] == 0.0:
            if abs(along) > half[k] + _SLACK:
                return np.uint64(0)
        else:
            start, end = (-half[k] - along) * slope[k], (half[k] - along) * slope[k]
            if start > end:
                start, end = end, start
            low, high = max(low, start), min(high, end)
    first = math.ceil(max(low + centre[2] - _SLACK, 0.0))
    last = math.floor(min(high + centre[2] + _SLACK, 63.0))
    return span(first, last) if first <= last else np.uint64(0)


@kernel
def _slope(axes: Float64) -> Float64:
    slope = np.zeros(3)
    for k in range(3):
        if abs(axes[2, k]) > _SLACK:
            slope[k] = 1.0 / axes[2, k]
    return slope


@kernel
def tally(
    centre: Float64,
    axes: Float64,
    half: Float64,
    near: Bits,
    far: Bits,
    free: Bits,
    low: int,
    folded: bool,
) -> tuple[int, int]:
    """Cells of the box that are in `near` and `far`, and twice those that are in `free`.

    Parameters
    ----------
    centre, axes, half
        The box.
    near, far, free : (64, 64) uint64
        Subsets `near` and `far` of `free`.
    low : int
        Cells with a lesser x don't count.
    folded : bool
        The box's image in the plane x = 31.5 counts too, each cell once.

    Returns
    -------
    (hits, cells)
    """
    hits, cells = 0, 0
    first_x, last_x = _reach(centre, axes, half, 0, 0)
    y0, y1 = _reach(centre, axes, half, 1, 0)
    z0, z1 = _reach(centre, axes, half, 2, 0)
    if z0 > z1:
        return 0, 0
    aligned, whole = is_aligned(axes), span(z0, z1)
    slope = _slope(axes)
    end = max(last_x, 63 - first_x) if folded else last_x
    for x in range(max(first_x, low), end + 1):
        itself = first_x <= x <= last_x
        image = folded and first_x <= 63 - x <= last_x
        if not (itself or image):
            continue
        for y in range(y0, y1 + 1):
            mask = whole
            if not aligned:
                mask = np.uint64(0)
                if itself:
                    mask = _column(centre, axes, half, slope, x, y)
                if image:
                    mask |= _column(centre, axes, half, slope, 63 - x, y)
            cells += ones(free[x, y] & mask)
            hits += ones(near[x, y] & mask) + ones(far[x, y] & mask)
    return hits, 2 * cells


@kernel
def paint(centre: Float64, axes: Float64, half: Float64, out: Bits) -> None:
    """Set the box's cells."""
    x0, x1 = _reach(centre, axes, half, 0, 0)
    y0, y1 = _reach(centre, axes, half, 1, 0)
    slope = _slope(axes)
    for x in range(x0, x1 + 1):
        for y in range(y0, y1 + 1):
            out[x, y] |= _column(centre, axes, half, slope, x, y)
