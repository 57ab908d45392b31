"""How far a result stands out of a shape, and how far it misses it; exact, point to triangle.

Lengths are in the normalised frame, where they are shares of the shape's longest side.
"""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
from numpy.typing import NDArray

from pnabs.geometry.contains import Insides
from pnabs.geometry.reference import Reference
from pnabs.geometry.sampling import draw_on_triangles
from pnabs.geometry.types import Float64, Int64

NEAR = 0.01
"""A point of the shape's surface this near to the result is covered (METHOD, metrics)."""

QUANTILE = 0.99

LEAST_SAMPLES = 200
"""Points on the part of the result outside the shape, however small that part is."""


@dataclass(frozen=True, slots=True)
class Deviation:
    """Distances of many points, of which the share `beyond` isn't 0.

    Attributes
    ----------
    distance : (K,) float64
        Of points uniform on the part of a surface where it isn't 0 by definition.
    share : float
        That part, as a share of the whole surface.
    largest : float
    """

    distance: Float64
    share: float
    largest: float

    @property
    def quantile(self) -> float:
        """The 99th percentile over the whole surface."""
        if not len(self.distance) or self.share <= 1 - QUANTILE:
            return 0.0
        return float(np.quantile(self.distance, 1 - (1 - QUANTILE) / self.share))


def distances(
    points: Float64, vertices: NDArray[np.floating], faces: NDArray[np.integer]
) -> tuple[Float64, Int64]:
    """Exact distance from points (P, 3) to a triangle mesh, and the nearest face, (P,) each."""
    squared, face, _ = igl.point_mesh_squared_distance(
        np.ascontiguousarray(points, dtype=np.float64),
        np.ascontiguousarray(vertices, dtype=np.float64),
        np.ascontiguousarray(faces, dtype=np.int64),
    )
    return np.sqrt(np.maximum(squared, 0)), np.asarray(face, dtype=np.int64).reshape(-1)


def outward(reference: Reference, triangles: Float64, samples: Float64) -> Deviation:
    """How far the surface of a result stands out of a shape that has no exact solid.

    Inside is what the rule of the solid's cells says of the point itself; a sheet holds what is
    within half of its thickness.

    Parameters
    ----------
    reference : Reference
        With a boundary.
    triangles : (F, 3, 3) float64
        The result's.
    samples : (P, 3) float64
        Points uniform on them.
    """
    corners = np.unique(triangles.reshape(-1, 3), axis=0)
    distance = _beyond(reference, np.concatenate([samples, corners]))
    own = distance[: len(samples)]
    return Deviation(own[own > 0], float(np.mean(own > 0)), float(distance.max(initial=0.0)))


def outward_exact(reference: Reference, outside: Float64, area: float, n: int) -> Deviation:
    """How far the surface of a result stands out of a closed shape.

    Parameters
    ----------
    reference : Reference
        Of a closed shape.
    outside : (K, 3, 3) float64
        The part of the result's surface outside the exact solid, as triangles.
    area : float
        Of the whole surface.
    n : int
        Points that the whole surface would get.
    """
    a, b, c = np.moveaxis(outside, 1, 0)
    part = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
    if part <= 0:
        return Deviation(np.zeros(0), 0.0, 0.0)
    share = min(part / area, 1.0)
    count = max(round(n * share), LEAST_SAMPLES)
    points, _ = draw_on_triangles(outside, count, np.random.default_rng(0))
    corners = np.unique(outside.reshape(-1, 3), axis=0)
    boundary = reference.boundary
    found, _ = distances(np.concatenate([points, corners]), boundary.vertices, boundary.faces)
    return Deviation(found[:count], share, float(found.max()))


def _beyond(reference: Reference, points: Float64) -> Float64:
    """Distance from points to the solid of an open shape, 0 inside, (P,)."""
    boundary = reference.boundary
    outside = np.flatnonzero(~reference.holds(points))
    far, face = distances(points[outside], boundary.vertices, boundary.faces)
    thick = np.where(boundary.sheet[face], boundary.thickness / 2, 0.0)
    out = np.zeros(len(points))
    out[outside] = np.maximum(far - thick, 0.0)
    return out


def missing(points: Float64, vertices: Float64, faces: Int64) -> Float64:
    """Distance from points of a shape's surface to a result, 0 inside it, (P,).

    Parameters
    ----------
    points : (P, 3) float64
    vertices : (V, 3) float64
    faces : (F, 3) int64
        The result, outward; not empty.
    """
    outside = np.flatnonzero(~Insides(vertices, faces).in_closed(points))
    far = np.zeros(len(points))
    far[outside], _ = distances(points[outside], vertices, faces)
    return far
