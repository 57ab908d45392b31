"""Distance fields of oriented meshes at cell centres."""

from __future__ import annotations

import numpy as np

from pnabs.geometry.kernel import kernel
from pnabs.geometry.orient import OrientedMesh
from pnabs.geometry.pieces import MOST_PIECES, boxes
from pnabs.geometry.solid import Voxels, voxelise_parts
from pnabs.geometry.types import GRID_SIDE, THETA_D, Float32, Float64, Int64

NUDGE = 1e-7
"""What replaces a distance whose sign would contradict the occupancy."""


def unsigned_distance(prepared: OrientedMesh, resolution: int) -> Float32:
    """Distance of cell centres to the surface, (G, G, G) float32, normalised units.

    Exact up to `THETA_D` plus one cell; farther out from the faces nearest to the
    neighbouring cells, which is never too small and rarely too large.
    """
    return _nearest(prepared, resolution)[0].astype(np.float32)


def signed_distance(
    prepared: OrientedMesh, resolution: int, voxels: Voxels | None = None
) -> Float32:
    """Distance of cell centres to the solid's surface, negative inside, (G, G, G) float32.

    A sheet has no inside: thin parts are thickened by half a cell to either side, so that
    the field is `|d| - cell / 2` at cells that are thin or nearest to a thin part, and the
    plain signed distance elsewhere.  The field is negative exactly where the solid is
    occupied.

    Parameters
    ----------
    prepared : OrientedMesh
    resolution : int
        Cells along a side of the grid, G.
    voxels : Voxels, optional
        The solid at the same resolution, if it is known already.
    """
    if voxels is None:
        voxels = voxelise_parts(prepared, resolution)
    distance, point = _nearest(prepared, resolution)
    cell = GRID_SIDE / resolution
    index = np.floor((point + GRID_SIDE / 2) / cell).astype(np.int64).clip(0, resolution - 1)
    near_thin = voxels.thin[index[..., 0], index[..., 1], index[..., 2]]
    outside = np.where(near_thin | voxels.thin, distance - cell / 2, distance)
    outside = np.where(voxels.thin, np.minimum(outside, -NUDGE), np.maximum(outside, NUDGE))
    field = np.where(voxels.core, -np.maximum(distance, NUDGE), outside)
    return np.asarray(field, dtype=np.float32)


def _nearest(prepared: OrientedMesh, resolution: int) -> tuple[Float64, Float64]:
    """Distance to, and position of, the nearest surface point: (G, G, G), (G, G, G, 3)."""
    cell = GRID_SIDE / resolution
    triangles = np.ascontiguousarray(prepared.mesh.triangles)
    squared = np.full((resolution, resolution, resolution), np.inf)
    nearest = np.full((resolution, resolution, resolution), -1, dtype=np.int64)
    point = np.zeros((resolution, resolution, resolution, 3))
    _band(triangles, prepared.normals, squared, nearest, point, cell, THETA_D + cell)
    distance = np.sqrt(squared)
    _spread(triangles, distance, nearest, point, cell, THETA_D + cell)
    return distance, point


@kernel
def _segment(px: float, py: float, pz: float, a: Float64, b: Float64) -> tuple[float, float, float]:
    """The point of segment a b nearest to p."""
    dx, dy, dz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    length = dx * dx + dy * dy + dz * dz
    t = 0.0
    if length > 0:
        t = ((px - a[0]) * dx + (py - a[1]) * dy + (pz - a[2]) * dz) / length
        t = min(max(t, 0.0), 1.0)
    return a[0] + t * dx, a[1] + t * dy, a[2] + t * dz


@kernel
def _closest(px: float, py: float, pz: float, triangle: Float64) -> tuple[float, float, float]:
    """The point of a triangle nearest to p, by the plane's barycentric coordinates."""
    a, b, c = triangle[0], triangle[1], triangle[2]
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    wx, wy, wz = px - a[0], py - a[1], pz - a[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    area = nx * nx + ny * ny + nz * nz
    beta = -1.0
    gamma = -1.0
    if area > 0:
        # components of w x v and u x w along the normal, over its length
        beta = (
            (wy * vz - wz * vy) * nx + (wz * vx - wx * vz) * ny + (wx * vy - wy * vx) * nz
        ) / area
        gamma = (
            (uy * wz - uz * wy) * nx + (uz * wx - ux * wz) * ny + (ux * wy - uy * wx) * nz
        ) / area
    if beta >= 0 and gamma >= 0 and beta + gamma <= 1:
        return (
            a[0] + beta * ux + gamma * vx,
            a[1] + beta * uy + gamma * vy,
            a[2] + beta * uz + gamma * vz,
        )
    bx, by, bz = _segment(px, py, pz, a, b)
    best = (bx - px) ** 2 + (by - py) ** 2 + (bz - pz) ** 2
    for side in range(2):
        qx, qy, qz = _segment(px, py, pz, c, b if side == 0 else a)
        squared = (qx - px) ** 2 + (qy - py) ** 2 + (qz - pz) ** 2
        if squared < best:
            best = squared
            bx, by, bz = qx, qy, qz
    return bx, by, bz


@kernel
def _band(
    triangles: Float64,
    normals: Float64,
    squared: Float64,
    nearest: Int64,
    point: Float64,
    cell: float,
    width: float,
) -> None:
    """Give every face to the cells within `width` of it."""
    cells = squared.shape[0]
    first = 0.5 * cell - 0.5 * cell * cells
    low = np.zeros(3, dtype=np.int64)
    high = np.zeros(3, dtype=np.int64)
    pieces = np.empty((MOST_PIECES, 2, 3))
    for f in range(len(triangles)):
        t = triangles[f]
        for piece in range(boxes(t[0], t[1], t[2], cell, pieces)):
            lo, hi = pieces[piece, 0], pieces[piece, 1]
            for axis in range(3):
                low[axis] = max(0, int(np.ceil((lo[axis] - width - first) / cell)))
                high[axis] = min(cells - 1, int(np.floor((hi[axis] + width - first) / cell)))
            _give(t, normals[f], f, lo, hi, low, high, squared, nearest, point, cell, width)


@kernel
def _give(
    t: Float64,
    normal: Float64,
    f: int,
    lo: Float64,
    hi: Float64,
    low: Int64,
    high: Int64,
    squared: Float64,
    nearest: Int64,
    point: Float64,
    cell: float,
    width: float,
) -> None:
    """Give a face to the cells of a range, as far as they are within `width` of a piece of it."""
    first = 0.5 * cell - 0.5 * cell * squared.shape[0]
    nx, ny, nz = normal[0], normal[1], normal[2]
    level = nx * t[0, 0] + ny * t[0, 1] + nz * t[0, 2]
    for i in range(low[0], high[0] + 1):
        px = first + i * cell
        gap_x = max(lo[0] - px, 0.0, px - hi[0])
        for j in range(low[1], high[1] + 1):
            py = first + j * cell
            gap_y = max(lo[1] - py, 0.0, py - hi[1])
            gap_xy = gap_x * gap_x + gap_y * gap_y
            for k in range(low[2], high[2] + 1):
                pz = first + k * cell
                best = squared[i, j, k]
                # neither the face's plane nor the piece's box may be farther than the best so far
                height = nx * px + ny * py + nz * pz - level
                gap_z = max(lo[2] - pz, 0.0, pz - hi[2])
                bound = max(height * height, gap_xy + gap_z * gap_z)
                if bound >= best or bound > width * width:
                    continue
                qx, qy, qz = _closest(px, py, pz, t)
                distance = (qx - px) ** 2 + (qy - py) ** 2 + (qz - pz) ** 2
                if distance < best:
                    squared[i, j, k] = distance
                    nearest[i, j, k] = f
                    point[i, j, k, 0] = qx
                    point[i, j, k, 1] = qy
                    point[i, j, k, 2] = qz


@kernel
def _spread(
    triangles: Float64,
    distance: Float64,
    nearest: Int64,
    point: Float64,
    cell: float,
    exact: float,
) -> None:
    """Hand nearest faces on from cells to their 26 neighbours, the nearest cells first.

    A face lies beyond the plane through its point nearest to a cell, across the way there.
    Where a neighbour has that plane no nearer than its best so far, it has the face no nearer
    either: all but a few are ruled out so.

    Parameters
    ----------
    distance : (N, N, N) float64
        inf where unknown.
    nearest : (N, N, N) int64
    point : (N, N, N, 3) float64
    cell : float
    exact : float
        Distances up to this are right already.
    """
    side = distance.shape[0]
    first = 0.5 * cell - 0.5 * cell * side
    flat, face, place = distance.ravel(), nearest.ravel(), point.reshape(-1, 3)
    known = flat <= exact
    buckets = int(2 * np.sqrt(3.0) * side) + 2
    # cells wait in lists, one for each half cell of distance
    head = np.full(buckets, -1, dtype=np.int64)
    space = 4 * len(flat)
    waiting = np.empty(space, dtype=np.int64)
    following = np.empty(space, dtype=np.int64)
    count = 0
    for c in range(len(flat)):
        if flat[c] < np.inf:
            b = int(2 * flat[c] / cell)
            waiting[count], following[count], head[b] = c, head[b], count
            count += 1
    done = np.zeros(len(flat), dtype=np.bool_)
    for b in range(buckets):
        while head[b] >= 0:
            c = waiting[head[b]]
            head[b] = following[head[b]]
            if done[c]:
                continue
            done[c] = True
            i, j, k = c // (side * side), c // side % side, c % side
            cx, cy, cz = first + i * cell, first + j * cell, first + k * cell
            qx, qy, qz = place[c, 0], place[c, 1], place[c, 2]
            wx, wy, wz = qx - cx, qy - cy, qz - cz
            here, f = flat[c], face[c]
            for x in range(max(i - 1, 0), min(i + 2, side)):
                px = first + x * cell
                for y in range(max(j - 1, 0), min(j + 2, side)):
                    py = first + y * cell
                    for z in range(max(k - 1, 0), min(k + 2, side)):
                        n = (x * side + y) * side + z
                        if known[n] or done[n] or face[n] == f:
                            continue
                        pz = first + z * cell
                        ahead = (qx - px) * wx + (qy - py) * wy + (qz - pz) * wz
                        if here > 0 and ahead >= flat[n] * here:
                            continue
                        tx, ty, tz = _closest(px, py, pz, triangles[f])
                        found = np.sqrt((tx - px) ** 2 + (ty - py) ** 2 + (tz - pz) ** 2)
                        if found >= flat[n]:
                            continue
                        flat[n], face[n] = found, f
                        place[n, 0], place[n, 1], place[n, 2] = tx, ty, tz
                        if count == space:
                            waiting = np.concatenate((waiting, waiting))
                            following = np.concatenate((following, following))
                            space *= 2
                        target = max(int(2 * found / cell), b)
                        waiting[count], following[count], head[target] = n, head[target], count
                        count += 1
