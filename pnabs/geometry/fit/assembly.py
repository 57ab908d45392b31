"""Positive and negative boxes on the grid, and what each of them adds to the whole."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pnabs.geometry.fit.bits import SIDE, Bits, count, nothing
from pnabs.geometry.fit.box import MIDDLE, Field, Room, is_aligned, paint
from pnabs.geometry.fit.search import search, stray, worth
from pnabs.geometry.types import Float64

PLANE = MIDDLE
"""x of the mirror plane."""

ANYWHERE: Room = (math.inf, math.inf, math.inf)
"""The room of boxes that may be anywhere."""

_TOUCHING = 2.0
"""Boxes whose bounds are nearer than so many cells matter to each other's search."""


class Box(NamedTuple):
    """A box in cells.

    Attributes
    ----------
    centre, axes, half : (3,), (3, 3), (3,) float64
    sign : int
        1 adds, -1 takes away.
    centred : bool
        Its own mirror image.
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

    def mirrored(self) -> Box:
        """Its image in the plane x = `PLANE`."""
        flip = np.array([-1.0, 1.0, 1.0])
        centre = np.array([2 * PLANE - self.centre[0], *self.centre[1:]])
        return self._replace(centre=centre, axes=flip[:, None] * self.axes * flip)

    def painted(self) -> Bits:
        """Its cells."""
        bits = nothing()
        paint(self.centre, self.axes, self.half, bits)
        return bits


class Target(NamedTuple):
    """The shape's cells, or the two halves of a mirrored shape's, laid on one another.

    Attributes
    ----------
    near, far : (64, 64) uint64
        The half x > `PLANE`, and the other half's mirror image.  Without a mirror both are
        the whole shape, so that each cell counts twice in either case.
    low : int
        First x that counts: 32 with a mirror, else 0.
    sure : (64, 64) uint64
        Cells that aren't in doubt (`pnabs.geometry.fit.sure`), in both halves.
    room : three floats
        Where turned positives may be (`pnabs.geometry.fit.box.Field`).
    """

    near: Bits
    far: Bits
    low: int
    sure: Bits
    room: Room

    @classmethod
    def whole(cls, bits: Bits, sure: Bits, room: Room = ANYWHERE) -> Target:
        """A shape as it is."""
        return cls(bits, bits, 0, sure, room)

    @classmethod
    def folded(cls, bits: Bits, sure: Bits, room: Room = ANYWHERE) -> Target:
        """A shape folded at the plane."""
        (near, far), (one, other) = _halves(bits), _halves(sure)
        return cls(near, far, SIDE // 2, one & other, room)

    @property
    def total(self) -> int:
        """Cells of the shape, each counted twice if there is no mirror."""
        return count(self.near) + count(self.far)


def _halves(bits: Bits) -> tuple[Bits, Bits]:
    """The half x > `PLANE`, and the other half's mirror image in its place."""
    near, far = nothing(), nothing()
    near[SIDE // 2 :] = bits[SIDE // 2 :]
    far[SIDE // 2 :] = bits[: SIDE // 2][::-1]
    return near, far


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
        self.boxes = list(boxes)
        self._painted = [self._paint(box) for box in boxes]
        self._stray = [self._strays(box) for box in boxes]
        self._bounds = [box.bounds() for box in boxes]
        self._settled = [np.inf] * len(boxes)

    def copy(self) -> Assembly:
        """One that can be changed by itself."""
        twin = Assembly.__new__(Assembly)
        twin.target, twin.total = self.target, self.total
        twin.boxes, twin._painted = list(self.boxes), list(self._painted)
        twin._bounds, twin._settled = list(self._bounds), list(self._settled)
        twin._stray = list(self._stray)
        return twin

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
        self.boxes.append(box)
        self._painted.append(self._paint(box))
        self._stray.append(self._strays(box))
        self._bounds.append(box.bounds())
        self._settled.append(np.inf)
        self._unsettle(self._bounds[-1])

    def remove(self, index: int) -> None:
        """Take a box away."""
        self.boxes.pop(index)
        self._painted.pop(index)
        self._stray.pop(index)
        self._settled.pop(index)
        self._unsettle(self._bounds.pop(index))

    def covered(self, but: int = -1) -> tuple[Bits, Bits]:
        """Cells of the positives and of the negatives, one box left out."""
        cells = {1: nothing(), -1: nothing()}
        for index, (box, painted) in enumerate(zip(self.boxes, self._painted, strict=True)):
            if index != but:
                np.bitwise_or(cells[box.sign], painted, out=cells[box.sign])
        return cells[1], cells[-1]

    def occupied(self) -> Bits:
        """Cells of the whole: in a positive and in no negative."""
        added, removed = self.covered()
        return added & ~removed

    def iou(self) -> float:
        """Intersection over union with the target, exactly within the grid.

        The union has the positives' cells outside the grid too, each box's by itself, as
        `pnabs.geometry.fit.search.worth` counts them.
        """
        cells = self.occupied()
        hits = count(cells & self.target.near) + count(cells & self.target.far)
        union = self.total + 2 * count(cells) + sum(self._stray) - hits
        return hits / union if union else 0.0

    def field(self, sign: int, but: int = -1) -> Field:
        """Where a box of that sign decides alone, one box left out."""
        added, removed = self.covered(but)
        return self._within(~(added | removed) if sign > 0 else added & ~removed)

    def _within(self, free: Bits) -> Field:
        target = self.target
        return Field(target.near & free, target.far & free, free, target.low, target.room)

    def gain(self, index: int, rate: float, *, sure: bool = False) -> float:
        """What a box adds to the whole: its `worth` beside all others, by sure cells or all."""
        box = self.boxes[index]
        field = self.field(box.sign, index)
        if sure:
            field = self._within(field.free & self.target.sure)
        folded = field.low > 0 and not box.centred
        return float(worth(*box[:3], field, rate, box.sign, folded))

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
        field = self.field(old.sign, index)
        new = old
        if is_aligned(old.axes):
            new, straight = self.searched(old, field, rate, step, least, turns=0)
            turned, value = self.searched(new, field, rate, step, least)
            if value > straight + fee:
                new = turned
        else:
            new, _ = self.searched(old, field, rate, step, least)
        self.replace(index, new)

    def replace(self, index: int, box: Box) -> None:
        """Put a box in another's place."""
        old = self.boxes[index]
        if all(np.array_equal(a, b) for a, b in zip(box[:3], old[:3], strict=True)):
            return
        self._unsettle(self._bounds[index])
        self.boxes[index] = box
        self._painted[index] = self._paint(box)
        self._stray[index] = self._strays(box)
        self._bounds[index] = box.bounds()
        self._unsettle(self._bounds[index])

    def searched(
        self,
        box: Box,
        field: Field,
        rate: float,
        step: float,
        least: float,
        *,
        turns: int = 3,
    ) -> tuple[Box, float]:
        """What pattern search makes of a box, and its worth."""
        new = box._replace(centre=box.centre.copy(), axes=box.axes.copy(), half=box.half.copy())
        turns = min(turns, 1) if box.centred else turns
        value = search(*new[:3], field, rate, box.sign, step, least, turns, box.centred)
        return new, float(value)

    def _paint(self, box: Box) -> Bits:
        bits = box.painted()
        if self.target.low:
            bits |= bits[::-1].copy()
            bits[: self.target.low] = 0
        return bits

    def _strays(self, box: Box) -> int:
        """The cells of a positive that lie outside the grid, counted as in `worth`."""
        if box.sign < 0:
            return 0
        return int(stray(*box[:3], self.target.low > 0 and box.centred))

    def _unsettle(self, changed: Float64) -> None:
        """Boxes about the changed bounds may do better now."""
        if not self._bounds:
            return
        low, high = np.array(self._bounds).transpose(1, 0, 2)
        near = (low < changed[1] + _TOUCHING) & (high > changed[0] - _TOUCHING)
        for index in np.flatnonzero(near.all(axis=1)):
            self._settled[index] = np.inf
