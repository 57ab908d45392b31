"""Signed crossings of grid rays: a winding number of a soup that holes hardly disturb.

Along each axis, every column of cell centres is a ray; a face met from its front adds one
to all cells behind it, from its back subtracts one.  Seen from either end of the column
this gives six signed counts a cell, a coarse sample of the generalised winding number.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import GRID_SIDE, Float32, Float64, Int64, Mesh

RAY_OFFSET = (1.3e-7, 2.9e-7)
"""Columns are moved sideways by this, so that no ray runs along an edge of a modelled box."""


def crossing_counts(
    mesh: Mesh, signs: NDArray[np.int8], resolution: int
) -> tuple[NDArray[np.int8], Float32]:
    """Count signed crossings for several orientations of the same faces at once.

    Parameters
    ----------
    mesh : Mesh
        Welded, in the normalised frame.
    signs : (K, F) int8
        For each orientation and face, -1 where the face is turned over.
    resolution : int
        Cells along a side of the grid, G.

    Returns
    -------
    votes : (K, G, G, G) int8
        How many of the six half-rays say inside (a positive count).
    winding : (K, G, G, G) float32
        Mean of the six counts.
    """
    count = len(signs)
    hits = np.zeros((count, 3, resolution, resolution, resolution + 1), dtype=np.int32)
    _rasterise(mesh.vertices, mesh.faces, signs, hits, GRID_SIDE / resolution, *RAY_OFFSET)
    votes = np.zeros((count, resolution, resolution, resolution), dtype=np.int8)
    total = np.zeros((count, resolution, resolution, resolution), dtype=np.int32)
    _accumulate(hits, votes, total)
    return votes, (total / 6).astype(np.float32)


@kernel
def _side(vertices: Float64, a: int, b: int, u: int, v: int, pu: float, pv: float) -> float:
    """Twice the signed area of edge and point in the (u, v) plane.

    Always evaluated from the lower to the higher vertex index, so that the two faces at an
    edge see the same number.
    """
    low, high = min(a, b), max(a, b)
    lu, lv = vertices[low, u], vertices[low, v]
    value: float = (vertices[high, u] - lu) * (pv - lv) - (vertices[high, v] - lv) * (pu - lu)
    return value if a < b else -value


@kernel
def _left(value: float, vertices: Float64, a: int, b: int, u: int, v: int) -> bool:
    """Whether a point lies left of the edge a -> b.

    A point on the edge is decided as if it were moved by an infinitesimal step along u and
    a yet smaller one along v.  As that is one move for all edges, a ray through a vertex
    is no exception.
    """
    if value != 0:
        return value > 0
    dv: float = vertices[b, v] - vertices[a, v]
    return dv < 0 or (dv == 0 and vertices[b, u] > vertices[a, u])


@kernel
def _rasterise(
    vertices: Float64,
    faces: Int64,
    signs: NDArray[np.int8],
    hits: NDArray[np.int32],
    step: float,
    offset_u: float,
    offset_v: float,
) -> None:
    """Add each face to every column it crosses, at the first cell centre behind the hit."""
    count = hits.shape[0]
    cells = hits.shape[2]
    first = 0.5 * step - 0.5 * step * cells
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        for axis in range(3):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            u0, u1, u2 = vertices[a, u], vertices[b, u], vertices[c, u]
            v0, v1, v2 = vertices[a, v], vertices[b, v], vertices[c, v]
            z0, z1, z2 = vertices[a, axis], vertices[b, axis], vertices[c, axis]
            i_low = max(0, int(np.ceil((min(u0, u1, u2) - offset_u - first) / step)))
            i_high = min(cells - 1, int(np.floor((max(u0, u1, u2) - offset_u - first) / step)))
            j_low = max(0, int(np.ceil((min(v0, v1, v2) - offset_v - first) / step)))
            j_high = min(cells - 1, int(np.floor((max(v0, v1, v2) - offset_v - first) / step)))
            for i in range(i_low, i_high + 1):
                pu = first + i * step + offset_u
                for j in range(j_low, j_high + 1):
                    pv = first + j * step + offset_v
                    ea = _side(vertices, b, c, u, v, pu, pv)
                    eb = _side(vertices, c, a, u, v, pu, pv)
                    ec = _side(vertices, a, b, u, v, pu, pv)
                    left = _left(ea, vertices, b, c, u, v)
                    if _left(eb, vertices, c, a, u, v) != left:
                        continue
                    if _left(ec, vertices, a, b, u, v) != left:
                        continue
                    total = ea + eb + ec
                    z = (ea * z0 + eb * z1 + ec * z2) / total if total != 0 else z0
                    z = min(max(z, min(z0, z1, z2)), max(z0, z1, z2))
                    k = min(max(int(np.ceil((z - first) / step)), 0), cells)
                    # counter-clockwise from above: the front looks up the ray, which leaves
                    sign = -1 if left else 1
                    for o in range(count):
                        hits[o, axis, i, j, k] += sign * signs[o, f]


@kernel
def _accumulate(hits: NDArray[np.int32], votes: NDArray[np.int8], total: NDArray[np.int32]) -> None:
    """Cumulate each column from both ends into votes and sums of the six counts."""
    cells = hits.shape[2]
    for o in range(hits.shape[0]):
        for axis in range(3):
            for i in range(cells):
                for j in range(cells):
                    column = hits[o, axis, i, j]
                    whole = column.sum()
                    below = 0
                    for k in range(cells):
                        below += column[k]
                        above = below - whole
                        if axis == 0:
                            x, y, z = k, i, j
                        elif axis == 1:
                            x, y, z = j, k, i
                        else:
                            x, y, z = i, j, k
                        votes[o, x, y, z] += (below > 0) + (above > 0)
                        total[o, x, y, z] += below + above
