"""One box on the grid: the cells whose centres it holds, counted or set, column by column.

Lengths are cells, and the centre of cell (i, j, k) is the point (i, j, k).  A box is its
centre (3,), its axes (3, 3) as columns of a rotation, and half its sides (3,).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pnabs.geometry.fit.bits import SIDE, Bits, ones, span
from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import Float64

Room = tuple[float, float, float]
"""See `Field`."""

MIDDLE = (SIDE - 1) / 2
"""The grid's centre, along each axis: between two layers of cells."""

_SLACK = 1e-9
"""A centre on a side is inside, whatever rounding says."""


@kernel
def _planes(centre: Float64, axes: Float64, half: Float64, axis: int) -> tuple[int, int]:
    """First and last plane of cells along an axis that its bounds hold, were the grid endless."""
    extent = 0.0
    for k in range(3):
        extent += abs(axes[axis, k]) * half[k]
    first = math.ceil(centre[axis] - extent - _SLACK)
    last = math.floor(centre[axis] + extent + _SLACK)
    return first, last


@kernel
def _reach(centre: Float64, axes: Float64, half: Float64, axis: int) -> tuple[int, int]:
    """First and last plane of the grid's cells along an axis that the box's bounds hold."""
    first, last = _planes(centre, axes, half, axis)
    return max(0, first), min(63, last)


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
def outside(centre: Float64, axes: Float64, half: Float64, room: Room) -> tuple[float, bool]:
    """How far a box stands out of its room (`Field`), in cells, and whether it leaves the grid."""
    most, leaves = 0.0, False
    for i in range(3):
        a, b, c = abs(axes[i, 0]), abs(axes[i, 1]), abs(axes[i, 2])
        far = abs(centre[i] - MIDDLE) + a * half[0] + b * half[1] + c * half[2]
        leaves = leaves or far > MIDDLE + 1 - _SLACK
        if a + b + c > 1 + _SLACK:  # else it is one of the box's own axes
            most = max(most, far - room[i])
    return most, leaves


@kernel
def _slabs(axes: Float64, half: Float64) -> Float64:
    """For each pair of sides: how their part of a column moves with x and y, and half of it.

    Sides along the columns have a part so long, or so far away, that it is all or nothing.
    """
    slabs = np.empty((3, 3))
    for k in range(3):
        slope = axes[2, k]
        stretch = 1.0 / slope if abs(slope) > _SLACK else 1e15
        slabs[k, 0], slabs[k, 1] = axes[0, k] * stretch, axes[1, k] * stretch
        slabs[k, 2] = (half[k] + _SLACK) * abs(stretch)
    return slabs


@kernel
def _run(
    centre: Float64, slabs: Float64, x: int, y: int, bottom: float, top: float
) -> tuple[int, int]:
    """First and last cell of a column, from `bottom` to `top`, in the box of those `_slabs`."""
    dx, dy = x - centre[0], y - centre[1]
    first, last = bottom - centre[2], top - centre[2]
    for k in range(3):
        middle = slabs[k, 0] * dx + slabs[k, 1] * dy
        first, last = max(first, -slabs[k, 2] - middle), min(last, slabs[k, 2] - middle)
    if first > last:
        return 0, -1
    return math.ceil(first + centre[2] - _SLACK), math.floor(last + centre[2] + _SLACK)


@kernel
def _column(centre: Float64, slabs: Float64, x: int, y: int) -> np.uint64:
    """The grid's cells of a column in the box of those `_slabs`."""
    low, high = _run(centre, slabs, x, y, 0.0, 63.0)
    return span(low, high) if low <= high else np.uint64(0)


@kernel
def cells_beyond(centre: Float64, axes: Float64, half: Float64) -> int:
    """Cells of the box outside the grid, if the grid went on without end."""
    x0, x1 = _planes(centre, axes, half, 0)
    y0, y1 = _planes(centre, axes, half, 1)
    z0, z1 = _planes(centre, axes, half, 2)
    if min(x0, y0, z0) >= 0 and max(x1, y1, z1) <= 63:
        return 0
    if is_aligned(axes):
        return _boxful(x0, x1, y0, y1, z0, z1) - _boxful(
            max(x0, 0), min(x1, 63), max(y0, 0), min(y1, 63), max(z0, 0), min(z1, 63)
        )
    slabs = _slabs(axes, half)
    beyond = 0
    for x in range(x0, x1 + 1):
        for y in range(y0, y1 + 1):
            low, high = _run(centre, slabs, x, y, float(z0), float(z1))
            beyond += max(0, high - low + 1)
            if 0 <= x <= 63 and 0 <= y <= 63:
                beyond -= max(0, min(high, 63) - max(low, 0) + 1)
    return beyond


@kernel
def _boxful(x0: int, x1: int, y0: int, y1: int, z0: int, z1: int) -> int:
    """Cells between planes along the grid."""
    return max(0, x1 - x0 + 1) * max(0, y1 - y0 + 1) * max(0, z1 - z0 + 1)


class Field(NamedTuple):
    """Where a box decides alone, and what is right there.

    Attributes
    ----------
    near, far, free : (64, 64) uint64
        All cells that it decides, `free`, and which of them two shapes have.
    low : int
        Cells with a lesser x don't count.
    room : three floats
        How far a positive's corners may be from the grid's centre along each axis, in cells, if
        that isn't one of its own axes; infinite where they may be anywhere.  (An array here
        would cost a third of `tally`'s time in counting references.)
    """

    near: Bits
    far: Bits
    free: Bits
    low: int
    room: Room


@kernel
def tally(
    centre: Float64, axes: Float64, half: Float64, field: Field, folded: bool
) -> tuple[int, int]:
    """Cells of the box that are in `near` and `far`, and twice those that are in `free`.

    Parameters
    ----------
    centre, axes, half
        The box.
    field : Field
    folded : bool
        The box's image in the plane x = 31.5 counts too, each cell once.

    Returns
    -------
    (hits, cells)
    """
    hits, cells = 0, 0
    first_x, last_x = _reach(centre, axes, half, 0)
    y0, y1 = _reach(centre, axes, half, 1)
    z0, z1 = _reach(centre, axes, half, 2)
    if z0 > z1:
        return 0, 0
    aligned, whole = is_aligned(axes), span(z0, z1)
    slabs = _slabs(axes, half)
    end = max(last_x, 63 - first_x) if folded else last_x
    for x in range(max(first_x, field.low), end + 1):
        itself = first_x <= x <= last_x
        image = folded and first_x <= 63 - x <= last_x
        if not (itself or image):
            continue
        for y in range(y0, y1 + 1):
            mask = whole
            if not aligned:
                mask = np.uint64(0)
                if itself:
                    mask = _column(centre, slabs, x, y)
                if image:
                    mask |= _column(centre, slabs, 63 - x, y)
            cells += ones(field.free[x, y] & mask)
            hits += ones(field.near[x, y] & mask) + ones(field.far[x, y] & mask)
    return hits, 2 * cells


@kernel
def paint(centre: Float64, axes: Float64, half: Float64, out: Bits) -> None:
    """Set the box's cells."""
    x0, x1 = _reach(centre, axes, half, 0)
    y0, y1 = _reach(centre, axes, half, 1)
    slabs = _slabs(axes, half)
    for x in range(x0, x1 + 1):
        for y in range(y0, y1 + 1):
            out[x, y] |= _column(centre, slabs, x, y)
