"""A glTF 2.0 document under construction, packed as one binary file."""

from __future__ import annotations

import colorsys
import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pnabs.geometry.types import Float32

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


class GltfDocument:
    """Nodes below one scene, meshes of coloured primitives, and their buffer."""

    def __init__(self) -> None:
        self.nodes: list[dict[str, Any]] = []
        self._meshes: list[dict[str, Any]] = []
        self._materials: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._views: list[dict[str, Any]] = []
        self._binary = b""

    def add_node(self, node: dict[str, Any]) -> int:
        """Add a node; returns its number.  The first is the scene's."""
        self.nodes.append(node)
        return len(self.nodes) - 1

    def add_mesh(
        self,
        name: str,
        vertices: Float32,
        faces: NDArray[np.integer],
        counts: list[int],
        sources: list[int],
    ) -> int:
        """Add a mesh of which all primitives share the vertices; returns its number.

        Parameters
        ----------
        vertices : (V, 3) float32
        faces : (F, 3) int
            Those of one primitive after those of the other.
        counts
            Faces of each primitive.
        sources
            The positive of each, by which it is named and coloured.
        """
        corners = self._add_view(vertices.astype("<f4").tobytes(), _ARRAY_BUFFER)
        position = self._add_accessor(
            {
                "bufferView": corners,
                "componentType": _FLOAT,
                "count": len(vertices),
                "type": "VEC3",
                "min": vertices.min(axis=0).tolist(),
                "max": vertices.max(axis=0).tolist(),
            }
        )
        indices = self._add_view(faces.astype("<u4").tobytes(), _ELEMENT_ARRAY_BUFFER)
        primitives = []
        first = 0
        for count, source in zip(counts, sources, strict=True):
            accessor = {
                "bufferView": indices,
                "byteOffset": 12 * first,
                "componentType": _UNSIGNED_INT,
                "count": 3 * count,
                "type": "SCALAR",
            }
            primitives.append(
                {
                    "attributes": {"POSITION": position},
                    "indices": self._add_accessor(accessor),
                    "material": self._material(source),
                    "mode": 4,
                }
            )
            first += count
        self._meshes.append({"name": name, "primitives": primitives})
        return len(self._meshes) - 1

    def to_bytes(self) -> bytes:
        """The document and its buffer as a .glb file."""
        document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "pnabs"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": self.nodes,
        }
        if self._meshes:
            document["meshes"] = self._meshes
            document["materials"] = self._materials
            document["accessors"] = self._accessors
            document["bufferViews"] = self._views
            document["buffers"] = [{"byteLength": len(self._binary)}]
        text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
        chunks = [_chunk(b"JSON", text, b" ")]
        if self._binary:
            chunks.append(_chunk(b"BIN\0", self._binary, b"\0"))
        body = b"".join(chunks)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body

    def _material(self, source: int) -> int:
        name = f"positive {source}"
        for number, known in enumerate(self._materials):
            if known["name"] == name:
                return number
        base = {"baseColorFactor": [*colour(source), 1.0], "metallicFactor": 0.0}
        look = {**base, "roughnessFactor": 0.8}
        self._materials.append({"name": name, "pbrMetallicRoughness": look})
        return len(self._materials) - 1

    def _add_accessor(self, accessor: dict[str, Any]) -> int:
        self._accessors.append(accessor)
        return len(self._accessors) - 1

    def _add_view(self, data: bytes, target: int) -> int:
        start = len(self._binary)
        view = {"buffer": 0, "byteOffset": start, "byteLength": len(data), "target": target}
        self._views.append(view)
        self._binary += data
        return len(self._views) - 1


def _chunk(kind: bytes, data: bytes, pad: bytes) -> bytes:
    padded = data + pad * (-len(data) % 4)
    return struct.pack("<I4s", len(padded), kind) + padded
