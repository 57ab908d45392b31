"""Anybody's result as a `Result` in its shape's normalised frame.

Meshes are made solid as shapes are: components that are closed are united, whether they come in
one file or as one file a part.  What isn't closed stays as it is, turned outward as far as that
can be told.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from manifold3d import Manifold
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pnabs.formats import Abstraction
from pnabs.geometry import quaternion
from pnabs.geometry.closed import closed_components, closed_solid
from pnabs.geometry.crop import crop
from pnabs.geometry.load import InvalidMeshError, has_area
from pnabs.geometry.manifolds import to_arrays, to_manifold, union
from pnabs.geometry.orient import prepare
from pnabs.geometry.score import Result
from pnabs.geometry.types import Cuboids, Float64, Int64, Mesh
from pnabs.geometry.weld import weld

THINNEST = 1e-6
"""Boxes with a shorter side, as a share of the shape's longest, enclose nothing."""

LEAST_VOLUME = 1e-12
"""A body that encloses less, in the result's own normalised frame, is none."""

UNIFORM = 1e-9
"""Axes of a uniform scale differ by at most this share."""

Frame = Literal["input", "normalised"]


@dataclass(frozen=True)
class Reading:
    """A result, and what its form tells.

    Attributes
    ----------
    result : Result
        In the shape's normalised frame.
    parts : int
        What it is made of: boxes, files of parts, or components of a mesh.
    positives, negatives : int or None
        Boxes of either kind, where it is boxes.
    bodies : int or None
        Connected bodies of its solid; None where it isn't closed.
    not_closed : str
        Why it bounds no exact solid; empty where it does.
    """

    result: Result
    parts: int
    positives: int | None = None
    negatives: int | None = None
    bodies: int | None = None
    not_closed: str = ""


def to_shape(frame: Frame, transform: Float64) -> Float64:
    """From the frame that a result is given in to the shape's normalised one, (4, 4).

    Parameters
    ----------
    frame
        `input` or `normalised`.
    transform : (4, 4) float64
        The shape's: normalised frame -> input.
    """
    return np.eye(4) if frame == "normalised" else inverse(transform)


def inverse(matrix: Float64) -> Float64:
    """Of a matrix (4, 4)."""
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def between_frames(own: Float64, transform: Float64) -> Float64:
    """From a normalised frame with a transform of its own to a shape's, (4, 4)."""
    if np.array_equal(own, transform):
        return np.eye(4)
    return np.asarray(inverse(transform) @ own)


def from_abstraction(abstraction: Abstraction, transform: Float64) -> Reading:
    """An abstraction as a result for a shape.

    Parameters
    ----------
    abstraction
        Of the shape, or of a mesh that was normalised otherwise: its own transform places it.
    transform : (4, 4) float64
        The shape's.

    Raises
    ------
    pnabs.geometry.load.InvalidMeshError
        When its transform makes nothing of it.
    """
    matrix = between_frames(abstraction.transform, transform)
    _check_matrix(matrix)
    solid = abstraction.solid
    mesh = moved(Mesh(solid.vertices.astype(np.float64), solid.faces.astype(np.int64)), matrix)
    positives = place(abstraction.positives, matrix)
    negatives = place(abstraction.negatives, matrix)
    boxes, min_side = None, 0.0
    if positives is not None and negatives is not None:
        boxes = positives, negatives
        min_side = abstraction.recipe.min_side * scale_of(matrix)
    counts = len(abstraction.positives), len(abstraction.negatives)
    result = Result(mesh.vertices, mesh.faces, boxes, min_side)
    return Reading(
        result, sum(counts), *counts, bodies=solid.pieces, not_closed=_not_closed(result)
    )


def from_boxes(positives: Float64, negatives: Float64, matrix: Float64) -> Reading:
    """Boxes of anybody as a result.

    Parameters
    ----------
    positives, negatives : (N, 10), (M, 10) float64
        Full sides, unit quaternion (w first), centre.
    matrix : (4, 4) float64
        From their frame to the shape's normalised one, a uniform scale and a translation.
    """
    added, removed = (_scaled(boxes, matrix) for boxes in (positives, negatives))
    mesh = crop(added, removed, min_side=THINNEST)
    counts = len(added), len(removed)
    result = Result(mesh.vertices, mesh.faces, (added, removed), THINNEST)
    return Reading(
        result, sum(counts), *counts, bodies=_bodies(result.solid), not_closed=_not_closed(result)
    )


def _scaled(boxes: Float64, matrix: Float64) -> Cuboids:
    """Boxes (N, 10) placed in double precision: float32 doesn't hold places far from the origin."""
    boxes = np.asarray(boxes, dtype=np.float64).reshape(-1, 10)
    placed = boxes.copy()
    placed[:, :3] *= scale_of(matrix)
    placed[:, 7:] = boxes[:, 7:] @ matrix[:3, :3].T + matrix[:3, 3]
    return Cuboids.from_vector(placed)


def place(cuboids: Cuboids, matrix: Float64) -> Cuboids | None:
    """Cuboids moved by a similarity (4, 4); None where it is none, which makes no cuboids."""
    if np.array_equal(matrix, np.eye(4)):
        return cuboids
    scale = scale_of(matrix)
    turn = matrix[:3, :3] / scale
    if not np.allclose(turn @ turn.T, np.eye(3), atol=UNIFORM) or np.linalg.det(turn) < 0:
        return None
    rotation = cuboids.rotation.astype(np.float64)
    if not np.allclose(turn, np.eye(3), atol=UNIFORM):
        rotation = quaternion.multiply(_quaternion(turn)[None], rotation)
    return Cuboids(
        (cuboids.scale.astype(np.float64) * scale).astype(np.float32),
        rotation.astype(np.float32),
        (cuboids.translation.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]).astype(
            np.float32
        ),
    )


def scale_of(matrix: Float64) -> float:
    """How much longer lengths become, at the mean."""
    return float(np.cbrt(abs(np.linalg.det(matrix[:3, :3]))))


def _quaternion(turn: Float64) -> Float64:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(turn).as_quat(scalar_first=True))


def moved(mesh: Mesh, matrix: Float64) -> Mesh:
    """A mesh moved by a matrix (4, 4), facing outward if it did."""
    if np.array_equal(matrix, np.eye(4)):
        return mesh
    vertices = mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    mirrored = np.linalg.det(matrix[:3, :3]) < 0
    faces = mesh.faces[:, ::-1] if mirrored else mesh.faces
    return Mesh(vertices, np.ascontiguousarray(faces))


def from_meshes(meshes: Sequence[Mesh], matrix: Float64) -> Reading:
    """A mesh, or the union of several, as a result.

    Parameters
    ----------
    meshes
        Of one, each component counts as a part; of several, each mesh.
    matrix : (4, 4) float64
        From their frame to the shape's normalised one.

    Raises
    ------
    pnabs.geometry.load.InvalidMeshError
        When no face has an area.
    """
    _check_matrix(matrix)
    # Tolerances are those of a normalised frame, and the shape's may lie elsewhere.
    used = [mesh.vertices[mesh.faces[has_area(mesh)].ravel()] for mesh in meshes]
    corners = np.concatenate(used)
    if not len(corners):
        raise InvalidMeshError("no face of non-zero area")
    low, high = corners.min(axis=0), corners.max(axis=0)
    own = np.eye(4) * float((high - low).max())
    own[:3, 3], own[3, 3] = low + (high - low) / 2, 1.0
    back = inverse(own)
    normalised = [moved(mesh, back) for mesh in meshes]
    solid, why = _united(normalised)
    exact = None if solid is None else Mesh(*to_arrays(solid))
    whole = exact or _turned_outward(_joined(normalised))
    parts = _components(normalised[0]) if len(meshes) == 1 else len(meshes)
    placed = moved(moved(whole, own), matrix)
    return Reading(
        Result(placed.vertices, placed.faces),
        parts,
        bodies=_bodies(solid),
        not_closed=why,
    )


def _united(meshes: Sequence[Mesh]) -> tuple[Manifold | None, str]:
    """The union of some meshes, or None and why there is none."""
    solids = []
    for mesh in meshes:
        faces = mesh.faces[has_area(mesh)]
        solid, why = (
            closed_solid(weld(Mesh(mesh.vertices, faces))) if len(faces) else (None, "empty")
        )
        if solid is None:
            solid = _by_own_components(Mesh(mesh.vertices, faces))
        if solid is None:
            return None, why
        solids.append(solid)
    whole = solids[0] if len(solids) == 1 else union(solids)
    return (whole, "") if whole.volume() > LEAST_VOLUME else (None, "empty")


def _by_own_components(mesh: Mesh) -> Manifold | None:
    """The union of components that share no vertices in the file, each closed by itself.

    Where they touch, welding joins them into what is no surface any more.
    """
    label = _labels(mesh.faces, len(mesh.vertices))
    count = int(label.max(initial=-1)) + 1
    if count < 2:
        return None
    solids = []
    for k in range(count):
        used, corners = np.unique(mesh.faces[label == k], return_inverse=True)
        solid = to_manifold(mesh.vertices[used], corners.reshape(-1, 3))
        if solid is None or solid.volume() <= LEAST_VOLUME:
            return None
        solids.append(solid)
    return union(solids)


def _labels(faces: Int64, vertices: int) -> Int64:
    """The component of each face, joined over common vertices."""
    a, b = faces[:, [0, 1]].T, faces[:, [1, 2]].T
    pairs = np.concatenate([a, b], axis=1)
    graph = coo_array((np.ones(pairs.shape[1], dtype=np.int8), pairs), shape=(vertices,) * 2)
    _, label = connected_components(graph, directed=False)
    used = label[faces[:, 0]] if len(faces) else np.zeros(0, dtype=np.int64)
    return np.asarray(np.unique(used, return_inverse=True)[1], dtype=np.int64)


def _components(mesh: Mesh) -> int:
    """Connected surfaces, in the file or after welding, whatever tells more apart."""
    faces = mesh.faces[has_area(mesh)]
    own = int(_labels(faces, len(mesh.vertices)).max(initial=-1)) + 1
    welded = weld(Mesh(mesh.vertices, faces))
    label = closed_components(welded.faces)
    if label is None:
        label = _labels(welded.faces, len(welded.vertices))
    count = int(label.max(initial=-1)) + 1
    # A file may hold each face with vertices of its own.
    return max(count, own) if own * 4 <= len(faces) else count


def _joined(meshes: Sequence[Mesh]) -> Mesh:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def _turned_outward(mesh: Mesh) -> Mesh:
    """A welded mesh, its faces as far as that can be told outward, without what closes holes."""
    faces = mesh.faces[has_area(mesh)]
    welded = weld(Mesh(mesh.vertices, faces))
    prepared = prepare(welded)
    return Mesh(prepared.mesh.vertices, prepared.mesh.faces[: len(welded.faces)])


def _bodies(solid: Manifold | None) -> int | None:
    """Connected bodies; a sealed void is part of the body around it."""
    if solid is None:
        return None
    return sum(bool(part.volume() > 0) for part in solid.decompose())


def _not_closed(result: Result) -> str:
    if result.solid is not None:
        return ""
    return "empty" if result.is_empty else "refused"


def _check_matrix(matrix: Float64) -> None:
    scale = scale_of(matrix) if np.isfinite(matrix).all() else float("nan")
    if not 1e-12 < scale < 1e12:
        raise InvalidMeshError("its transform makes nothing of it, or is not finite")
