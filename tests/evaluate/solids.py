"""Boxes whose volumes, overlaps and frames are arithmetic."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pnabs.geometry.cuboid import UNIT_CORNERS, UNIT_FACES
from pnabs.geometry.types import Mesh

QUICK = (
    *("--set", "ingest.surface_points=500", "--set", "ingest.interior_points=50"),
    *("--set", "ingest.preview_faces=50", "--set", "abstract.metric_samples=500"),
)
"""Arguments by which a model takes a tenth of a second."""

SETTINGS = {
    "ingest": {"surface_points": 500, "interior_points": 50, "preview_faces": 50},
    "abstract": {"metric_samples": 500},
}
"""The same for the library."""


def box(sides: Sequence[float] = (1, 1, 1), centre: Sequence[float] = (0, 0, 0)) -> Mesh:
    """A closed box, outward."""
    return Mesh(UNIT_CORNERS * np.array(sides) + np.array(centre), UNIT_FACES.copy())


def joined(*meshes: Mesh) -> Mesh:
    """Meshes side by side in one."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]),
    )


def moved(mesh: Mesh, turn: np.ndarray | None = None, scale: float = 1, shift: float = 0) -> Mesh:
    """A mesh turned about the origin, then scaled, then shifted along all axes."""
    vertices = mesh.vertices if turn is None else mesh.vertices @ np.asarray(turn).T
    return Mesh(vertices * scale + shift, mesh.faces)


def write(path: Path, mesh: Mesh) -> Path:
    """Write a mesh as OBJ."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (mesh.faces + 1).tolist()]
    path.write_text("\n".join(lines) + "\n")
    return path


def ell(centre: Sequence[float] = (0, 0, 0)) -> Mesh:
    """A solid that no rotation takes to itself: a long foot along x, a post up y, a toe along z.

    The foot is 4 x 1 x 1, the post 1 x 2 x 1 on its left end, the toe 1 x 1 x 1 in front of it.
    """
    parts = (
        box((4, 1, 1), (0, 0, 0)),
        box((1, 2, 1), (-1.5, 1.25, 0)),
        box((1, 1, 1), (-1.5, 0, 0.75)),
    )
    whole = joined(*parts)
    return Mesh(whole.vertices + np.array(centre), whole.faces)
