"""Polygons in space to triangles: the triangulation of least area, which of a flat one is right."""

from __future__ import annotations

import manifold3d
import numpy as np

from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import Float64, Int64, Mesh

LONGEST_EXACT = 128
"""Rims of more corners aren't closed at least cost: that takes n^3 steps."""

LONGEST_BENT = 32
"""Polygons of more corners are taken to be flat, and triangulated in their plane."""


MOST_CORNERS = 10_000
"""Corners of a polygon that isn't convex: cutting it takes the square of them."""


class PolygonError(ValueError):
    """A polygon that can't be triangulated at a bearable cost."""


class TooManyFacesError(ValueError):
    """More triangles than allowed."""


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


def polygon_mesh(vertices: Float64, corners: Int64, starts: Int64) -> Mesh:
    """A mesh of polygons as a mesh of triangles.

    Quads are cut along the diagonal that gives less area, other polygons from their first
    corner where they are convex and for least area where not.  Polygons of more corners than
    `LONGEST_BENT` that aren't convex are triangulated in the plane that fits them best.

    Parameters
    ----------
    vertices : (V, 3) float64
    corners : (C,) int64
        Vertices of all polygons, one after another.
    starts : (P + 1,) int64
        First corner of each polygon, and their number; polygons have three corners or more.

    Raises
    ------
    PolygonError
        If one has more than `MOST_CORNERS` and isn't convex.
    """
    faces = np.empty((int((np.diff(starts) - 2).sum()), 3), dtype=np.int64)
    _triangulate_all(vertices, corners, starts, faces)
    for p in np.flatnonzero(np.diff(starts) > LONGEST_BENT):
        polygon = corners[starts[p] : starts[p + 1]]
        if np.isfinite(vertices[polygon]).all() and not _convex(vertices, polygon):
            if len(polygon) > MOST_CORNERS:
                raise PolygonError(
                    f"a polygon of {len(polygon):,} corners that isn't convex; "
                    f"at most {MOST_CORNERS:,} can be triangulated"
                )
            first = int(starts[p] - 2 * p)
            better = _in_plane(vertices, polygon)
            if better.shape == (len(polygon) - 2, 3):
                faces[first : first + len(better)] = better
    return Mesh(vertices, faces)


def _in_plane(vertices: Float64, polygon: Int64) -> Int64:
    """Triangles over a polygon, seen along its mean normal, (n - 2, 3) if it is simple there."""
    points = vertices[polygon] - vertices[polygon].mean(axis=0)
    scale = float(np.abs(points).max())
    points = points / (scale if scale > 0 else 1.0)
    normal = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    # two axes across the normal that turn as it says
    frame = np.linalg.svd(normal[None] if normal.any() else np.array([[0.0, 0.0, 1.0]]))[2]
    across = frame[1:]
    if np.dot(np.cross(across[0], across[1]), normal) < 0:
        across = across[::-1]
    return polygon[np.asarray(manifold3d.triangulate([points @ across.T]), dtype=np.int64)]


@kernel
def _convex(vertices: Float64, polygon: Int64) -> bool:
    """Whether all fan triangles about the first corner turn the same way."""
    n = len(polygon)
    a = vertices[polygon[0]]
    sx, sy, sz = 0.0, 0.0, 0.0
    for turn in range(2):
        for i in range(1, n - 1):
            b, c = vertices[polygon[i]], vertices[polygon[i + 1]]
            ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
            vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
            nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            if turn == 0:
                sx, sy, sz = sx + nx, sy + ny, sz + nz
            elif nx * sx + ny * sy + nz * sz < 0:
                return False
    return True


@kernel
def _triangulate_all(vertices: Float64, corners: Int64, starts: Int64, faces: Int64) -> None:
    filled = 0
    for p in range(len(starts) - 1):
        polygon = corners[starts[p] : starts[p + 1]]
        n = len(polygon)
        if n == 4:
            a, b = vertices[polygon[0]], vertices[polygon[1]]
            c, d = vertices[polygon[2]], vertices[polygon[3]]
            plain = _normal(a, b, c)[3] + _normal(a, c, d)[3]
            if _normal(a, b, d)[3] + _normal(b, c, d)[3] < plain * (1 - 1e-9):
                faces[filled, 0], faces[filled, 1] = polygon[0], polygon[1]
                faces[filled, 2] = polygon[3]
                faces[filled + 1, 0], faces[filled + 1, 1] = polygon[1], polygon[2]
                faces[filled + 1, 2] = polygon[3]
                filled += 2
                continue
        elif n > 4 and n <= LONGEST_BENT and not _convex(vertices, polygon):
            triangulate(vertices, polygon, np.zeros((n, 3)), 0.0, faces[filled : filled + n - 2])
            filled += n - 2
            continue
        for i in range(1, n - 1):
            faces[filled, 0], faces[filled, 1] = polygon[0], polygon[i]
            faces[filled, 2] = polygon[i + 1]
            filled += 1
