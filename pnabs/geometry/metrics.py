"""The paper's measures: agreement on grids and Chamfer distances (section 4.3; METHOD, metrics).

Lengths are in the normalised frame (longest side 1), Chamfer distances times 1000.
"""

from __future__ import annotations

import igl
import numpy as np
from scipy import ndimage
from scipy.spatial import ConvexHull, cKDTree

from pnabs.geometry import cuboid
from pnabs.geometry.crop import croppable
from pnabs.geometry.types import Bool, Cuboids, Float32, Float64, Int64

_EQUAL_AREA_RADIUS = 1 / np.sqrt(np.log(2))
"""Radius of a disc of the area that falls to one of many random points on a surface, over
the median distance to the nearest neighbour (a Poisson process in the plane)."""


def iou(a: Bool, b: Bool, *, beyond: float = 0.0) -> float:
    """Intersection over union of two occupancies; 0 where both are empty.

    Parameters
    ----------
    a, b : (G, G, G) bool
    beyond : float
        Cells of either outside the grid, for the union.
    """
    union = np.count_nonzero(a | b) + beyond
    return float(np.count_nonzero(a & b) / union) if union else 0.0


def predicted_occupancy(
    positives: Cuboids, negatives: Cuboids, resolution: int, min_side: float
) -> Bool:
    """Cell centres in a positive, raised to a cell's thickness, and in no negative.

    Cuboids too thin to take part in the crop are left out here too.

    Returns
    -------
    (G, G, G) bool
    """
    added = positives[croppable(positives, min_side)]
    removed = negatives[croppable(negatives, min_side)]
    solid = cuboid.voxelise(added, resolution, raise_thin=True)
    return solid & ~cuboid.voxelise(removed, resolution, raise_thin=False)


def chamfer(points_a: Float64, points_b: Float64) -> tuple[float, float]:
    """Chamfer distances between two sets of surface samples.

    Parameters
    ----------
    points_a, points_b : (P, 3), (Q, 3) float

    Returns
    -------
    (cd_l1, cd_l2)
        Mean of the two directed mean distances, and sum of the two directed mean squares,
        both times 1000.  NaN where a set is empty.
    """
    if not len(points_a) or not len(points_b):
        return float("nan"), float("nan")
    there, _ = _nearest(_tree(points_b), points_a)
    back, _ = _nearest(_tree(points_a), points_b)
    return _chamfer(there, back)


def _chamfer(there: Float64, back: Float64) -> tuple[float, float]:
    l1 = 500 * (there.mean() + back.mean())
    l2 = 1000 * (np.square(there).mean() + np.square(back).mean())
    return float(l1), float(l2)


def _tree(points: Float64) -> cKDTree:
    return cKDTree(points, balanced_tree=False, compact_nodes=False)


def _nearest(tree: cKDTree, points: Float64) -> tuple[Float64, Int64]:
    distance, index = tree.query(points)
    return np.asarray(distance), np.asarray(index, dtype=np.int64)


class OriginalSurface:
    """Samples of a shape's surface, as the surface that results are measured against.

    Parameters
    ----------
    surface : (P, 6) float32
        Points and normals.
    """

    def __init__(self, surface: Float32) -> None:
        self.points: Float64 = surface[:, :3].astype(np.float64)
        self.normals: Float64 = surface[:, 3:].astype(np.float64)
        self.tree = _tree(self.points)
        spacing = np.median(self.tree.query(self.points, k=[2])[0]) if len(surface) > 1 else 0.0
        self.radius = float(_EQUAL_AREA_RADIUS * spacing)
        """Radius of the disc of surface that one sample stands for."""

    def to_surface(self, points: Float64, nearest: Float64, index: Int64) -> Float64:
        """Distance from points to the surface, through the disc of the nearest sample.

        A sample stands for a disc in its tangent plane.  On 20 models of six categories with
        10,000 samples each, the mean distance of points displaced by 0.005 to 0.04 errs by
        0.2e-3 and by 0.7e-3 at most; that of points on the surface itself comes out as 1.1e-3.
        Distances to the samples themselves are 2e-3 too large, and the 32^3 signed distance
        field, which gives thin sheets a thickness, errs by up to 5e-3.

        Parameters
        ----------
        points : (Q, 3) float64
        nearest : (Q,) float64
            Distance to the nearest sample.
        index : (Q,) int
            Which one it is.

        Returns
        -------
        (Q,) float64
        """
        offset = points - self.points[index]
        height = np.abs(np.einsum("qi,qi->q", offset, self.normals[index]))
        along = np.sqrt(np.maximum(np.square(nearest) - np.square(height), 0))
        return np.asarray(np.hypot(height, np.maximum(along - self.radius, 0)))


def surface_distances(
    original: OriginalSurface, vertices: Float64, faces: Int64, samples: Float64
) -> tuple[float, float, float]:
    """Chamfer distances between a shape and a result.

    Parameters
    ----------
    original : OriginalSurface
    vertices : (V, 3) float64
    faces : (F, 3) int64
        The result.
    samples : (Q, 3) float64
        Points uniform on the result's surface.

    Returns
    -------
    (cd_l1, cd_l2, cd_surface)
        The first two between samples (`chamfer`); the third is the mean of the two directed
        mean distances from samples to the other surface, exact towards the result and by
        `OriginalSurface.to_surface` towards the shape.  Times 1000; NaN for an empty result.
    """
    if not len(faces):
        return float("nan"), float("nan"), float("nan")
    there, index = _nearest(original.tree, samples)
    back, _ = _nearest(_tree(samples), original.points)
    towards_shape = original.to_surface(samples, there, index)
    squared, _, _ = igl.point_mesh_squared_distance(original.points, vertices, faces)
    towards_result = np.sqrt(squared)
    return *_chamfer(there, back), float(500 * (towards_shape.mean() + towards_result.mean()))


def hull_occupancy(occupancy: Bool) -> Bool:
    """Cells whose centre lies in the convex hull of the occupied cells, (G, G, G) bool.

    The hull is that of the whole cells, not of their centres.
    """
    if not occupancy.any():
        return np.zeros_like(occupancy)
    resolution = len(occupancy)
    columns = np.argwhere(np.any(occupancy, axis=2))
    low = np.argmax(occupancy, axis=2)[tuple(columns.T)]
    high = resolution - np.argmax(occupancy[:, :, ::-1], axis=2)[tuple(columns.T)]
    # The hull's corners are among the ends of the columns; here cell i spans i to i + 1.
    ends = np.concatenate([np.column_stack([columns, end]) for end in (low, high)])
    square = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0]])
    planes = np.unique(ConvexHull((ends[:, None] + square).reshape(-1, 3)).equations, axis=0)

    centre = np.arange(resolution) + 0.5
    # Each half-space bounds a column of cells from above, from below, or as a whole.
    level = planes[:, 0, None, None] * centre[:, None] + planes[:, 1, None, None] * centre
    level = -(level + planes[:, 3, None, None])
    slope = planes[:, 2]
    flat, slack = np.abs(slope) < 1e-9, 1e-9
    up, down = slope >= 1e-9, slope <= -1e-9
    top = (level[up] / slope[up, None, None]).min(axis=0)
    bottom = (level[down] / slope[down, None, None]).max(axis=0)
    within = np.all(level[flat] >= -slack, axis=0)
    height = (centre >= bottom[..., None] - slack) & (centre <= top[..., None] + slack)
    return np.asarray(height & within[..., None])


def connected_pieces(occupancy: Bool) -> int:
    """Pieces of a solid on a grid (G, G, G), joined over faces, edges and corners of cells."""
    return int(ndimage.label(occupancy, np.ones((3, 3, 3), dtype=bool))[1])


def open_space(occupancy: Bool, prediction: Bool, hull: Bool | None = None) -> float:
    """The share of the space in the shape's convex hull and outside the shape left open.

    Parameters
    ----------
    occupancy : (G, G, G) bool
        The shape, with at least one occupied cell.
    prediction : (G, G, G) bool
        The result.
    hull : (G, G, G) bool, optional
        `hull_occupancy` of the shape, if it is known already.

    Returns
    -------
    float
        1 for a convex shape, which has no such space to fill.
    """
    space = (hull_occupancy(occupancy) if hull is None else hull) & ~occupancy
    total = np.count_nonzero(space)
    return float(np.count_nonzero(space & ~prediction) / total) if total else 1.0
