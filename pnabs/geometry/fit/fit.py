"""The fit of one shape: from its solid to boxes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import ndimage
from scipy.spatial.transform import Rotation

from pnabs.geometry import cuboid, quaternion
from pnabs.geometry.fit import tidy
from pnabs.geometry.fit.assembly import ANYWHERE, Assembly, Box, Target
from pnabs.geometry.fit.bits import Bits, count, pack, unpack
from pnabs.geometry.fit.box import is_aligned
from pnabs.geometry.fit.bridge import bridge
from pnabs.geometry.fit.build import Effort, Start, Terms, build, grow, polish, prune
from pnabs.geometry.fit.contain import Bounds, contain
from pnabs.geometry.fit.levels import Unit, levels
from pnabs.geometry.fit.search import LEAST_HALF
from pnabs.geometry.kernel import compiling
from pnabs.geometry.sampling import near_to
from pnabs.geometry.types import GRID_SIDE, Bool, Cuboids, Float32, Float64

NEAR = 0.01
"""Points of the surface this near to a box are covered, normalised frame."""

BRIDGE = 2e-3
"""IoU that closing a gap between two boxes may cost."""

POINTS = 600
"""Points of the outer surface whose cover counts."""

OVERLAP = 1e-3
"""By how much boxes that touch overlap, normalised frame."""

MIRROR_IOU = 0.9
"""A shape that agrees with its mirror image less than this is fitted without a mirror."""

_EMPTIEST = 0.1
"""Negatives carve shapes that fill at least this much of their bounding box."""

STANDS_OUT = 2.5e-3
"""How far corners of turned boxes may stand out of the shape's bounding box, normalised frame."""


_NEGLIGIBLE = 5e-4
"""IoU that a tidy side may cost."""

_EFFORT = Effort()


@dataclass(frozen=True, slots=True)
class FittedLevel:
    """A coarser level.

    Attributes
    ----------
    positives, negatives : Cuboids
    origins : list of list of int
        For each box, positives before negatives, the finest boxes that it stands for.
    """

    positives: Cuboids
    negatives: Cuboids
    origins: list[list[int]]


@dataclass(frozen=True, slots=True)
class Fitted:
    """Boxes that approximate a shape, normalised frame.

    Attributes
    ----------
    positives, negatives : Cuboids
    pairs : int
        Boxes that have an exact mirror image among them, each pair counted once.
    centred : int
        Boxes that are their own mirror image.
    aligned : int
        Boxes along the grid's axes.
    coarser : dict of size to FittedLevel
        Levels of at most that many boxes.
    """

    positives: Cuboids
    negatives: Cuboids
    pairs: int
    centred: int
    aligned: int
    coarser: dict[int, FittedLevel]


def fit(
    occupancy: Bool,
    fine: Bool,
    surface: Float32,
    mirror: int,
    terms: Terms,
    rng: np.random.Generator,
    *,
    extent: Float64,
    min_side: float,
    start: tuple[Cuboids, Cuboids] | None = None,
    scattered: bool = True,
    sizes: Sequence[int] = (),
    effort: Effort = _EFFORT,
    strict: bool = False,
) -> Fitted:
    """Cover a shape with positives and negatives, few and in agreement with its solid.

    Positives, those of coarser levels too, lie inside the shape's bounding box: along the grid
    exactly, turned ones with corners at most `STANDS_OUT` outside it.  Only boxes that need
    `min_side` to be as thick as that stand out further, by half of it at most.

    Parameters
    ----------
    occupancy : (64, 64, 64) bool
        The solid on the grid on which boxes are found.
    fine : (G, G, G) bool
        The solid on a finer grid, on which their sides are; G is a multiple of 64.
    surface : (P, 6) float32
        Samples of its surface with normals, normalised frame.
    mirror : int
        Axis across which the shape mirrors, or -1.
    terms : Terms
    rng : numpy.random.Generator
    extent : (3,) float64
        Sides of the shape's bounding box, which lies about the origin; normalised frame.
    min_side : float
        Boxes are cut down to the bounding box, but no side becomes shorter than this;
        normalised frame.
    start : (positives, negatives), optional
        Boxes to begin with.
    scattered : bool
        Begin with none as well, and go on with what is better.  Always so without a start.
    sizes : sequence of int
        Numbers of boxes of coarser levels.
    effort : Effort
    strict : bool
        Corners of turned positives stay inside the bounding box too, which costs agreement.

    Returns
    -------
    Fitted
        Without positives if no box is worth its price.
    """
    order = [(max(mirror, 0) + k) % 3 for k in range(3)]
    coarse = _Grid.of(occupancy, order, extent, min_side, strict)
    finer = _Grid.of(fine, order, extent, min_side, strict)
    samples = surface[:, :3].astype(np.float64)[:, order]
    normals = surface[:, 3:].astype(np.float64)[:, order]
    outer = _outer(samples, occupancy.transpose(order))
    given = _to_boxes(start, order, coarse) if start else []
    # Walls keep the search from what lies along them, so boxes are held to the bounds at its end.
    whole = [one.target(outer, terms.cover, strict) for one in (coarse, finer)]
    mirrored = mirror >= 0 and _mirror_iou(whole[0].near) >= MIRROR_IOU
    targets = [one.folded() for one in whole] if mirrored else whole
    if mirrored:
        given = _paired(given, coarse.middle)
    starts = _starts(whole[0].near, given, scattered=scattered, centred=mirrored)
    rough = build(targets[0], starts, terms, effort, rng)
    factor = finer.side / coarse.side
    assembly = Assembly(targets[1], [box.scaled(factor) for box in rough.boxes])
    assembly = polish(assembly, terms, effort, rng)
    points = finer.places(samples)
    if mirrored:
        points, normals = tidy.folded(points, normals, finer.middle)
    _tidy(assembly, finer.bounds, terms, points, normals)
    alone: list[Box] = []
    if mirrored:  # before thin boxes get their own thickness, which leaves cells uncovered
        both = [box for box in assembly.boxes for box in _images(box, mirrored, finer.middle)]
        alone = _completed(Assembly(whole[1], both), terms, effort, rng)
    _finish(assembly, finer.bounds, points, normals)
    groups = [_images(box, mirrored, finer.middle) for box in assembly.boxes]
    groups += [[box] for box in alone]
    bounds = finer.bounds
    groups = tidy.without_hidden([_contained(group, bounds) for group in groups])
    groups.sort(key=lambda group: -group[0].sign)

    first = np.cumsum([0, *map(len, groups)])
    units = [
        Unit(group, [[int(at) + k] for k in range(len(group))])
        for at, group in zip(first, groups, strict=False)
    ]
    boxes = [box for group in groups for box in group]
    return Fitted(
        *_to_cuboids(groups, order, finer),
        pairs=sum(len(group) == 2 for group in groups),
        centred=sum(box.centred for box in boxes),
        aligned=sum(bool(is_aligned(box.axes)) for box in boxes),
        coarser={
            size: _level(level, finer, order)
            for size, level in _levels(whole[0], units, sizes, factor).items()
        },
    )


def _levels(
    target: Target, units: list[Unit], sizes: Sequence[int], factor: float
) -> dict[int, list[Unit]]:
    """Coarser levels, found on the coarse grid; boxes that stay are those of the finer one."""
    rough, fine = [], {}
    for unit in units:
        boxes = [box.scaled(1 / factor) for box in unit.boxes]
        boxes = [box._replace(half=np.maximum(box.half, LEAST_HALF)) for box in boxes]
        rough.append(Unit(boxes, unit.origins))
        fine[id(boxes[0].centre)] = unit.boxes
    return {
        size: [
            Unit(
                fine.get(id(unit.boxes[0].centre)) or [box.scaled(factor) for box in unit.boxes],
                unit.origins,
            )
            for unit in level.units
        ]
        for size, level in levels(target, rough, sizes).items()
    }


class _Grid(NamedTuple):
    """A grid of the shape, its axes in the order of the fit."""

    bits: Bits
    side: int
    bounds: Bounds

    @classmethod
    def of(
        cls, occupancy: Bool, order: list[int], extent: Float64, min_side: float, strict: bool
    ) -> _Grid:
        side = len(occupancy)
        cell = GRID_SIDE / side
        half = np.asarray(extent, dtype=np.float64)[order] / 2 / cell
        tolerance = 0.0 if strict else STANDS_OUT / cell
        bounds = Bounds(half, min_side / cell, tolerance, (side - 1) / 2)
        return cls(pack(occupancy.transpose(order)), side, bounds)

    @property
    def cell(self) -> float:
        """Side of a cell in the normalised frame."""
        return GRID_SIDE / self.side

    @property
    def middle(self) -> float:
        """The grid's centre, along each axis."""
        return (self.side - 1) / 2

    def places(self, points: Float64) -> Float64:
        """Points of the normalised frame, in cells."""
        return (points + GRID_SIDE / 2) / self.cell - 0.5

    def target(self, outer: Float64, cover: float, strict: bool) -> Target:
        """The shape on this grid, with points of its outer surface."""
        room = self.bounds.room() if strict else ANYWHERE
        return Target.whole(self.bits, self.places(outer), cover, NEAR / self.cell, room)


def _outer(points: Float64, occupancy: Bool) -> Float64:
    """Some of the points that lie on the outer surface."""
    labels, _ = ndimage.label(~occupancy)
    outside = labels == labels[0, 0, 0]
    kept = np.flatnonzero(near_to(points, outside))[:POINTS]
    kept = kept if len(kept) else np.arange(min(len(points), POINTS))
    return points[kept]


def _level(units: Sequence[Unit], grid: _Grid, order: list[int]) -> FittedLevel:
    """A level's boxes inside the bounds."""
    kept = [(unit, group) for unit in units if (group := _contained(unit.boxes, grid.bounds))]
    origins = [origin for unit, _ in kept for origin in unit.origins]
    return FittedLevel(*_to_cuboids([group for _, group in kept], order, grid), origins)


def _contained(group: list[Box], bounds: Bounds) -> list[Box]:
    """A box, or a mirrored pair, inside the bounds; nothing if it lies outside.

    Negatives may reach out.
    """
    if group[0].sign < 0:
        return group
    box = contain(group[0], bounds)
    if box is None:
        return []
    return [box, box.mirrored(bounds.middle)] if len(group) == 2 else [box]


def _mirror_iou(bits: Bits) -> float:
    image = bits[::-1]
    return count(bits & image) / max(count(bits | image), 1)


def _tidy(
    assembly: Assembly, bounds: Bounds, terms: Terms, points: Float64, normals: Float64
) -> None:
    rate, fee = assembly.iou(), _NEGLIGIBLE * assembly.total
    tilt, cells = terms.tilt * assembly.total, assembly.target.side / GRID_SIDE
    tidy.straighten(assembly, rate, tilt)
    tidy.align(assembly, points, normals, rate, fee)
    tidy.settle(assembly, points, normals, rate, fee)
    tidy.join(assembly, rate, fee, OVERLAP * cells)
    if tidy.hold(assembly, bounds, tilt):
        tidy.settle(assembly, points, normals, rate, fee)
        tidy.join(assembly, rate, fee, OVERLAP * cells)
    tidy.merge(assembly, terms.price)
    prune(assembly, terms, assembly.iou(), terms.budget)


def _finish(assembly: Assembly, bounds: Bounds, points: Float64, normals: Float64) -> None:
    """What needs the other boxes as they will be."""
    rate, cells = assembly.iou(), assembly.target.side / GRID_SIDE
    tidy.thin(assembly, points, normals, bounds.least)
    bridge(assembly, rate, BRIDGE * assembly.total, OVERLAP * cells)
    tidy.open_out(assembly, rate)


def _images(box: Box, mirrored: bool, plane: float) -> list[Box]:
    """A box, and its mirror image if it stands for both."""
    return [box, box.mirrored(plane)] if mirrored and not box.centred else [box]


def _completed(
    assembly: Assembly, terms: Terms, effort: Effort, rng: np.random.Generator
) -> list[Box]:
    """Boxes for what isn't symmetric, which are added."""
    before, rate = len(assembly), assembly.iou()
    grow(assembly, terms, effort, rate, terms.budget, rng)
    for index in reversed(range(before, len(assembly))):
        if assembly.gain(index, rate) < terms.price * assembly.total:
            assembly.remove(index)
    return assembly.boxes[before:]


def _starts(bits: Bits, given: list[Box], *, scattered: bool, centred: bool) -> list[Start]:
    starts = [Start(given, 1.0)] if given else []
    if not scattered and given:
        return starts
    starts.append(Start([], 1.0))
    cells = np.argwhere(unpack(bits))
    low, high = (cells.min(axis=0), cells.max(axis=0)) if len(cells) else np.zeros((2, 3))
    middle = (low + high) / 2
    if centred:
        middle[0] = (bits.shape[0] - 1) / 2
    half = np.maximum(high - middle, middle - low) + 0.5
    filled = len(cells) / (2 * half).prod()
    if _EMPTIEST <= filled < 1:
        block = Box(middle, np.eye(3), half, centred=centred)
        # at half the rate at which the block alone would be worth nothing
        starts.append(Start([block], min(0.4, 0.5 * filled / (1 - filled))))
    return starts


def _to_boxes(start: tuple[Cuboids, Cuboids], order: list[int], grid: _Grid) -> list[Box]:
    """Boxes at least a cell thick, positives inside the bounds."""
    bounds = grid.bounds._replace(least=2 * LEAST_HALF)
    boxes: list[Box] = []
    for sign, cuboids in zip((1, -1), start, strict=True):
        axes = cuboid.rotation_matrices(cuboids)[:, order][:, :, order]
        half = cuboids.scale.astype(np.float64)[:, order] / 2 / grid.cell
        half = np.maximum(half, LEAST_HALF)
        centre = grid.places(cuboids.translation.astype(np.float64)[:, order])
        for parts in zip(centre, axes, half, strict=True):
            boxes += _contained([Box(*parts, sign)], bounds)
    return boxes


def _paired(boxes: list[Box], plane: float) -> list[Box]:
    """Boxes for a folded shape: those about the plane centred, others on its upper side."""
    found = []
    for box in boxes:
        low, high = box.bounds()[:, 0] - plane
        if box.centre[0] < plane:
            box, low, high = box.mirrored(plane), -high, -low
        if -low > high / 2:
            straight = tidy.along(box, 0)
            centre = np.array([plane, *box.centre[1:]])
            half = np.array([high, *straight.half[1:]])
            box = straight._replace(centre=centre, half=half, centred=True)
        found.append(box)
    return found


def _to_cuboids(
    groups: Sequence[list[Box]], order: list[int], grid: _Grid
) -> tuple[Cuboids, Cuboids]:
    """Positives and negatives; the second of a pair mirrors the first to the last bit."""
    if not groups:
        return Cuboids.empty(), Cuboids.empty()
    boxes = [group[0] for group in groups]
    back = np.argsort(order)
    scale = np.array([2 * box.half for box in boxes])[:, back] * grid.cell
    # own axes are put in another order too, so that a box along the grid's has no rotation
    axes = np.array([box.axes for box in boxes])[:, back][:, :, back]
    centre = (np.array([box.centre for box in boxes])[:, back] + 0.5) * grid.cell - GRID_SIDE / 2
    rotation = Rotation.from_matrix(axes).as_quat(scalar_first=True)
    one = Cuboids.from_vector(np.concatenate([scale, rotation, centre], axis=1))

    pair = np.array([len(group) == 2 for group in groups])
    flip = np.ones(3, dtype=np.float32)
    flip[order[0]] = -1
    turned = quaternion.mirror(one.rotation, order[0]).astype(np.float32)
    both = one.joined(Cuboids(one.scale, turned, one.translation * flip)[pair])
    place = np.concatenate([np.arange(len(groups)), np.flatnonzero(pair)])
    both = both[np.argsort(place, kind="stable")]
    sign = np.array([box.sign for group in groups for box in group])
    return both[sign > 0], both[sign < 0]


def warm_up() -> None:
    """Compile, or load from the cache, every kernel that `fit` runs.

    Call it once before processes are forked, so that each doesn't compile for itself.
    """

    def wedge(side: int) -> Bool:
        x, y, z = np.indices((side, side, side)) / side
        return np.asarray((abs(x - 0.5) < 0.2) & (y >= 0.3) & (z >= 0.3) & (y + z < 0.95))

    with compiling():
        fit(
            wedge(64),
            wedge(192),
            np.zeros((1, 6), np.float32),
            0,
            Terms(2, 0.01),
            np.random.default_rng(0),
            extent=np.ones(3),
            min_side=2e-3,
        )
