"""The checked mesh alone, in the input's coordinates: OBJ, PLY and STL.

Numbers are float64, or the shortest decimals that give the same float64: a mesh of a metre
placed a thousand kilometres from the origin keeps its shape and stays closed.  One so far
away that float64 can't part its vertices does not; `abstraction.glb` does.
"""

from __future__ import annotations

import numpy as np

from pnabs.formats.abstraction import Abstraction
from pnabs.geometry.types import Float64

_PLY_HEADER = """ply
format binary_little_endian 1.0
comment pnabs
element vertex {vertices}
property double x
property double y
property double z
element face {faces}
property list uchar int vertex_indices
property int positive
end_header
"""


def to_obj(abstraction: Abstraction) -> bytes:
    """Wavefront OBJ: one object, a group for each positive's faces, vertices in common."""
    mesh = abstraction.mesh()
    source = abstraction.solid.source
    lines = ["# pnabs", "o abstraction", *(f"v {_numbers(point)}" for point in mesh.vertices)]
    for positive in np.unique(source).tolist():
        lines.append(f"g positive_{positive}")
        lines += ["f {} {} {}".format(*face) for face in (mesh.faces[source == positive] + 1)]
    return ("\n".join(lines) + "\n").encode("ascii")


def to_ply(abstraction: Abstraction) -> bytes:
    """Binary PLY of doubles; each face names its positive."""
    mesh = abstraction.mesh()
    header = _PLY_HEADER.format(vertices=len(mesh.vertices), faces=len(mesh.faces))
    kind = [("count", "u1"), ("corners", "<i4", 3), ("positive", "<i4")]
    faces = np.zeros(len(mesh.faces), kind)
    faces["count"], faces["corners"] = 3, mesh.faces
    faces["positive"] = abstraction.solid.source
    return header.encode("ascii") + mesh.vertices.astype("<f8").tobytes() + faces.tobytes()


def to_stl(abstraction: Abstraction) -> bytes:
    """STL as text: its binary form has float32 alone."""
    mesh = abstraction.mesh()
    # In the normalised frame, where nothing is too small or far away to have a normal.
    corners = abstraction.solid.triangles
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-300)
    lines = ["solid abstraction"]
    for normal, triangle in zip(normals, mesh.triangles, strict=True):
        lines += [f"facet normal {_numbers(normal)}", "outer loop"]
        lines += [f"vertex {_numbers(point)}" for point in triangle]
        lines += ["endloop", "endfacet"]
    return ("\n".join([*lines, "endsolid abstraction"]) + "\n").encode("ascii")


def _numbers(values: Float64) -> str:
    return " ".join(repr(float(value)) for value in values)
