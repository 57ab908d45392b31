"""Sample models as Wavefront OBJ text, the same bytes everywhere."""

from __future__ import annotations

import itertools

import numpy as np

from pnabs.dataset.samples.parts import Part
from pnabs.geometry.types import Float64


def _lines(keyword: str, rows: Float64, digits: int) -> list[str]:
    # Rounding first and adding zero makes -0.0 positive, so that no sign of nothing is written.
    rounded = np.round(rows, digits) + 0.0
    return [f"{keyword} " + " ".join(f"{x:.{digits}f}" for x in row) for row in rounded.tolist()]


def _normal(corners: Float64) -> Float64:
    """Newell's normal of a polygon, (3,), of length 1; up for one without area."""
    normal: Float64 = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
    length = float(np.linalg.norm(normal))
    return normal / length if length > 1e-12 else np.array([0.0, 1.0, 0.0])


def obj_text(
    parts: tuple[Part, ...], *, keyword: str = "g", triangles: bool = False, shading: bool = False
) -> str:
    """The parts as OBJ.

    Parameters
    ----------
    keyword
        ``g`` or ``o``, the statement that names a part.
    triangles
        Whether polygons are cut into fans.
    shading
        Whether texture coordinates (the vertex seen from the front) and one normal a
        face are written, ``f v/vt/vn``.
    """
    lines: list[str] = []
    seen: dict[str, int] = {}
    normals: dict[str, int] = {}
    start = 1
    for part in parts:
        seen[part.name] = seen.get(part.name, 0) + 1
        lines.append(f"{keyword} {part.name}_{seen[part.name]}")
        lines += _lines("v", part.vertices, 6)
        if shading:
            lines += _lines("vt", part.vertices[:, :2] + 0.5, 4)
        for face in part.faces:
            end = ""
            if shading:
                normal = _lines("vn", _normal(part.vertices[list(face)])[None], 4)[0]
                if normal not in normals:
                    normals[normal] = len(normals) + 1
                    lines.append(normal)
                end = f"/{normals[normal]}"
            fans = [(face[0], a, b) for a, b in itertools.pairwise(face[1:])]
            for polygon in fans if triangles else [face]:
                corners = (
                    f"{i + start}/{i + start}{end}" if shading else f"{i + start}" for i in polygon
                )
                lines.append("f " + " ".join(corners))
        start += len(part.vertices)
    return "\n".join(lines) + "\n"
