"""Which cells of the grid a surface passes through: exact triangle and box overlap."""

from __future__ import annotations

import numpy as np

from pnabs.geometry.kernel import kernel
from pnabs.geometry.pieces import MOST_PIECES, boxes
from pnabs.geometry.types import GRID_SIDE, Bool, Float64, Int64, Mesh

TOUCH = 1e-9
"""A face this close to a cell touches it: a face between two cells is in both."""


def surface_cells(mesh: Mesh, resolution: int) -> Bool:
    """Cells that a face touches, (G, G, G) bool, by the separating axis test."""
    touched = np.zeros((resolution, resolution, resolution), dtype=np.bool_)
    _mark(mesh.vertices, mesh.faces, touched, GRID_SIDE / resolution, TOUCH)
    return touched


@kernel
def _apart(p: float, q: float, r: float, reach: float) -> bool:
    """Whether three projections all lie beyond one end of [-reach, reach]."""
    return min(p, q, r) > reach or max(p, q, r) < -reach


@kernel
def _mark(vertices: Float64, faces: Int64, touched: Bool, step: float, tolerance: float) -> None:
    cells = touched.shape[0]
    origin = -0.5 * step * cells
    half = 0.5 * step + tolerance
    low = np.zeros(3, dtype=np.int64)
    high = np.zeros(3, dtype=np.int64)
    edges = np.zeros((3, 3))
    pieces = np.empty((MOST_PIECES, 2, 3))
    for f in range(len(faces)):
        p = vertices[faces[f, 0]]
        q = vertices[faces[f, 1]]
        r = vertices[faces[f, 2]]
        for axis in range(3):
            edges[0, axis] = q[axis] - p[axis]
            edges[1, axis] = r[axis] - q[axis]
            edges[2, axis] = p[axis] - r[axis]
        for piece in range(boxes(p, q, r, step, pieces)):
            for axis in range(3):
                start = pieces[piece, 0, axis] - tolerance - origin
                end = pieces[piece, 1, axis] + tolerance - origin
                low[axis] = min(max(int(np.floor(start / step)), 0), cells - 1)
                high[axis] = min(max(int(np.floor(end / step)), 0), cells - 1)
            _mark_box(p, q, r, edges, low, high, touched, origin, step, half)


@kernel
def _mark_box(
    p: Float64,
    q: Float64,
    r: Float64,
    edges: Float64,
    low: Int64,
    high: Int64,
    touched: Bool,
    origin: float,
    step: float,
    half: float,
) -> None:
    """Mark the cells of a box that a triangle touches."""
    if low[0] == high[0] and low[1] == high[1] and low[2] == high[2]:
        touched[low[0], low[1], low[2]] = True
        return
    nx = edges[0, 1] * edges[1, 2] - edges[0, 2] * edges[1, 1]
    ny = edges[0, 2] * edges[1, 0] - edges[0, 0] * edges[1, 2]
    nz = edges[0, 0] * edges[1, 1] - edges[0, 1] * edges[1, 0]
    reach = half * (abs(nx) + abs(ny) + abs(nz))
    for i in range(low[0], high[0] + 1):
        cx = origin + (i + 0.5) * step
        px, qx, rx = p[0] - cx, q[0] - cx, r[0] - cx
        for j in range(low[1], high[1] + 1):
            cy = origin + (j + 0.5) * step
            py, qy, ry = p[1] - cy, q[1] - cy, r[1] - cy
            for k in range(low[2], high[2] + 1):
                if touched[i, j, k]:
                    continue
                cz = origin + (k + 0.5) * step
                pz, qz, rz = p[2] - cz, q[2] - cz, r[2] - cz
                if abs(nx * px + ny * py + nz * pz) > reach:
                    continue
                separated = False
                for e in range(3):
                    ex, ey, ez = edges[e, 0], edges[e, 1], edges[e, 2]
                    ax, ay, az = abs(ex), abs(ey), abs(ez)
                    # the edge crossed with the x, y and z axis
                    if (
                        _apart(
                            ey * pz - ez * py,
                            ey * qz - ez * qy,
                            ey * rz - ez * ry,
                            half * (ay + az),
                        )
                        or _apart(
                            ez * px - ex * pz,
                            ez * qx - ex * qz,
                            ez * rx - ex * rz,
                            half * (ax + az),
                        )
                        or _apart(
                            ex * py - ey * px,
                            ex * qy - ey * qx,
                            ex * ry - ey * rx,
                            half * (ax + ay),
                        )
                    ):
                        separated = True
                        break
                if not separated:
                    touched[i, j, k] = True
