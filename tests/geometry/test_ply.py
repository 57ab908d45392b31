"""PLY: ascii and binary bodies, and what is wrong in which header line or row."""

from __future__ import annotations

import struct
import tracemalloc

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from pnabs.geometry.ply import PlyError, parse_ply
from pnabs.geometry.polygon import TooManyFacesError
from pnabs.geometry.types import Mesh

FORMATS = {"<": "binary_little_endian", ">": "binary_big_endian", "": "ascii"}
XYZ = "property float x\nproperty float y\nproperty float z\n"
LIST = "property list uchar int vertex_indices\n"
SQUARE = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0)]
SQUARE_TEXT = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"


def parsed(data: bytes | str, max_faces: int = 10**6) -> Mesh:
    return parse_ply(data.encode() if isinstance(data, str) else data, max_faces)


def header(order: str, vertices: int, faces: int, xyz: str = XYZ, lists: str = LIST) -> str:
    return (
        f"ply\nformat {FORMATS[order]} 1.0\nelement vertex {vertices}\n{xyz}"
        f"element face {faces}\n{lists}end_header\n"
    )


def ply(order: str, points: list[tuple[float, ...]], polygons: list[list[int]]) -> bytes:
    start = header(order, len(points), len(polygons)).encode()
    if not order:
        rows = [*points, *([len(p), *p] for p in polygons)]
        return start + "\n".join(" ".join(map(str, row)) for row in rows).encode()
    body = b"".join(struct.pack(f"{order}3f", *p) for p in points)
    return start + body + b"".join(struct.pack(f"{order}B{len(p)}i", len(p), *p) for p in polygons)


def square(faces: str, count: int = 1, lists: str = LIST) -> str:
    return header("", 4, count, lists=lists) + SQUARE_TEXT + faces


def area(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
@pytest.mark.parametrize("shape", ["box", "torus"])
def test_exports_come_back(encoding: str, shape: str) -> None:
    made = trimesh.creation.box() if shape == "box" else trimesh.creation.torus(1.0, 0.3)
    made.vertex_normals  # noqa: B018 (has them written too)
    data = trimesh.exchange.ply.export_ply(made, encoding=encoding)
    assert f"format {encoding}".encode() in data
    found = parsed(data)
    np.testing.assert_array_equal(found.faces, made.faces)
    np.testing.assert_allclose(found.vertices, made.vertices, atol=1e-6)
    assert found.vertices.dtype == np.float64
    assert found.faces.dtype == np.int64


@pytest.mark.parametrize("order", FORMATS)
def test_polygons(order: str) -> None:
    # an arrowhead, and the same with a corner more; fans from corner 3 cover too much
    points = [(0.0, 0.0, 0.0), (2.0, 2.0, 0.0), (0.0, 1.0, 0.0), (-2.0, 2.0, 0.0), (-1.0, 1.0, 0.0)]
    for concave in ([3, 0, 1, 2], [3, 4, 0, 1, 2]):
        assert area(parsed(ply(order, points, [concave]))) == pytest.approx(2)
    found = parsed(ply(order, SQUARE, [[0, 1, 2, 3], [], [0], [0, 1, 2], [1, 2]]))
    assert found.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 2]]
    np.testing.assert_array_equal(found.vertices, SQUARE)


@pytest.mark.parametrize("order", ["<", ">"])
def test_all_else_is_passed_over(order: str) -> None:
    head = (
        f"ply\nformat {FORMATS[order]} 1.0\ncomment end_header\nobj_info\n"
        "element material 1\nproperty list ushort short parts\nproperty uchar red\n"
        "element face 2\nproperty uchar flag\nproperty list uchar float texcoord\n"
        "property list uint ushort vertex_index\nproperty double area\n"
        "element empty 99999999999999999\n"
        "element vertex 4\nproperty uchar red\nproperty double z\nproperty short y\n"
        "property int8 x\nproperty list char double weights\n"
        "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    )
    body = struct.pack(order + "H2hB", 2, -1, -2, 255)
    body += struct.pack(order + "BB6fI3Hd", 1, 6, *range(6), 3, 0, 1, 2, 0.5)
    body += struct.pack(order + "BBI3Hd", 1, 0, 3, 0, 2, 3, 0.5)
    for i, (x, y, _) in enumerate(SQUARE):
        body += struct.pack(order + f"Bdhbb{i}d", 7, 0.1, int(-y), int(-x), i, *range(i))
    body += struct.pack(order + "i4i", 4, 0, 1, 2, -1)
    found = parsed(head.encode() + body)
    expected = np.array(SQUARE) * -1 + [0, 0, 0.1]
    np.testing.assert_array_equal(found.vertices, expected)
    assert found.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_ascii_rows_end_with_their_lines_and_other_lists_are_passed_over() -> None:
    lists = "property list int float texcoord\n" + LIST + "property uchar flag\n"
    found = parsed(square("2 .5 -nan 3\t0 1\r\n2 255\n0 3 0 2 3 1", 2, lists))
    assert found.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    with pytest.raises(PlyError, match="face 1 of 2 doesn't end where its line does"):
        parsed(square("4 0 1 2\n3 0 2 3 1", 2))


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_line_ends(end: str) -> None:
    assert parsed(square("3 0 1 2\n").replace("\n", end)).faces.shape == (1, 3)
    data = ply("<", [(struct.unpack("<f", b"\n\n\r\n")[0], 0.0, 0.0), *SQUARE], [[0, 1, 2]])
    start = data.index(b"end_header\n") + len(b"end_header\n")
    data = data[:start].replace(b"\n", end.encode()) + data[start:]
    assert parsed(data).faces.shape == (1, 3)
    assert parsed(data + end.encode()).faces.shape == (1, 3)


def test_words_for_nan_in_coordinates() -> None:
    text = header("", 4, 0) + "nan 0 0\n0 -inf 0\n0 0 Infinity\n1e3 -2.5 +.5"
    found = parsed(text).vertices
    assert np.isnan(found).sum() == 3
    assert found[3].tolist() == [1000, -2.5, 0.5]


def test_double_and_large_numbers_are_exact() -> None:
    xyz = XYZ.replace("float", "double").replace("double y", "uint y")
    value = 0.1234567890123456
    head = header("<", 1, 0, xyz).encode()
    found = parsed(head + struct.pack("<dId", value, 2**32 - 1, -value))
    assert found.vertices.tolist() == [[value, 2**32 - 1, -value]]


def test_without_faces() -> None:
    text = "ply\nformat ascii 1.0\nelement vertex 1\n" + XYZ + "end_header\n1 2 3\n"
    found = parsed(text)
    assert found.faces.shape == (0, 3)
    assert found.vertices.tolist() == [[1, 2, 3]]
    assert parsed(header("", 0, 0)).faces.shape == (0, 3)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("ply\n", "plx\n", "header line 1: .*starts with a line 'ply'"),
        ("ascii 1.0", "ascii 2.0", "header line 2: 'format ascii 2.0' is not understood"),
        ("ascii", "text", "header line 2: "),
        ("format ascii 1.0\n", "", "header line 8: 'end_header' is not understood"),
        ("1.0\n", "1.0\nformat ascii 1.0\n", "header line 3: "),
        ("1.0\n", "1.0\nproperty int a\n", "header line 3: 'property int a' is not understood"),
        ("vertex 4", "vertex -4", "header line 3: 'element vertex -4' is not understood"),
        ("vertex 4", "vertex 4.0", "header line 3: "),
        ("vertex 4", "vertex " + "9" * 5000, "header line 3: "),
        ("vertex 4", "vertex", "header line 3: "),
        ("float x", "half x", "header line 4: 'property half x' is not understood"),
        ("list uchar", "list float", "header line 8: "),
        ("float y", "float x", "header line 5: a second property 'x'"),
        ("element face", "element vertex", "header line 7: a second element 'vertex'"),
        ("float y", "float v", "header line 3: element vertex needs single values x, y and z"),
        ("float y", "list int int y", "header line 3: element vertex needs single values"),
        ("element vertex", "element point", "the header has no element vertex"),
        ("vertex_indices", "corners", "header line 7: element face needs one list of integers"),
        ("int vertex_i", "float vertex_i", "header line 7: element face needs one list"),
        ("list uchar int", "int", "header line 7: element face needs one list"),
        ("indices\n", "indices\nfoo\n", "header line 9: 'foo' is not understood"),
        ("end_header", "comment", "header line "),
    ],
)
def test_headers_that_make_no_sense(old: str, new: str, message: str) -> None:
    text = square("3 0 1 2\n")
    assert old in text
    with pytest.raises(PlyError, match=message):
        parsed(text.replace(old, new, 1))


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        ("3 0 1", "the body ends within face 1 of 1"),
        ("3 0 1 2 3", "face 1 of 1 doesn't end where its line does"),
        ("3 0 1 2\n3", "holds more than the header says: 1 numbers more"),
        ("3 0 1 4", "face 1 of 1: 4 is no index of 4 vertices, of type int32"),
        ("3 0 1 -1", "face 1 of 1: -1 is no index"),
        ("3 0 1 1.5", "face 1 of 1: 1.5 is no index"),
        ("3 0 1 nan", "face 1 of 1: nan is no index"),
        ("-3 0 1 2", "face 1 of 1: a list can't have length -3"),
        ("2.5 0 1 2", "face 1 of 1: a list can't have length 2.5"),
        ("256 0 1 2", "face 1 of 1: a list can't have length 256"),
        ("inf 0 1 2", "face 1 of 1: a list can't have length nan"),
        ("3 0 x 2", "number 15 of the body is none: 'x'"),
        ("3 0 1#2 2", "number 15 of the body is none: '1#2'"),
    ],
)
def test_ascii_faces_that_lie(faces: str, message: str) -> None:
    with pytest.raises(PlyError, match=message):
        parsed(square(faces))


def test_an_index_beyond_its_type() -> None:
    text = header("", 300, 1, lists=LIST.replace("int ", "uchar ")) + "0 0 0\n" * 300
    assert len(parsed(text + "3 0 1 255").faces) == 1
    with pytest.raises(PlyError, match="256 is no index of 300 vertices, of type uint8"):
        parsed(text + "3 0 1 256")


@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_faces_that_lie(order: str) -> None:
    good = ply(order, SQUARE, [[0, 1, 2], [0, 2, 3]])
    assert len(parsed(good).faces) == 2
    with pytest.raises(PlyError, match="the body ends within face 2 of 2"):
        parsed(good[:-1])
    with pytest.raises(PlyError, match="more than the header says: 2 bytes more"):
        parsed(good + b"\n\n")
    with pytest.raises(PlyError, match="more than the header says: 1 bytes more"):
        parsed(good + b"\0")
    with pytest.raises(PlyError, match="face 2 of 2: 4 is no index of 4 vertices"):
        parsed(ply(order, SQUARE, [[0, 1, 2], [0, 2, 4]]))
    with pytest.raises(PlyError, match="face 2 of 2: -1 is no index of 4 vertices"):
        parsed(ply(order, SQUARE, [[0, 1, 2], [-1, 2, 3]]))
    with pytest.raises(PlyError, match="bytes can't hold vertex 4 of 4"):
        parsed(good[: good.index(b"end_header\n") + 11 + 47])
    short = header(order, 0, 1, lists=LIST.replace("uchar", "short")).encode()
    with pytest.raises(PlyError, match="face 1 of 1: a list can't have length -2"):
        parsed(short + struct.pack(order + "h", -2))
    uint = header(order, 0, 1, lists=LIST.replace("uchar", "uint")).encode()
    with pytest.raises(PlyError, match="the body ends within face 1 of 1"):
        parsed(uint + struct.pack(order + "I", 2**32 - 1))


@pytest.mark.parametrize("order", FORMATS)
@pytest.mark.parametrize("name", ["vertex", "face"])
def test_counts_that_lie_cost_nothing(order: str, name: str) -> None:
    good = ply(order, SQUARE, [[0, 1, 2]])
    count = {"vertex": b"vertex 4", "face": b"face 1"}[name]
    data = good.replace(count, f"{name} 999999999999".encode())
    tracemalloc.start()
    with pytest.raises(PlyError, match=f"bytes can't hold {name} .* of 999,999,999,999"):
        parsed(data)
    assert tracemalloc.get_traced_memory()[1] < 10**6
    tracemalloc.stop()


@pytest.mark.parametrize("order", FORMATS)
def test_limit(order: str) -> None:
    data = ply(order, SQUARE, [[0, 1, 2, 3], [0, 1, 2]])
    assert len(parsed(data, 3).faces) == 3
    for limit in (1, 2):
        with pytest.raises(TooManyFacesError):
            parsed(data, limit)


@settings(deadline=None)
@given(st.data(), st.sampled_from(["<", ">", ""]))
def test_what_is_cut_short_is_an_error(draw: st.DataObject, order: str) -> None:
    corners = st.integers(0, 3)
    polygons = draw.draw(st.lists(st.lists(corners, max_size=6), min_size=1, max_size=5))
    data = ply(order, SQUARE, polygons)
    assert len(parsed(data).faces) == sum(max(len(p) - 2, 0) for p in polygons)
    body = data.index(b"end_header\n")
    # a number cut short may be one still
    ends = [i for i in range(len(data)) if order or i < body or data[i : i + 1] in b" \n"]
    with pytest.raises(PlyError):
        parsed(data[: draw.draw(st.sampled_from(ends))])


@settings(deadline=None)
@given(st.data(), st.sampled_from(["<", ">", ""]))
def test_damage_gives_an_error_of_ours_or_a_mesh(draw: st.DataObject, order: str) -> None:
    data = bytearray(ply(order, SQUARE, [[0, 1, 2, 3], [0, 1, 2]]))
    for _ in range(draw.draw(st.integers(1, 3))):
        data[draw.draw(st.integers(0, len(data) - 1))] = draw.draw(st.integers(0, 255))
    try:
        mesh = parsed(bytes(data))
    except (PlyError, TooManyFacesError):
        return
    assert mesh.faces.size == 0 or 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices)
