"""OFF, STL and glTF: what is read rightly, and what is refused for claiming what isn't so."""

from __future__ import annotations

import base64
import io
import json
import struct
import urllib.parse
from typing import Any

import numpy as np
import pytest
import trimesh

from pnabs.geometry.gltf import GltfError, parse_gltf
from pnabs.geometry.off import OffError, parse_off
from pnabs.geometry.polygon import TooManyFacesError
from pnabs.geometry.stl import StlError, parse_stl
from pnabs.geometry.types import Float64, Mesh
from tests.geometry.soups import box

BOX = box((1, 2, 3))
MANY = 10**6


def area(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


# OFF


def off(header: str = "OFF\n8 12 0", cut: int | None = None, extra: str = "") -> bytes:
    rows = [" ".join(map(repr, v)) for v in BOX.vertices.tolist()]
    rows += ["3 " + " ".join(map(str, f)) for f in BOX.faces.tolist()]
    return "\n".join([header, *rows[:cut]]).encode() + extra.encode()


@pytest.mark.parametrize(
    "header", ["OFF\n8 12 0", "off 8 12 0", "# x\nOFF\n# y\n\n8 12", "OFF 8 12 18\n"]
)
def test_off_headers(header: str) -> None:
    assert area(parse_off(off(header), MANY)) == pytest.approx(22)


def test_off_with_colours_normals_and_polygons() -> None:
    outline = "COFF\n6 1 0\n" + "0 0 0 1 0 0 1\n2 0 0 1 0 0 1\n2 1 0 1 0 0 1\n"
    text = outline + "1 1 0 1 0 0 1\n1 2 0 1 0 0 1\n0 2 0 1 0 0 1\n6 2 3 4 5 0 1 255 0 0 # red\n"
    assert area(parse_off(text.encode(), MANY)) == pytest.approx(3)
    assert parse_off(
        b"NOFF\n3 2\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n2 0 1\n3 0 1 2", 2
    ).faces.shape == (1, 3)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (off(cut=-1), "8 vertices and 12 faces, but 19 rows"),
        (off("OFF\n9 12 0"), "but 20 rows"),
        (off("OFF\n8 11 0"), "but 20 rows"),
        (off("OFF\n8 99999999999999999999 0"), "but 20 rows"),
        (off("OFF\n8 -1 0"), "first row"),
        (off("OFF\n8.5 12 0"), "first row"),
        (off("4OFF\n8 12 0"), "four coordinates"),
        (off("PLY\n8 12 0"), "doesn't begin with OFF"),
        (b"OFF", "first row"),
        (off(cut=19, extra="\n3 0 1 8"), "face 11 names vertex 8, but there are 8"),
        (off(cut=19, extra="\n3 0 1 -1"), "face 11 names vertex -1"),
        (off(cut=19, extra="\n3 0 1 1.5"), "face 11 names vertex 1.5"),
        (off(cut=19, extra="\n4 0 1 2"), "face 11 says 4 corners"),
        (off(cut=19, extra="\n-3 0 1 2"), "face 11 says -3 corners"),
        (off(cut=19, extra="\n3 0 1 x"), "line 22: not a number"),
        (off().replace(b"-0.5 -1.0 -1.5", b"-0.5 -1.0"), "vertex 0 has fewer than three"),
    ],
)
def test_off_files_that_lie(data: bytes, said: str) -> None:
    with pytest.raises(OffError, match=said):
        parse_off(data, MANY)


def test_off_limit() -> None:
    with pytest.raises(TooManyFacesError):
        parse_off(off(), 11)


# STL


def stl(text: bool = False) -> bytes:
    shape = trimesh.Trimesh(BOX.vertices, BOX.faces, process=False)
    data = shape.export(file_type="stl_ascii" if text else "stl")
    return data.encode() if isinstance(data, str) else data


@pytest.mark.parametrize("text", [False, True])
def test_stl(text: bool) -> None:
    mesh = parse_stl(stl(text), 12)
    assert area(mesh) == pytest.approx(22)
    np.testing.assert_allclose(mesh.triangles, BOX.triangles, atol=1e-6)
    with pytest.raises(TooManyFacesError):
        parse_stl(stl(text), 11)


def test_stl_whose_header_begins_like_text_or_ends_in_padding() -> None:
    data = b"solid of a box".ljust(80) + stl()[80:]
    assert len(parse_stl(data, MANY).faces) == 12
    assert len(parse_stl(stl() + b"\n", MANY).faces) == 12


def test_stl_text_of_several_solids_names_and_line_ends() -> None:
    text = stl(text=True).replace(b"solid", b"SOLID vertex 1 endsolid", 1)
    both = text + b"\n" + text
    for data in (both, both.replace(b"\n", b"\r\n"), both.replace(b"\n", b"\r")):
        assert area(parse_stl(data, MANY)) == pytest.approx(44)


QUAD = b"vertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\n"


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (stl()[:-50], "says 12 facets, but holds 11"),
        (stl() + bytes(50), "says 12 facets, but holds 13"),
        (stl()[:83], "within its header"),
        (b"\0" * 200, "says 0 facets"),
        (stl(text=True)[:-40], "line"),
        (stl(text=True).rsplit(b"endsolid", 1)[0], "last line isn't endsolid"),
        (b"solid\nfacet\nouter loop\n" + QUAD + b"endloop\nendfacet\nendsolid", "line 9: a facet"),
        (b"solid\nvertex 0 0 0\nendsolid", "line 2: a vertex outside"),
        (b"solid\nfacet\nvertex 0 0 z\nendsolid", "line 3: not a number"),
        (b"solid\nhello\nendsolid", "line 2: neither a statement"),
    ],
)
def test_stl_files_that_lie(data: bytes, said: str) -> None:
    with pytest.raises(StlError, match=said):
        parse_stl(data, MANY)


# glTF

POINTS = BOX.vertices.astype("<f4")
INDICES = BOX.faces.astype("<u2")


def tree(**replaced: Any) -> dict[str, Any]:
    """A box; views are 0 positions and 1 indices, and so are accessors."""
    blob = POINTS.tobytes() + INDICES.tobytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(blob).decode()
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 96},
            {"buffer": 0, "byteOffset": 96, "byteLength": 72},
        ],
        "buffers": [{"byteLength": len(blob), "uri": uri}],
        **replaced,
    }


def changed(kind: str, index: int, **values: Any) -> dict[str, Any]:
    made = tree()
    made[kind][index] = {**made[kind][index], **values}
    return made


def read(made: dict[str, Any], max_faces: int = MANY, max_bytes: int = 2**20) -> Float64:
    """All triangles, transformed."""
    parts = parse_gltf(json.dumps(made).encode(), max_faces, max_bytes)
    return np.concatenate(
        [(points @ m[:3, :3].T + m[:3, 3])[faces] for m, points, faces in parts]
        + [np.zeros((0, 3, 3))]
    )


def test_a_gltf_box() -> None:
    np.testing.assert_allclose(read(tree()), BOX.triangles, atol=1e-6)
    np.testing.assert_allclose(read(tree(scenes=[], scene=0)), BOX.triangles, atol=1e-6)


def test_transforms_multiply_down_the_tree() -> None:
    half = float(np.sqrt(0.5))
    turn = {"rotation": [0, 0, half, half], "translation": [5, 0, 0], "children": [1]}
    inner = {"mesh": 0, "scale": [2, 1, 1], "translation": [0, 1, 0]}
    found = read(tree(nodes=[{"mesh": 0, **turn}, inner]))
    x, y, z = np.moveaxis(BOX.triangles, 2, 0)
    # a quarter turn about z takes x to y and y to -x
    moved = np.stack([5 - (y + 1), 2 * x, z], axis=2)
    np.testing.assert_allclose(found[12:], moved, atol=1e-6)
    np.testing.assert_allclose(found[:12], np.stack([5 - y, x, z], axis=2), atol=1e-6)
    matrix = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 7, 8, 9, 1]
    shifted = read(tree(nodes=[{"mesh": 0, "matrix": matrix}]))
    np.testing.assert_allclose(shifted, BOX.triangles + np.array([7, 8, 9]), atol=1e-6)


def test_a_chain_of_thousands_of_nodes() -> None:
    nodes: list[dict[str, Any]] = [
        {"children": [i + 1], "translation": [0.001, 0, 0]} for i in range(5000)
    ]
    found = read(tree(nodes=[*nodes, {"mesh": 0}]))
    np.testing.assert_allclose(found, BOX.triangles + np.array([5, 0, 0]), atol=1e-6)


def test_strips_fans_and_other_modes() -> None:
    flat = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype="<f4")
    uri = "data:;base64," + base64.b64encode(flat.tobytes()).decode()
    made = tree(
        buffers=[{"byteLength": 48, "uri": uri}],
        bufferViews=[{"buffer": 0, "byteLength": 48}],
        accessors=[{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}],
    )
    for mode, faces in {5: [[0, 1, 2], [1, 3, 2]], 6: [[1, 2, 0], [2, 3, 0]], 1: []}.items():
        made["meshes"] = [{"primitives": [{"attributes": {"POSITION": 0}, "mode": mode}]}]
        np.testing.assert_array_equal(read(made), flat[np.array(faces, dtype=int).reshape(-1, 3)])


def test_strides_sparse_and_normalised_positions() -> None:
    wide = np.zeros((8, 5), dtype="<f4")
    wide[:, 1:4] = POINTS
    values = np.array([[9, 9, 9]], dtype="<f4").tobytes()
    blob = wide.tobytes() + INDICES.tobytes() + struct.pack("<H", 3) + bytes(2) + values
    made = changed(
        "accessors",
        0,
        byteOffset=4,
        sparse={
            "count": 1,
            "indices": {"bufferView": 2, "componentType": 5123},
            "values": {"bufferView": 3},
        },
    )
    made["buffers"][0] = {
        "byteLength": len(blob),
        "uri": "data:;base64," + base64.b64encode(blob).decode(),
    }
    made["bufferViews"] = [
        {"buffer": 0, "byteLength": 160, "byteStride": 20},
        {"buffer": 0, "byteOffset": 160, "byteLength": 72},
        {"buffer": 0, "byteOffset": 232, "byteLength": 2},
        {"buffer": 0, "byteOffset": 236, "byteLength": 12},
    ]
    points = BOX.vertices.copy()
    points[3] = 9
    np.testing.assert_allclose(read(made), points[BOX.faces], atol=1e-6)
    short = np.array([[0, 0, 0], [32767, 0, 0], [0, -32767, 0]], dtype="<i2").tobytes()
    made = tree(
        meshes=[{"primitives": [{"attributes": {"POSITION": 0}}]}],
        accessors=[
            {"bufferView": 0, "componentType": 5122, "count": 3, "type": "VEC3", "normalized": True}
        ],
        bufferViews=[{"buffer": 0, "byteLength": 18}],
        buffers=[{"byteLength": 18, "uri": "data:;base64," + base64.b64encode(short).decode()}],
    )
    np.testing.assert_allclose(read(made), [[[0, 0, 0], [1, 0, 0], [0, -1, 0]]])


def test_a_library_s_own_files() -> None:
    scene = trimesh.Scene([trimesh.creation.box((1, 2, 3)), trimesh.creation.icosphere(2)])
    scene.apply_transform(trimesh.transformations.rotation_matrix(1, [1, 2, 3], [4, 5, 6]))
    data = scene.export(file_type="glb")
    parts = parse_gltf(data, MANY, 2**24)
    found = np.concatenate([(p @ m[:3, :3].T + m[:3, 3])[f] for m, p, f in parts])
    theirs = trimesh.load(io.BytesIO(data), file_type="glb", force="mesh", process=False)
    np.testing.assert_allclose(found.min(axis=(0, 1)), theirs.bounds[0], atol=1e-5)
    np.testing.assert_allclose(found.max(axis=(0, 1)), theirs.bounds[1], atol=1e-5)
    assert len(found) == len(theirs.faces)
    for cut in range(0, len(data), 97):
        with pytest.raises(GltfError):
            parse_gltf(data[:cut], MANY, 2**24)


LIES = {
    "count beyond": (changed("accessors", 0, count=9), "reach beyond bufferViews"),
    "count huge": (changed("accessors", 0, count=10**15), "larger than limits.max_bytes"),
    "no view huge": (
        tree(accessors=[{"componentType": 5126, "count": 10**10, "type": "VEC3"}] * 2),
        "larger than limits.max_bytes",
    ),
    "count negative": (changed("accessors", 0, count=-1), "not a whole number"),
    "count fraction": (changed("accessors", 0, count=1.5), "not a whole number"),
    "view beyond": (changed("bufferViews", 1, byteLength=73), "reaches beyond its buffer"),
    "offset negative": (changed("bufferViews", 1, byteOffset=-4), "not a whole number"),
    "stride small": (changed("bufferViews", 0, byteStride=4), "from 12 up"),
    "buffer short": (changed("buffers", 0, byteLength=169), "says 169 bytes, but there are 168"),
    "buffer missing": (changed("bufferViews", 0, buffer=1), "buffers\\[1\\] is named but"),
    "index negative": (changed("nodes", 0, mesh=-1), "not a whole number"),
    "mesh missing": (changed("nodes", 0, mesh=1), "meshes\\[1\\] is named but"),
    "scene missing": (tree(scene=1), "scenes\\[1\\] is named but"),
    "signed indices": (changed("accessors", 1, componentType=5122), "unsigned"),
    "positions of whole numbers": (changed("accessors", 0, componentType=5125), "aren't of floats"),
    "positions of two": (changed("accessors", 0, type="VEC2"), "not VEC3"),
    "index beyond": (changed("accessors", 0, count=7), "from 0 to 7, but there are 7"),
    "corners odd": (changed("accessors", 1, count=35), "make no triangles"),
    "own child": (changed("nodes", 0, children=[0]), "own ancestor"),
    "two parents": (tree(scenes=[{"nodes": [0, 0]}]), "two parents"),
    "projective": (changed("nodes", 0, matrix=[1] * 16), "isn't affine"),
    "matrix short": (changed("nodes", 0, matrix=[1.0] * 15), "isn't 16 finite"),
    "no rotation": (changed("nodes", 0, rotation=[0, 0, 0, 0]), "is zero"),
    "needs draco": (tree(extensionsRequired=["KHR_draco_mesh_compression"]), "isn't supported"),
    "needs instancing": (tree(extensionsRequired=["EXT_mesh_gpu_instancing"]), "isn't supported"),
    "version 1": (tree(asset={"version": "1.0"}), "only 2.x"),
    "no asset": (tree(asset=None), "only 2.x"),
    "base64": (changed("buffers", 0, uri="data:;base64,!!"), "base64 of buffers"),
    "outside": (changed("buffers", 0, uri="../x.bin"), "lies outside the file"),
    "meshes no list": (tree(meshes={}), "meshes isn't a list"),
}


@pytest.mark.parametrize("name", LIES)
def test_gltf_files_that_lie(name: str) -> None:
    made, said = LIES[name]
    with pytest.raises(GltfError, match=said):
        read(made)


def test_gltf_limits_hold_for_instances_and_overlapping_views() -> None:
    nodes = [{"mesh": 0} for _ in range(5)]
    made = tree(nodes=nodes, scenes=[{"nodes": list(range(5))}])
    assert len(read(made, max_faces=60)) == 60
    with pytest.raises(TooManyFacesError):
        read(made, max_faces=59)
    meshes = [tree()["meshes"][0] for _ in range(100)]
    many = tree(
        meshes=meshes,
        nodes=[{"mesh": i} for i in range(100)],
        scenes=[{"nodes": list(range(100))}],
    )
    with pytest.raises(GltfError, match="larger than limits.max_bytes"):
        read(many, max_bytes=10_000)


def test_gltf_vertices_count_as_often_as_they_are_placed_and_arrays_once() -> None:
    lone = {"componentType": 5126, "count": 40_000, "type": "VEC3", "bufferView": 0}
    blob = np.zeros((40_000, 3), dtype="<f4")
    blob[:8] = POINTS
    data = blob.tobytes() + INDICES.tobytes()
    made = tree(
        accessors=[lone, tree()["accessors"][1]],
        buffers=[{"byteLength": len(data), "uri": "data:," + urllib.parse.quote_from_bytes(data)}],
        bufferViews=[
            {"buffer": 0, "byteLength": blob.nbytes},
            {"buffer": 0, "byteOffset": blob.nbytes, "byteLength": 72},
        ],
        meshes=[{"primitives": tree()["meshes"][0]["primitives"] * 50}],
        nodes=[{"mesh": 0}] * 20,
        scenes=[{"nodes": list(range(20))}],
    )
    parts = parse_gltf(json.dumps(made).encode(), MANY, 2**21)
    # of the vertices only those in use are placed
    assert {len(points) for _, points, _ in parts} == {8}
    assert len(parts) == 1000
    with pytest.raises(GltfError, match=r"the vertices of node \d+: the arrays together"):
        parse_gltf(json.dumps(made).encode(), MANY, 40_000 * 24 + 36 * 8 + 10 * 50 * 8 * 24)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"glTF" + bytes(3), "within its header"),
        (struct.pack("<4sIIII", b"glTF", 1, 20, 0, 0), "version 1"),
        (struct.pack("<4sIIII", b"glTF", 2, 21, 0, 0), "says 21 bytes"),
        (struct.pack("<4sIII4s", b"glTF", 2, 20, 9, b"JSON"), "reaches beyond the file"),
        (struct.pack("<4sIII4s", b"glTF", 2, 20, 0, b"BIN\0"), "first chunk isn't JSON"),
        (b"[", "can't be read"),
        (b"[" * 100_000, "can't be read"),
        (b"[]", "isn't an object"),
        (b'{"asset": NaN}', "holds NaN"),
        (b"\xff\xfe{", "can't be read"),
    ],
)
def test_gltf_containers_that_lie(data: bytes, said: str) -> None:
    with pytest.raises(GltfError, match=said):
        parse_gltf(data, MANY, 2**20)
