"""Whether points lie in a mesh, by the rays that decide for the cells of a solid.

A ray through a point runs along each axis.  Faces are found by a lattice across that axis, so a
point costs what lies over and under it, however many faces there are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pnabs.geometry.columns import ONE_SIDED, left_of, side_of
from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import Bool, Float64, Int64

_LATTICE = 64
"""Lattice cells along a side, to begin with."""

_MOST = 2**23
"""Entries of a lattice at most; large faces over each other by the thousand get a coarser one."""


@dataclass(frozen=True, slots=True)
class _Lattice:
    """Which faces lie over each cell of a square lattice across an axis."""

    axis: int
    low: Float64
    step: Float64
    cells: int
    starts: Int64
    face: NDArray[np.int32]


class Insides:
    """Tells which points an oriented mesh holds.

    Parameters
    ----------
    vertices : (V, 3) float64
    faces : (F, 3) int64
        Outward.
    """

    def __init__(self, vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> None:
        self._vertices = np.ascontiguousarray(vertices, dtype=np.float64)
        self._faces = np.ascontiguousarray(faces, dtype=np.int64)
        self._lattices: dict[int, _Lattice] = {}

    def votes(self, points: Float64, axes: tuple[int, ...] = (0, 1, 2)) -> NDArray[np.int8]:
        """How many half-rays from each point say inside, (P,) int8.

        Counted as `pnabs.geometry.columns.inside_votes` does for the cells of a grid.
        """
        votes = np.zeros(len(points), dtype=np.int8)
        if len(self._faces):
            points = np.ascontiguousarray(points, dtype=np.float64)
            for axis in axes:
                lattice = self._lattice(axis)
                _vote(
                    *(points, self._vertices, self._faces, lattice.axis),
                    *(lattice.low, lattice.step, lattice.cells),
                    *(lattice.starts, lattice.face, votes),
                )
        return votes

    def in_closed(self, points: Float64) -> Bool:
        """Points inside a closed mesh, (P,) bool."""
        return np.asarray(np.mod(self.votes(points, (2,)), ONE_SIDED) > 0)

    def _lattice(self, axis: int) -> _Lattice:
        if axis not in self._lattices:
            self._lattices[axis] = _build(self._vertices, self._faces, axis)
        return self._lattices[axis]


def _build(vertices: Float64, faces: Int64, axis: int) -> _Lattice:
    across = vertices[:, [(axis + 1) % 3, (axis + 2) % 3]]
    corners = across[faces]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    first, last = corners.min(axis=1), corners.max(axis=1)
    cells = _LATTICE
    while True:
        step = np.maximum((high - low) / cells, 1e-12)
        begin = np.clip((first - low) / step, 0, cells - 1).astype(np.int64)
        end = np.clip((last - low) / step, 0, cells - 1).astype(np.int64)
        if cells == 1 or (end - begin + 1).prod(axis=1).sum() <= _MOST:
            break
        cells //= 2
    starts, face = _fill(begin, end, cells)
    return _Lattice(axis, low, step, cells, starts, face)


@kernel
def _fill(begin: Int64, end: Int64, cells: int) -> tuple[Int64, NDArray[np.int32]]:
    """Where each cell's faces start, and the faces by cell."""
    starts = np.zeros(cells * cells + 1, dtype=np.int64)
    for f in range(len(begin)):
        for i in range(begin[f, 0], end[f, 0] + 1):
            for j in range(begin[f, 1], end[f, 1] + 1):
                starts[i * cells + j + 1] += 1
    for c in range(cells * cells):
        starts[c + 1] += starts[c]
    filled = starts[:-1].copy()
    face = np.empty(starts[-1], dtype=np.int32)
    for f in range(len(begin)):
        for i in range(begin[f, 0], end[f, 0] + 1):
            for j in range(begin[f, 1], end[f, 1] + 1):
                face[filled[i * cells + j]] = f
                filled[i * cells + j] += 1
    return starts, face


@kernel
def _vote(
    points: Float64,
    vertices: Float64,
    faces: Int64,
    axis: int,
    low: Float64,
    step: Float64,
    cells: int,
    starts: Int64,
    face: NDArray[np.int32],
    votes: NDArray[np.int8],
) -> None:
    """Add the votes of both half-rays along an axis."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    for p in range(len(points)):
        pu, pv, z = points[p, u], points[p, v], points[p, axis]
        i, j = int(np.floor((pu - low[0]) / step[0])), int(np.floor((pv - low[1]) / step[1]))
        if pu < low[0] or pv < low[1] or i > cells or j > cells:
            continue
        cell = min(i, cells - 1) * cells + min(j, cells - 1)
        below, whole = 0, 0
        for place in range(starts[cell], starts[cell + 1]):
            f = face[place]
            a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
            ea = side_of(vertices, b, c, u, v, pu, pv)
            eb = side_of(vertices, c, a, u, v, pu, pv)
            ec = side_of(vertices, a, b, u, v, pu, pv)
            left = left_of(ea, vertices, b, c, u, v)
            if left_of(eb, vertices, c, a, u, v) != left:
                continue
            if left_of(ec, vertices, a, b, u, v) != left:
                continue
            total = ea + eb + ec
            height = vertices[a, axis]
            if total != 0:
                height = (
                    ea * vertices[a, axis] + eb * vertices[b, axis] + ec * vertices[c, axis]
                ) / total
            # counter-clockwise from above: the front looks up the ray, which leaves
            front = -1 if left else 1
            whole += front
            if height <= z:
                below += front
        said = (below > 0) + (below > whole)
        if said == 1:
            said += ONE_SIDED
        votes[p] += said
