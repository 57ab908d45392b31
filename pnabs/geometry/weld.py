"""Polygon soup to a welded mesh: close vertices joined, repeated and degenerate faces dropped."""

from __future__ import annotations

import numpy as np

from pnabs.geometry.load import COLLINEAR
from pnabs.geometry.types import Bool, Float64, Int64, Mesh

WELD_TOLERANCE = 1e-6
"""Vertices this close are one, in the normalised frame."""


def weld(mesh: Mesh) -> Mesh:
    """Join vertices, drop degenerate faces and all but the first of faces with the same corners.

    Dropping repeated faces alone cures double-sided surfaces.  A mesh whose every face is
    thinner than the tolerance is returned as it is rather than empty.

    Parameters
    ----------
    mesh : Mesh
        In the normalised frame, at least one face of non-zero area.

    Returns
    -------
    Mesh
        Vertices in an order that depends on their positions only.
    """
    vertices, index = _join(mesh.vertices)
    faces = index[mesh.faces]
    faces = faces[~_degenerate(vertices, faces)]
    return Mesh(vertices, faces[_first_of_equals(faces)]) if len(faces) else mesh


def _join(vertices: Float64) -> tuple[Float64, Int64]:
    """One vertex for each occupied cell of a fine lattice, and each vertex' new index."""
    lattice = np.rint((vertices + 1.0) / WELD_TOLERANCE).astype(np.int64)
    if lattice.min(initial=0) >= 0 and lattice.max(initial=0) < 1 << 21:
        key = (lattice[:, 0] << 42) | (lattice[:, 1] << 21) | lattice[:, 2]
        _, first, index = np.unique(key, return_index=True, return_inverse=True)
    else:  # a result may reach far beyond its shape
        _, first, index = np.unique(lattice, axis=0, return_index=True, return_inverse=True)
    return np.ascontiguousarray(vertices[first]), index.reshape(-1)


def _degenerate(vertices: Float64, faces: Int64) -> Bool:
    """Faces with collinear or repeated corners, (F,) bool."""
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    longest = np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.asarray(doubled <= COLLINEAR * longest)


def _first_of_equals(faces: Int64) -> Int64:
    """Indices, ascending, of the first face of each set of three corners."""
    corners = np.sort(faces, axis=1)
    order = np.lexsort(corners.T)
    ranked = corners[order]
    new = np.ones(len(faces), dtype=bool)
    new[1:] = (ranked[1:] != ranked[:-1]).any(axis=1)
    return np.sort(order[new])
