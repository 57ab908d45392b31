"""Mesh files to arrays: bytes in, one validated triangle mesh out.

No path is ever opened here; the caller reads the bytes, from a folder or an archive.
Materials and textures are never read.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pnabs.geometry.gltf import GltfError, parse_gltf
from pnabs.geometry.obj import ObjError, parse_obj
from pnabs.geometry.off import OffError, parse_off
from pnabs.geometry.ply import PlyError, parse_ply
from pnabs.geometry.polygon import PolygonError, TooManyFacesError
from pnabs.geometry.stl import StlError, parse_stl
from pnabs.geometry.types import Bool, Float64, Int64, Mesh
from pnabs.settings import Limits

SUFFIXES = (".obj", ".off", ".ply", ".stl", ".glb", ".gltf")
"""File suffixes that `parse_mesh` understands, lower case."""

EXTENT_RANGE = (1e-12, 1e12)
"""Longest sides of a bounding box that double precision can still work with."""

COLLINEAR = 1e-12
"""A face whose doubled area is this share of its longest side squared has no area."""


class InvalidMeshError(ValueError):
    """A file that holds no usable mesh; the message says what is wrong with it."""


def parse_mesh(
    data: bytes,
    suffix: str,
    limits: Limits,
    read_sibling: Callable[[str], bytes] | None = None,
) -> Mesh:
    """Read one mesh file.

    Parameters
    ----------
    data : bytes
        The file's content.
    suffix : str
        One of `SUFFIXES`, in any case: what the content claims to be.
    limits : Limits
        Size and face limits, checked before the cost is paid.
    read_sibling : callable, optional
        Gives the content of a file that a .gltf names, by its relative name.  It is the
        caller's to confine it to the dataset.  Without it, external buffers are an error.

    Returns
    -------
    Mesh
        Faces of all parts together, in the file's coordinates, with at least one face
        of non-zero area.  Nothing is welded or removed.

    Raises
    ------
    InvalidMeshError
        If the file is too large, can't be read, or holds no usable mesh.
    """
    suffix = suffix.lower()
    if suffix not in SUFFIXES:
        raise InvalidMeshError(f"unknown suffix {suffix!r}; known are {', '.join(SUFFIXES)}")
    if len(data) > limits.max_bytes:
        raise InvalidMeshError(
            f"the file has {len(data):,} bytes, more than limits.max_bytes = {limits.max_bytes:,}"
        )
    if not data.strip():
        raise InvalidMeshError("the file is empty")
    data = data.removeprefix(b"\xef\xbb\xbf")
    try:
        mesh = _read(data, suffix, limits, read_sibling)
    except TooManyFacesError:
        raise InvalidMeshError(
            f"the mesh has more than limits.max_faces = {limits.max_faces:,} faces"
        ) from None
    except MemoryError:
        raise
    except InvalidMeshError:
        raise
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        raise InvalidMeshError(f"not a readable {suffix} file ({reason})") from error
    validate(mesh, limits)
    return mesh


def validate(mesh: Mesh, limits: Limits) -> None:
    """Raise `InvalidMeshError` unless the mesh is one that a solid can be made of.

    Checks the face limit, the range of indices, that vertices are finite, the extent
    (`EXTENT_RANGE`), and that a face of non-zero area is there.
    """
    vertices, faces = mesh.vertices, mesh.faces
    if len(faces) == 0:
        raise InvalidMeshError("no faces: the file is damaged, or holds points or lines only")
    if len(faces) > limits.max_faces:
        raise _too_many_faces(len(faces), limits)
    _check_indices(faces, len(vertices))
    finite = np.isfinite(vertices).all(axis=1)
    if not finite.all():
        raise InvalidMeshError(
            f"{np.count_nonzero(~finite):,} of {len(vertices):,} vertices are not finite numbers, "
            f"the first is vertex {int(np.argmin(finite))}"
        )
    solid_faces = has_area(mesh)
    if not solid_faces.any():
        raise InvalidMeshError(f"all {len(faces):,} faces have zero area")
    used = vertices[faces[solid_faces].ravel()]
    with np.errstate(over="ignore"):
        extent = float((used.max(axis=0) - used.min(axis=0)).max())
    if not EXTENT_RANGE[0] < extent < EXTENT_RANGE[1]:
        raise InvalidMeshError(
            f"the longest side is {extent:.3g}, outside {EXTENT_RANGE[0]:g} to {EXTENT_RANGE[1]:g}"
        )


def has_area(mesh: Mesh) -> Bool:
    """Which faces have non-zero area, (F,) bool.

    The cross product is taken of edges scaled to the mesh's extent, so that it neither
    underflows nor overflows for tiny or huge meshes.
    """
    corners = mesh.triangles
    with np.errstate(over="ignore", invalid="ignore"):
        edges: Float64 = corners[:, 1:] - corners[:, :1]
        scale = float(np.abs(edges).max(initial=0.0))
        if not 0.0 < scale < np.inf:
            # all faces are points, or coordinates so far apart that no check can save them
            return np.full(len(corners), scale > 0.0)
        edges = edges / scale
    longest = np.max(
        [(edge**2).sum(axis=1) for edge in (*np.moveaxis(edges, 1, 0), edges[:, 1] - edges[:, 0])],
        axis=0,
    )
    doubled = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    return np.asarray(doubled > COLLINEAR * longest)


def _check_indices(faces: Int64, vertex_count: int) -> None:
    low, high = int(faces.min(initial=0)), int(faces.max(initial=-1))
    if low < 0 or high >= vertex_count:
        raise InvalidMeshError(
            f"face indices run from {low} to {high}, but there are {vertex_count:,} vertices"
        )


def _too_many_faces(count: int, limits: Limits) -> InvalidMeshError:
    return InvalidMeshError(
        f"the mesh has {count:,} faces, more than limits.max_faces = {limits.max_faces:,}"
    )


def _read(
    data: bytes, suffix: str, limits: Limits, read_sibling: Callable[[str], bytes] | None
) -> Mesh:
    """The file's triangles, not yet validated."""
    try:
        if suffix == ".obj":
            return parse_obj(data, limits.max_faces)
        if suffix == ".off":
            return parse_off(data, limits.max_faces)
        if suffix == ".ply":
            return parse_ply(data, limits.max_faces)
        if suffix == ".stl":
            return parse_stl(data, limits.max_faces)
        if suffix == ".glb" and data[:4] != b"glTF":
            raise GltfError("it doesn't begin with glTF")
        parts = parse_gltf(data, limits.max_faces, limits.max_bytes, read_sibling)
    except (GltfError, ObjError, OffError, PlyError, PolygonError, StlError) as error:
        raise InvalidMeshError(str(error)) from error.__cause__
    return _concatenate(parts)


def _concatenate(parts: list[tuple[Float64, Float64, Int64]]) -> Mesh:
    """Transformed parts (matrix, vertices, faces) side by side; mirrored ones turned right."""
    vertices, faces, start = [], [], 0
    for matrix, points, triangles in parts:
        identity = np.array_equal(matrix, np.eye(4))
        vertices.append(points if identity else points @ matrix[:3, :3].T + matrix[:3, 3])
        _check_indices(triangles, len(points))
        mirrored = not identity and np.linalg.det(matrix[:3, :3]) < 0
        faces.append((triangles[:, ::-1] if mirrored else triangles) + start)
        start += len(points)
    if not parts:
        return Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
    return Mesh(
        np.ascontiguousarray(np.concatenate(vertices)), np.ascontiguousarray(np.concatenate(faces))
    )
