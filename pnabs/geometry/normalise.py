"""The normalised frame: bounding-box centre at the origin, longest side 1."""

from __future__ import annotations

import numpy as np

from pnabs.geometry.load import InvalidMeshError, has_area
from pnabs.geometry.types import Float64, Mesh


def normalise(mesh: Mesh) -> tuple[Mesh, Float64]:
    """Move a mesh to the normalised frame (METHOD, shapes).

    Faces without area and vertices that no face uses are left out first, so that they
    don't count for the bounding box.

    Returns
    -------
    Mesh
        In the normalised frame.
    transform : (4, 4) float64
        Normalised frame -> the input's coordinates, a uniform scale and a translation.

    Raises
    ------
    InvalidMeshError
        If no face has non-zero area.
    """
    faces = mesh.faces[has_area(mesh)]
    if len(faces) == 0:
        raise InvalidMeshError("no face of non-zero area")
    used, faces = np.unique(faces, return_inverse=True)
    vertices = mesh.vertices[used]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    centre, side = low + (high - low) / 2, float((high - low).max())
    transform = np.diag([side, side, side, 1.0])
    transform[:3, 3] = centre
    return Mesh((vertices - centre) / side, faces.reshape(-1, 3).astype(np.int64)), transform
