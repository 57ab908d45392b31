"""Stanford PLY, as far as shape goes: vertices and faces, from ascii and binary bodies.

The library at hand lets truncated files and counts that lie pass, and fans polygons from
their first corner.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pnabs.geometry.kernel import kernel
from pnabs.geometry.polygon import TooManyFacesError, polygon_mesh
from pnabs.geometry.types import Float64, Int64, Mesh
from pnabs.geometry.words import decimal, finite_word

_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
_TYPES |= {"float": "f4", "double": "f8", "float32": "f4", "float64": "f8", "int8": "i1"}
_TYPES |= {"uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"}
_INTEGERS = "|".join(name for name in _TYPES if _TYPES[name][0] != "f")
_PROPERTY = re.compile(f"property (?:list ({_INTEGERS}) )?({'|'.join(_TYPES)}) ([^ ]+)")
_OK, _SHORT, _LENGTH, _ROW = range(4)
_Array: TypeAlias = NDArray[Any]


class PlyError(ValueError):
    """What is wrong with a PLY file, and in which header line or row."""


@dataclass
class _Element:
    name: str
    count: int
    line: int
    # name to (type, a list's length's type or ""), as numpy spells them
    properties: dict[str, tuple[str, str]] = field(default_factory=dict)

    def row(self, index: int) -> str:
        return f"{self.name} {index + 1:,} of {self.count:,}"


def parse_ply(data: bytes, max_faces: int) -> Mesh:
    """Vertices and triangles of a PLY file.

    All but coordinates and corners is passed over.  Faces short of three corners are dropped;
    those of more are triangulated (`pnabs.geometry.polygon.polygon_mesh`).

    Parameters
    ----------
    data : bytes
    max_faces : int
        Limit on the triangles, and before the body is read on the header's count of faces.

    Raises
    ------
    PlyError
        A header that makes no sense, a body that holds more or less than the header says,
        a number that is none, or a vertex that isn't there; names the line or row.
    TooManyFacesError
    """
    elements, order, start = _header(data)
    if "vertex" not in elements:
        raise PlyError("the header has no element vertex")
    wanted = {name: _wanted(element) for name, element in elements.items()}
    units: _Array = np.frombuffer(data, dtype=np.uint8)[start:]
    _check_room(elements, len(units), order)
    if "face" in elements and elements["face"].count > max_faces:
        raise TooManyFacesError
    last = np.zeros(0, dtype=np.uint8)
    if not order:
        units, last, at = _numbers(units)
        if at >= 0:
            word = data[start + at : start + at + 40].split()[0].decode("latin-1")
            raise PlyError(f"number {len(units) + 1:,} of the body is none: {word!r}")
    found: dict[str, tuple[list[_Array], Int64]] = {}
    at = 0
    for name, element in elements.items():
        found[name], at = _read(units, last, order, at, element, wanted[name])
    rest = units[at:]
    if len(rest) and not (order and rest[:3].tobytes() in (b"\n", b"\r\n", b"\r")):
        unit = "bytes" if order else "numbers"
        raise PlyError(f"the body holds more than the header says: {len(rest):,} {unit} more")

    vertices = np.empty((elements["vertex"].count, 3))
    # a signalling nan is no reason for a warning
    with np.errstate(invalid="ignore"):
        for axis, column in enumerate(found.pop("vertex")[0]):
            vertices[:, axis] = column
    if "face" not in elements:
        return Mesh(vertices, np.zeros((0, 3), dtype=np.int64))
    [values], lengths = found.pop("face")
    if np.maximum(lengths - 2, 0).sum() > max_faces:
        raise TooManyFacesError
    kind = elements["face"].properties[wanted["face"][0]][0]
    good = (values >= 0) & (values < len(vertices)) & (values <= np.iinfo(kind).max)
    if not order:
        good &= values == np.floor(values)
    if not good.all():
        bad = int(np.argmin(good))
        row = int(np.searchsorted(np.cumsum(lengths), bad, side="right"))
        raise PlyError(
            f"{elements['face'].row(row)}: {values[bad]:.15g} is no index of {len(vertices):,} "
            f"vertices, of type {np.dtype(kind).name}"
        )
    corners = values.astype(np.int64)
    keep = lengths >= 3
    if not keep.all():
        corners, lengths = corners[np.repeat(keep, lengths)], lengths[keep]
    starts = np.zeros(len(lengths) + 1, dtype=np.int64)
    np.cumsum(lengths, out=starts[1:])
    del units, rest, values, good, lengths, keep  # before the triangles need the room
    return polygon_mesh(vertices, corners, starts)


def _header(data: bytes) -> tuple[dict[str, _Element], str, int]:
    """Elements in order, the body's byte order (empty for ascii), and where it starts."""
    first = re.match(rb"ply[ \t]*(\r\n|\n|\r)", data)
    if first is None:
        raise PlyError("header line 1: a PLY file starts with a line 'ply'")
    # The first line end holds for all: after a lone CR, a LF would be the body's first byte.
    newline, at, line = first[1], first.end(), 1
    elements: dict[str, _Element] = {}
    order: str | None = None
    last: _Element | None = None
    while at < len(data):
        stop = data.find(newline, at)
        stop = len(data) if stop < 0 else stop
        words = [word.decode("latin-1") for word in data[at:stop].split()]
        at, line = stop + len(newline), line + 1
        match words:
            case ["comment" | "obj_info", *_]:
                continue
            case ["end_header"] if order is not None:
                return elements, order, at
            case ["format", name, "1.0"] if name in _ORDERS and order is None:
                order = _ORDERS[name]
                continue
            case ["element", name, count] if re.fullmatch("[0-9]{1,18}", count):
                if name in elements:
                    raise PlyError(f"header line {line}: a second element {name[:40]!r}")
                elements[name] = last = _Element(name, int(count), line)
                continue
        found = _PROPERTY.fullmatch(" ".join(words))
        if found is None or last is None:
            shown = " ".join(words)[:60]
            raise PlyError(f"header line {line}: {shown!r} is not understood here")
        if found[3] in last.properties:
            raise PlyError(f"header line {line}: a second property {found[3][:40]!r}")
        last.properties[found[3]] = (_TYPES[found[2]], _TYPES[found[1]] if found[1] else "")
    raise PlyError(f"header line {line}: the file ends without end_header")


def _wanted(element: _Element) -> list[str]:
    """The properties that are read."""
    known, where = element.properties, f"header line {element.line}"
    if element.name == "vertex":
        if any(known.get(name, ("", "list"))[1] for name in "xyz"):
            raise PlyError(f"{where}: element vertex needs single values x, y and z")
        return ["x", "y", "z"]
    if element.name == "face":
        lists = [name for name in known if name in ("vertex_indices", "vertex_index")]
        if len(lists) != 1 or not known[lists[0]][1] or known[lists[0]][0][0] == "f":
            raise PlyError(f"{where}: element face needs one list of integers, vertex_indices")
        return lists
    return []


def _check_room(elements: dict[str, _Element], size: int, order: str) -> None:
    """Raise if not even empty lists would let the rows fit in the body."""
    # a number and a blank take two bytes, but the last needs no blank
    room = size if order else size + 1
    for element in elements.values():
        kinds = element.properties.values()
        least = sum(int((counts or kind)[1]) if order else 2 for kind, counts in kinds)
        if element.count * least > room:
            raise PlyError(f"the body of {size:,} bytes can't hold {element.row(room // least)}")
        room -= element.count * least


def _read(
    units: _Array,
    last: NDArray[np.uint8],
    order: str,
    at: int,
    element: _Element,
    wanted: list[str],
) -> tuple[tuple[list[_Array], Int64], int]:
    """Values of an element's wanted properties and list lengths; where the element ends.

    Units are the bytes of a binary body, or the numbers of an ascii one.
    """
    properties = element.properties
    if not properties:  # else any count would be walked
        return ([], np.empty(0, dtype=np.int64)), at
    layout = np.zeros((len(properties), 4), dtype=np.int64)
    for i, (name, (kind, counts)) in enumerate(properties.items()):
        layout[i, 0] = int((counts or kind)[1]) if order else 1
        layout[i, 1] = wanted.index(name) if name in wanted else -1
        if counts:
            layout[i, 2:] = int(kind[1]) if order else 1, np.iinfo(counts).max
    begins = np.empty((len(wanted), element.count if wanted else 0), dtype=np.int64)
    lengths = np.ones(begins.shape[1], dtype=np.int64)
    at, row, problem, length = _walk(
        units, last, not order, order == ">", at, element.count, layout, begins, lengths
    )
    if problem == _SHORT:
        raise PlyError(f"the body ends within {element.row(row)}")
    if problem == _ROW:
        raise PlyError(f"{element.row(row)} doesn't end where its line does")
    if problem == _LENGTH:
        raise PlyError(f"{element.row(row)}: a list can't have length {length:.15g}")
    found = []
    for name, begin in zip(wanted, begins, strict=True):
        kind = properties[name][0]
        size = int(kind[1]) if order else 1
        values = np.empty(int(lengths.sum()) * size, dtype=units.dtype)
        _gather(units, begin, lengths, size, values)
        found.append(values.view(order + kind) if order else values)
    return (found, lengths), at


@kernel
def _numbers(text: NDArray[np.uint8]) -> tuple[Float64, NDArray[np.uint8], int]:
    """All numbers, which end a line, and where the first word is that is none, or -1."""
    end = len(text)
    numbers = np.empty(end // 2 + 1)
    last = np.zeros(end // 2 + 1, dtype=np.uint8)
    count, at = 0, 0
    while True:
        while at < end and (text[at] == 32 or 9 <= text[at] <= 13):
            if count > 0 and (text[at] == 10 or text[at] == 13):
                last[count - 1] = 1
            at += 1
        if at >= end:
            if count > 0:
                last[count - 1] = 1
            return numbers[:count], last[:count], -1
        first = at
        if finite_word(text, at, end):
            numbers[count], at, good = decimal(text, at, end)
            if not good or (at < end and not (text[at] == 32 or 9 <= text[at] <= 13)):
                return numbers[:count], last[:count], first
        else:
            numbers[count] = np.nan
            while at < end and not (text[at] == 32 or 9 <= text[at] <= 13):
                at += 1
        count += 1


@kernel
def _walk(
    units: _Array,
    last: NDArray[np.uint8],
    text: bool,
    big: bool,
    at: int,
    rows: int,
    layout: Int64,
    begins: Int64,
    lengths: Int64,
) -> tuple[int, int, int, float]:
    """Where rows end, or the row, the problem and the list length that stop it.

    The layout (P, 4) has each property's size, or that of its list's length; its row in
    `begins` or -1; the size of its list's items or 0, and the greatest length of its type.
    Begins (W, rows) and, of a list among them, lengths (rows,) are filled.
    """
    end = len(units)
    for row in range(rows):
        for p in range(len(layout)):
            size, column, item, high = layout[p, 0], layout[p, 1], layout[p, 2], layout[p, 3]
            if at + size > end:
                return at, row, _SHORT, 0.0
            begin, length = at, 1
            at += size
            if item > 0:
                if text:
                    number = float(units[begin])
                    if not (0 <= number <= high and number == np.floor(number)):
                        return at, row, _LENGTH, number
                    length = int(number)
                else:
                    length = 0
                    for k in range(size):
                        length = length * 256 + int(units[begin + k if big else at - 1 - k])
                    if length > high:  # of a signed type, and negative
                        return at, row, _LENGTH, float(length - 2 * (high + 1))
                begin = at
                at += length * item
                if at > end:
                    return at, row, _SHORT, 0.0
            if column >= 0:
                begins[column, row], lengths[row] = begin, length
        # a count that lies can fall into step again, but not with the lines
        if text and last[at - 1] == 0:
            return at, row, _ROW, 0.0
    return at, rows, _OK, 0.0


@kernel
def _gather(units: _Array, begins: Int64, lengths: Int64, size: int, out: _Array) -> None:
    """Runs of units, one after another."""
    filled = 0
    for i in range(len(begins)):
        for k in range(begins[i], begins[i] + lengths[i] * size):
            out[filled] = units[k]
            filled += 1
