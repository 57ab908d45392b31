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
def triangulate(vertices: Float64, polygon: Int64, faces: Int64) -> None:
    """Triangles of least total area over a polygon (Barequet and Sharir 1995).

    Parameters
    ----------
    vertices : (V, 3) float64
    polygon : (n,) int64
        Indices of its corners in order, at least three.
    faces : (n - 2, 3) int64
        Filled with triangles that turn like the polygon.
    """
    n = len(polygon)
    cost = np.zeros((n, n))
    split = np.zeros((n, n), dtype=np.int64)
    for span in range(2, n):
        for i in range(n - span):
            k = i + span
            best = np.inf
            # Of equals the last is taken: on a convex polygon that is a fan about corner 0.
            for j in range(k - 1, i, -1):
                area = (
                    cost[i, j]
                    + cost[j, k]
                    + doubled_area(vertices[polygon[i]], vertices[polygon[j]], vertices[polygon[k]])
                )
                if area < best:
                    best = area
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
