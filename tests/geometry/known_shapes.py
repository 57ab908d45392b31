"""Shapes whose volumes and distances are arithmetic, as meshes, and references made of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from pnabs.geometry.fields import compute_fields
from pnabs.geometry.reference import Reference
from pnabs.geometry.score import Result, score
from pnabs.geometry.types import Float64, Mesh
from pnabs.settings import Ingest

TURN = Rotation.from_euler("xyz", [20, 35, 50], degrees=True).as_matrix()


@dataclass(frozen=True)
class Block:
    """An axis-aligned box from one corner to the other."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]

    @property
    def volume(self) -> float:
        return float(np.prod(np.subtract(self.high, self.low)))

    def mesh(self) -> Mesh:
        box = trimesh.creation.box(bounds=[self.low, self.high])
        return Mesh(np.array(box.vertices, dtype=np.float64), np.array(box.faces, dtype=np.int64))


def block(x: float, y: float, z: float, at: tuple[float, float, float] = (0, 0, 0)) -> Block:
    """A box of these sides about a place."""
    half = np.array([x, y, z]) / 2
    return Block(tuple(np.subtract(at, half)), tuple(np.add(at, half)))


def joined(*meshes: Mesh) -> Mesh:
    """Meshes as one, side by side, not united."""
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + at for mesh, at in zip(meshes, first, strict=False)]),
    )


def of_blocks(*blocks: Block) -> Mesh:
    """The blocks' surfaces side by side."""
    return joined(*(one.mesh() for one in blocks))


def inverted(mesh: Mesh) -> Mesh:
    """The mesh inside out."""
    return Mesh(mesh.vertices, mesh.faces[:, ::-1].copy())


def turned(mesh: Mesh, matrix: Float64 = TURN) -> Mesh:
    """The mesh turned about the origin."""
    return Mesh(mesh.vertices @ matrix.T, mesh.faces)


def united(*meshes: Mesh) -> Mesh:
    """The union of closed meshes, as a result would be written."""
    whole = trimesh.boolean.union([trimesh.Trimesh(m.vertices, m.faces) for m in meshes])
    return Mesh(np.array(whole.vertices, dtype=np.float64), np.array(whole.faces, dtype=np.int64))


def pipe(outer: float, inner: float, height: float, sides: int) -> Mesh:
    """A prism of a regular polygon with a bore; radii are those of the corners."""
    made = trimesh.creation.annulus(inner, outer, height, sections=sides)
    return Mesh(np.array(made.vertices, dtype=np.float64), np.array(made.faces, dtype=np.int64))


def reference_of(mesh: Mesh, ingest: Ingest | None = None) -> Reference:
    """What results for a mesh are measured against."""
    fields = compute_fields(mesh, ingest or Ingest(), "folder", np.random.default_rng(0))
    return Reference.of(fields)


def measured(reference: Reference, result: Mesh) -> dict[str, float | int]:
    """The score of a result in the shape's own coordinates."""
    back = np.linalg.inv(reference.transform)
    vertices = result.vertices @ back[:3, :3].T + back[:3, 3]
    return score(reference, Result(vertices, result.faces), samples=10_000, seed=1)
