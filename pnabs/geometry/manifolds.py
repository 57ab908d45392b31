"""Meshes as solids of manifold3d, whose booleans are exact, and back."""

from __future__ import annotations

import os
from functools import cache

import numpy as np
from manifold3d import Error, Manifold, Mesh64, OpType
from numpy.typing import NDArray

from pnabs.geometry.types import Float64, Int64


@cache
def unit_cube() -> Manifold:
    """The cube that all boxes are made of; the first call holds manifold3d to one thread.

    It takes as many threads as the process has cores when it is first used, for good.  On
    meshes this small a second thread mostly spins: a tenth faster, at 1.7 times the CPU time,
    which the other workers of a batch lack.
    """
    if not hasattr(os, "sched_setaffinity"):
        return Manifold.cube((1.0, 1.0, 1.0), True)
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        return Manifold.cube((1.0, 1.0, 1.0), True)
    finally:
        os.sched_setaffinity(0, cores)


def to_manifold(vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> Manifold | None:
    """A closed mesh as a solid.

    Parameters
    ----------
    vertices : (V, 3) float
    faces : (F, 3) int
        Closed and oriented alike; outward faces give a positive volume.

    Returns
    -------
    Manifold or None
        None where manifold3d refuses the mesh.
    """
    unit_cube()
    solid = Manifold(
        Mesh64(
            np.ascontiguousarray(vertices, dtype=np.float64),
            np.ascontiguousarray(faces, dtype=np.uint64),
        )
    )
    return solid if solid.status() == Error.NoError else None


def to_arrays(solid: Manifold) -> tuple[Float64, Int64]:
    """Vertices (V, 3) and outward faces (F, 3) of a solid."""
    mesh = solid.to_mesh64()
    vertices = np.array(np.asarray(mesh.vert_properties)[:, :3], dtype=np.float64)
    return vertices, np.array(mesh.tri_verts, dtype=np.int64)


def face_origins(solid: Manifold) -> Int64:
    """For each face of a boolean's result, the `original_id` of the solid it was cut from, (F,)."""
    mesh = solid.to_mesh64()
    ends = np.asarray(mesh.run_index, dtype=np.int64) // 3
    return np.repeat(np.asarray(mesh.run_original_id, dtype=np.int64), ends[1:] - ends[:-1])


def union(solids: list[Manifold]) -> Manifold:
    """The union of some solids, not yet evaluated."""
    return Manifold.batch_boolean(solids, OpType.Add)


def difference(added: list[Manifold], removed: list[Manifold]) -> Manifold:
    """The union of some solids minus the union of others, not yet evaluated."""
    if not removed:
        return union(added)
    return Manifold.batch_boolean([union(added), union(removed)], OpType.Subtract)
