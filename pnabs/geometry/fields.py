"""Everything that is kept of a mesh: its solid, fields, samples and a preview."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pnabs.geometry.distance import signed_distance
from pnabs.geometry.kernel import compiling
from pnabs.geometry.mirror import detect_mirror
from pnabs.geometry.normalise import normalise
from pnabs.geometry.obj import parse_obj
from pnabs.geometry.off import parse_off
from pnabs.geometry.orient import prepare
from pnabs.geometry.ply import parse_ply
from pnabs.geometry.preview import preview
from pnabs.geometry.reference import Boundary, make_boundary
from pnabs.geometry.sampling import sample_interior, sample_surface
from pnabs.geometry.solid import voxelise, voxelise_parts
from pnabs.geometry.stl import parse_stl
from pnabs.geometry.types import GRID_SIDE, Bool, Float32, Float64, Mesh
from pnabs.settings import Ingest

RESOLUTION = 32
"""Grid of the networks' input and of the signed distance field."""

FINE_RESOLUTION = 64
"""Grid of the finer occupancy, for samples, the fit and the paper's metrics."""

FIT_RESOLUTION = 192
"""Grid on which the fit finds where the sides of boxes are."""

FINEST_RESOLUTION = 128
"""Grid that no box was fitted to, for metrics."""


_EVERY_KERNEL = b"""\
v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1
f 1 3 2\nf 1 2 4\nf 2 3 4
v 0 2 0\nv 1 2 0\nv .2 2.2 0\nv .1 3 0\nv 0 3 0
f 5 6 7 8 9
"""
"""A mesh that needs all that is compiled: one with a hole, and a sheet that isn't convex."""


_PLY = b"""ply
format %s 1.0
element vertex 3
property uchar x
property uchar y
property uchar z
element face 1
property list uchar uchar vertex_indices
end_header
"""

_OTHER_FORMATS: tuple[tuple[Callable[[bytes, int], Mesh], bytes], ...] = (
    (parse_off, b"OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
    (parse_stl, b"solid\nfacet\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendfacet\nendsolid"),
    *(
        (parse_ply, _PLY % form + body)
        for form, body in (
            (b"ascii", b"0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
            (b"binary_little_endian", bytes(9) + b"\3\0\1\2"),
        )
    ),
)


@dataclass(frozen=True, slots=True)
class Fields:
    """What ingest keeps of one model, all in the normalised frame.

    Attributes
    ----------
    occupancy : (32, 32, 32) bool
    occupancy_64 : (64, 64, 64) bool
    occupancy_128 : (128, 128, 128) bool
    occupancy_192 : (192, 192, 192) bool
    sdf : (32, 32, 32) float32
        Negative exactly where `occupancy` is set.
    surface : (P, 6) float32
        Points on the solid's surface and unit normals out of it.
    interior : (Q, 3) float32
        Points in the solid.
    transform : (4, 4) float64
        Normalised frame -> the input's coordinates.
    mirror : int
        Axis of the mirror symmetry, 0 x, 1 y, 2 z, -1 none.
    preview : (Fp, 3, 3) float16
        Corners of a decimated mesh's triangles.
    extent : (3,) float64
        Sides of the bounding box, whose centre is the origin.
    boundary : Boundary
        What exact volumes and distances are measured against.
    """

    occupancy: Bool
    occupancy_64: Bool
    occupancy_128: Bool
    occupancy_192: Bool
    sdf: Float32
    surface: Float32
    interior: Float32
    transform: Float64
    mirror: int
    preview: NDArray[np.float16]
    extent: Float64
    boundary: Boundary


def compute_fields(mesh: Mesh, settings: Ingest, layout: str, rng: np.random.Generator) -> Fields:
    """Turn a mesh into its fields (METHOD, shapes).  A pure function of its arguments.

    Parameters
    ----------
    mesh : Mesh
        In the input's coordinates, as `pnabs.geometry.load.parse_mesh` gives it.
    settings : Ingest
    layout : str
        Layout of the collection, which may fix the mirror axis.
    rng : numpy.random.Generator
        Source of the samples.

    Raises
    ------
    pnabs.geometry.load.InvalidMeshError
        If no face has non-zero area.
    """
    normalised, transform = normalise(mesh)
    prepared = prepare(normalised, settings.solid.open)
    coarse = voxelise_parts(prepared, RESOLUTION)
    fine = voxelise_parts(prepared, FINE_RESOLUTION)
    finest = voxelise_parts(prepared, FINEST_RESOLUTION)
    occupancy, occupancy_64 = coarse.occupancy, fine.occupancy
    return Fields(
        occupancy=occupancy,
        occupancy_64=occupancy_64,
        occupancy_128=finest.occupancy,
        occupancy_192=voxelise(prepared, FIT_RESOLUTION),
        sdf=signed_distance(prepared, RESOLUTION, coarse),
        surface=sample_surface(prepared, settings.surface_points, rng, fine.core),
        interior=sample_interior(occupancy_64, settings.interior_points, rng),
        transform=transform,
        mirror=detect_mirror(occupancy, settings.solid, layout),
        preview=preview(normalised, settings.preview_faces).triangles.astype(np.float16),
        extent=np.ptp(normalised.vertices, axis=0),
        boundary=make_boundary(
            normalised,
            prepared,
            finest.core,
            limit=settings.limits.exact_faces,
            thickness=settings.solid.sheet,
        ),
    )


def interpolate_sdf(sdf: Float32, points: NDArray[np.floating]) -> Float32:
    """A distance field at points, (P,) float32.

    Trilinear between cell centres; outside their hull, the value at the hull's nearest
    point plus the distance to it (METHOD, shapes).

    Parameters
    ----------
    sdf : (G, G, G) float32
        Values at the cell centres of the grid, x slowest.
    points : (P, 3) float
        Normalised frame.
    """
    resolution = len(sdf)
    position = (np.asarray(points, dtype=np.float64) + GRID_SIDE / 2) * (resolution / GRID_SIDE)
    position -= 0.5
    inside = np.clip(position, 0, resolution - 1)
    beyond = np.linalg.norm(position - inside, axis=1) * (GRID_SIDE / resolution)
    low = np.minimum(inside.astype(np.int64), resolution - 2)
    fraction = inside - low
    values: Float64 = beyond
    for corner in np.ndindex(2, 2, 2):
        weight = np.where(np.array(corner) == 1, fraction, 1 - fraction).prod(axis=1)
        values = values + weight * sdf[tuple((low + corner).T)]
    return np.asarray(values, dtype=np.float32)


def warm_up() -> None:
    """Compile, or load from the cache, every kernel that `compute_fields` runs.

    Call it once before processes are forked, so that each doesn't compile for itself.
    """
    with compiling():
        for parse, data in _OTHER_FORMATS:
            parse(data, 1)
        mesh = parse_obj(_EVERY_KERNEL, max_faces=100)
        settings = Ingest(surface_points=1, interior_points=1)
        compute_fields(mesh, settings, "folder", np.random.default_rng(0))
