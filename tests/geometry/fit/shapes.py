"""Shapes for the tests of the fit, as solids and surface samples."""

from __future__ import annotations

import numpy as np

from pnabs.geometry import cuboid
from pnabs.geometry.crop import crop
from pnabs.geometry.fit.assembly import ANYWHERE, Box, Target
from pnabs.geometry.fit.bits import Bits, pack
from pnabs.geometry.fit.search import Room
from pnabs.geometry.sampling import draw_on_triangles
from pnabs.geometry.types import GRID_SIDE, Bool, Cuboids, Float32, Float64, grid_points

CELL = GRID_SIDE / 64
PLANE = 31.5
POINTS = np.stack(np.meshgrid(*[np.arange(64.0)] * 3, indexing="ij"), axis=-1)

Sides = tuple[float, float, float]


def upright(*rows: tuple[Sides, Sides]) -> Cuboids:
    """Cuboids along the axes, from sides and centres in cells of the 64^3 grid."""
    vectors = [
        [*(CELL * np.array(sides)), 1, 0, 0, 0, *(CELL * np.array(centre))]
        for sides, centre in rows
    ]
    return Cuboids.from_vector(np.array(vectors, dtype=np.float64))


def extent(positives: Cuboids) -> Float64:
    """Sides of the box about the origin that just holds them, (3,) float64."""
    return np.asarray(2 * np.abs(cuboid.corners(positives)).max(axis=(0, 1)))


def stands_out(positives: Cuboids, extent: Float64) -> float:
    """How far they leave a box about the origin of those sides."""
    return float((np.abs(cuboid.corners(positives)) - extent / 2).max())


def contained(box: Box) -> Bool:
    """Cell centres in a box in cells, by its definition, (64, 64, 64) bool."""
    inside: Bool = np.all(np.abs((POINTS - box.centre) @ box.axes) <= box.half + 1e-9, axis=-1)
    return inside


def painted(box: Box) -> Bits:
    """These cells as bits."""
    return pack(contained(box))


def whole(bits: Bits, room: Room = ANYWHERE) -> Target:
    """A shape of which only the cells count."""
    return Target.whole(bits, np.zeros((0, 3)), 0.0, 0.6, room)


def occupied(positives: Cuboids, negatives: Cuboids | None = None, side: int = 64) -> Bool:
    """Cell centres in a positive and in no negative, (side, side, side) bool."""
    points = grid_points(side)
    inside = cuboid.contains(points, positives).any(axis=0)
    if negatives is not None:
        inside &= ~cuboid.contains(points, negatives).any(axis=0)
    return inside.reshape(side, side, side)


def surface(positives: Cuboids, negatives: Cuboids | None = None, count: int = 4000) -> Float32:
    """Points and normals on the surface of the crop."""
    result = crop(positives, negatives or Cuboids.empty(), min_side=2e-3)
    triangles = result.vertices[result.faces]
    points, index = draw_on_triangles(triangles, count, np.random.default_rng(0))
    first, second, third = triangles[index].transpose(1, 0, 2)
    normals = np.cross(second - first, third - first)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.column_stack([points, normals]).astype(np.float32)


TABLE = upright(
    ((50, 4, 30), (0, 20, 0)),
    *(((4, 40, 4), (x, -1, z)) for x in (-20, 20) for z in (-11, 11)),
)
"""A top on four legs, each its own mirror image's partner."""

CRATE = upright(((40, 30, 20), (0, 0, 0)))
HOLLOW = upright(((34, 30, 14), (0, 3, 0)))
"""A crate, and what makes it hollow: five walls, or two boxes."""
