"""How well a result agrees with a shape: volumes, distances, grids and pieces (METHOD, metrics).

The result may be anybody's: a mesh, and the boxes that it was made of where there are some.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from manifold3d import Manifold

from pnabs.geometry import deviation
from pnabs.geometry.exact import overlap
from pnabs.geometry.inside import inside_grid
from pnabs.geometry.manifolds import to_manifold, unit_cube
from pnabs.geometry.metrics import (
    connected_pieces,
    iou,
    open_space,
    predicted_occupancy,
    surface_distances,
)
from pnabs.geometry.orient import OrientedMesh, prepare
from pnabs.geometry.reference import Reference
from pnabs.geometry.sampling import draw_on_triangles
from pnabs.geometry.solid import voxelise
from pnabs.geometry.types import GRID_SIDE, Bool, Cuboids, Float64, Int64, Mesh

RESOLUTIONS = (32, 64, 128)

OUTER_POINTS = 10_000
"""Points of the shape's outer surface whose distance to the result is taken."""


@dataclass(frozen=True)
class Result:
    """A result in the shape's normalised frame.

    Attributes
    ----------
    vertices : (V, 3) float64
    faces : (F, 3) int64
        Outward; empty where nothing is left.
    boxes : (positives, negatives), optional
        Cuboids that the mesh was cropped from.
    min_side : float
        Cuboids with a shorter side took no part in the crop.
    """

    vertices: Float64
    faces: Int64
    boxes: tuple[Cuboids, Cuboids] | None = None
    min_side: float = 0.0
    _cells: dict[int, Bool] = field(default_factory=dict, repr=False)

    @property
    def is_empty(self) -> bool:
        """Whether there is no surface."""
        return len(self.faces) == 0

    @property
    def triangles(self) -> Float64:
        """Corner positions, (F, 3, 3) float64."""
        return self.vertices[self.faces]

    @cached_property
    def solid(self) -> Manifold | None:
        """The result as a solid; None where it isn't closed, or encloses nothing."""
        solid = None if self.is_empty else to_manifold(self.vertices, self.faces)
        return solid if solid is not None and solid.volume() > 0 else None

    @cached_property
    def area(self) -> float:
        """Of the surface, in normalised units."""
        a, b, c = np.moveaxis(self.triangles, 1, 0)
        return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)

    def occupancy(self, resolution: int) -> Bool:
        """Its cells on a grid, (G, G, G) bool, by the rule that favours thin parts of shapes.

        Of boxes, each positive counts with at least half a cell to every side; of a mesh, cells
        that its surface passes away from solid ones are solid too.
        """
        if resolution not in self._cells:
            self._cells[resolution] = self._voxelised(resolution)
        return self._cells[resolution]

    def _voxelised(self, resolution: int) -> Bool:
        if self.boxes is not None:
            return predicted_occupancy(*self.boxes, resolution, self.min_side)
        if self.is_empty:
            return np.zeros((resolution,) * 3, dtype=bool)
        return voxelise(self._prepared, resolution)

    @cached_property
    def _prepared(self) -> OrientedMesh:
        return prepare(Mesh(self.vertices, self.faces))

    @cached_property
    def beyond_grid(self) -> float:
        """Volume outside the grid, which no cell of it sees; 0 where the result isn't closed."""
        if self.is_empty or np.abs(self.vertices).max() <= GRID_SIDE / 2 or self.solid is None:
            return 0.0
        inside = self.solid ^ unit_cube().scale((GRID_SIDE,) * 3)
        return float(self.solid.volume() - inside.volume())


def score(
    reference: Reference, result: Result, *, samples: int, seed: int
) -> dict[str, float | int]:
    """All that is measured of a result.

    Parameters
    ----------
    reference : Reference
    result : Result
    samples : int
        Points on the result's surface.
    seed : int
        Of those points.

    Returns
    -------
    dict
        Lengths are shares of the longest side, those that end in `_units` in the input's units,
        Chamfer distances times 1000.  Exact volumes are there where shape and result are closed;
        distances are not where the result is empty, nor `out_*` where the shape's boundary
        wasn't kept.
    """
    found: dict[str, float | int] = {"closed": int(reference.boundary.not_exact == "")}
    points = _sample(result, samples, seed)
    found |= _grids(reference, result)
    found |= _paper(reference, result, points)
    found |= _distances(reference, result, points)
    found["beyond"] = beyond(reference, result.vertices)
    found["faces"] = len(result.faces)
    return found


def beyond(reference: Reference, vertices: Float64) -> float:
    """How far vertices (V, 3) leave the input's bounding box, 0 where they don't."""
    return float((np.abs(vertices) - reference.extent / 2).max(initial=0.0))


def _sample(result: Result, n: int, seed: int) -> Float64:
    if result.is_empty:
        return np.zeros((0, 3))
    return draw_on_triangles(result.triangles, n, np.random.default_rng(seed))[0]


def _grids(reference: Reference, result: Result) -> dict[str, float | int]:
    shapes = (reference.occupancy, reference.occupancy_64, reference.occupancy_128)
    found: dict[str, float | int] = {
        f"iou_{resolution}": iou(
            result.occupancy(resolution),
            shape,
            beyond=result.beyond_grid * (resolution / GRID_SIDE) ** 3,
        )
        for resolution, shape in zip(RESOLUTIONS, shapes, strict=True)
    }
    found["iou_mesh_64"] = iou(inside_grid(result.triangles, 64), reference.occupancy_64)
    found["open_space"] = open_space(reference.occupancy_64, result.occupancy(64), reference.hull)
    found["shape_pieces"] = reference.pieces
    found["result_pieces"] = connected_pieces(result.occupancy(64))
    return found


def _paper(reference: Reference, result: Result, points: Float64) -> dict[str, float | int]:
    names = ("cd_l1", "cd_l2", "cd_surface")
    values = surface_distances(reference.original, result.vertices, result.faces, points)
    return dict(zip(names, values, strict=True))


def _distances(reference: Reference, result: Result, points: Float64) -> dict[str, float | int]:
    found: dict[str, float | int] = {}
    boundary = reference.boundary
    out = None
    if reference.solid is not None and (result.solid is not None or result.is_empty):
        found |= {"volume_iou": 0.0, "covered": 0.0, "excess": 0.0}
        if result.solid is not None:
            both = overlap(reference.solid, result.solid)
            found |= {
                "volume_iou": both.volume_iou,
                "covered": both.covered,
                "excess": both.excess,
            }
            out = deviation.outward_exact(reference, both.outside, result.area, len(points))
    elif not result.is_empty and len(boundary.faces):
        out = deviation.outward(reference, result.triangles, points)
    if out is not None:
        found |= {"out_99": out.quantile, "out_max": out.largest}
    if result.is_empty:
        found["coverage"] = 0.0
    else:
        outer = reference.outer_points(OUTER_POINTS)
        far = deviation.missing(outer, result.vertices, result.faces)
        found["miss_99"] = float(np.quantile(far, deviation.QUANTILE))
        found["miss_max"] = float(far.max())
        found["coverage"] = float(np.mean(far <= deviation.NEAR))
    lengths = ("out_99", "out_max", "miss_99", "miss_max")
    units = {f"{name}_units": found[name] * reference.unit for name in lengths if name in found}
    return found | {name: value for name, value in units.items() if math.isfinite(value)}
