"""The difference volume V_delta = Vol(C+) - Vol(S), and its pre-process.

What the positive cuboids hold too much of a shape S: the input and the target of the
negative module (METHOD, "The difference volume and pre-process"; section 3.3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_erosion
from scipy.spatial import cKDTree

from pnabs import settings
from pnabs.geometry import cuboid
from pnabs.geometry.sampling import sample_interior
from pnabs.geometry.types import (
    GRID_SIDE,
    THETA_D,
    Bool,
    Cuboids,
    Float32,
    Float64,
    cell_centres,
    grid_points,
)

_SAMPLES_PER_FACE_VOXEL = 16
"""Density of the samples that stand for the boundary of the union of the positives."""
_MAX_BOUNDARY_SAMPLES = 60_000
"""Most of them, whatever the cuboids' size."""


@dataclass(frozen=True, slots=True)
class Difference:
    """The difference volume of one shape and its positives, in the normalised frame.

    Attributes
    ----------
    occupancy : (G, G, G) bool
        V_delta after pre-process, never empty.
    sdf : (G, G, G) float32
        max(sdf(C+), theta_d - sdf(S)), negative inside.
    surface : (P, 3) float32
        Points on its surface.
    interior : (Q, 3) float32
        Points uniform in its voxels.
    """

    occupancy: Bool
    sdf: Float32
    surface: Float32
    interior: Float32


def difference_volume(
    positives: Cuboids, occupancy: Bool, sdf: Float32, options: settings.Difference
) -> Bool:
    """V_delta after pre-process, all that the negative module reads (section 3.3).

    Parameters
    ----------
    positives : the predicted C+
    occupancy : (G, G, G) bool
        The shape S.
    sdf : (G, G, G) float32
        Its signed distance field.
    options : settings.Difference

    Returns
    -------
    (G, G, G) bool, possibly empty
    """
    volume = cuboid.voxelise(positives, len(occupancy), raise_thin=False) & ~occupancy
    if options.preprocess:
        boundary = volume & ~binary_erosion(volume)
        volume = volume & ~(boundary & (sdf < THETA_D))
    return volume


def difference(
    positives: Cuboids,
    occupancy: Bool,
    sdf: Float32,
    surface: Float32,
    options: settings.Difference,
    *,
    surface_points: int,
    interior_points: int,
    rng: np.random.Generator,
) -> Difference | None:
    """The pre-processed difference volume with its samples and its field (section 3.3).

    A voxel of V_delta is at its boundary if one of its six neighbours is not in V_delta;
    such a voxel is removed if it is nearer to the shape than theta_d.  Surface samples are
    taken within a voxel of each voxel kept: from the boundary of the union of the positives
    where that is nearer, else from the shape, moved outward by theta_d.  Without
    pre-process nothing is removed and theta_d is 0.

    Parameters
    ----------
    positives : the predicted C+
    occupancy : (G, G, G) bool
        The shape S.
    sdf : (G, G, G) float32
        Its signed distance field.
    surface : (P, 6) float32
        Points with outward normals on its surface.
    options : settings.Difference
    surface_points, interior_points : int
        How many samples of V_delta are drawn, with replacement if there are fewer.
    rng : numpy.random.Generator

    Returns
    -------
    Difference, or None where V_delta is empty: such a shape needs no negatives.
    """
    resolution = len(occupancy)
    theta = THETA_D if options.preprocess else 0.0
    volume = difference_volume(positives, occupancy, sdf, options)
    if not volume.any():
        return None

    points = grid_points(resolution)
    to_union = cuboid.union_sdf(points, positives).reshape(volume.shape)
    field = np.maximum(to_union, theta - sdf)
    candidates = _surface_candidates(
        positives, volume, to_union, sdf, surface, theta, options.points_per_voxel, rng
    )
    few = len(candidates) < surface_points
    drawn = rng.choice(len(candidates), surface_points, replace=few)
    return Difference(
        occupancy=volume,
        sdf=field.astype(np.float32),
        surface=candidates[drawn].astype(np.float32),
        interior=sample_interior(volume, interior_points, rng),
    )


def union_boundary(positives: Cuboids, n: int, rng: np.random.Generator) -> Float64:
    """About `n` points on the boundary of the union of the positives, at most `n`.

    Parameters
    ----------
    positives : Cuboids
    n : int
        Points over all faces; those inside another cuboid are then left out.
    rng : numpy.random.Generator

    Returns
    -------
    (M, 3) float64
    """
    side = positives.scale.astype(np.float64)
    areas = 2 * (side[:, 0] * side[:, 1] + side[:, 1] * side[:, 2] + side[:, 2] * side[:, 0])
    if not len(positives) or areas.sum() <= 0:
        return np.zeros((0, 3))
    counts = np.floor(n * areas / areas.sum()).astype(np.int64)
    samples = [
        cuboid.sample_surface(positives[i : i + 1], int(count), rng)[0, :, :3]
        for i, count in enumerate(counts)
    ]
    points = np.concatenate(samples).astype(np.float64)
    # A point's own cuboid gives 0 up to float32 rounding of the point.
    return points[cuboid.union_sdf(points, positives) > -1e-6]


def _surface_candidates(
    positives: Cuboids,
    volume: Bool,
    to_union: Float64,
    sdf: Float32,
    surface: Float32,
    theta: float,
    count: int,
    rng: np.random.Generator,
) -> Float64:
    voxel = GRID_SIDE / len(volume)
    side = positives.scale.astype(np.float64)
    area = 2 * float(np.sum(side * np.roll(side, 1, axis=1)))
    wanted = min(int(_SAMPLES_PER_FACE_VOXEL * area / voxel**2) + 1, _MAX_BOUNDARY_SAMPLES)
    on_union = union_boundary(positives, wanted, rng)
    moved = surface[:, :3].astype(np.float64) + theta * surface[:, 3:].astype(np.float64)

    voxels = np.argwhere(volume)
    centres = cell_centres(len(volume))[voxels]
    union_nearer = np.abs(to_union[volume]) < np.maximum(sdf[volume], 0)
    chosen = [
        _near(on_union, centres[union_nearer], count, voxel),
        _near(moved, centres[~union_nearer], count, voxel),
    ]
    found = np.concatenate(chosen)
    if not len(found):  # V_delta only where both surfaces are more than a voxel away
        found = _near(np.concatenate([on_union, moved]), centres, count, np.inf)
    return found


def _near(points: Float64, centres: Float64, count: int, radius: float) -> Float64:
    """The points among the `count` nearest within `radius` of some centre, each once."""
    if not len(points) or not len(centres):
        return np.zeros((0, 3))
    tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
    _, index = tree.query(centres, k=range(1, count + 1), distance_upper_bound=radius)
    index = np.unique(index)
    return points[index[index < len(points)]]
