"""Object File Format: vertices and polygons, row by row, as the header says."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from pnabs.geometry.kernel import kernel
from pnabs.geometry.polygon import TooManyFacesError, polygon_mesh
from pnabs.geometry.types import Float64, Int64, Mesh
from pnabs.geometry.words import decimal, finite_word

_HEADER = re.compile(rb"\s*(?:#[^\r\n]*[\r\n]+\s*)*(?:ST)?C?N?(4?n?)OFF\b", re.IGNORECASE)


class OffError(ValueError):
    """What is wrong with an OFF file, and in which row."""


def parse_off(data: bytes, max_faces: int) -> Mesh:
    """Vertices and triangles of an OFF file.

    Normals, colours and texture coordinates are passed over; polygons are triangulated
    (`pnabs.geometry.polygon.polygon_mesh`).  Each vertex and each face has a row of its own.

    Parameters
    ----------
    data : bytes
    max_faces : int

    Raises
    ------
    OffError
    TooManyFacesError
    """
    header = _HEADER.match(data)
    if header is None:
        raise OffError("it doesn't begin with OFF")
    if header[1]:
        raise OffError("vertices of four coordinates or more can't be read")
    values, starts, problem = _rows(np.frombuffer(data, dtype=np.uint8), header.end())
    if problem:
        raise OffError(f"line {problem}: not a number")
    rows = len(starts) - 1
    head = values[: starts[1]] if rows else values[:0]
    if len(head) not in (2, 3) or (head < 0).any() or (head != np.rint(head)).any():
        raise OffError("its first row isn't the numbers of vertices, faces and edges")
    vertex_count, face_count = (int(min(value, 2**53)) for value in head[:2])
    if rows != 1 + vertex_count + face_count:
        raise OffError(
            f"its header says {vertex_count:,} vertices and {face_count:,} faces, "
            f"but {rows - 1:,} rows follow"
        )
    if face_count > max_faces:
        raise TooManyFacesError
    widths = np.diff(starts)
    short = np.flatnonzero(widths[1 : 1 + vertex_count] < 3)
    if len(short):
        raise OffError(f"vertex {short[0]} has fewer than three coordinates")
    first = starts[1 : 1 + vertex_count]
    vertices = values[first[:, None] + np.arange(3)]
    return _faces(
        vertices, values, starts[1 + vertex_count : -1], widths[1 + vertex_count :], max_faces
    )


def _faces(vertices: Float64, values: Float64, begin: Int64, widths: Int64, max_faces: int) -> Mesh:
    said = values[begin]
    wrong = np.flatnonzero(~((said >= 0) & (said == np.rint(said)) & (said < widths)))
    if len(wrong):
        raise OffError(f"face {wrong[0]} says {said[wrong[0]]:g} corners, which its row hasn't")
    sizes = said.astype(np.int64)
    begin, sizes, kept = begin[sizes > 2], sizes[sizes > 2], np.flatnonzero(sizes > 2)
    if int((sizes - 2).sum()) > max_faces:
        raise TooManyFacesError
    starts = np.concatenate([[0], np.cumsum(sizes)])
    place = np.arange(starts[-1]) + np.repeat(begin + 1 - starts[:-1], sizes)
    named = values[place]
    wrong = np.flatnonzero(~((named >= 0) & (named == np.rint(named)) & (named < len(vertices))))
    if len(wrong):
        face = kept[np.searchsorted(starts, wrong[0], side="right") - 1]
        raise OffError(
            f"face {face} names vertex {named[wrong[0]]:g}, but there are {len(vertices):,}, "
            "counted from 0"
        )
    return polygon_mesh(vertices, named.astype(np.int64), starts)


@kernel
def _rows(text: NDArray[np.uint8], at: int) -> tuple[Float64, Int64, int]:
    """All numbers, where each row that has any starts, and the line of what is none, or 0."""
    end = len(text)
    values = np.empty((end - at) // 2 + 1)
    starts = np.empty((end - at) // 2 + 2, dtype=np.int64)
    count, rows, line = 0, 0, 1
    for i in range(at):
        line += text[i] == 10
    begun = False
    starts[0] = 0
    while at < end:
        c = text[at]
        if c == 10 or c == 13:
            line += c == 10 or at + 1 >= end or text[at + 1] != 10
            if begun:
                rows += 1
                starts[rows] = count
            begun = False
            at += 1
        elif c == 35:
            while at < end and text[at] != 10 and text[at] != 13:
                at += 1
        elif c == 32 or 9 <= c <= 12:
            at += 1
        else:
            begun = True
            good = True
            if finite_word(text, at, end):
                values[count], at, good = decimal(text, at, end)
            else:
                values[count] = np.nan
                while at < end and text[at] > 32:
                    at += 1
            if not good or (at < end and text[at] > 32 and text[at] != 35):
                return values[:0].copy(), starts[:1].copy(), line
            count += 1
    if begun:
        rows += 1
        starts[rows] = count
    return values[:count].copy(), starts[: rows + 1].copy(), 0
