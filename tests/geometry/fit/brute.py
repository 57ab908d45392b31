"""Boxes and sets of boxes cell by cell and point by point, by their definitions.

What the kernels of the fit count is compared with this.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from pnabs.geometry.fit.assembly import Box, Target
from pnabs.geometry.fit.bits import pack
from pnabs.geometry.types import Bool, Float64

KINDS = ("exact", "aligned", "leaning", "hinged", "turned")
"""Sides through centres of cells; along the grid; hardly turned; about one axis; anyhow."""

SLACK = 1e-9


def some_box(
    rng: np.random.Generator, kind: str, side: int, sign: int = 1, *, centred: bool = False
) -> Box:
    """A box of some kind, parts of which may lie outside the grid."""
    centre, half = rng.uniform(-0.1, 1.1, 3) * side, rng.uniform(0.5, 0.3 * side, 3)
    if kind == "exact":
        centre, half = np.round(2 * centre) / 2, np.maximum(np.round(2 * half) / 2, 0.5)
    if kind in ("exact", "aligned"):
        axes = np.eye(3)[rng.permutation(3)]
        axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    elif kind == "leaning":
        axes = Rotation.from_rotvec(10 ** rng.uniform(-7, -2) * rng.normal(size=3)).as_matrix()
    elif kind == "hinged":
        axes = Rotation.from_euler("xyz"[rng.integers(3)], rng.uniform(0, np.pi)).as_matrix()
    else:
        axes = Rotation.random(random_state=rng).as_matrix()
    if centred:
        angle = {"exact": 0.0, "aligned": 0.0, "leaning": 1e-4}.get(kind, rng.uniform(0, np.pi))
        axes, centre[0] = Rotation.from_euler("x", angle).as_matrix(), (side - 1) / 2
    return Box(centre, axes, half, sign, centred)


def some_boxes(rng: np.random.Generator, number: int, target: Target) -> list[Box]:
    """Boxes of all kinds and both signs; of a folded shape also centred ones."""
    found = []
    for _ in range(number):
        centred = target.low > 0 and rng.random() < 0.3
        kind, sign = str(rng.choice(KINDS)), int(rng.choice([1, -1]))
        found.append(some_box(rng, kind, target.side, sign, centred=centred))
    return found


def holds(box: Box, x: Float64, y: Float64, z: Float64, margin: float = SLACK) -> Bool:
    """Whether points are in the box, grown by a margin; coordinates that broadcast."""
    dx, dy, dz = x - box.centre[0], y - box.centre[1], z - box.centre[2]
    inside: Bool = np.ones(np.broadcast_shapes(x.shape, y.shape, z.shape), dtype=bool)
    for k in range(3):
        local = box.axes[0, k] * dx + box.axes[1, k] * dy + box.axes[2, k] * dz
        inside &= np.abs(local) <= box.half[k] + margin
    return inside


def near(box: Box, points: Float64, margin: float) -> Bool:
    """Which of some points, (K, 3), are in the box, grown by a margin."""
    return holds(box, points[:, 0], points[:, 1], points[:, 2], margin)


def cells(box: Box, side: int) -> Bool:
    """Cells of a grid whose centres the box holds, (side, side, side) bool."""
    x, y, z = np.ogrid[:side, :side, :side]
    return holds(box, x, y, z)


def beyond(box: Box, side: int) -> int:
    """Points with whole coordinates in the box and outside the grid."""
    low, high = np.floor(box.bounds()[0]), np.ceil(box.bounds()[1])
    x, y, z = np.ogrid[tuple(slice(a, b + 1) for a, b in zip(low, high, strict=True))]
    there = ((x >= 0) & (x < side)) & ((y >= 0) & (y < side)) & ((z >= 0) & (z < side))
    return int(np.sum(holds(box, x, y, z) & ~there))


def images(box: Box, target: Target) -> list[Box]:
    """All that a box stands for."""
    return [box, box.mirrored(target.plane)] if target.low and not box.centred else [box]


def union(boxes: Sequence[Box], side: int) -> Bool:
    found = np.zeros((side, side, side), dtype=bool)
    for box in boxes:
        found |= cells(box, side)
    return found


def by_any(boxes: Sequence[Box], points: Float64, margin: float) -> Bool:
    found = np.zeros(len(points), dtype=bool)
    for box in boxes:
        found |= near(box, points, margin)
    return found


class Whole(NamedTuple):
    """What some boxes make together, their images included.

    Attributes
    ----------
    added, removed : (G, G, G) bool
    strays : int
        Cells of the positives outside the grid, each box's by itself.
    covered : (K,) bool
        Points of the target that are covered.
    """

    added: Bool
    removed: Bool
    strays: int
    covered: Bool

    @classmethod
    def of(cls, boxes: Sequence[Box], target: Target) -> Whole:
        every = [image for box in boxes for image in images(box, target)]
        positives = [box for box in every if box.sign > 0]
        negatives = [box for box in every if box.sign < 0]
        return cls(
            union(positives, target.side),
            union(negatives, target.side),
            sum(beyond(box, target.side) for box in positives),
            by_any(positives, target.points, target.reach)
            & ~by_any(negatives, target.points, -target.reach),
        )

    def iou(self, shape: Bool) -> float:
        """With a shape that has no cells outside the grid."""
        solid = self.added & ~self.removed
        return float(np.sum(solid & shape) / (np.sum(solid | shape) + self.strays))

    def value(self, shape: Bool, target: Target, rate: float) -> float:
        """What is right less `rate` times what is wrong, and what covered points are worth."""
        solid = self.added & ~self.removed
        hits, wrong = np.sum(solid & shape), np.sum(solid & ~shape) + self.strays
        each = 1 if target.low else 2
        points = target.cover * np.mean(self.covered) * np.sum(shape)
        return float(each * (hits - rate * wrong + points))


def lumpy(rng: np.random.Generator, side: int) -> Bool:
    """A shape of some boxes and of stray cells."""
    shape = union([some_box(rng, "turned", side) for _ in range(4)], side)
    return np.asarray(shape ^ (rng.random(shape.shape) < 0.03))


def some_target(rng: np.random.Generator, side: int, *, folded: bool) -> tuple[Target, Bool]:
    """A lumpy shape with points that need not lie on it, and its cells."""
    shape = lumpy(rng, side)
    points = rng.uniform(0, side - 1, (200, 3))
    target = Target.whole(pack(shape), points, 0.3, 0.02 * side)
    return (target.folded() if folded else target), shape
