"""Tidying: boxes as a person would place them, where that costs nothing measurable.

Turned boxes are straightened, sides go where the surface is and not just between the right
two layers of cells, neighbours become flush, and negatives reach out of what they open.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pnabs.geometry.cuboid import UNIT_CORNERS
from pnabs.geometry.fit.assembly import Assembly, Box
from pnabs.geometry.fit.box import is_aligned, outside
from pnabs.geometry.fit.contain import Bounds, contain
from pnabs.geometry.fit.search import LEAST_HALF
from pnabs.geometry.types import Float64, Int64

_NEARLY = 1.5
"""Sides of two boxes that are nearer than so many cells are meant to be flush."""
_BESIDE = 1.05
"""A side may move so far, in cells, to where the surface is: all between two layers of cells."""
_FACING = 0.9
"""Cosine of the largest angle between a side's normal and a sample's."""
_ALIKE = 0.98
"""The same of samples that tell how a side is turned."""
_NEAR_SIDE = 2.0
"""How near to the side these are, in cells."""
_LITTLE = 1e-6
"""Weight of a box's own axes where samples don't tell."""
_THIN = 1.5
"""Half the thickness up to which the grid doesn't tell a part's own, in cells."""
_BESIDE_THIN = 1.0
"""Samples of a thin part lie so far out of a box, in cells."""
_EVEN = 0.5
"""Most of the samples on one side of a flat part lie within such a height, in cells."""
_WITHIN = 1e-3
"""A corner this near to a box, in cells, counts as within."""
_ENOUGH = 5
"""Samples that say where a side is."""
_NEAR_FRAME = 0.35
"""A box is turned into another's frame by so much at most, radians."""
_SAME_FRAME = 1e-5
_HOLLOW = 1.2
"""Boxes are merged into one of so much of their volumes' sum at most."""
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
    assembly.confine(bounds.room())
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


def align(assembly: Assembly, points: Float64, normals: Float64, rate: float, fee: float) -> None:
    """Turn boxes that aren't along the grid so that their sides face as the samples beside them.

    Parameters
    ----------
    assembly : Assembly
    points, normals : (P, 3) float64
        Samples of the shape's surface, in cells; folded like the target.
    rate, fee : float
        A box turns unless that costs more than the fee, in doubled cells.
    """
    for index, box in enumerate(assembly.boxes):
        if box.sign < 0 or is_aligned(box.axes):
            continue
        local, facing, at = _beside(box, points, normals, _NEAR_SIDE)
        beside = normals[at]
        side = np.sign(facing)
        facing_one = np.abs(facing) > _ALIKE
        inside = np.abs(local) < box.half + _BESIDE
        near = np.abs(local * side - box.half) < _NEAR_SIDE
        sums = _LITTLE * box.axes
        for k in range(3):
            others = [i for i in range(3) if i != k]
            chosen = facing_one[:, k] & near[:, k] & inside[:, others].all(axis=1)
            if np.count_nonzero(chosen) >= _ENOUGH:
                sums[:, k] += (side[chosen, k, None] * beside[chosen]).sum(axis=0)
        first = 1 if box.centred else 0
        if box.centred:  # its first axis is the grid's, and it may turn about that alone
            sums[0, 1:] = 0.0
        left, _, right = np.linalg.svd(sums[first:, first:])
        turned = left @ right
        if np.linalg.det(turned) * np.linalg.det(box.axes[first:, first:]) < 0:
            continue
        axes = box.axes.copy()
        axes[first:, first:] = turned
        _accept(assembly, index, box._replace(axes=axes), rate, fee)


def _beside(
    box: Box, points: Float64, normals: Float64, margin: float
) -> tuple[Float64, Float64, Int64]:
    """Samples in a box or this near to it, in its frame: places, normals, and which they are."""
    low, high = box.bounds()
    bounding = np.all((points > low - 2 * margin) & (points < high + 2 * margin), axis=1)
    chosen = np.flatnonzero(bounding)
    local = (points[chosen] - box.centre) @ box.axes
    near = np.all(np.abs(local) < box.half + margin, axis=1)
    chosen = chosen[near]
    return local[near], normals[chosen] @ box.axes, chosen


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
        local, facing, _ = _beside(box, points, normals, _BESIDE)
        facing *= box.sign
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


def thin(assembly: Assembly, points: Float64, normals: Float64, least: float) -> None:
    """Give thin boxes the thickness that the surface samples on both sides tell.

    The grid can't: it has a cell wherever a thin part is.

    Parameters
    ----------
    assembly : Assembly
    points, normals : (P, 3) float64
        Samples of the shape's surface, in cells; folded like the target.
    least : float
        The shortest side, in cells.
    """
    for index, box in enumerate(assembly.boxes):
        if box.sign < 0 or box.half.min() > _THIN:
            continue
        k = int(np.argmin(box.half))
        if box.centred and k == 0:
            continue
        local, facing, _ = _beside(box, points, normals, _BESIDE_THIN)
        facing = facing[:, k]
        others = [i for i in range(3) if i != k]
        beside = np.all(np.abs(local[:, others]) < box.half[others], axis=1)
        beside &= np.abs(local[:, k]) < box.half[k] + _BESIDE_THIN
        above, below = local[beside & (facing > _FACING), k], local[beside & (facing < -_FACING), k]
        if min(len(above), len(below)) < _ENOUGH:
            continue
        high, low = float(np.median(above)), float(np.median(below))
        wide = high - low
        uneven = max(float(np.ptp(np.quantile(one, (0.1, 0.9)))) for one in (above, below))
        if wide > 2 * box.half[k] + 1 or uneven > _EVEN:
            continue
        half = box.half.copy()
        half[k] = max(wide, least) / 2
        centre = box.centre + box.axes[:, k] * ((low + high) / 2)
        assembly.replace(index, box._replace(centre=centre, half=half))


def without_hidden(groups: list[list[Box]]) -> list[list[Box]]:
    """Boxes, and mirrored pairs, but for empty groups and positives that lie within others."""
    kept = [group for group in groups if group]
    for group in sorted(kept, key=lambda group: group[0].half.prod()):
        others = [box for other in kept if other is not group for box in other if box.sign > 0]
        if group[0].sign > 0 and all(any(_within(box, other) for other in others) for box in group):
            kept = [one for one in kept if one is not group]
    return kept


def _within(box: Box, other: Box) -> bool:
    """Whether a box lies within another."""
    corners = box.centre + (2 * UNIT_CORNERS * box.half) @ box.axes.T
    local = np.abs((corners - other.centre) @ other.axes)
    return bool(np.all(local <= other.half + _WITHIN))


def merge(assembly: Assembly, price: float) -> None:
    """Put one box in the place of two in one frame that it serves as well as.

    Parameters
    ----------
    assembly : Assembly
    price : float
        What a box must add, in IoU or the like.
    """
    index = 0
    while index < len(assembly):
        merged = any(
            _merged(assembly, index, other, price) for other in range(index + 1, len(assembly))
        )
        index = 0 if merged else index + 1


def _merged(assembly: Assembly, index: int, other: int, price: float) -> bool:
    """Whether two boxes were merged."""
    one, two = assembly.boxes[index], assembly.boxes[other]
    if min(one.sign, two.sign) < 0 or one.centred != two.centred:
        return False
    if not _in_one_frame(one, two):
        return False
    middle, reach = one.axes.T @ (two.centre - one.centre), np.abs(one.axes.T @ two.axes) @ two.half
    low, high = np.minimum(-one.half, middle - reach), np.maximum(one.half, middle + reach)
    half = (high - low) / 2
    if half.prod() > _HOLLOW * (one.half.prod() + two.half.prod()):
        return False
    both = one._replace(centre=one.centre + one.axes @ ((low + high) / 2), half=half)
    trial = assembly.copy()
    trial.replace(index, both)
    trial.remove(other)
    if trial.merit() < assembly.merit() - price * assembly.cost(one):
        return False
    assembly.replace(index, both)
    assembly.remove(other)
    return True


def _in_one_frame(one: Box, two: Box) -> bool:
    """Whether the axes of two boxes are the same, in any order."""
    turn = np.abs(one.axes.T @ two.axes)
    return bool(np.all((turn < _SAME_FRAME) | (turn > 1 - _SAME_FRAME)))


def join(assembly: Assembly, rate: float, fee: float, overlap: float) -> None:
    """Make sides of positives in one frame that are nearly flush exactly so.

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
    if index == other or one.sign < 0 or two.sign < 0 or (one.centred and k == 0):
        return
    if not _in_one_frame(one, two):
        return
    turn = np.abs(one.axes.T @ two.axes)
    middle = one.axes.T @ (two.centre - one.centre)
    reach = turn @ two.half
    mine, theirs = np.array([-one.half, one.half]), np.array([middle - reach, middle + reach])
    across = [i for i in range(3) if i != k]
    common = np.minimum(mine[1], theirs[1]) - np.maximum(mine[0], theirs[0])
    if np.any(common[across] < -_NEARLY) or one.half[across].prod() > reach[across].prod():
        return
    outward = 1 if side else -1
    for wanted in (theirs[side, k], theirs[1 - side, k] + outward * overlap):
        change = wanted - mine[side, k]
        if change and abs(change) <= _NEARLY:
            half = one.half.copy()
            half[k] += outward * change / 2
            centre = one.centre + one.axes[:, k] * (change / 2)
            if half[k] >= LEAST_HALF:
                _accept(assembly, index, one._replace(centre=centre, half=half), rate, fee)
            return


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
