"""Positive and negative boxes on the grid, and what each of them adds to the whole."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pnabs.geometry.fit.bits import WORD, Bits, count, nothing, ones, span, tell, untell
from pnabs.geometry.fit.box import bounds_of, cells_of, chords, is_aligned, rows_of, slabs_of
from pnabs.geometry.fit.search import Field, Room, search, stray, worth
from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import Float64, Int64

ANYWHERE: Room = (math.inf, math.inf, math.inf)
"""The room of boxes that may be anywhere."""

_TOUCHING = 2.0
"""Boxes whose bounds are nearer than so many cells, and twice the points' reach, matter to each
other."""

_DEPTH = 5
"""Binary digits of the counts of boxes over a cell, until there are more boxes than that."""


class Box(NamedTuple):
    """A box in cells.

    Attributes
    ----------
    centre, axes, half : (3,), (3, 3), (3,) float64
    sign : int
        1 adds, -1 takes away.
    centred : bool
        Its own mirror image in the grid's middle plane across x.
    """

    centre: Float64
    axes: Float64
    half: Float64
    sign: int = 1
    centred: bool = False

    def bounds(self) -> Float64:
        """Least and largest coordinates, (2, 3)."""
        extent = np.abs(self.axes) @ self.half
        return np.array([self.centre - extent, self.centre + extent])

    def contiguous(self) -> Box:
        """The same box in arrays of one layout; kernels are compiled anew for each other one."""
        if all(part.flags.c_contiguous for part in self[:3]):
            return self
        centre, axes, half = map(np.ascontiguousarray, self[:3])
        return self._replace(centre=centre, axes=axes, half=half)

    def mirrored(self, plane: float) -> Box:
        """Its image in the plane x = `plane`."""
        flip = np.array([-1.0, 1.0, 1.0])
        centre = np.array([2 * plane - self.centre[0], *self.centre[1:]])
        return self._replace(centre=centre, axes=flip[:, None] * self.axes * flip)

    def scaled(self, factor: float) -> Box:
        """The same box in the cells of a grid that has `factor` times as many."""
        return self._replace(
            centre=(self.centre + 0.5) * factor - 0.5,
            axes=self.axes.copy(),
            half=self.half * factor,
        )


class Target(NamedTuple):
    """The shape's cells, or the two halves of a mirrored shape's, laid on one another.

    Attributes
    ----------
    near, far : (G, G, G / 64) uint64
        The half beyond the middle plane across x, and the other half's mirror image.  Without a
        mirror both are the whole shape, so that each cell counts twice in either case.
    low : int
        First x that counts: G / 2 with a mirror, else 0.
    points : (K, 3) float64
        Points of the outer surface, in cells; with a mirror all beyond the plane.
    cover : float
        What covering all of them is worth, as a share of the shape's volume.
    reach : float
        How near to a box points are covered, in cells.
    room : three floats
        Where turned positives may be (`pnabs.geometry.fit.search.Room`).
    """

    near: Bits
    far: Bits
    low: int
    points: Float64
    cover: float
    reach: float
    room: Room

    @classmethod
    def whole(
        cls,
        bits: Bits,
        points: Float64,
        cover: float,
        reach: float,
        room: Room = ANYWHERE,
    ) -> Target:
        """A shape as it is."""
        return cls(bits, bits, 0, points, cover, reach, room)

    def folded(self) -> Target:
        """The shape folded at the plane."""
        low = self.side // 2
        near, far = nothing(self.side), nothing(self.side)
        near[low:] = self.near[low:]
        far[low:] = self.near[:low][::-1]
        points = folded(self.points, self.plane)
        return self._replace(near=near, far=far, low=low, points=points)

    @property
    def side(self) -> int:
        """Cells along the grid."""
        return int(self.near.shape[0])

    @property
    def plane(self) -> float:
        """x of the middle plane."""
        return (self.side - 1) / 2

    @property
    def total(self) -> int:
        """Cells of the shape, each counted twice if there is no mirror."""
        return count(self.near) + count(self.far)


def folded(points: Float64, plane: float) -> Float64:
    """Points, and other numbers behind them, with x below the plane mirrored in it."""
    points = points.copy()
    points[:, 0] = plane + np.abs(points[:, 0] - plane)
    return points


class _Cover:
    """How many boxes of one sign lie over each cell, and near each point."""

    def __init__(self, side: int, points: int) -> None:
        self.planes = np.zeros((_DEPTH, side, side, side // WORD), dtype=np.uint64)
        self.any = nothing(side)
        self.points = np.zeros(points, dtype=np.int64)

    def copy(self) -> _Cover:
        twin = _Cover.__new__(_Cover)
        twin.planes, twin.any = self.planes.copy(), self.any.copy()
        twin.points = self.points.copy()
        return twin

    def deepen(self) -> None:
        self.planes = np.concatenate([self.planes, np.zeros_like(self.planes[:1])])


@kernel
def _stamp(
    centre: Float64,
    axes: Float64,
    half: Float64,
    low: int,
    folded: bool,
    planes: Bits,
    union: Bits,
    add: bool,
) -> None:
    """Count a box in, or out, in all its cells with x >= `low`; folded, its image's too."""
    last = union.shape[0] - 1
    bounds = bounds_of(centre, axes, half)
    x0, x1 = max(0, bounds[0, 0]), min(last, bounds[0, 1])
    y0, y1 = max(0, bounds[1, 0]), min(last, bounds[1, 1])
    z0, z1 = max(0, bounds[2, 0]), min(last, bounds[2, 1])
    if y0 > y1 or z0 > z1:
        return
    slabs = slabs_of(axes, half)
    lows, highs = np.empty(y1 - y0 + 1), np.empty(y1 - y0 + 1)
    lows2, highs2 = np.empty(y1 - y0 + 1), np.empty(y1 - y0 + 1)
    end = max(x1, last - x0) if folded else x1
    for x in range(max(x0, low), end + 1):
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
            low2, high2 = cells_of(lows2[y - first], highs2[y - first]) if image else (1, 0)
            if low > high and low2 > high2:
                continue
            for w in range(union.shape[2]):
                mask = span(low, high, w) | span(low2, high2, w)
                if mask:
                    if add:
                        tell(planes, x, y, w, mask)
                        union[x, y, w] |= mask
                    else:
                        untell(planes, x, y, w, mask)
                        left = np.uint64(0)
                        for d in range(planes.shape[0]):
                            left |= planes[d, x, y, w]
                        union[x, y, w] = left


@kernel
def _reach(
    centre: Float64,
    axes: Float64,
    half: Float64,
    points: Float64,
    margin: float,
    last: float,
    folded: bool,
    counts: Int64,
    by: int,
) -> None:
    """Count a box, grown by a margin, in or out at the points that it holds."""
    a, b, c = half[0] + margin, half[1] + margin, half[2] + margin
    if min(a, b, c) < 0:
        return
    for p in range(len(points)):
        for image in range(2 if folded else 1):
            x = points[p, 0] if image == 0 else last - points[p, 0]
            x -= centre[0]
            y, z = points[p, 1] - centre[1], points[p, 2] - centre[2]
            if (
                abs(axes[0, 0] * x + axes[1, 0] * y + axes[2, 0] * z) <= a
                and abs(axes[0, 1] * x + axes[1, 1] * y + axes[2, 1] * z) <= b
                and abs(axes[0, 2] * x + axes[1, 2] * y + axes[2, 2] * z) <= c
            ):
                counts[p] += by
                break


@kernel
def _undecided(points: Float64, over: Int64, under: Int64, sign: int) -> Float64:
    """Points whose cover one more box of that sign decides."""
    kept, count = np.empty_like(points), 0
    for p in range(len(points)):
        if under[p] == 0 and (over[p] == 0) == (sign > 0):
            for r in range(3):
                kept[count, r] = points[p, r]
            count += 1
    return kept[:count]


class Assembly:
    """Boxes that approximate a target: the positives' cells less the negatives'.

    Parameters
    ----------
    target : Target
        With a mirror, a box that isn't centred stands for itself and its image.
    boxes : list of Box
    """

    def __init__(self, target: Target, boxes: list[Box]) -> None:
        self.target = target
        self.total = target.total
        self.boxes: list[Box] = []
        self._covers = {sign: _Cover(target.side, len(target.points)) for sign in (1, -1)}
        self._stray: list[int] = []
        self._bounds = np.empty((0, 2, 3))
        self._settled: list[float] = []
        self._gains: list[tuple[float, float] | None] = []
        for box in boxes:
            self.add(box)

    def copy(self) -> Assembly:
        """One that can be changed by itself."""
        twin = Assembly.__new__(Assembly)
        twin.target, twin.total = self.target, self.total
        twin.boxes, twin._stray = list(self.boxes), list(self._stray)
        twin._bounds, twin._settled = self._bounds.copy(), list(self._settled)
        twin._gains = list(self._gains)
        twin._covers = {sign: cover.copy() for sign, cover in self._covers.items()}
        return twin

    def confine(self, room: Room) -> None:
        """Say where turned positives may be."""
        self.target = self.target._replace(room=room)
        self._gains = [None] * len(self.boxes)

    def __len__(self) -> int:
        return len(self.boxes)

    def cost(self, box: Box) -> int:
        """How many boxes it stands for."""
        return 2 if self.target.low and not box.centred else 1

    @property
    def size(self) -> int:
        """How many boxes all of them stand for."""
        return sum(self.cost(box) for box in self.boxes)

    def size_of(self, sign: int) -> int:
        """How many boxes all of one sign stand for."""
        return sum(self.cost(box) for box in self.boxes if box.sign == sign)

    def add(self, box: Box) -> None:
        """Add a box."""
        box = box.contiguous()
        if (
            sum(other.sign == box.sign for other in self.boxes)
            >= 2 ** len(self._covers[box.sign].planes) - 1
        ):
            self._covers[box.sign].deepen()
        self._stamp(box, add=True)
        self.boxes.append(box)
        self._stray.append(self._strays(box))
        self._bounds = np.concatenate([self._bounds, box.bounds()[None]])
        self._settled.append(np.inf)
        self._gains.append(None)
        self._unsettle(self._bounds[-1])

    def remove(self, index: int) -> None:
        """Take a box away."""
        self._stamp(self.boxes.pop(index), add=False)
        self._stray.pop(index)
        self._settled.pop(index)
        self._gains.pop(index)
        gone = self._bounds[index].copy()
        self._bounds = np.delete(self._bounds, index, axis=0)
        self._unsettle(gone)

    @property
    def added(self) -> Bits:
        """Cells of the positives; not to be changed."""
        return self._covers[1].any

    @property
    def removed(self) -> Bits:
        """Cells of the negatives; not to be changed."""
        return self._covers[-1].any

    def occupied(self) -> Bits:
        """Cells of the whole: in a positive and in no negative."""
        return self.added & ~self.removed

    def iou(self) -> float:
        """Intersection over union with the target, exactly within the grid.

        The union has the positives' cells outside the grid too, each box's by itself, as
        `pnabs.geometry.fit.search.worth` counts them.
        """
        hits, cells = _agreement(self.target.near, self.target.far, self.added, self.removed)
        union = self.total + 2 * cells + sum(self._stray) - hits
        return hits / union if union else 0.0

    def coverage(self) -> float:
        """Share of the surface's points that are covered."""
        if not len(self.target.points):
            return 0.0
        return float(np.mean((self._covers[1].points > 0) & (self._covers[-1].points == 0)))

    def merit(self) -> float:
        """What the boxes are chosen by: the IoU, and for points that are covered."""
        return self.iou() + self.target.cover * self.coverage()

    def field(self, sign: int) -> Field:
        """What the boxes leave to one more of that sign."""
        target = self.target
        over, under = self._covers[1].points, self._covers[-1].points
        points = _undecided(target.points, over, under, sign)
        weight = target.cover * self.total / max(len(target.points), 1)
        return Field(
            target.near,
            target.far,
            self.added,
            self.removed,
            target.low,
            target.room,
            points,
            weight,
            target.reach,
        )

    def gain(self, index: int, rate: float) -> float:
        """What a box adds to the whole: its `worth` beside all others."""
        known = self._gains[index]
        if known and known[0] == rate:
            return known[1]
        box = self.boxes[index]
        self._stamp(box, add=False)
        field = self.field(box.sign)
        folded = field.low > 0 and not box.centred
        value = float(worth(*box[:3], field, rate, box.sign, folded))
        self._stamp(box, add=True)
        self._gains[index] = rate, value
        return value

    def refine(self, rate: float, step: float, least: float, fee: float) -> None:
        """Improve each box in turn that isn't at its best beside the others already.

        Parameters
        ----------
        rate, step, least : float
            See `pnabs.geometry.fit.search`.
        fee : float
            What turning away from the grid's axes must earn, in doubled cells.
        """
        for index in range(len(self.boxes)):
            if self._settled[index] > least:
                self._improve(index, rate, step, least, fee)
                self._settled[index] = least

    def _improve(self, index: int, rate: float, step: float, least: float, fee: float) -> None:
        old = self.boxes[index]
        self._stamp(old, add=False)
        if is_aligned(old.axes):
            new, straight = self.searched(old, rate, step, least, turns=0)
            turned, value = self.searched(new, rate, step, least)
            if value > straight + fee:
                new = turned
        else:
            new, _ = self.searched(old, rate, step, least)
        self._stamp(old, add=True)
        self.replace(index, new)

    def improved(
        self, index: int, start: Box, rate: float, step: float, least: float, *, turns: int = 3
    ) -> tuple[Box, float]:
        """What pattern search makes of another box in a box's place, and its worth."""
        old = self.boxes[index]
        self._stamp(old, add=False)
        found = self.searched(start, rate, step, least, turns=turns)
        self._stamp(old, add=True)
        return found

    def replace(self, index: int, box: Box) -> None:
        """Put a box in another's place."""
        old, box = self.boxes[index], box.contiguous()
        if all(np.array_equal(a, b) for a, b in zip(box[:3], old[:3], strict=True)):
            return
        self._stamp(old, add=False)
        self._stamp(box, add=True)
        self._unsettle(self._bounds[index])
        self.boxes[index] = box
        self._stray[index] = self._strays(box)
        self._bounds[index] = box.bounds()
        self._unsettle(self._bounds[index])

    def searched(
        self, box: Box, rate: float, step: float, least: float, *, turns: int = 3
    ) -> tuple[Box, float]:
        """What pattern search makes of one more box, and its worth."""
        new = box._replace(centre=box.centre.copy(), axes=box.axes.copy(), half=box.half.copy())
        turns = min(turns, 1) if box.centred else turns
        field = self.field(box.sign)
        value = search(*new[:3], field, rate, box.sign, step, least, turns, box.centred)
        return new, float(value)

    def _stamp(self, box: Box, *, add: bool) -> None:
        target, cover = self.target, self._covers[box.sign]
        folded = target.low > 0 and not box.centred
        _stamp(*box[:3], target.low, folded, cover.planes, cover.any, add)
        _reach(
            *box[:3],
            target.points,
            box.sign * target.reach,
            2 * target.plane,
            folded,
            cover.points,
            1 if add else -1,
        )

    def _strays(self, box: Box) -> int:
        """The cells of a positive that lie outside the grid, counted as in `worth`."""
        if box.sign < 0:
            return 0
        target = self.target
        return int(stray(*box[:3], target.low > 0 and box.centred, target.side))

    def _unsettle(self, changed: Float64) -> None:
        """Boxes about the changed bounds may do better now, and are worth something else."""
        margin = _TOUCHING + 2 * self.target.reach
        low, high = self._bounds[:, 0], self._bounds[:, 1]
        near = (low < changed[1] + margin) & (high > changed[0] - margin)
        for index in np.flatnonzero(near.all(axis=1)):
            self._settled[index] = np.inf
            self._gains[index] = None


@kernel
def _agreement(near: Bits, far: Bits, added: Bits, removed: Bits) -> tuple[int, int]:
    """Cells in both the boxes and either shape, and the boxes' cells."""
    hits, cells = 0, 0
    for x in range(near.shape[0]):
        for y in range(near.shape[1]):
            for w in range(near.shape[2]):
                word = added[x, y, w] & ~removed[x, y, w]
                if word:
                    cells += ones(word)
                    hits += ones(near[x, y, w] & word) + ones(far[x, y, w] & word)
    return hits, cells
