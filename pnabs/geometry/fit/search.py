"""Pattern search: one box's sides, place and turn, changed while the exact score rises."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pnabs.geometry.fit.bits import Bits, ones, span
from pnabs.geometry.fit.box import (
    SLACK,
    bounds_of,
    cells_beyond,
    cells_of,
    chords,
    is_aligned,
    outside,
    rows_of,
    slabs_of,
)
from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import Float64

LEAST_HALF = 0.5
"""Half a cell: a thinner box would miss whole layers of cells."""

_LARGEST_TURN = 0.5

_GAIN = 1e-6
"""A change must gain more than this, in doubled cells."""

_SIDES = (-1, 1, 0)
"""The side that moves; 0: both, so that the box is shifted.  That comes last: it is what the two
sides' moves were."""

_MANY = 24
"""Of a box over so many planes a third of these tells whether a turn is worth a closer look."""

_OUT = 1e5
"""What each cell of length outside its room costs a box: more than any box is worth."""

Room = tuple[float, float, float]
"""How far a positive's corners may be from the grid's centre along each axis, in cells, if that
isn't one of its own axes; infinite where they may be anywhere."""


class Field(NamedTuple):
    """A shape, and what other boxes leave of it to one more.

    Attributes
    ----------
    near, far : (G, G, G / 64) uint64
        Cells of two shapes.
    added, removed : (G, G, G / 64) uint64
        Cells of the other positives and negatives.
    low : int
        Cells with a lesser x don't count.
    room : three floats
    points : (K, 3) float64
        Points of the surface whose cover the box decides.
    weight, reach : float
        What covering one of these is worth, in doubled cells, and how near a box must be.
    """

    near: Bits
    far: Bits
    added: Bits
    removed: Bits
    low: int
    room: Room
    points: Float64
    weight: float
    reach: float


@kernel
def tally(
    centre: Float64,
    axes: Float64,
    half: Float64,
    field: Field,
    sign: int,
    folded: bool,
    stride: int = 1,
) -> tuple[int, int]:
    """Cells that the box decides: how many are in `near` and `far`, and twice those that there are.

    A positive decides those of no other box, a negative those of positives alone.

    Parameters
    ----------
    centre, axes, half
        The box.
    field : Field
    sign : int
    folded : bool
        The box's image in the middle plane across x counts too, each cell once.
    stride : int
        Count every so many planes across x alone.

    Returns
    -------
    (hits, cells)
    """
    hits, cells = 0, 0
    near, far, added, removed = field.near, field.far, field.added, field.removed
    last = near.shape[0] - 1
    bounds = bounds_of(centre, axes, half)
    x0, x1 = max(0, bounds[0, 0]), min(last, bounds[0, 1])
    y0, y1 = max(0, bounds[1, 0]), min(last, bounds[1, 1])
    z0, z1 = max(0, bounds[2, 0]), min(last, bounds[2, 1])
    if z0 > z1 or y0 > y1:
        return 0, 0
    one_shape = field.low == 0
    every = np.uint64(0xFFFFFFFFFFFFFFFF)
    flip = every if sign > 0 else np.uint64(0)
    begin, end = max(x0, field.low), max(x1, last - x0) if folded else x1
    begin += (-begin) % stride
    if is_aligned(axes):
        for w in range(z0 >> 6, (z1 >> 6) + 1):
            mask = span(z0, z1, w)
            for x in range(begin, end + 1, stride):
                if x0 <= x <= x1 or x0 <= last - x <= x1:
                    for y in range(y0, y1 + 1):
                        free = (added[x, y, w] ^ flip) & ~removed[x, y, w] & mask
                        cells += ones(free)
                        hits += ones(near[x, y, w] & free)
                        if not one_shape:
                            hits += ones(far[x, y, w] & free)
        return 2 * hits if one_shape else hits, 2 * cells
    slabs = slabs_of(axes, half)
    lows, highs = np.empty(y1 - y0 + 1), np.empty(y1 - y0 + 1)
    lows2, highs2 = np.empty(y1 - y0 + 1), np.empty(y1 - y0 + 1)
    for x in range(begin, end + 1, stride):
        itself = x0 <= x <= x1
        image = folded and x0 <= last - x <= x1
        first, final = y0, y1
        if not image:
            first, final = rows_of(centre, axes, half, x, y0, y1)
        if itself:
            chords(centre, slabs, x, first, final, z0, z1, lows, highs)
        if image:
            chords(centre, slabs, last - x, first, final, z0, z1, lows2, highs2)
        for y in range(first, final + 1):
            low, high = cells_of(lows[y - first], highs[y - first]) if itself else (1, 0)
            if not image:
                if low <= high:
                    for w in range(low >> 6, (high >> 6) + 1):
                        mask = span(low, high, w)
                        free = (added[x, y, w] ^ flip) & ~removed[x, y, w] & mask
                        cells += ones(free)
                        hits += ones(near[x, y, w] & free)
                        if not one_shape:
                            hits += ones(far[x, y, w] & free)
                continue
            low2, high2 = cells_of(lows2[y - first], highs2[y - first])
            for w in range(near.shape[2]):
                mask = span(low, high, w) | span(low2, high2, w)
                free = (added[x, y, w] ^ flip) & ~removed[x, y, w] & mask
                cells += ones(free)
                hits += ones(near[x, y, w] & free)
                if not one_shape:
                    hits += ones(far[x, y, w] & free)
    return 2 * hits if one_shape else hits, 2 * cells


@kernel
def met(
    centre: Float64, axes: Float64, half: Float64, field: Field, sign: int, folded: bool
) -> int:
    """Points of the field that the box is near to; of a negative those that it is well around."""
    reach = field.reach if sign > 0 else -field.reach
    a, b, c = half[0] + reach, half[1] + reach, half[2] + reach
    if min(a, b, c) < 0:
        return 0
    last, found = field.near.shape[0] - 1, 0
    for p in range(len(field.points)):
        for image in range(2 if folded else 1):
            x = field.points[p, 0] if image == 0 else last - field.points[p, 0]
            x -= centre[0]
            y, z = field.points[p, 1] - centre[1], field.points[p, 2] - centre[2]
            if (
                abs(axes[0, 0] * x + axes[1, 0] * y + axes[2, 0] * z) <= a
                and abs(axes[0, 1] * x + axes[1, 1] * y + axes[2, 1] * z) <= b
                and abs(axes[0, 2] * x + axes[1, 2] * y + axes[2, 2] * z) <= c
            ):
                found += 1
                break
    return found


@kernel
def worth(
    centre: Float64,
    axes: Float64,
    half: Float64,
    field: Field,
    rate: float,
    sign: int,
    folded: bool,
) -> float:
    """What the box adds: cells set right, less `rate` times the cells set wrong.

    A negative box (sign -1) sets right what it takes away from outside the shape, at the
    rate, and loses what it takes from the shape.  With the rate at the IoU reached, what
    raises this raises the IoU (Dinkelbach's method for fractions).  Points of the surface that
    the box covers, or uncovers, count beside the cells.

    Outside the grid there is no shape: a positive's cells there are wrong, whatever else is
    there, and a negative neither earns nor loses anything, what it crops of a positive included.
    """
    inner = _inner(centre, axes, half, field, rate, sign, folded)
    return inner + around(centre, axes, half, field, rate, sign, folded)


@kernel
def _inner(
    centre: Float64,
    axes: Float64,
    half: Float64,
    field: Field,
    rate: float,
    sign: int,
    folded: bool,
    stride: int = 1,
) -> float:
    """The part of a box's worth that is in the grid's cells; told from some planes by a stride."""
    hits, cells = tally(centre, axes, half, field, sign, folded, stride)
    return sign * stride * (hits - rate * (cells - hits))


@kernel
def around(
    centre: Float64,
    axes: Float64,
    half: Float64,
    field: Field,
    rate: float,
    sign: int,
    folded: bool,
) -> float:
    """The part of a box's worth that isn't in the grid's cells."""
    value = 0.0
    if len(field.points):
        value = sign * field.weight * met(centre, axes, half, field, sign, folded)
    if sign > 0:
        out, leaves = outside(centre, axes, half, field.room, field.near.shape[0])
        value -= _OUT * out
        if leaves:
            centred = field.low > 0 and not folded
            value -= rate * stray(centre, axes, half, centred, field.near.shape[0])
    return value


@kernel
def stray(centre: Float64, axes: Float64, half: Float64, centred: bool, side: int) -> int:
    """Cells of a box outside the grid, as `tally` counts those inside.

    Parameters
    ----------
    centre, axes, half
        The box.
    centred : bool
        The box is its own mirror image, and the grid is folded.
    side : int
        Cells along the grid.
    """
    return (1 if centred else 2) * cells_beyond(centre, axes, half, side)


@kernel
def turn(axes: Float64, about: int, angle: float) -> Float64:
    """The axes turned about one of themselves."""
    i, j = (about + 1) % 3, (about + 2) % 3
    cosine, sine = math.cos(angle), math.sin(angle)
    turned = axes.copy()
    for r in range(3):
        turned[r, i] = cosine * axes[r, i] + sine * axes[r, j]
        turned[r, j] = cosine * axes[r, j] - sine * axes[r, i]
    return turned


@kernel
def _slab(
    centre: Float64,
    axes: Float64,
    half: Float64,
    k: int,
    side: int,
    change: float,
    field: Field,
    rate: float,
    sign: int,
) -> float:
    """What a box's cells gain when one of its sides moves outwards, or inwards (change < 0)."""
    low, high = half[k], half[k] + change
    if change < 0:
        low, high = high, low
    thick = half.copy()
    thick[k] = (high - low) / 2 - SLACK
    middle = centre.copy()
    for r in range(3):
        middle[r] += axes[r, k] * side * ((low + high) / 2 + SLACK)
    hits, cells = tally(middle, axes, thick, field, sign, False)
    value = sign * (hits - rate * (cells - hits))
    return value if change > 0 else -value


@kernel
def search(
    centre: Float64,
    axes: Float64,
    half: Float64,
    field: Field,
    rate: float,
    sign: int,
    step: float,
    least: float,
    turns: int,
    centred: bool,
) -> float:
    """Improve a box in place, with everything else as it is; its worth.

    Each side, the place along each axis and the turn about each axis is changed by a step, as
    often as that helps; when nothing helps the step is halved.

    Parameters
    ----------
    centre, axes, half
        The box; changed.
    field, rate, sign
        As `worth`.
    step, least : float
        The first step and the last, in cells (turns: at the box's far end).
    turns : int
        About how many of its axes it may turn, the first first.
    centred : bool
        The box's first axis is the grid's, and its centre stays where it is along it: sides
        change in pairs.  It may turn about that axis alone.
    """
    folded = field.low > 0 and not centred
    inner = _inner(centre, axes, half, field, rate, sign, folded)
    best = inner + around(centre, axes, half, field, rate, sign, folded)
    moved, resized = centre.copy(), half.copy()
    # What the cells gain when a side goes out or in, while the box is as it was then.
    slabs, known = np.zeros((2, 2)), np.zeros((2, 2), dtype=np.bool_)
    moves = 9 + turns
    move, idle = 0, 0
    while step >= least:
        idle += 1
        if move >= 9:
            k = move - 9
            size = min(step / max(half[(k + 1) % 3], half[(k + 2) % 3]), _LARGEST_TURN)
            bounds = bounds_of(centre, axes, half)
            stride = 3 if bounds[0, 1] - bounds[0, 0] >= _MANY else 1
            told = 0.0
            if stride > 1:
                told = _inner(centre, axes, half, field, rate, sign, folded, stride)
            for way in range(2):
                angle = size if way == 0 else -size
                went = False
                while True:
                    turned = turn(axes, k, angle)
                    if stride > 1:
                        tells = _inner(centre, turned, half, field, rate, sign, folded, stride)
                        value = inner + tells - told
                        value += around(centre, turned, half, field, rate, sign, folded)
                        if value <= best:
                            break
                        told = tells
                    now = _inner(centre, turned, half, field, rate, sign, folded)
                    value = now + around(centre, turned, half, field, rate, sign, folded)
                    if value <= best + _GAIN:
                        break
                    best, inner, went, idle = value, now, True, 1
                    axes[:] = turned
                if went:
                    break
        else:
            k, side = move // 3, _SIDES[move % 3]
            pair = centred and k == 0
            if move % 3 == 0:
                known[:] = False
            for way in range(2 if side == 1 or not pair else 0):
                change = step if way == 0 else -step
                went = False
                while True:
                    for r in range(3):
                        moved[r], resized[r] = centre[r], half[r]
                    if not pair:
                        along = change if side == 0 else side * change / 2
                        for r in range(3):
                            moved[r] += axes[r, k] * along
                    if side != 0:
                        resized[k] += change / 2
                        if resized[k] < LEAST_HALF:
                            break
                    if (
                        folded
                        and min(
                            bounds_of(moved, axes, resized)[0, 0],
                            bounds_of(centre, axes, half)[0, 0],
                        )
                        < field.low
                    ):
                        now = _inner(moved, axes, resized, field, rate, sign, folded)
                    elif pair:
                        now = inner
                        for end in (-1, 1):
                            if field.low == 0 or end * axes[0, 0] > 0:
                                now += _slab(
                                    centre, axes, half, k, end, change / 2, field, rate, sign
                                )
                    elif side == 0 and abs(change) >= 2 * half[k]:
                        now = _inner(moved, axes, resized, field, rate, sign, folded)
                    else:
                        now = inner
                        for end in (-1, 1):
                            if side == -end:
                                continue
                            size = change if side != 0 else end * change
                            i, j = (end + 1) // 2, 0 if size > 0 else 1
                            if not known[i, j]:
                                slabs[i, j] = _slab(
                                    centre, axes, half, k, end, size, field, rate, sign
                                )
                                known[i, j] = True
                            now += slabs[i, j]
                    value = now + around(moved, axes, resized, field, rate, sign, folded)
                    if value <= best + _GAIN:
                        break
                    best, inner, went, idle = value, now, True, 1
                    known[:] = False
                    for r in range(3):
                        centre[r], half[r] = moved[r], resized[r]
                if went:
                    break
        move = (move + 1) % moves
        if idle == moves:  # none of them helps
            step, move, idle = step * 0.5, 0, 0
    return best
