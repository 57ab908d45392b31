"""What results are measured against: the shape's solid on grids, and its boundary as triangles."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray
from scipy import ndimage

from pnabs.geometry.closed import NotExact, closed_solid
from pnabs.geometry.contains import Insides
from pnabs.geometry.manifolds import to_arrays, to_manifold
from pnabs.geometry.metrics import OriginalSurface, connected_pieces, hull_occupancy
from pnabs.geometry.orient import OrientedMesh
from pnabs.geometry.sampling import draw_on_triangles, has_core_beside, near_to
from pnabs.geometry.solid import are_inside
from pnabs.geometry.types import Bool, Float32, Float64, Mesh
from pnabs.geometry.weld import weld

_ROUNDS = 4
_MOST = 16
_SEED = 17


@dataclass(frozen=True, slots=True)
class Boundary:
    """The shape's surface, as results are measured against it; normalised frame.

    Attributes
    ----------
    vertices : (V, 3) float32
    faces : (F, 3) int32
        Outward.  Of a closed model the boundary of its exact solid, else the oriented soup with
        its holes closed.
    sheet : (F,) bool
        Faces of a sheet: no solid lies on either side of them.
    thickness : float
        What a sheet counts as having, to both sides of its faces together.
    not_exact : str
        Empty for a closed model, else why it has no exact solid
        (`pnabs.geometry.closed.NotExact`).
    """

    vertices: Float32
    faces: NDArray[np.int32]
    sheet: Bool
    thickness: float
    not_exact: NotExact

    @property
    def triangles(self) -> Float64:
        """Corner positions, (F, 3, 3) float64."""
        return self.vertices.astype(np.float64)[self.faces]


def make_boundary(
    normalised: Mesh, prepared: OrientedMesh, core: Bool, *, limit: int, thickness: float
) -> Boundary:
    """The boundary of a shape.

    Parameters
    ----------
    normalised : Mesh
        In the normalised frame.
    prepared : OrientedMesh
        The same, oriented.
    core : (G, G, G) bool
        Core cells of the solid (`pnabs.geometry.solid.Voxels`).
    limit : int
        With more faces than this nothing is kept ("large").
    thickness : float
        What a sheet counts as having.
    """
    if len(normalised.faces) > limit:
        nothing = np.zeros((0, 3))
        return _rounded(nothing, nothing, np.zeros(0, dtype=bool), thickness, "large")
    solid, why = closed_solid(weld(normalised))
    if solid is not None:
        vertices, faces = to_arrays(solid)
        # What is kept must still be a solid once it is rounded.
        if len(faces) <= 2 * limit and to_manifold(vertices.astype(np.float32), faces) is not None:
            return _rounded(vertices, faces, np.zeros(len(faces), dtype=bool), thickness, "")
        why = "refused"
    mesh = prepared.mesh
    sheet = prepared.open_faces()
    sheet[sheet] = ~has_core_beside(mesh.triangles[sheet], prepared.normals[sheet], core)
    return _rounded(mesh.vertices, mesh.faces, sheet, thickness, why)


def _rounded(
    vertices: Float64, faces: NDArray[Any], sheet: Bool, thickness: float, why: NotExact
) -> Boundary:
    return Boundary(vertices.astype(np.float32), faces.astype(np.int32), sheet, thickness, why)


class Measurable(Protocol):
    """A shape with all that a `Reference` holds."""

    @property
    def occupancy(self) -> Bool: ...
    @property
    def occupancy_64(self) -> Bool: ...
    @property
    def occupancy_128(self) -> Bool: ...
    @property
    def surface(self) -> Float32: ...
    @property
    def boundary(self) -> Boundary: ...
    @property
    def transform(self) -> Float64: ...
    @property
    def extent(self) -> Float64: ...


@dataclass(frozen=True)
class Reference:
    """A shape as results are measured against it; normalised frame.

    Attributes
    ----------
    occupancy, occupancy_64, occupancy_128 : (G, G, G) bool
        The solid at cell centres, thin parts included.
    surface : (P, 6) float32
        Samples of its surface with normals, for the Chamfer distances.
    boundary : Boundary
    transform : (4, 4) float64
        Normalised frame -> the input's coordinates.
    extent : (3,) float64
        Sides of the bounding box, whose centre is the origin.
    """

    occupancy: Bool
    occupancy_64: Bool
    occupancy_128: Bool
    surface: Float32
    boundary: Boundary
    transform: Float64
    extent: Float64

    @classmethod
    def of(cls, shape: Measurable) -> Reference:
        """What is measured against, of `pnabs.geometry.fields.Fields` or a stored shape."""
        values: dict[str, Any] = {one.name: getattr(shape, one.name) for one in fields(cls)}
        return cls(**values)

    @property
    def unit(self) -> float:
        """Length of the longest side in the input's units."""
        return float(np.linalg.norm(self.transform[:3, 0]))

    @cached_property
    def solid(self) -> Manifold | None:
        """The exact solid of a closed model."""
        if self.boundary.not_exact:
            return None
        return to_manifold(self.boundary.vertices, self.boundary.faces)

    @cached_property
    def original(self) -> OriginalSurface:
        """The samples of the surface, as the Chamfer distances need them."""
        return OriginalSurface(self.surface)

    @cached_property
    def hull(self) -> Bool:
        """Cells in the convex hull of the solid, (64, 64, 64) bool."""
        return hull_occupancy(self.occupancy_64)

    @cached_property
    def pieces(self) -> int:
        """Connected pieces of the solid at 64^3."""
        return connected_pieces(self.occupancy_64)

    @cached_property
    def outside(self) -> Bool:
        """Cells that the outside reaches without passing a solid one, (128, 128, 128) bool."""
        # the grid is wider than the shape, so its rim is one component
        label, _ = ndimage.label(~self.occupancy_128)
        return np.asarray(label == label[0, 0, 0])

    @cached_property
    def insides(self) -> Insides:
        """Tells what the boundary holds."""
        return Insides(self.boundary.vertices, self.boundary.faces)

    def holds(self, points: Float64) -> Bool:
        """Points inside the boundary, by the rule of the solid's cells, (P,) bool."""
        return are_inside(self.insides.votes(points))

    def outer_points(self, n: int) -> Float64:
        """Points uniform on the surface that is seen from outside, at most n, (K, 3).

        Always the same ones.  All of the surface counts where none of it is seen.
        """
        if n not in self._points:
            self._points[n] = self._drawn(n)
        return self._points[n]

    @cached_property
    def _points(self) -> dict[int, Float64]:
        return {}

    def _drawn(self, n: int) -> Float64:
        if not len(self.boundary.faces):
            points = self.surface[:n, :3].astype(np.float64)
            seen = near_to(points, self.outside)
            return np.asarray(points[seen] if seen.any() else points)
        rng = np.random.default_rng(_SEED)
        triangles, wanted = self.boundary.triangles, n
        for _ in range(_ROUNDS):
            points, _ = draw_on_triangles(triangles, wanted, rng)
            places = np.flatnonzero(near_to(points, self.outside))
            if len(places) >= n:
                break
            wanted = min(int(1.2 * wanted * n / max(len(places), n / 8)), _MOST * n)
        chosen = np.sort(rng.permutation(places)[:n]) if len(places) else np.arange(n)
        return np.asarray(points[chosen])
