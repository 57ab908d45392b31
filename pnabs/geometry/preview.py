"""A light copy of a mesh for pictures."""

from __future__ import annotations

import numpy as np

from pnabs.geometry.types import Int64, Mesh

_FINEST = 512


def preview(mesh: Mesh, max_faces: int) -> Mesh:
    """Decimate by vertex clustering until at most `max_faces` faces are left.

    The finest lattice (of up to 512 cells along the longest side) that leaves few enough
    faces is found by bisection.  Each cluster becomes the mean of its vertices.

    Parameters
    ----------
    mesh : Mesh
        At least one face.
    max_faces : int
        At least 1.
    """
    if len(mesh.faces) <= max_faces:
        return mesh
    best = None
    few, many = 0, _FINEST + 1
    while many - few > 1:
        cells = (few + many) // 2
        clustered = _cluster(mesh, cells)
        if len(clustered.faces) <= max_faces:
            few, best = cells, clustered
        else:
            many = cells
    if best is None or len(best.faces) == 0:
        return _largest(mesh, max_faces)
    return best


def _cluster(mesh: Mesh, cells: int) -> Mesh:
    """One vertex for each occupied cell of a lattice; faces that collapse or repeat are gone."""
    low = mesh.vertices.min(axis=0)
    side = float((mesh.vertices.max(axis=0) - low).max()) or 1.0
    lattice = np.floor((mesh.vertices - low) * (cells / side)).astype(np.int64)
    key = (lattice[:, 0] * (cells + 1) + lattice[:, 1]) * (cells + 1) + lattice[:, 2]
    _, index, count = np.unique(key, return_inverse=True, return_counts=True)
    vertices = np.stack(
        [np.bincount(index, weights=mesh.vertices[:, axis]) / count for axis in range(3)], axis=1
    )
    faces: Int64 = index[mesh.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    corners = np.sort(faces, axis=1)
    _, first = np.unique(
        (corners[:, 0] * len(vertices) + corners[:, 1]) * len(vertices) + corners[:, 2],
        return_index=True,
    )
    return Mesh(vertices, faces[np.sort(first)])


def _largest(mesh: Mesh, count: int) -> Mesh:
    """The faces of largest area, in their order."""
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return Mesh(mesh.vertices, mesh.faces[np.sort(np.argsort(-area, kind="stable")[:count])])
