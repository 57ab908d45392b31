"""`abstraction.glb`: the cropped mesh as binary glTF 2.0.

Node `solid` holds the mesh in the normalised frame, where float32 is exact enough, and its
matrix is the transform to the input's coordinates.  Each positive's faces are a primitive of
their own colour; all primitives share one accessor of vertices, so that together they are
the closed mesh.  Cuboids are kept in the node's extras.
"""

from __future__ import annotations

import colorsys
import json
import struct
from typing import Any

import numpy as np

from pnabs.formats.abstraction import Abstraction
from pnabs.formats.json_format import VERSION, cuboid_records
from pnabs.geometry.solidify import SolidMesh

_ARRAY_BUFFER, _ELEMENT_ARRAY_BUFFER = 34962, 34963
_FLOAT, _UNSIGNED_INT = 5126, 5125
_GOLDEN = 0.6180339887498949


def colour(index: int) -> tuple[float, float, float]:
    """A colour for each index, well apart from its neighbours: linear RGB, each in 0..1."""
    hue = (0.58 + index * _GOLDEN) % 1.0
    value = (0.92, 0.72)[index % 2]
    srgb = colorsys.hsv_to_rgb(hue, (0.55, 0.7, 0.42)[index % 3], value)
    red, green, blue = (round(channel**2.2, 4) for channel in srgb)
    return red, green, blue


def to_glb(abstraction: Abstraction, solid: SolidMesh | None = None) -> bytes:
    """The abstraction as binary glTF; the same abstraction gives the same bytes.

    Parameters
    ----------
    abstraction : Abstraction
    solid : SolidMesh, optional
        Its mesh, where that is at hand.

    Returns
    -------
    bytes
        A file without a mesh if the result is empty.
    """
    solid = abstraction.solid if solid is None else solid
    # glTF stores matrices column by column.
    columns = np.asarray(abstraction.transform, dtype=np.float64).T.ravel().tolist()
    node: dict[str, Any] = {
        "name": "solid",
        "matrix": columns,
        "extras": {
            "format": "pnabs/abstraction",
            "version": VERSION,
            "category": abstraction.category,
            "model_id": abstraction.model_id,
            "positives": cuboid_records(abstraction.positives),
            "negatives": cuboid_records(abstraction.negatives),
        },
    }
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "pnabs"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [node],
    }
    binary = b""
    if not solid.is_empty:
        node["mesh"] = 0
        binary = _add_mesh(document, solid)
    return _pack(document, binary)


def _add_mesh(document: dict[str, Any], solid: SolidMesh) -> bytes:
    """Describe the mesh in the document and return its buffer."""
    order = np.argsort(solid.source, kind="stable")
    sources, counts = np.unique(solid.source, return_counts=True)
    positions = solid.vertices.astype("<f4").tobytes()
    indices = solid.faces[order].astype("<u4").tobytes()
    accessors: list[dict[str, Any]] = [
        {
            "bufferView": 0,
            "componentType": _FLOAT,
            "count": len(solid.vertices),
            "type": "VEC3",
            "min": solid.vertices.min(axis=0).tolist(),
            "max": solid.vertices.max(axis=0).tolist(),
        }
    ]
    materials, primitives = [], []
    first = 0
    for number, (source, count) in enumerate(zip(sources.tolist(), counts.tolist(), strict=True)):
        accessors.append(
            {
                "bufferView": 1,
                "byteOffset": 12 * first,
                "componentType": _UNSIGNED_INT,
                "count": 3 * count,
                "type": "SCALAR",
            }
        )
        name = f"positive {source}"
        base = {"baseColorFactor": [*colour(source), 1.0], "metallicFactor": 0.0}
        materials.append({"name": name, "pbrMetallicRoughness": {**base, "roughnessFactor": 0.8}})
        primitives.append(
            {"attributes": {"POSITION": 0}, "indices": number + 1, "material": number, "mode": 4}
        )
        first += count
    document["meshes"] = [{"name": "solid", "primitives": primitives}]
    document["materials"] = materials
    document["accessors"] = accessors
    document["bufferViews"] = [
        {
            "buffer": 0,
            "byteOffset": 0,
            "byteLength": len(positions),
            "target": _ARRAY_BUFFER,
        },
        {
            "buffer": 0,
            "byteOffset": len(positions),
            "byteLength": len(indices),
            "target": _ELEMENT_ARRAY_BUFFER,
        },
    ]
    document["buffers"] = [{"byteLength": len(positions) + len(indices)}]
    return positions + indices


def _pack(document: dict[str, Any], binary: bytes) -> bytes:
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    chunks = [_chunk(b"JSON", text, b" ")]
    if binary:
        chunks.append(_chunk(b"BIN\0", binary, b"\0"))
    body = b"".join(chunks)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def _chunk(kind: bytes, data: bytes, pad: bytes) -> bytes:
    padded = data + pad * (-len(data) % 4)
    return struct.pack("<I4s", len(padded), kind) + padded
