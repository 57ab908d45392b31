"""Wavefront OBJ, as far as shape goes: `v` and `f` lines to vertices and triangles.

The libraries at hand fan polygons from their first corner, which covers the wrong area
where a polygon isn't convex, and let a vertex number 0 pass as the last vertex.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pnabs.geometry.kernel import kernel
from pnabs.geometry.polygon import TooManyFacesError, polygon_mesh
from pnabs.geometry.types import Float64, Int64, Mesh
from pnabs.geometry.words import blank, decimal, ends, finite_word, next_line

_OK, _NUMBER, _SHORT, _INDEX, _ZERO, _RANGE, _TOO_MANY = range(7)
_PROBLEMS = {
    _NUMBER: "not a number",
    _SHORT: "a vertex of fewer than three coordinates",
    _INDEX: "not a vertex number",
    _ZERO: "face index 0, but OBJ counts vertices from 1",
}


class ObjError(ValueError):
    """What is wrong with an OBJ file, and in which line."""


def parse_obj(data: bytes, max_faces: int) -> Mesh:
    """Vertices and triangles of an OBJ file.

    Negative numbers count back from the last vertex so far; texture and normal numbers,
    vertex colours and weights, and all other statements are passed over.  Corners short of
    three make no face; more are triangulated (`pnabs.geometry.polygon.polygon_mesh`).

    Parameters
    ----------
    data : bytes
    max_faces : int
        Reading stops where there are more triangles.

    Raises
    ------
    ObjError
        A number that is none, or a vertex that isn't there; names the line.
    TooManyFacesError
    """
    text = np.frombuffer(data, dtype=np.uint8)
    vertices, corners, starts, lines, problem, line = _read(text, max_faces)
    if problem == _TOO_MANY:
        raise TooManyFacesError
    if problem == _RANGE:
        raise ObjError(f"line {line}: a face names a vertex before the first")
    if problem != _OK:
        raise ObjError(f"line {line}: {_PROBLEMS[problem]}")
    beyond = np.flatnonzero(corners >= len(vertices))
    if len(beyond):
        line = lines[np.searchsorted(starts, beyond[0], side="right") - 1]
        raise ObjError(
            f"line {line}: a face names vertex {corners[beyond[0]] + 1}, "
            f"but there are {len(vertices):,} vertices"
        )
    return polygon_mesh(vertices, corners, starts)


@kernel
def _splits(c: int) -> bool:
    """Whether a character ends a keyword: a blank, or a backslash before a line's end."""
    return c == 32 or c == 9 or c == 92


@kernel
def _read(text: NDArray[np.uint8], max_faces: int) -> tuple[Float64, Int64, Int64, Int64, int, int]:
    """Vertices, the polygons' corners, where each polygon starts and its line; what is wrong."""
    end = len(text)
    # "v 0 0 0" and a newline take 8 bytes, "f 1 2 3" too
    vertices = np.empty((end // 7 + 1, 3))
    corners = np.empty(end // 2 + 1, dtype=np.int64)
    starts = np.empty(end // 7 + 2, dtype=np.int64)
    lines = np.empty(end // 7 + 1, dtype=np.int64)
    vertex_count, corner_count, polygons, triangles = 0, 0, 0, 0
    problem = 0
    line = 1
    at = 0
    starts[0] = 0
    while at < end and problem == 0:
        at = blank(text, at, end)
        if at + 1 < end and text[at] == 118 and _splits(text[at + 1]):
            at += 1
            for axis in range(3):
                at = blank(text, at, end)
                if ends(text, at, end):
                    problem = 2
                    break
                if not finite_word(text, at, end):
                    vertices[vertex_count, axis] = np.nan
                    while not ends(text, at, end):
                        at += 1
                    continue
                vertices[vertex_count, axis], at, good = decimal(text, at, end)
                if not good or not ends(text, at, end):
                    problem = 1
                    break
            vertex_count += 1
        elif at + 1 < end and text[at] == 102 and _splits(text[at + 1]):
            at += 1
            first = corner_count
            while problem == 0:
                at = blank(text, at, end)
                if ends(text, at, end):
                    break
                back = text[at] == 45
                if text[at] == 45 or text[at] == 43:
                    at += 1
                number = 0
                digits = 0
                while at < end and 48 <= text[at] <= 57:
                    number = min(number * 10 + (text[at] - 48), 1 << 40)
                    digits += 1
                    at += 1
                if digits == 0 or not (ends(text, at, end) or text[at] == 47):
                    problem = 3
                elif number == 0:
                    problem = 4
                elif back and number > vertex_count:
                    problem = 5
                corners[corner_count] = vertex_count - number if back else number - 1
                corner_count += 1
                while not ends(text, at, end):
                    at += 1
            if corner_count - first < 3:
                corner_count = first
            else:
                lines[polygons] = line
                polygons += 1
                starts[polygons] = corner_count
                triangles += corner_count - first - 2
                if triangles > max_faces and problem == 0:
                    problem = 6
        if problem != 0:
            break
        # to the next line; one that ends in a backslash goes on
        at = next_line(text, at, end)
        line += 1
    return (
        vertices[:vertex_count].copy(),
        corners[:corner_count].copy(),
        starts[: polygons + 1].copy(),
        lines[:polygons].copy(),
        problem,
        line,
    )
