"""What an abstraction is measured by: its own score, and that of its positives alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pnabs import settings
from pnabs.geometry import cuboid
from pnabs.geometry.kernel import compiling
from pnabs.geometry.metrics import chamfer, iou, open_space, surface_distances
from pnabs.geometry.reference import Boundary, Reference
from pnabs.geometry.sampling import draw_on_triangles
from pnabs.geometry.score import Result, score
from pnabs.geometry.solidify import SolidMesh, SolidResult, make_solid, solidify
from pnabs.geometry.types import Bool, Cuboids, Float64

ALONE = (
    *("iou_32", "iou_64", "open_space"),
    *("cd_l1", "cd_l2", "cd_surface"),
)
"""Measures of the paper that are taken of the positives alone, too."""


def measure(
    positives: Cuboids,
    negatives: Cuboids,
    solid: SolidResult,
    reference: Reference,
    options: settings.Abstract,
    seeds: tuple[int, int],
) -> dict[str, float | int]:
    """All metrics of one abstraction.

    Parameters
    ----------
    positives, negatives : Cuboids
        As they were cropped.
    solid : SolidResult
        What `pnabs.geometry.solidify.solidify` made of them.
    reference : Reference
        The shape, as ingest keeps it.
    options : settings.Abstract
    seeds : (int, int)
        Of the points on the result's surface, and of those of another sampling of it.

    Returns
    -------
    dict
        All that `pnabs.geometry.score.score` finds; `bodies`, the connected solids of the written
        mesh; the measures of the paper for the positives alone, with the suffix `_positives`; and
        cd_l1_floor, cd_l2_floor, the distance between two samplings of the result.  All
        Chamfer distances of an empty result are NaN.
    """
    samples = options.metric_samples
    result = _result(solid.mesh, positives, negatives, options.min_side)
    found = score(reference, result, samples=samples, seed=seeds[0])
    found["bodies"] = solid.mesh.pieces
    again = [_sample(solid.mesh, samples, seed) for seed in seeds]
    found["cd_l1_floor"], found["cd_l2_floor"] = chamfer(*again)

    if not len(negatives):
        # Nothing was cropped: the positives alone are the result.
        return found | {f"{name}_positives": found[name] for name in ALONE}
    alone = make_solid(positives, Cuboids.empty(), replace(solid.recipe, jitter_attempt=0))
    uncropped = _result(alone, positives, Cuboids.empty(), options.min_side)
    for resolution, shape in ((32, reference.occupancy), (64, reference.occupancy_64)):
        found[f"iou_{resolution}_positives"] = iou(uncropped.occupancy(resolution), shape)
    found["open_space_positives"] = open_space(
        reference.occupancy_64, uncropped.occupancy(64), reference.hull
    )
    # The same seed for both: without negatives both have the same figures.
    distances = surface_distances(
        reference.original,
        uncropped.vertices,
        uncropped.faces,
        _sample(alone, samples, seeds[0]),
    )
    for name, value in zip(("cd_l1", "cd_l2", "cd_surface"), distances, strict=True):
        found[f"{name}_positives"] = value
    return found


def _result(mesh: SolidMesh, positives: Cuboids, negatives: Cuboids, min_side: float) -> Result:
    vertices, faces = mesh.vertices.astype(np.float64), mesh.faces.astype(np.int64)
    return Result(vertices, faces, (positives, negatives), min_side)


def _sample(mesh: SolidMesh, n: int, seed: int) -> Float64:
    if mesh.is_empty:
        return np.zeros((0, 3))
    return draw_on_triangles(mesh.triangles, n, np.random.default_rng(seed))[0]


def warm_up() -> None:
    """Load what the post-process, the check and the metrics need: kernels and libraries.

    Call it once before processes are forked, so that each doesn't load for itself.
    """
    with compiling():
        box = Cuboids.from_vector(np.array([[0.5, 0.5, 0.5, 1, 0, 0, 0, 0, 0, 0]]))
        rng = np.random.default_rng(0)
        options = settings.Abstract(metric_samples=8)
        solid = solidify(box, Cuboids.empty(), options, rng)

        def cells(resolution: int) -> Bool:
            return cuboid.voxelise(box, resolution, raise_thin=True)

        faces = solid.mesh.faces
        closed = Boundary(solid.mesh.vertices, faces, np.zeros(len(faces), bool), 0.005, "")
        reference = Reference(
            occupancy=cells(32),
            occupancy_64=cells(64),
            occupancy_128=cells(128),
            surface=cuboid.sample_surface(box, 8, rng)[0],
            boundary=closed,
            transform=np.eye(4),
            extent=np.full(3, 0.5),
        )
        measure(box, Cuboids.empty(), solid, reference, options, (0, 1))
