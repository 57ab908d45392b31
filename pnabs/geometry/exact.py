"""Volumes of a shape and a result by exact booleans, without any grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from manifold3d import Manifold

from pnabs.geometry.manifolds import face_origins, to_arrays
from pnabs.geometry.types import Float64


@dataclass(frozen=True, slots=True)
class Overlap:
    """How two solids lie to each other.

    Attributes
    ----------
    volume_iou : float
        Intersection over union.
    covered : float
        Share of the shape inside the result.
    excess : float
        Volume of the result outside the shape, as a share of the shape's.
    outside : (K, 3, 3) float64
        The part of the result's surface that lies outside the shape, as triangles.
    """

    volume_iou: float
    covered: float
    excess: float
    outside: Float64


def overlap(shape: Manifold, result: Manifold) -> Overlap:
    """Compare a result with a shape of some volume."""
    result = result.as_original()
    beyond = result - shape
    whole, own, extra = shape.volume(), result.volume(), beyond.volume()
    common = own - extra
    vertices, faces = to_arrays(beyond)
    mine = faces[face_origins(beyond) == result.original_id()] if len(faces) else faces
    return Overlap(
        volume_iou=common / (whole + extra),
        covered=common / whole,
        excess=extra / whole,
        outside=vertices[mine] if len(mine) else np.zeros((0, 3, 3)),
    )
