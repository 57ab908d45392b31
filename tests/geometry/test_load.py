"""Mesh files of every format, and files that only look like them."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pnabs.geometry.load import SUFFIXES, InvalidMeshError, parse_mesh
from pnabs.geometry.types import Mesh
from pnabs.settings import Limits

LIMITS = Limits()
CORNERS = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"
POSITIONS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=np.float32).tobytes()
BUFFER = POSITIONS + np.array([0, 1, 2], dtype=np.uint32).tobytes()


def exported(shape: trimesh.Trimesh, suffix: str) -> bytes:
    data = shape.export(file_type=suffix[1:])
    return data if isinstance(data, bytes) else data.encode()


def gltf(buffer: bytes | str = BUFFER, **replaced: Any) -> bytes:
    """One triangle; `buffer` is embedded, or named if a string."""
    uri = buffer
    if isinstance(buffer, bytes):
        uri = "data:application/octet-stream;base64," + base64.b64encode(buffer).decode()
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"uri": uri, "byteLength": len(BUFFER)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 12},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"},
        ],
    }
    return json.dumps(tree | replaced).encode()


def sorted_triangles(mesh: Mesh) -> list[list[tuple[float, ...]]]:
    """Triangles as sets of corners, whatever the order of vertices and faces."""
    return sorted(sorted(tuple(c) for c in t.round(5)) for t in mesh.triangles)


@pytest.mark.parametrize("suffix", [s for s in SUFFIXES if s != ".gltf"])
def test_every_format_gives_the_same_triangles(suffix: str) -> None:
    shape = trimesh.creation.box((1, 2, 3)).apply_translation((5, 6, 7))
    read = parse_mesh(exported(shape, suffix), suffix.upper(), LIMITS)
    assert read.vertices.dtype == np.float64
    assert read.faces.dtype == np.int64
    expected = Mesh(np.array(shape.vertices), np.array(shape.faces))
    assert sorted_triangles(read) == sorted_triangles(expected)


def test_obj_dialects() -> None:
    reference = parse_mesh(CORNERS + b"f 1 2 3\n", ".obj", LIMITS).triangles
    for data in (
        CORNERS + b"f -3 -2 -1\n",
        CORNERS + b"f 1// 2// 3//\n",
        (CORNERS + b"f 1 2 3\n").replace(b"\n", b"\r\n"),
        (CORNERS + b"f 1 2 3\n").replace(b"\n", b"\r"),
        b"\xef\xbb\xbf" + CORNERS + b"f 1 2 3 # not 0\n",
        b"mtllib ../../../etc/passwd\nusemtl caf\xe9\n" + CORNERS + b"l 1 2\nf 1 2 3\n",
        b"v 0 0 0 .1 .2 .3\nv 1 0 0 .1 .2 .3\nv 0 1 0 .1 .2 .3\nf 1 2 3\n",
    ):
        np.testing.assert_array_equal(parse_mesh(data, ".obj", LIMITS).triangles, reference)


def test_polygons_are_split() -> None:
    mesh = parse_mesh(CORNERS + b"v 1 1 0\nf 1 2 4 3\n", ".obj", LIMITS)
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == 1


def test_node_transforms_apply_and_a_mirrored_node_keeps_its_front() -> None:
    nodes = [{"mesh": 0, "scale": [-2, 2, 2], "translation": [10, 0, 0]}, {"mesh": 0}]
    mesh = parse_mesh(gltf(nodes=nodes, scenes=[{"nodes": [0, 1]}]), ".gltf", LIMITS)
    assert sorted(mesh.vertices[:, 0]) == [0, 0, 1, 8, 10, 10]
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    normals = np.cross(b - a, c - a)
    # reflecting the solid in x leaves a front that looks along +z looking along +z
    assert sorted(normals[:, 2]) == [1, 4]


def test_named_buffers_come_from_the_caller_alone() -> None:
    asked = []

    def read(name: str) -> bytes:
        asked.append(name)
        return BUFFER

    images = {"images": [{"uri": "../secret.png"}], "textures": [{"source": 0}]}
    material = {"materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]}
    mesh = parse_mesh(gltf("a%20b.bin", **images, **material), ".gltf", LIMITS, read)
    assert mesh.faces.shape == (1, 3)
    assert asked == ["a b.bin"]


def missing(name: str) -> bytes:
    raise FileNotFoundError(f"no {name} here")


@pytest.mark.parametrize(("read", "said"), [(None, "outside the file"), (missing, "no x.bin here")])
def test_unreadable_buffers_are_named(read: Callable[[str], bytes] | None, said: str) -> None:
    with pytest.raises(InvalidMeshError, match=said):
        parse_mesh(gltf("x.bin"), ".gltf", LIMITS, read)


INVALID = {
    "empty": (b"", ".obj", "empty"),
    "blank": (b" \n\n", ".stl", "empty"),
    "html": (b"<!doctype html>", ".obj", "no faces"),
    "garbage": (b"\0\xff garbage" * 50, ".glb", "doesn't begin with glTF"),
    "points": (CORNERS, ".obj", "no faces"),
    "lines": (CORNERS + b"l 1 2 3\n", ".obj", "no faces"),
    "index 0": (CORNERS + b"f 1 2 3\nf 0 1 2\n", ".obj", "line 5: face index 0"),
    "index 0 with texture": (CORNERS + b"f 1/1 2/2 0/3\n", ".obj", "line 4: face index 0"),
    "index too high": (
        CORNERS + b"f 1 2 4\n",
        ".obj",
        "line 4: a face names vertex 4, but there are 3",
    ),
    "index too low": (CORNERS + b"f 1 2 -4\n", ".obj", "line 4: a face names a vertex before"),
    "index in a buffer": (
        gltf(POSITIONS + np.array([0, 1, 7], dtype=np.uint32).tobytes()),
        ".gltf",
        "from 0 to 7, but there are 3",
    ),
    "nan": (CORNERS.replace(b"v 1", b"v nan") + b"f 1 2 3\n", ".obj", "1 of 3 vertices"),
    "inf": (CORNERS.replace(b"v 1", b"v 1e999") + b"f 1 2 3\n", ".obj", "the first is vertex 1"),
    "flat": (b"v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\n", ".obj", "zero area"),
    "one point": (b"v 1 1 1\n" * 3 + b"f 1 2 3\n", ".obj", "zero area"),
    "huge": (CORNERS.replace(b"1", b"1e13") + b"f 1 2 3\n", ".obj", "longest side is 1e\\+13"),
    "overflow": (b"v -1e308 0 0\nv 1e308 0 0\nv 0 1 0\nf 1 2 3\n", ".obj", "longest side"),
    "tiny": (CORNERS.replace(b"1", b"1e-13") + b"f 1 2 3\n", ".obj", "longest side is 1e-13"),
    "cycle of nodes": (
        gltf(nodes=[{"mesh": 0, "children": [1]}, {"mesh": 0, "children": [0]}]),
        ".gltf",
        "has two parents",
    ),
    "nested too deep": (b"[" * 100_000, ".gltf", "can't be read"),
    "stl that lies": (
        bytes(80) + struct.pack("<I", 10**9) + bytes(50),
        ".stl",
        "says 1,000,000,000 facets",
    ),
    "unknown suffix": (b"x", ".fbx", "known are .obj"),
}


@pytest.mark.parametrize("name", INVALID)
def test_invalid_files_say_what_is_wrong(name: str) -> None:
    data, suffix, said = INVALID[name]
    with pytest.raises(InvalidMeshError, match=said):
        parse_mesh(data, suffix, LIMITS)


def test_limits_hold_before_parsing() -> None:
    with pytest.raises(InvalidMeshError, match="limits.max_bytes = 10"):
        parse_mesh(CORNERS, ".obj", Limits(max_bytes=10))
    # the face that can't be parsed is never reached
    with pytest.raises(InvalidMeshError, match="more than limits.max_faces = 2"):
        parse_mesh(CORNERS + b"f 1 2 3\n" * 3 + b"f what\n", ".obj", Limits(max_faces=2))


def test_a_part_used_many_times_counts_as_often() -> None:
    many = gltf(nodes=[{"mesh": 0}] * 20, scenes=[{"nodes": list(range(20))}])
    assert len(parse_mesh(many, ".gltf", Limits(max_faces=20)).faces) == 20
    with pytest.raises(InvalidMeshError, match="more than limits.max_faces = 19"):
        parse_mesh(many, ".gltf", Limits(max_faces=19))


@settings(deadline=None)
@given(
    suffix=st.sampled_from(SUFFIXES),
    head=st.sampled_from(
        [b"", b"OFF\n", b"ply\nformat ascii 1.0\n", b"solid x\n", b"glTF\2\0\0\0", b"{", CORNERS]
    ),
    tail=st.binary(max_size=80),
)
@example(suffix=".obj", head=CORNERS, tail=b"f 1 2 3")
def test_any_bytes_are_a_usable_mesh_or_invalid(suffix: str, head: bytes, tail: bytes) -> None:
    try:
        mesh = parse_mesh(head + tail, suffix, LIMITS)
    except InvalidMeshError:
        return
    assert np.isfinite(mesh.triangles).all()
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    assert np.cross(b - a, c - a).any()


@settings(deadline=None)
@given(cut=st.floats(0, 1), suffix=st.sampled_from([".stl", ".ply", ".glb"]))
def test_truncated_binaries_are_invalid(cut: float, suffix: str) -> None:
    data = exported(trimesh.creation.box(), suffix)
    with pytest.raises(InvalidMeshError):
        parse_mesh(data[: int(cut * (len(data) - 1))], suffix, LIMITS)
