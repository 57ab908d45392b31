"""Tidying: boxes as a person would place them, where that costs nothing measurable.

Turned boxes are straightened, sides go where the surface is and not just between the right
two layers of cells, neighbours become flush, and negatives reach out of what they open.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pnabs.geometry.fit.assembly import Assembly, Box
from pnabs.geometry.fit.box import is_aligned, outside
from pnabs.geometry.fit.contain import Bounds, contain
from pnabs.geometry.fit.search import LEAST_HALF
from pnabs.geometry.types import Float64

_NEARLY = 0.5
"""Sides of two boxes that are nearer than so many cells are meant to be flush."""
_BESIDE = 0.75
"""A side may move so far, in cells, to where the surface is."""
_FACING = 0.9
"""Cosine of the largest angle between a side's normal and a sample's."""
_ENOUGH = 5
"""Samples that say where a side is."""
_NEAR_FRAME = 0.35
"""A box is turned into another's frame by so much at most, radians."""
_SAME_FRAME = 1e-6
_BEYOND = 1.0
"""How far a negative reaches out of what it opens, in cells."""


def straighten(assembly: Assembly, rate: float, fee: float) -> None:
    """Turn boxes to axes that are the grid's or another box's, and fit them again.

    The largest come first: a shape that stands askew has axes of its own, which are those of
    its largest boxes.

    Parameters
    ----------
    assembly : Assembly
    rate : float
    fee : float
        What that may cost a box, in doubled cells.
    """
    frames = [np.eye(3)]
    for index in np.argsort([-box.half.prod() for box in assembly.boxes], kind="stable"):
        box = assembly.boxes[index]
        if is_aligned(box.axes):
            assembly.replace(index, _in_frame(box, np.eye(3)))
            continue
        least = assembly.gain(index, rate) - fee
        for start, turns in _straighter(box, frames):
            straight, value = assembly.improved(index, start, rate, 2.0, 0.25, turns=turns)
            if value >= least:
                assembly.replace(index, straight)
                break
        axes = assembly.boxes[index].axes
        if not any(_apart(axes, frame) < _SAME_FRAME for frame in frames):
            frames += [axes, assembly.boxes[index].mirrored(assembly.target.plane).axes]


def _straighter(box: Box, frames: list[Float64]) -> Iterator[tuple[Box, int]]:
    """A turned box in the grid's frame, in others near it, and along one axis of the grid.

    With each comes the number of turns that are left to it.
    """
    near = [(k > 0, _apart(box.axes, frame), k) for k, frame in enumerate(frames)]
    for _, apart, k in sorted(near):
        # a centred box has the mirror plane's normal among its axes
        possible = not box.centred or np.any(np.abs(frames[k][0]) == 1)
        if possible and (k == 0 or apart < _NEAR_FRAME):
            yield _in_frame(box, frames[k]), 0
    if not box.centred:
        yield along(box, int(np.argmax(np.abs(box.axes).max(axis=1)))), 1


def _apart(axes: Float64, frame: Float64) -> float:
    """Angle of the largest turn from an axis to the frame's nearest, radians."""
    return float(np.arccos(np.clip(np.abs(frame.T @ axes).max(axis=0).min(), -1, 1)))


def _in_frame(box: Box, frame: Float64) -> Box:
    """The box with a frame's axes, in their order; each side goes along the one nearest to it."""
    size, order = np.abs(frame.T @ box.axes), np.zeros(3, dtype=np.int64)
    for _ in range(3):
        i, k = np.unravel_index(np.argmax(size), (3, 3))
        order[i] = k
        size[i, :], size[:, k] = -1.0, -1.0
    return box._replace(axes=frame.copy(), half=box.half[order])


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


def hold(assembly: Assembly, bounds: Bounds, tilt: float) -> bool:
    """Cut turned positives down to the shape's bounds, and improve all boxes within them.

    Parameters
    ----------
    assembly : Assembly
        Its target gets the bounds' room.
    bounds : Bounds
    tilt : float
        See `pnabs.geometry.fit.assembly.Assembly.refine`.

    Returns
    -------
    bool
        Whether any box was cut.
    """
    assembly.target = assembly.target._replace(room=bounds.room())
    cut = False
    for index, box in enumerate(assembly.boxes):
        if box.sign > 0 and outside(*box[:3], assembly.target.room, assembly.target.side)[0] > 0:
            # along its own axes a box may be a cell too thick, here as in the search
            own = np.abs(box.axes).sum(axis=1) <= 1 + 1e-9
            wide = bounds._replace(half=np.where(own, np.inf, bounds.half), least=2 * LEAST_HALF)
            if inner := contain(box, wide):
                assembly.replace(index, inner)
                cut = True
    if cut:
        for step in (2.0, 1.0):
            assembly.refine(assembly.iou(), step, 0.25, tilt)
    return cut


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


def folded(points: Float64, normals: Float64, plane: float) -> tuple[Float64, Float64]:
    """Surface samples with those below the plane mirrored in it."""
    lower = points[:, 0] < plane
    points, normals = points.copy(), normals.copy()
    points[lower, 0] = 2 * plane - points[lower, 0]
    normals[lower, 0] *= -1
    return points, normals
