"""Tidying: boxes as a person would place them, where that costs nothing measurable.

Turned boxes are straightened, sides go where the surface is and not just between the right
two layers of cells, neighbours become flush, and negatives reach out of what they open.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pnabs.geometry.fit.assembly import PLANE, Assembly, Box
from pnabs.geometry.fit.box import is_aligned
from pnabs.geometry.fit.search import LEAST_HALF
from pnabs.geometry.types import Bool, Float64

_NEARLY = 0.5
"""Sides of two boxes that are nearer than so many cells are meant to be flush."""
_BESIDE = 0.75
"""A side may move so far, in cells, to where the surface is."""
_FACING = 0.9
"""Cosine of the largest angle between a side's normal and a sample's."""
_ENOUGH = 5
"""Samples that say where a side is."""
_BEYOND = 1.0
"""How far a negative reaches out of what it opens, in cells."""


def straighten(assembly: Assembly, rate: float, fee: float) -> None:
    """Turn boxes to the grid's axes, all three or one of them, and fit them again.

    Parameters
    ----------
    assembly : Assembly
    rate : float
    fee : float
        What it may cost to lose one degree of freedom of turning, in doubled cells.
    """
    for index, box in enumerate(assembly.boxes):
        if is_aligned(box.axes):
            assembly.replace(index, _canonical(box))
            continue
        field = assembly.field(box.sign, index)
        least = assembly.gain(index, rate)
        for start, turns in _straighter(box):
            straight, value = assembly.searched(start, field, rate, 1.0, 0.25, turns=turns)
            if value >= least - fee * (3 - turns):
                assembly.replace(index, straight)
                break


def _canonical(box: Box) -> Box:
    """An aligned box with the grid's own axes in their order."""
    order = np.argmax(np.abs(box.axes), axis=0)
    half = np.empty(3)
    half[order] = box.half
    return box._replace(axes=np.eye(3), half=half)


def _straighter(box: Box) -> Iterator[tuple[Box, int]]:
    """A turned box along all axes of the grid, then along one, with the turns left to it."""
    yield _canonical(box._replace(axes=_nearest_permutation(box.axes))), 0
    if not box.centred:
        yield along(box, int(np.argmax(np.abs(box.axes).max(axis=1)))), 1


def along(box: Box, axis: int) -> Box:
    """The box turned so that one of its axes, made its first, is that axis of the grid."""
    own = int(np.argmax(np.abs(box.axes[axis])))
    order = [(own + k) % 3 for k in range(3)]
    axes, half = box.axes[:, order], box.half[order]
    first = np.zeros(3)
    first[axis] = 1.0 if axes[axis, 0] >= 0 else -1.0
    second = axes[:, 1] - first * (first @ axes[:, 1])
    second /= np.linalg.norm(second)
    axes = np.column_stack([first, second, np.cross(first, second)])
    return box._replace(axes=axes, half=half)


def _nearest_permutation(axes: Float64) -> Float64:
    """The signed permutation matrix that takes each axis to one of the grid's near it."""
    size, nearest = np.abs(axes), np.zeros((3, 3))
    for _ in range(3):
        i, k = np.unravel_index(np.argmax(size), (3, 3))
        nearest[i, k] = 1.0 if axes[i, k] >= 0 else -1.0
        size[i, :], size[:, k] = -1.0, -1.0
    return nearest


def settle(assembly: Assembly, points: Float64, normals: Float64, rate: float, fee: float) -> None:
    """Move sides to the surface samples beside them, within a cell.

    Parameters
    ----------
    assembly : Assembly
    points, normals : (P, 3) float64
        Samples of the shape's surface, in cells; folded like the target.
    rate, fee : float
        A side moves unless that costs more than the fee, in doubled cells.
    """
    for index, box in enumerate(assembly.boxes):
        local = (points - box.centre) @ box.axes
        facing = box.sign * (normals @ box.axes)
        excess = np.abs(local) - box.half
        low, high = -box.half, box.half.copy()
        for k in range(3):
            others = [i for i in range(3) if i != k]
            beside = np.all(excess[:, others] < _BESIDE, axis=1)
            for side, ends in ((-1, low), (1, high)):
                near = beside & (np.abs(local[:, k] - side * box.half[k]) < _BESIDE)
                near &= side * facing[:, k] > _FACING
                if np.count_nonzero(near) >= _ENOUGH:
                    ends[k] = np.median(local[near, k])
            if high[k] - low[k] < 2 * LEAST_HALF:
                low[k], high[k] = -box.half[k], box.half[k]
        if box.centred:
            low[0] = -high[0]
        moved = box._replace(
            centre=box.centre + box.axes @ ((low + high) / 2), half=(high - low) / 2
        )
        _accept(assembly, index, moved, rate, fee)


def join(assembly: Assembly, rate: float, fee: float, overlap: float) -> None:
    """Make sides of aligned positives that are nearly flush exactly so.

    Two that face each other overlap a little instead, as boxes that only touch make no
    closed solid.  Of two boxes the one with the smaller side is changed.
    """
    for index in range(len(assembly)):
        for other in range(len(assembly)):
            for k in range(3):
                for side in (0, 1):
                    _join_side(assembly, index, other, k, side, rate, fee, overlap)


def _join_side(
    assembly: Assembly,
    index: int,
    other: int,
    k: int,
    side: int,
    rate: float,
    fee: float,
    overlap: float,
) -> None:
    one, two = assembly.boxes[index], assembly.boxes[other]
    if index == other or not (_joins(one) and _joins(two)) or (one.centred and k == 0):
        return
    mine, theirs = one.bounds(), two.bounds()
    across = [i for i in range(3) if i != k]
    common = np.minimum(mine[1], theirs[1]) - np.maximum(mine[0], theirs[0])
    if np.any(common[across] < -_NEARLY) or one.half[across].prod() > two.half[across].prod():
        return
    outward = 1 if side else -1
    for wanted in (theirs[side, k], theirs[1 - side, k] + outward * overlap):
        change = wanted - mine[side, k]
        if change and abs(change) <= _NEARLY:
            half = one.half.copy()
            centre = one.centre.copy()
            half[k] += outward * change / 2
            centre[k] += change / 2
            if half[k] >= LEAST_HALF:
                _accept(assembly, index, one._replace(centre=centre, half=half), rate, fee)
            return


def _joins(box: Box) -> bool:
    return box.sign > 0 and np.array_equal(box.axes, np.eye(3))


def open_out(assembly: Assembly, rate: float) -> None:
    """Let negatives reach out of the solid where that takes nothing away.

    A side that ends where a positive does would leave a skin without thickness.
    """
    for index, box in enumerate(assembly.boxes):
        if box.sign > 0:
            continue
        for k in range(3):
            for side in (-1, 1):
                now = assembly.boxes[index]
                both = now.centred and k == 0
                half = now.half.copy()
                half[k] += _BEYOND if both else _BEYOND / 2
                centre = now.centre + (0 if both else side * _BEYOND / 2) * now.axes[:, k]
                _accept(assembly, index, now._replace(centre=centre, half=half), rate, 0.0)


def _accept(assembly: Assembly, index: int, box: Box, rate: float, fee: float) -> None:
    """Take a box in another's place if the whole loses no more than the fee."""
    before = assembly.gain(index, rate)
    old = assembly.boxes[index]
    assembly.replace(index, box)
    if assembly.gain(index, rate) < before - fee:
        assembly.replace(index, old)


def folded(points: Float64, normals: Float64) -> tuple[Float64, Float64]:
    """Surface samples with those of the lower half mirrored into the upper one."""
    lower: Bool = points[:, 0] < PLANE
    points, normals = points.copy(), normals.copy()
    points[lower, 0] = 2 * PLANE - points[lower, 0]
    normals[lower, 0] *= -1
    return points, normals
