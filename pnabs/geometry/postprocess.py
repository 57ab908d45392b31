"""The post-process of negative cuboids: tangent to the shape, useful, and not redundant.

METHOD, "Abstraction" step 2; section 3.3 of the paper.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pnabs import settings
from pnabs.geometry import cuboid
from pnabs.geometry.crop import croppable
from pnabs.geometry.tangent import largest_half_sides
from pnabs.geometry.types import GRID_SIDE, THETA_D, Bool, Cuboids, Float32, Float64

TOUCH = 1e-4
"""A surface sample no deeper in a cuboid than this touches it."""
_ROUNDING = 1e-6
"""Kept free of `TOUCH` for the rounding of side lengths to float32."""
_LATTICE = 16
"""Volumes are shares of a cuboid's lattice of this many points along each side."""
_VOXEL = GRID_SIDE / 32


@dataclass(frozen=True, slots=True)
class PostprocessReport:
    """What became of the negatives.

    `predicted` is the sum of the discarded, the suppressed and the kept.  `shrunk` and
    `grown` count before the rules that follow them, so some of those are discarded.

    Attributes
    ----------
    predicted, kept : int
    shrunk, grown : int
        Scaled to be tangent to the shape.
    discarded_deep : int
        A surface sample lies deeper in it than theta_d.
    discarded_overlap : int
        Too much of its volume lies in the shape, even after scaling.
    discarded_gap : int
        It is too far from the shape, even after scaling.
    discarded_idle : int
        Too thin to crop, or none of its volume in V_delta: it would remove nothing that
        ought to go (ours).
    suppressed : int
        It repeats one that removes more.
    """

    predicted: int
    shrunk: int = 0
    grown: int = 0
    discarded_deep: int = 0
    discarded_overlap: int = 0
    discarded_gap: int = 0
    discarded_idle: int = 0
    suppressed: int = 0
    kept: int = 0


def postprocess(
    negatives: Cuboids,
    surface: Float32,
    occupancy: Bool,
    difference: Bool,
    options: settings.Abstract,
) -> tuple[Cuboids, PostprocessReport]:
    """Make negatives tangent to the shape, discard the harmful and useless, suppress repeats.

    Parameters
    ----------
    negatives : the predicted C-
    surface : (P, 6) float32
        Samples of the shape's surface.
    occupancy : (G, G, G) bool
        The shape as a solid, at the finest resolution there is: a cuboid tangent to the shape
        must not count its stair-steps as overlap.
    difference : (K, K, K) bool
        V_delta after pre-process (`Difference.occupancy`).
    options : settings.Abstract

    Returns
    -------
    (Cuboids, PostprocessReport)
        Those kept, in the order predicted, each changed in scale alone and each half-side by
        at most theta_d; all of them untouched where `options.postprocess` is off.
    """
    total = len(negatives)
    if not options.postprocess:
        return negatives, PostprocessReport(predicted=total, kept=total)

    valid = croppable(negatives, 0.0)  # a thin one may still grow
    points = surface[:, :3].astype(np.float64)
    deepest = np.full(total, -np.inf)
    deepest[valid] = -_least_depth(points, negatives[valid])
    deep = deepest > THETA_D
    shrink = ~deep & (deepest > TOUCH)
    grow = valid & (deepest < 0)
    scaled = _scale_to_touch(negatives, points, shrink, grow)

    left = valid & ~deep & croppable(scaled, options.min_side)
    lattice = _lattice(scaled[left])
    overlap, gap, share = np.zeros(total), np.zeros(total), np.zeros(total)
    overlap[left] = _share_in(lattice, occupancy)
    gap[left] = np.maximum(_least_depth(points, scaled[left]), 0)
    share[left] = _share_in(lattice, difference)
    overlapping = left & (overlap > options.max_overlap)
    distant = left & ~overlapping & (gap > options.max_gap * _VOXEL)
    useful = left & ~overlapping & ~distant & (share > 0)

    candidates = np.flatnonzero(useful)
    kept = candidates[_suppress(scaled[candidates], share[candidates], options.suppression)]
    return scaled[kept], PostprocessReport(
        predicted=total,
        shrunk=int(shrink.sum()),
        grown=int(np.any(scaled.scale[grow] > negatives.scale[grow], axis=1).sum()),
        discarded_deep=int(deep.sum()),
        discarded_overlap=int(overlapping.sum()),
        discarded_gap=int(distant.sum()),
        discarded_idle=int((~deep & ~overlapping & ~distant & ~useful).sum()),
        suppressed=len(candidates) - len(kept),
        kept=len(kept),
    )


def _least_depth(points: Float64, cuboids: Cuboids) -> Float64:
    """Each cuboid's least signed distance to a point, (N,); infinite without points."""
    each = [cuboid.union_sdf(points, cuboids[i : i + 1]) for i in range(len(cuboids))]
    return np.array([one.min(initial=np.inf) for one in each])


def _scale_to_touch(negatives: Cuboids, points: Float64, shrink: Bool, grow: Bool) -> Cuboids:
    """Shrink or grow about the centre, along the own axes, to the largest that only touches."""
    scale = negatives.scale.copy()
    for i in np.flatnonzero(shrink | grow):
        one = negatives[i : i + 1]
        half = cuboid.half_sides(one)[0]
        low = np.maximum(half - THETA_D, 0) if shrink[i] else half
        high = half if shrink[i] else half + THETA_D
        found = largest_half_sides(
            np.abs(cuboid.local(points, one)[0]), low, high, TOUCH - _ROUNDING
        )
        scale[i] = 2 * found
    return Cuboids(scale, negatives.rotation, negatives.translation)


def _lattice(cuboids: Cuboids) -> Float64:
    """Points that each stand for the same share of their cuboid, (N, L^3, 3)."""
    axis = (np.arange(_LATTICE) + 0.5) / _LATTICE - 0.5
    unit = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    return cuboid.to_world(unit, cuboids)


def _share_in(points: Float64, grid: Bool) -> Float64:
    """The share of each row of points whose cell of the grid is set, (N,)."""
    cell = np.floor((points + GRID_SIDE / 2) * (len(grid) / GRID_SIDE)).astype(np.int64)
    within = np.all((cell >= 0) & (cell < len(grid)), axis=-1)
    x, y, z = np.moveaxis(np.clip(cell, 0, len(grid) - 1), -1, 0)
    return np.asarray((grid[x, y, z] & within).mean(axis=1))


def _suppress(cuboids: Cuboids, share: Float64, threshold: float) -> list[int]:
    """Non-maximum suppression by the volume removed from V_delta; indices kept, ascending."""
    lattice = _lattice(cuboids)
    common = np.array([cuboid.contains(points, cuboids).mean(axis=1) for points in lattice])
    kept: list[int] = []
    for i in np.argsort(-cuboid.volumes(cuboids) * share, kind="stable"):
        if all(max(common[i, j], common[j, i]) <= threshold for j in kept):
            kept.append(int(i))
    return sorted(kept)
