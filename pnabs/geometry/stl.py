"""STL: binary files of the length that their count says, and text ones that end properly."""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from pnabs.geometry.kernel import kernel
from pnabs.geometry.polygon import TooManyFacesError
from pnabs.geometry.types import Float64, Mesh
from pnabs.geometry.words import blank, decimal, ends, finite_word, next_line

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_PROBLEMS = {
    1: "not a number",
    2: "a facet of other than three vertices",
    3: "a vertex outside a facet",
    4: "neither a statement of STL nor one in its place",
}


class StlError(ValueError):
    """What is wrong with an STL file."""


def parse_stl(data: bytes, max_faces: int) -> Mesh:
    """Triangles of an STL file, each with vertices of its own; its normals are passed over.

    Parameters
    ----------
    data : bytes
        Binary or text: text begins with `solid` and isn't as long as a binary file would be.
    max_faces : int

    Raises
    ------
    StlError
    TooManyFacesError
    """
    count = struct.unpack_from("<I", data, 80)[0] if len(data) >= 84 else -1
    is_text = data.lstrip()[:5].lower() == b"solid"
    if count < 0 or (is_text and len(data) != 84 + 50 * count):
        if not is_text:
            raise StlError("the file ends within its header, and isn't text either")
        return _parse_text(data, max_faces)
    # some writers pad; a facet more or less is a lie
    if not 0 <= len(data) - (84 + 50 * count) < _FACET.itemsize:
        raise StlError(f"it says {count:,} facets, but holds {(len(data) - 84) / 50:,.4g}")
    if count > max_faces:
        raise TooManyFacesError
    facets = np.frombuffer(data, dtype=_FACET, count=count, offset=84)
    return _soup(facets["corners"].astype(np.float64).reshape(-1, 3))


def _parse_text(data: bytes, max_faces: int) -> Mesh:
    vertices, problem, line = _read(np.frombuffer(data, dtype=np.uint8))
    if problem:
        raise StlError(f"line {line}: {_PROBLEMS[problem]}")
    if not data.rstrip().splitlines()[-1].lstrip().lower().startswith(b"endsolid"):
        raise StlError("its last line isn't endsolid: it may be cut off")
    if len(vertices) > 3 * max_faces:
        raise TooManyFacesError
    return _soup(vertices)


def _soup(vertices: Float64) -> Mesh:
    return Mesh(vertices, np.arange(len(vertices), dtype=np.int64).reshape(-1, 3))


@kernel
def _is(text: NDArray[np.uint8], at: int, word: NDArray[np.uint8]) -> bool:
    """Whether a word, in lower case, stands here."""
    if at + len(word) > len(text):
        return False
    for i in range(len(word)):
        if text[at + i] | 32 != word[i]:
            return False
    return bool(ends(text, at + len(word), len(text)))


_VERTEX, _FACET_WORD, _END_FACET, _SOLID, _END_SOLID, _OUTER, _END_LOOP = (
    np.frombuffer(word, dtype=np.uint8)
    for word in (b"vertex", b"facet", b"endfacet", b"solid", b"endsolid", b"outer", b"endloop")
)


@kernel
def _read(text: NDArray[np.uint8]) -> tuple[Float64, int, int]:
    """Vertices in the order of the file; what is wrong, or 0, and in which line."""
    end = len(text)
    vertices = np.empty((end // 13 + 1, 3))
    count, line, at = 0, 1, 0
    corners = -1
    while at < end:
        at = blank(text, at, end)
        if _is(text, at, _VERTEX):
            if corners < 0:
                return vertices[:0].copy(), 3, line
            at += len(_VERTEX)
            for axis in range(3):
                at = blank(text, at, end)
                good = not ends(text, at, end)
                if good and not finite_word(text, at, end):
                    vertices[count, axis] = np.nan
                    while not ends(text, at, end):
                        at += 1
                elif good:
                    vertices[count, axis], at, good = decimal(text, at, end)
                if not good or not ends(text, at, end):
                    return vertices[:0].copy(), 1, line
            count += 1
            corners += 1
        elif _is(text, at, _FACET_WORD):
            if corners >= 0:
                return vertices[:0].copy(), 4, line
            corners = 0
        elif _is(text, at, _END_FACET):
            if corners != 3:
                return vertices[:0].copy(), 2, line
            corners = -1
        elif _is(text, at, _SOLID) or _is(text, at, _END_SOLID):
            if corners >= 0:
                return vertices[:0].copy(), 4, line
        elif not (ends(text, at, end) or _is(text, at, _OUTER) or _is(text, at, _END_LOOP)):
            return vertices[:0].copy(), 4, line
        at = next_line(text, at, end)
        line += 1
    return vertices[:count].copy(), 2 if corners >= 0 else 0, line
