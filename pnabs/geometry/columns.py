"""Where the columns of the grid pierce a mesh: what insides and orientations are judged by.

Along each axis, every column of cell centres is a line; a face met from its front adds one
to all that lies behind it, from its back subtracts one.  Seen from either end of a line
this gives six signed counts a point, a coarse sample of the generalised winding number.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from pnabs.geometry.kernel import kernel
from pnabs.geometry.load import InvalidMeshError
from pnabs.geometry.types import GRID_SIDE, Float64, Int64, Mesh, Signs

LINE_OFFSET = (1.3e-7, 2.9e-7)
"""Lines are moved sideways by this, so that none runs along an edge of a modelled box."""

SLACK = 1e-9
"""What rounding can take a line away from where a face's side crosses its row."""

ONE_SIDED = 8
"""What a vote that its opposite contradicts counts beside itself."""

MAX_HITS = 2**24
"""Hits kept, at most: 25 bytes each.  Faces of a hundred times the shape's own size, laid over
each other by the thousand, have more; no mesh that somebody modelled comes near."""


Scalar = TypeVar("Scalar", bound=np.generic)


@dataclass(frozen=True, slots=True)
class Columns:
    """The hits of all lines with a mesh, by line and height.

    Attributes
    ----------
    resolution : int
        Lines along a side of the grid, G.
    starts : (3 G^2 + 1,) int64
        First hit of each line; the line through cells (i, j) of the two axes after `axis`,
        in cyclic order, is number (axis G + i) G + j.
    height : (H,) float64
        Coordinate along the line, ascending on each.
    face : (H,) int64
    front : (H,) int8
        1 where the line enters the solid if the face is oriented as in the mesh, else -1.
    """

    resolution: int
    starts: Int64
    height: Float64
    face: Int64
    front: Signs


def trace(mesh: Mesh, resolution: int) -> Columns:
    """Intersect all lines with a mesh in the normalised frame.

    Raises
    ------
    pnabs.geometry.load.InvalidMeshError
        If there are more than `MAX_HITS`.
    """
    # a face has at most as many hits as there are lines
    lines = 3 * resolution * resolution
    space = 4 * len(mesh.faces) + 2 * lines
    line, face = np.empty(space, dtype=np.int64), np.empty(space, dtype=np.int64)
    height, front = np.empty(space), np.empty(space, dtype=np.int8)
    step = GRID_SIDE / resolution
    seen, count = 0, 0
    while True:
        seen, count = _trace(
            *(mesh.vertices, mesh.faces, resolution, step, *LINE_OFFSET, seen, count),
            *(line, height, face, front),
        )
        if count > MAX_HITS:
            raise InvalidMeshError(
                f"large faces lie over each other too often: the lines of a {resolution}^3 grid "
                f"meet them more than {MAX_HITS:,} times"
            )
        if seen == len(mesh.faces):
            break
        space = 2 * space + lines
        line, face = _longer(line, space), _longer(face, space)
        height, front = _longer(height, space), _longer(front, space)
    line, face, height, front = line[:count], face[:count], height[:count], front[:count]
    starts, order = _sort(line, height, lines)
    return Columns(resolution, starts, height[order], face[order], front[order])


def _longer(array: NDArray[Scalar], space: int) -> NDArray[Scalar]:
    longer = np.empty(space, dtype=array.dtype)
    longer[: len(array)] = array
    return longer


def inside_votes(columns: Columns, signs: Signs) -> NDArray[np.int8]:
    """How many of six half-lines from each cell centre say inside, (G, G, G) int8.

    Plus `ONE_SIDED` for each axis along which just one of its two half-lines does.

    Parameters
    ----------
    columns : Columns
    signs : (F,) int8
        -1 for faces that are taken turned over.
    """
    votes = np.zeros((columns.resolution,) * 3, dtype=np.int8)
    _vote(columns.starts, columns.height, columns.face, columns.front, signs, votes)
    return votes


@kernel
def side_of(vertices: Float64, a: int, b: int, u: int, v: int, pu: float, pv: float) -> float:
    """Twice the signed area of edge and point in the (u, v) plane.

    Always evaluated from the lower to the higher vertex index, so that the two faces at an
    edge see the same number.
    """
    low, high = min(a, b), max(a, b)
    lu, lv = vertices[low, u], vertices[low, v]
    value: float = (vertices[high, u] - lu) * (pv - lv) - (vertices[high, v] - lv) * (pu - lu)
    return value if a < b else -value


@kernel
def left_of(value: float, vertices: Float64, a: int, b: int, u: int, v: int) -> bool:
    """Whether a point lies left of the edge a -> b.

    A point on the edge is decided as if it were moved by an infinitesimal step along u and
    a yet smaller one along v.  As that is one move for all edges, a line through a vertex
    is no exception.
    """
    if value != 0:
        return value > 0
    dv: float = vertices[b, v] - vertices[a, v]
    return dv < 0 or (dv == 0 and vertices[b, u] > vertices[a, u])


@kernel
def _trace(
    vertices: Float64,
    faces: Int64,
    cells: int,
    step: float,
    offset_u: float,
    offset_v: float,
    begin: int,
    count: int,
    line: Int64,
    height: Float64,
    face: Int64,
    front: Signs,
) -> tuple[int, int]:
    """Note the hits of faces from `begin` on while there is room: next face, and hits so far."""
    first = 0.5 * step - 0.5 * step * cells
    for f in range(begin, len(faces)):
        if count + 3 * cells * cells > len(line):
            return f, count
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        for axis in range(3):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            u0, u1, u2 = vertices[a, u], vertices[b, u], vertices[c, u]
            v0, v1, v2 = vertices[a, v], vertices[b, v], vertices[c, v]
            i_low = max(0, int(np.ceil((min(u0, u1, u2) - offset_u - first) / step)))
            i_high = min(cells - 1, int(np.floor((max(u0, u1, u2) - offset_u - first) / step)))
            if i_low > i_high:
                continue
            j_low = max(0, int(np.ceil((min(v0, v1, v2) - offset_v - first) / step)))
            j_high = min(cells - 1, int(np.floor((max(v0, v1, v2) - offset_v - first) / step)))
            if j_low > j_high:
                continue
            z0, z1, z2 = vertices[a, axis], vertices[b, axis], vertices[c, axis]
            for i in range(i_low, i_high + 1):
                pu = first + i * step + offset_u
                # where the face's sides meet the plane of this row of lines
                low, high = np.inf, -np.inf
                for side in range(3):
                    m = faces[f, side]
                    n = faces[f, (side + 1) % 3]
                    mu, nu = vertices[m, u], vertices[n, u]
                    if min(mu, nu) <= pu <= max(mu, nu):
                        mv, nv = vertices[m, v], vertices[n, v]
                        at = mv + (pu - mu) / (nu - mu) * (nv - mv) if mu != nu else mv
                        low, high = min(low, at), max(high, at)
                        if mu == nu:
                            low, high = min(low, nv), max(high, nv)
                begin = max(j_low, int(np.ceil((low - SLACK - offset_v - first) / step)))
                stop = min(j_high, int(np.floor((high + SLACK - offset_v - first) / step)))
                for j in range(begin, stop + 1):
                    pv = first + j * step + offset_v
                    ea = side_of(vertices, b, c, u, v, pu, pv)
                    eb = side_of(vertices, c, a, u, v, pu, pv)
                    ec = side_of(vertices, a, b, u, v, pu, pv)
                    left = left_of(ea, vertices, b, c, u, v)
                    if left_of(eb, vertices, c, a, u, v) != left:
                        continue
                    if left_of(ec, vertices, a, b, u, v) != left:
                        continue
                    total = ea + eb + ec
                    z = (ea * z0 + eb * z1 + ec * z2) / total if total != 0 else z0
                    line[count] = (axis * cells + i) * cells + j
                    height[count] = min(max(z, min(z0, z1, z2)), max(z0, z1, z2))
                    face[count] = f
                    # counter-clockwise from above: the front looks up the line, which leaves
                    front[count] = -1 if left else 1
                    count += 1
    return len(faces), count


@kernel
def _sort(line: Int64, height: Float64, lines: int) -> tuple[Int64, Int64]:
    """Where each line's hits start, and the hits' order by line and height."""
    starts = np.zeros(lines + 1, dtype=np.int64)
    for h in range(len(line)):
        starts[line[h] + 1] += 1
    for i in range(lines):
        starts[i + 1] += starts[i]
    order = np.empty(len(line), dtype=np.int64)
    filled = starts[:-1].copy()
    for h in range(len(line)):
        order[filled[line[h]]] = h
        filled[line[h]] += 1
    for i in range(lines):
        low, high = starts[i], starts[i + 1]
        gap = high - low
        while gap > 1:
            # Shell's sort: most lines have a few hits, and some may have thousands
            gap = max(1, gap * 5 // 11)
            for place in range(low + gap, high):
                h = order[place]
                hole = place
                while hole >= low + gap and height[order[hole - gap]] > height[h]:
                    order[hole] = order[hole - gap]
                    hole -= gap
                order[hole] = h
    return starts, order


@kernel
def _vote(
    starts: Int64,
    height: Float64,
    face: Int64,
    front: Signs,
    signs: Signs,
    votes: NDArray[np.int8],
) -> None:
    """Cumulate each line from both ends."""
    cells = votes.shape[0]
    step = GRID_SIDE / cells
    first = 0.5 * step - 0.5 * step * cells
    for axis in range(3):
        for i in range(cells):
            for j in range(cells):
                number = (axis * cells + i) * cells + j
                low, high = starts[number], starts[number + 1]
                if low == high:
                    continue
                whole = 0
                for h in range(low, high):
                    whole += front[h] * signs[face[h]]
                below, begin = 0, 0
                for h in range(low, high + 1):
                    stop = _cell_above(height[h], first, step, cells) if h < high else cells
                    said = (below > 0) + (below > whole)
                    if said == 1:
                        said += ONE_SIDED
                    if said > 0 and axis == 0:
                        for k in range(begin, stop):
                            votes[k, i, j] += said
                    elif said > 0 and axis == 1:
                        for k in range(begin, stop):
                            votes[j, k, i] += said
                    elif said > 0:
                        for k in range(begin, stop):
                            votes[i, j, k] += said
                    begin = stop
                    if h < high:
                        below += front[h] * signs[face[h]]


@kernel
def _cell_above(height: float, first: float, step: float, cells: int) -> int:
    """The first cell of a line whose centre isn't below a height; `cells` if there is none."""
    k = min(max(int(np.ceil((height - first) / step)), 0), cells)
    # as the centres are rounded, not as the quotient is
    while k > 0 and height <= first + (k - 1) * step:
        k -= 1
    while k < cells and height > first + k * step:
        k += 1
    return k
