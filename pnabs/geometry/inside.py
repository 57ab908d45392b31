"""Inside and outside of closed triangle meshes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import Bool, Float64, cell_centres


def winding_number(triangles: Float64, points: Float64) -> Float64:
    """The exact winding number of a closed mesh about each point, by solid angles.

    Meant for few points: time and memory grow with points times triangles.

    Parameters
    ----------
    triangles : (F, 3, 3) float64
        Outward faces count positive.
    points : (P, 3) float64

    Returns
    -------
    (P,) float64
        1 inside and 0 outside of a simple closed mesh.
    """
    a, b, c = np.moveaxis(triangles[None] - points[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
    numerator = np.einsum("pfi,pfi->pf", a, np.cross(b, c))
    denominator = (
        la * lb * lc
        + np.einsum("pfi,pfi->pf", a, b) * lc
        + np.einsum("pfi,pfi->pf", b, c) * la
        + np.einsum("pfi,pfi->pf", c, a) * lb
    )
    turns: Float64 = np.arctan2(numerator, denominator).sum(axis=1) / (2 * np.pi)
    return turns


def inside_grid(triangles: Float64, resolution: int) -> Bool:
    """Cells of the grid whose centre lies inside a closed mesh.

    Counts the signed crossings of a ray along z below each cell centre.  Rays through an
    edge or a vertex are counted once: every edge is compared by the same arithmetic in both
    its triangles, with half-open intervals.

    Parameters
    ----------
    triangles : (F, 3, 3) float64
        Closed, outward faces, in the normalised frame.
    resolution : int

    Returns
    -------
    (G, G, G) bool, x slowest
    """
    axis = cell_centres(resolution)
    counts = np.zeros((resolution, resolution, resolution + 1), dtype=np.int16)
    _count_crossings(np.ascontiguousarray(triangles, dtype=np.float64), axis, counts)
    return np.cumsum(counts[:, :, :resolution], axis=2) > 0


@kernel
def _edge_x(ax: float, ay: float, bx: float, by: float, y: float) -> float:
    """Where an edge meets the line at `y`; the same for the edge's two directions."""
    if ay > by or (ay == by and ax > bx):
        ax, ay, bx, by = bx, by, ax, ay
    return ax + (y - ay) / (by - ay) * (bx - ax)


@kernel
def _count_crossings(triangles: Float64, axis: Float64, counts: NDArray[np.int16]) -> None:
    """Add 1 at the first centre above a downward face, -1 at that above an upward face."""
    for f in range(len(triangles)):
        t = triangles[f]
        u, v = t[1] - t[0], t[2] - t[0]
        nx, ny, nz = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
        low, high = t[:, 2].min(), t[:, 2].max()
        first = np.searchsorted(axis, t[:, 1].min())
        last = np.searchsorted(axis, t[:, 1].max(), side="right")
        for j in range(first, last):
            y = axis[j]
            rising, falling = 0.0, 0.0
            for e in range(3):
                a, b = t[e], t[(e + 1) % 3]
                if a[1] <= y < b[1]:
                    rising = _edge_x(a[0], a[1], b[0], b[1], y)
                elif b[1] <= y < a[1]:
                    falling = _edge_x(a[0], a[1], b[0], b[1], y)
            # Round an upward face the edge that rises in y is at the larger x.  The line meets
            # two edges or none; in the latter case, and seen edge on, the interval is empty.
            sign = -1 if rising > falling else 1
            left, right = min(rising, falling), max(rising, falling)
            for i in range(np.searchsorted(axis, left), np.searchsorted(axis, right)):
                z = low
                if nz != 0:
                    z = t[0, 2] - (nx * (axis[i] - t[0, 0]) + ny * (y - t[0, 1])) / nz
                counts[i, j, np.searchsorted(axis, min(max(z, low), high), side="right")] += sign
