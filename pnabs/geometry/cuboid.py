"""Sets of cuboids: distances, membership, volumes, samples and meshes.

All functions calculate in float64 from the cuboids' float32 parameters.  A cuboid's
*local* coordinates are R^T (p - t): lengths are kept, the cuboid spans plus and minus
its half-sides (METHOD, cuboids; section 3.2).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from pnabs.geometry import quaternion
from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import (
    GRID_SIDE,
    Bool,
    Cuboids,
    Float32,
    Float64,
    Int64,
    Mesh,
    cell_centres,
)

UNIT_CORNERS: Float64 = (
    np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64) - 0.5
)
"""Corners of [-1/2, 1/2]^3, z fastest: (8, 3)."""

UNIT_FACES: Int64 = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5]),
        *([0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6]),
        *([0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ],
    dtype=np.int64,
)
"""Triangles over `UNIT_CORNERS`, counter-clockwise seen from outside: (12, 3)."""


def rotation_matrices(cuboids: Cuboids) -> Float64:
    """Rotations from local to world directions, (N, 3, 3) float64."""
    return quaternion.to_matrix(cuboids.rotation)


def half_sides(cuboids: Cuboids) -> Float64:
    """Half of each side length, (N, 3) float64."""
    return np.asarray(cuboids.scale.astype(np.float64) / 2)


def corners(cuboids: Cuboids) -> Float64:
    """World coordinates of the corners in the order of `UNIT_CORNERS`, (N, 8, 3) float64."""
    offsets = UNIT_CORNERS * cuboids.scale.astype(np.float64)[:, None]
    turned = offsets @ rotation_matrices(cuboids).swapaxes(1, 2)
    return np.asarray(turned + cuboids.translation.astype(np.float64)[:, None])


def volumes(cuboids: Cuboids) -> Float64:
    """Volume of each cuboid, (N,) float64."""
    return np.asarray(cuboids.scale.astype(np.float64).prod(axis=1))


def local(points: ArrayLike, cuboids: Cuboids) -> Float64:
    """Points in every cuboid's local coordinates.

    Parameters
    ----------
    points : (P, 3) float
    cuboids : N cuboids

    Returns
    -------
    (N, P, 3) float64
    """
    offsets = np.asarray(points, dtype=np.float64) - cuboids.translation.astype(np.float64)[:, None]
    return np.asarray(offsets @ rotation_matrices(cuboids))


def _excess(points: ArrayLike, cuboids: Cuboids) -> Float64:
    return np.asarray(np.abs(local(points, cuboids)) - half_sides(cuboids)[:, None])


def contains(points: ArrayLike, cuboids: Cuboids) -> Bool:
    """Whether each cuboid, its surface included, holds each point: (N, P) bool."""
    return np.asarray(np.all(_excess(points, cuboids) <= 0, axis=-1))


def distance(points: ArrayLike, cuboids: Cuboids) -> Float64:
    """Distance from each cuboid as a solid, 0 inside: (N, P) float64 (METHOD, cuboids)."""
    outside: Float64 = np.linalg.norm(np.maximum(_excess(points, cuboids), 0), axis=-1)
    return outside


def depth(points: ArrayLike, cuboids: Cuboids) -> Float64:
    """Signed distance to each cuboid's surface, negative inside, exact: (N, P) float64."""
    excess = _excess(points, cuboids)
    outside = np.linalg.norm(np.maximum(excess, 0), axis=-1)
    return np.asarray(outside + np.minimum(excess.max(axis=-1), 0))


def union_sdf(points: ArrayLike, cuboids: Cuboids) -> Float64:
    """Signed distance to the union of the cuboids: the least of their signed distances.

    Exact outside.  Inside, the distance to the union's boundary is at least the absolute
    value returned.  Infinite where there are no cuboids.

    Parameters
    ----------
    points : (P, 3) float
    cuboids : N cuboids

    Returns
    -------
    (P,) float64
    """
    nearest = np.full(len(np.asarray(points)), np.inf)
    _lower_to_depths(
        np.ascontiguousarray(points, dtype=np.float64),
        rotation_matrices(cuboids),
        half_sides(cuboids),
        cuboids.translation.astype(np.float64),
        nearest,
    )
    return nearest


@kernel
def _lower_to_depths(
    points: Float64, matrices: Float64, halves: Float64, translations: Float64, nearest: Float64
) -> None:
    """Lower each point's value to its least signed distance to a cuboid."""
    for p in range(len(points)):
        for n in range(len(halves)):
            x, y, z = (
                points[p, 0] - translations[n, 0],
                points[p, 1] - translations[n, 1],
                points[p, 2] - translations[n, 2],
            )
            squared, inner = 0.0, -np.inf
            for j in range(3):
                along = x * matrices[n, 0, j] + y * matrices[n, 1, j] + z * matrices[n, 2, j]
                excess = abs(along) - halves[n, j]
                squared += max(excess, 0.0) ** 2
                inner = max(inner, excess)
            nearest[p] = min(nearest[p], np.sqrt(squared) if inner > 0 else inner)


def mirror(cuboids: Cuboids, axis: int) -> Cuboids:
    """The cuboids mirrored across the plane through the origin normal to `axis` (0 x, 1 y, 2 z)."""
    translation = cuboids.translation.copy()
    translation[:, axis] *= -1
    rotation = quaternion.mirror(cuboids.rotation, axis).astype(np.float32)
    return Cuboids(cuboids.scale.copy(), rotation, translation)


def to_world(unit: ArrayLike, cuboids: Cuboids) -> Float64:
    """Points of [-1/2, 1/2]^3 brought into each cuboid.

    Parameters
    ----------
    unit : (N, P, 3) or (P, 3) float
    cuboids : N cuboids

    Returns
    -------
    (N, P, 3) float64
    """
    offsets = np.asarray(unit, dtype=np.float64) * cuboids.scale.astype(np.float64)[:, None]
    turned = offsets @ rotation_matrices(cuboids).swapaxes(1, 2)
    return np.asarray(turned + cuboids.translation.astype(np.float64)[:, None])


def sample_volume(cuboids: Cuboids, n: int, rng: np.random.Generator) -> Float32:
    """`n` points uniform in the volume of each cuboid, (N, n, 3) float32."""
    unit = rng.random((len(cuboids), n, 3)) - 0.5
    return to_world(unit, cuboids).astype(np.float32)


def sample_surface(cuboids: Cuboids, n: int, rng: np.random.Generator) -> Float32:
    """`n` points uniform by area on the surface of each cuboid, with outward normals.

    Parameters
    ----------
    cuboids : N cuboids
        The points of one without area all lie on a side drawn at random.
    n : int
    rng : numpy.random.Generator

    Returns
    -------
    (N, n, 6) float32
        Position, then normal.
    """
    scale = cuboids.scale.astype(np.float64)
    areas = np.stack(
        [scale[:, 1] * scale[:, 2], scale[:, 2] * scale[:, 0], scale[:, 0] * scale[:, 1]], axis=1
    )
    total = areas.sum(axis=1, keepdims=True)
    share = np.where(total > 0, areas / np.where(total > 0, total, 1), 1 / 3)
    draw = rng.random((len(cuboids), n))
    axis = np.sum(draw[..., None] >= np.cumsum(share[:, :2], axis=1)[:, None], axis=-1)
    sign = np.where(rng.random((len(cuboids), n)) < 0.5, -1.0, 1.0)
    unit = rng.random((len(cuboids), n, 3)) - 0.5
    np.put_along_axis(unit, axis[..., None], (sign / 2)[..., None], axis=-1)
    normal = np.zeros_like(unit)
    np.put_along_axis(normal, axis[..., None], sign[..., None], axis=-1)
    normal = normal @ rotation_matrices(cuboids).swapaxes(1, 2)
    return np.concatenate([to_world(unit, cuboids), normal], axis=-1).astype(np.float32)


def to_mesh(cuboids: Cuboids) -> Mesh:
    """The boxes side by side, each closed and facing outward; not their union."""
    faces = UNIT_FACES + 8 * np.arange(len(cuboids), dtype=np.int64)[:, None, None]
    return Mesh(corners(cuboids).reshape(-1, 3), faces.reshape(-1, 3))


def voxelise(cuboids: Cuboids, resolution: int, *, raise_thin: bool) -> Bool:
    """Cells of the grid whose centre lies in a cuboid (METHOD, metrics).

    Parameters
    ----------
    cuboids : N cuboids
    resolution : int
        Cells along each side of the grid (`pnabs.geometry.types.GRID_SIDE` wide).
    raise_thin : bool
        Raise each half-side to at least half a cell, so that cuboids thinner than a cell
        meet cell centres; the reference solid favours its thin parts alike.

    Returns
    -------
    (G, G, G) bool, x slowest
    """
    occupancy = np.zeros((resolution,) * 3, dtype=np.bool_)
    centres = cell_centres(resolution)
    cell = GRID_SIDE / resolution
    halves = np.maximum(half_sides(cuboids), cell / 2) if raise_thin else half_sides(cuboids)
    matrices = rotation_matrices(cuboids)
    translations = cuboids.translation.astype(np.float64)
    reaches = np.einsum("nij,nj->ni", np.abs(matrices), halves)
    slack = 1e-9  # a bounding block a hair too large costs nothing, one too small costs cells
    first = np.searchsorted(centres, (translations - reaches - slack).ravel()).reshape(-1, 3)
    last = np.searchsorted(centres, (translations + reaches + slack).ravel()).reshape(-1, 3)
    for matrix, half, translation, low, high in zip(
        matrices, halves, translations, first, last, strict=True
    ):
        block = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
        x, y, z = (centres[block[k]] - translation[k] for k in range(3))
        inside = np.ones((len(x), len(y), len(z)), dtype=np.bool_)
        for j in range(3):
            plane = (x * matrix[0, j])[:, None] + y * matrix[1, j]
            inside &= np.abs(plane[:, :, None] + z * matrix[2, j]) <= half[j]
        occupancy[block] |= inside
    return occupancy
