"""Meshes whose solid is known, and ways to spoil them."""

from __future__ import annotations

import numpy as np
import trimesh

from benchmarks.known_solids import concatenate
from pnabs.geometry.types import GRID_SIDE, Bool, Float64, Mesh

CELL = GRID_SIDE / 32


def as_mesh(shape: trimesh.Trimesh) -> Mesh:
    return Mesh(np.array(shape.vertices, dtype=np.float64), np.array(shape.faces, dtype=np.int64))


def merged(*meshes: Mesh) -> Mesh:
    return concatenate(meshes)


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
