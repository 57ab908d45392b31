"""Meshes whose solid is known, and ways to spoil them."""

from __future__ import annotations

import numpy as np
import trimesh

from pnabs.geometry.types import GRID_SIDE, Bool, Float64, Mesh

CELL = GRID_SIDE / 32


def as_mesh(shape: trimesh.Trimesh) -> Mesh:
    return Mesh(np.array(shape.vertices, dtype=np.float64), np.array(shape.faces, dtype=np.int64))


def merged(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]),
    )


def box(sides: tuple[float, float, float], centre: tuple[float, float, float] = (0, 0, 0)) -> Mesh:
    shape = trimesh.creation.box(sides)
    return Mesh(
        np.array(shape.vertices, dtype=np.float64) + centre, np.array(shape.faces, dtype=np.int64)
    )


def sheet(side: float = 1.0, height: float = 0.0) -> Mesh:
    """A square without thickness, facing -y."""
    half = side / 2
    corners = [[-half, height, -half], [half, height, -half], [half, height, half]]
    vertices = np.array([*corners, [-half, height, half]], dtype=np.float64)
    return Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int64))


def tube(radius: float = 0.4, height: float = 1.0) -> Mesh:
    """A cylinder along z without its caps."""
    shape = trimesh.creation.cylinder(radius, height, sections=48)
    sides = np.abs(shape.face_normals[:, 2]) < 0.5
    return Mesh(np.array(shape.vertices), np.array(shape.faces[sides], dtype=np.int64))


def chair_parts() -> list[Mesh]:
    """Overlapping closed boxes; symmetric along x alone."""
    seat = box((0.5, 0.09, 0.5))
    back = box((0.5, 0.5, 0.09), (0, 0.25, -0.2))
    legs = [box((0.09, 0.5, 0.09), (x, -0.25, z)) for x in (-0.2, 0.2) for z in (-0.2, 0.2)]
    return [seat, back, *legs]


def box_distance(points: Float64, sides: tuple[float, float, float], centre: Float64) -> Float64:
    """Signed distance of points to an axis-aligned box."""
    q = np.abs(points - centre) - np.array(sides) / 2
    return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)


def iou(a: Bool, b: Bool) -> float:
    return float(np.count_nonzero(a & b) / np.count_nonzero(a | b))


def spoil(mesh: Mesh, ways: str, rng: np.random.Generator) -> Mesh:
    """Do to a mesh what modellers and converters do: several ways joined by `+`."""
    vertices, faces = mesh.vertices, mesh.faces
    for way in ways.split("+"):
        chosen = rng.random(len(faces)) < 0.3
        if way == "flip":
            faces = np.where(chosen[:, None], faces[:, ::-1], faces)
        elif way == "invert":
            faces = faces[:, ::-1]
        elif way == "repeat":
            faces = np.concatenate([faces, faces[chosen]])
        elif way == "double":
            faces = np.concatenate([faces, faces[:, ::-1]])
        elif way == "shuffle":
            faces = rng.permutation(faces)
        elif way == "tear":
            faces = faces[rng.random(len(faces)) > 0.05]
        elif way == "unweld":
            vertices = vertices[faces].reshape(-1, 3)
            faces = np.arange(len(vertices)).reshape(-1, 3)
        else:
            raise ValueError(way)
    return Mesh(vertices, faces)
