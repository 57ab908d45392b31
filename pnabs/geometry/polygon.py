"""Polygons in space to triangles: the triangulation of least area, which of a flat one is right."""

from __future__ import annotations

import numpy as np

from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import Float64, Int64

LONGEST_EXACT = 128
"""Polygons of more corners aren't triangulated for least area: it costs n^3."""


@kernel
def doubled_area(a: Float64, b: Float64, c: Float64) -> float:
    """Twice the area of a triangle, from its corners (3,)."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return float(np.sqrt(nx * nx + ny * ny + nz * nz))


@kernel
def _normal(a: Float64, b: Float64, c: Float64) -> tuple[float, float, float, float]:
    """A triangle's unit normal, and twice its area."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    over = length if length > 0 else 1.0
    return nx / over, ny / over, nz / over, length


@kernel
def triangulate(
    vertices: Float64, polygon: Int64, beside: Float64, weight: float, faces: Int64
) -> None:
    """Triangles of least cost over a polygon, by dynamic programming (Barequet and Sharir 1995).

    The cost is twice the area, and for each side of the polygon its length times how far the
    triangle there turns from the face beside it, one less the cosine, times a weight.

    Parameters
    ----------
    vertices : (V, 3) float64
    polygon : (n,) int64
        Indices of its corners in order, at least three.
    beside : (n, 3) float64
        Unit normals of the faces beyond the sides, from each corner to the next.
    weight : float
        A length; with 0 the area alone counts.
    faces : (n - 2, 3) int64
        Filled with triangles that turn like the polygon.
    """
    n = len(polygon)
    cost = np.zeros((n, n))
    split = np.zeros((n, n), dtype=np.int64)
    side = np.zeros(n)
    for i in range(n):
        a, b = vertices[polygon[i]], vertices[polygon[(i + 1) % n]]
        side[i] = weight * np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)
    for span in range(2, n):
        for i in range(n - span):
            k = i + span
            best = np.inf
            # Of equals the last is taken: on a convex polygon that is a fan about corner 0.
            for j in range(k - 1, i, -1):
                known = cost[i, j] + cost[j, k]
                if known >= best:
                    continue
                x, y, z, found = _normal(
                    vertices[polygon[i]], vertices[polygon[j]], vertices[polygon[k]]
                )
                found += known
                if j == i + 1:
                    found += side[i] * (
                        1 - (x * beside[i, 0] + y * beside[i, 1] + z * beside[i, 2])
                    )
                if k == j + 1:
                    found += side[j] * (
                        1 - (x * beside[j, 0] + y * beside[j, 1] + z * beside[j, 2])
                    )
                if span == n - 1:
                    found += side[k] * (
                        1 - (x * beside[k, 0] + y * beside[k, 1] + z * beside[k, 2])
                    )
                if found < best:
                    best = found
                    split[i, k] = j
            cost[i, k] = best
    filled = 0
    stack = [(0, n - 1)]
    while len(stack) > 0:
        i, k = stack.pop()
        if k - i < 2:
            continue
        j = split[i, k]
        faces[filled, 0], faces[filled, 1], faces[filled, 2] = polygon[i], polygon[j], polygon[k]
        filled += 1
        stack.append((j, k))
        stack.append((i, j))
