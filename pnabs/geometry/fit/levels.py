"""Levels of detail: coarser and coarser sets of boxes, each made of the finer one's.

A step either leaves out a box or puts one in the place of two; whichever costs the least
IoU.  Mirrored pairs go together, so a symmetric shape stays symmetric at every level.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from pnabs.geometry.cuboid import UNIT_CORNERS
from pnabs.geometry.fit.assembly import Assembly, Box, Target
from pnabs.geometry.types import Float64

_REFINED = 4
"""Of all steps possible, so many of the best are improved before one is chosen."""
_STEP, _LEAST = 2.0, 0.5


@dataclass(frozen=True, slots=True)
class Unit:
    """A box, or a mirrored pair, with the finest boxes it stands for.

    Attributes
    ----------
    boxes : list of one or two Box
        The second is the first one's mirror image.
    origins : list of list of int
        For each, the finest boxes in its place.
    """

    boxes: list[Box]
    origins: list[list[int]]

    @property
    def sign(self) -> int:
        """1 adds, -1 takes away."""
        return self.boxes[0].sign


@dataclass(frozen=True, slots=True)
class Level:
    """The units of one level, positives first, and for each box the finest it stands for."""

    units: list[Unit]

    @property
    def origins(self) -> list[list[int]]:
        """For each box of all units, in their order."""
        return [origin for unit in self.units for origin in unit.origins]


def levels(target: Target, units: Sequence[Unit], sizes: Sequence[int]) -> dict[int, Level]:
    """Coarser sets of boxes: for each size one of at most that many boxes.

    Parameters
    ----------
    target : Target
        The whole shape, not folded.
    units : sequence of Unit
        The finest boxes.
    sizes : sequence of int

    Returns
    -------
    dict of size to Level
        A level's boxes each stand for one or more of those of every finer level, and no two
        for the same.
    """
    found: dict[int, Level] = {}
    current = list(units)
    for size in sorted(set(sizes), reverse=True):
        while _size(current) > size:
            current = _coarser(target, current)
        found[size] = Level(sorted(current, key=lambda unit: -unit.sign))
    return found


def _size(units: Sequence[Unit]) -> int:
    return sum(len(unit.boxes) for unit in units)


def _assembly(target: Target, units: Sequence[Unit]) -> Assembly:
    return Assembly(target, [box for unit in units for box in unit.boxes])


def _coarser(target: Target, units: list[Unit]) -> list[Unit]:
    """The best set with a box or a pair less; positives don't vanish altogether."""
    options = []
    for gone, merged in _steps(units, target.plane):
        rest = [unit for index, unit in enumerate(units) if index not in gone]
        rest += [merged] if merged else []
        if any(unit.sign > 0 for unit in rest):
            options.append((_assembly(target, rest).merit(), rest, merged is not None))
    options.sort(key=lambda option: -option[0])
    best_iou, best, _ = options[0]
    for _, rest, is_merged in options[:_REFINED]:
        if is_merged:
            refined = [*rest[:-1], _refined(target, rest)]
            iou = _assembly(target, refined).merit()
            if iou > best_iou:
                best_iou, best = iou, refined
    return best


def _steps(units: list[Unit], plane: float) -> Iterator[tuple[tuple[int, ...], Unit | None]]:
    """Units that may go, and what takes their place."""
    for index, unit in enumerate(units):
        yield (index,), None
        if len(unit.boxes) == 2:
            yield (index,), _one([unit], plane)
    for (i, one), (j, two) in combinations(enumerate(units), 2):
        if one.sign != two.sign:
            continue
        if len(one.boxes) == len(two.boxes) == 2:
            yield (i, j), _pair(one, two, plane)
        else:
            yield (i, j), _one([one, two], plane)


def _pair(one: Unit, two: Unit, plane: float) -> Unit:
    """A pair around two pairs, each side around the boxes that are nearer together."""
    near = np.linalg.norm(one.boxes[0].centre - two.boxes[0].centre)
    far = np.linalg.norm(one.boxes[0].centre - two.boxes[1].centre)
    first = 0 if near <= far else 1
    box = _around([one.boxes[0], two.boxes[first]], plane)
    origins = [one.origins[k] + two.origins[(first + k) % 2] for k in range(2)]
    return Unit([box, box.mirrored(plane)], origins)


def _one(units: list[Unit], plane: float) -> Unit:
    """One box around all boxes of some units, centred if each unit is its own mirror image."""
    boxes = [box for unit in units for box in unit.boxes]
    origins = sorted(i for unit in units for origin in unit.origins for i in origin)
    centred = all(len(unit.boxes) == 2 or unit.boxes[0].centred for unit in units)
    return Unit([_around(boxes, plane, centred=centred)], [origins])


def _around(boxes: list[Box], plane: float, *, centred: bool = False) -> Box:
    """The smallest box around some boxes that has the grid's axes or those of one of them."""
    corners = np.concatenate(
        [box.centre + (2 * UNIT_CORNERS * box.half) @ box.axes.T for box in boxes]
    )
    turned = [box.axes for box in boxes if box.centred or not centred]
    found = [_bounding(corners, axes, plane if centred else None) for axes in (np.eye(3), *turned)]
    centre, axes, half = min(found, key=lambda box: float(box[2].prod()))
    return Box(centre, axes, half, boxes[0].sign, centred)


def _bounding(
    corners: Float64, axes: Float64, plane: float | None
) -> tuple[Float64, Float64, Float64]:
    local = corners @ axes
    low, high = local.min(axis=0), local.max(axis=0)
    if plane is not None:  # the first axis is the grid's x, up to its sign
        middle = plane * axes[0, 0]
        reach = max(middle - low[0], high[0] - middle)
        low[0], high[0] = middle - reach, middle + reach
    return axes @ ((low + high) / 2), axes, (high - low) / 2


def _refined(target: Target, units: list[Unit]) -> Unit:
    """The last unit fitted again beside the others."""
    last = units[-1]
    others = _assembly(target, units[:-1])
    rate = _assembly(target, units).merit()
    box, _ = others.searched(last.boxes[0], rate, _STEP, _LEAST)
    images = [box, box.mirrored(target.plane)] if len(last.boxes) == 2 else [box]
    return Unit(images, last.origins)
