"""glTF 2.0, as far as shape goes: positions, indices and the nodes' transforms.

The library at hand loses or misplaces parts where names clash, a node has several primitives
and children, or positions are sparse or normalised, and pays for what a file merely claims.
Here every claim is checked before it is paid for, and what isn't understood is refused.
"""

from __future__ import annotations

import base64
import binascii
import json
import math
import struct
import urllib.parse
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pnabs.geometry.polygon import TooManyFacesError
from pnabs.geometry.types import Float64, Int64

Part = tuple[Float64, Float64, Int64]
"""Node's matrix (4, 4), vertices (V, 3), faces (F, 3)."""

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_UNSIGNED = (5121, 5123, 5125)
_POSITIONS = (5120, 5121, 5122, 5123, 5126)
_HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_mesh_quant")
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_MOST_VALUES = 8_000_000


class GltfError(ValueError):
    """What is wrong with a glTF file, and at which of its objects."""


def parse_gltf(
    data: bytes,
    max_faces: int,
    max_bytes: int,
    read_sibling: Callable[[str], bytes] | None = None,
) -> list[Part]:
    """The triangles of the default scene, node by node, in the rest pose.

    Lines and points are passed over, and so are skins and morph targets.

    Parameters
    ----------
    data : bytes
        Binary (.glb) or JSON (.gltf), told apart by the first bytes.
    max_faces : int
        Most triangles, instances counted.
    max_bytes : int
        Most bytes of all arrays together, as they are read.
    read_sibling : callable, optional
        Gives the content of a file that a buffer names.

    Raises
    ------
    GltfError
    TooManyFacesError
    """
    chunk = None
    if data[:4] == b"glTF":
        data, chunk = _chunks(data)
    # brackets and commas tell how many objects the text becomes, tens of bytes each
    if sum(data.count(mark) for mark in (b"[", b"{", b",")) > _MOST_VALUES:
        raise GltfError(f"its JSON has more than {_MOST_VALUES:,} values")
    try:
        tree = json.loads(data, parse_constant=_no_constant)
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise GltfError(f"its JSON can't be read ({type(error).__name__}: {error})") from None
    return _File(tree, chunk, max_faces, max_bytes, read_sibling).parts()


def _no_constant(name: str) -> float:
    raise GltfError(f"its JSON holds {name}, which is no number")


def _chunks(data: bytes) -> tuple[bytes, bytes | None]:
    """The JSON and the binary chunk of a .glb file."""
    if len(data) < 20:
        raise GltfError("the file ends within its header")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise GltfError(f"glTF version {version}; only 2 is read")
    if length != len(data):
        raise GltfError(f"its header says {length:,} bytes, the file has {len(data):,}")
    found: list[tuple[bytes, bytes]] = []
    at = 12
    while at + 8 <= length and len(found) < 2:
        (size,) = struct.unpack_from("<I", data, at)
        if at + 8 + size > length:
            raise GltfError(f"a chunk says {size:,} bytes and reaches beyond the file")
        found.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + size]))
        at += 8 + size
    if not found or found[0][0] != b"JSON":
        raise GltfError("its first chunk isn't JSON")
    binary = found[1][1] if len(found) > 1 and found[1][0] == b"BIN\0" else None
    return found[0][1], binary


def _whole(value: Any, what: str, low: int = 0) -> int:
    """A whole number that JSON gave."""
    if isinstance(value, bool) or not isinstance(value, int) or value < low:
        raise GltfError(f"{what} is {value!r}, not a whole number from {low} up")
    return value


def _numbers(value: Any, count: int, what: str) -> Float64:
    """So many finite numbers that JSON gave."""
    good = isinstance(value, list) and len(value) == count
    if not good or not all(type(x) in (int, float) and abs(x) < 1e300 for x in value):
        raise GltfError(f"{what} isn't {count} finite numbers")
    return np.array(value, dtype=np.float64)


class _File:
    """A parsed file, its arrays read on demand."""

    def __init__(
        self,
        tree: Any,
        chunk: bytes | None,
        max_faces: int,
        max_bytes: int,
        read_sibling: Callable[[str], bytes] | None,
    ) -> None:
        if not isinstance(tree, dict):
            raise GltfError("its JSON isn't an object")
        asset = tree.get("asset")
        version = asset.get("version") if isinstance(asset, dict) else None
        if not str(version).startswith("2."):
            raise GltfError(f"asset.version is {version!r}; only 2.x is read")
        required = tree.get("extensionsRequired", [])
        for name in required if isinstance(required, list) else [required]:
            if not str(name).startswith(_HARMLESS):
                raise GltfError(f"it needs the extension {str(name)[:60]!r}, which isn't supported")
        self._tree = tree
        self._chunk = chunk
        self._max_faces = max_faces
        self._left = max_bytes
        self._read_sibling = read_sibling
        self._buffers: dict[int, bytes] = {}
        self._arrays: dict[tuple[int, str], NDArray[Any]] = {}

    def parts(self) -> list[Part]:
        """Every node's primitives."""
        meshes: dict[int, list[tuple[Float64, Int64]]] = {}
        out: list[Part] = []
        faces = 0
        seen = set()
        waiting = [(index, np.eye(4)) for index in reversed(self._roots())]
        while waiting:
            index, above = waiting.pop()
            if index in seen:
                raise GltfError(f"node {index} has two parents, or is its own ancestor")
            seen.add(index)
            node = self._object("nodes", index)
            matrix = above @ _matrix(node, f"node {index}")
            if "mesh" in node:
                number = _whole(node["mesh"], f"the mesh of node {index}")
                if number not in meshes:
                    meshes[number] = self._mesh(number)
                faces += sum(len(triangles) for _, triangles in meshes[number])
                if faces > self._max_faces:
                    raise TooManyFacesError
                points = sum(len(points) for points, _ in meshes[number])
                self._charge(points * 24, f"the vertices of node {index}")
                out += [(matrix, points, triangles) for points, triangles in meshes[number]]
            children = node.get("children", [])
            if not isinstance(children, list):
                raise GltfError(f"the children of node {index} aren't a list")
            waiting += [
                (_whole(child, f"a child of node {index}"), matrix) for child in reversed(children)
            ]
        return out

    def _charge(self, size: int, what: str) -> None:
        """Take bytes off what the arrays may have together."""
        self._left -= size
        if self._left < 0:
            raise GltfError(f"{what}: the arrays together are larger than limits.max_bytes")

    def _roots(self) -> list[int]:
        if self._list("scenes"):
            number = _whole(self._tree.get("scene", 0), "scene")
            roots = self._object("scenes", number).get("nodes", [])
            if not isinstance(roots, list):
                raise GltfError(f"the nodes of scene {number} aren't a list")
            return [_whole(root, f"a node of scene {number}") for root in roots]
        nodes = self._list("nodes")
        below = {
            child
            for node in nodes
            if isinstance(node, dict) and isinstance(node.get("children"), list)
            for child in node["children"]
            if isinstance(child, int)
        }
        return [index for index in range(len(nodes)) if index not in below]

    def _list(self, kind: str) -> list[Any]:
        found = self._tree.get(kind, [])
        if not isinstance(found, list):
            raise GltfError(f"{kind} isn't a list")
        return found

    def _object(self, kind: str, index: int) -> dict[str, Any]:
        found = self._list(kind)
        if index >= len(found) or not isinstance(found[index], dict):
            raise GltfError(f"{kind}[{index}] is named but isn't there")
        item: dict[str, Any] = found[index]
        return item

    def _mesh(self, number: int) -> list[tuple[Float64, Int64]]:
        out = []
        primitives = self._object("meshes", number).get("primitives", [])
        if not isinstance(primitives, list):
            raise GltfError(f"the primitives of mesh {number} aren't a list")
        for place, primitive in enumerate(primitives):
            what = f"primitive {place} of mesh {number}"
            if not isinstance(primitive, dict):
                raise GltfError(f"{what} isn't an object")
            mode = primitive.get("mode", _TRIANGLES)
            if mode not in (_TRIANGLES, _STRIP, _FAN):
                continue
            if "KHR_draco_mesh_compression" in str(primitive.get("extensions"))[:1000]:
                raise GltfError(f"{what} is compressed by Draco, which isn't supported")
            attributes = primitive.get("attributes")
            if not isinstance(attributes, dict) or "POSITION" not in attributes:
                continue
            points = self._array(attributes["POSITION"], "VEC3", f"the positions of {what}")
            order = np.arange(len(points))
            if "indices" in primitive:
                indices = self._array(primitive["indices"], "SCALAR", f"the indices of {what}")
                order = indices.reshape(-1).astype(np.int64)
            if len(order) and int(order.max()) >= len(points):
                raise GltfError(
                    f"{what}: face indices run from {order.min()} to {order.max()}, "
                    f"but there are {len(points):,} vertices"
                )
            faces = _faces(order, mode, what, self._max_faces)
            used, faces = np.unique(faces, return_inverse=True)
            out.append((points[used], faces.reshape(-1, 3).astype(np.int64)))
        return out

    def _array(self, index: Any, kind: str, what: str) -> NDArray[Any]:
        """An accessor's values: float64 (n, 3) for VEC3, whole numbers (n, 1) for SCALAR."""
        number = _whole(index, what)
        if (number, kind) not in self._arrays:
            self._arrays[number, kind] = self._read(number, kind, what)
        return self._arrays[number, kind]

    def _read(self, number: int, kind: str, what: str) -> NDArray[Any]:
        accessor = self._object("accessors", number)
        component = accessor.get("componentType")
        if accessor.get("type") != kind or component not in list(_COMPONENTS):
            raise GltfError(
                f"{what} are {accessor.get('type')!r} of component type {component!r}, "
                f"not {kind} of a known one"
            )
        if component not in (_UNSIGNED if kind == "SCALAR" else _POSITIONS):
            wanted = "an unsigned type" if kind == "SCALAR" else "floats or short whole numbers"
            raise GltfError(f"{what} aren't of {wanted}")
        width = 3 if kind == "VEC3" else 1
        count = _whole(accessor.get("count"), f"the count of {what}")
        self._charge(count * width * 8, what)
        if "bufferView" in accessor:
            offset = _whole(accessor.get("byteOffset", 0), f"the offset of {what}")
            raw = self._rows(accessor["bufferView"], offset, count, component, width, what)
        else:
            raw = np.zeros((count, width), dtype=_COMPONENTS[component])
        if "sparse" in accessor:
            raw = self._sparse(accessor["sparse"], raw.copy(), component, what)
        if kind == "SCALAR":
            return raw
        values: Float64 = raw.astype(np.float64)
        if component != 5126 and accessor.get("normalized") is True:
            values = np.maximum(values / np.iinfo(raw.dtype).max, -1.0)
        return values

    def _sparse(self, sparse: Any, values: NDArray[Any], component: int, what: str) -> NDArray[Any]:
        """Values with some of them replaced."""
        try:
            count = _whole(sparse["count"], f"the sparse count of {what}")
            where, which = sparse["indices"], sparse["values"]
            kind = where["componentType"]
            views = where["bufferView"], which["bufferView"]
            offsets = [_whole(item.get("byteOffset", 0), what) for item in (where, which)]
        except (KeyError, TypeError, AttributeError):
            raise GltfError(f"{what}: their sparse part isn't complete") from None
        if kind not in _UNSIGNED or count > len(values):
            raise GltfError(f"{what}: their sparse part is of another size or type")
        places = self._rows(views[0], offsets[0], count, kind, 1, what)[:, 0].astype(np.int64)
        if count and int(places.max()) >= len(values):
            raise GltfError(f"{what}: their sparse part reaches beyond them")
        values[places] = self._rows(views[1], offsets[1], count, component, values.shape[1], what)
        return values

    def _rows(
        self, index: Any, offset: int, count: int, component: int, width: int, what: str
    ) -> NDArray[Any]:
        """Rows of a buffer view, (count, width), as they lie there."""
        number = _whole(index, f"the view of {what}")
        view = self._object("bufferViews", number)
        name = f"bufferViews[{number}]"
        data = self._buffer(_whole(view.get("buffer"), f"the buffer of {name}"))
        start = _whole(view.get("byteOffset", 0), f"the offset of {name}")
        length = _whole(view.get("byteLength"), f"the length of {name}")
        kind = np.dtype(_COMPONENTS[component])
        row = width * kind.itemsize
        stride = _whole(view.get("byteStride", row), f"the stride of {name}", row)
        if start + length > len(data):
            raise GltfError(f"{name} reaches beyond its buffer of {len(data):,} bytes")
        if count and offset + stride * (count - 1) + row > length:
            raise GltfError(f"{what} reach beyond {name} of {length:,} bytes")
        return np.ndarray((count, width), kind, data, start + offset, (stride, kind.itemsize))

    def _buffer(self, index: int) -> bytes:
        if index not in self._buffers:
            buffer = self._object("buffers", index)
            length = _whole(buffer.get("byteLength"), f"the length of buffers[{index}]")
            found = self._content(buffer.get("uri"), index)
            if len(found) < length:
                raise GltfError(
                    f"buffers[{index}] says {length:,} bytes, but there are {len(found):,}"
                )
            self._buffers[index] = found[:length]
        return self._buffers[index]

    def _content(self, uri: Any, index: int) -> bytes:
        if uri is None:
            if index or self._chunk is None:
                raise GltfError(f"buffers[{index}] has no content")
            return self._chunk
        if not isinstance(uri, str):
            raise GltfError(f"the uri of buffers[{index}] isn't a text")
        if uri.startswith("data:"):
            head, _, body = uri.partition(",")
            try:
                if head.endswith(";base64"):
                    return base64.b64decode(body, validate=True)
            except (binascii.Error, ValueError) as error:
                raise GltfError(f"the base64 of buffers[{index}] is damaged ({error})") from None
            return urllib.parse.unquote_to_bytes(body)
        shown = uri[:200]
        if self._read_sibling is None:
            raise GltfError(f"the buffer {shown!r} lies outside the file and can't be read")
        try:
            return self._read_sibling(urllib.parse.unquote(uri))
        except Exception as error:
            reason = " ".join(str(error).split())[:200]
            raise GltfError(f"the buffer {shown!r} can't be read ({reason})") from error


def _matrix(node: dict[str, Any], what: str) -> Float64:
    """A node's own transform, (4, 4)."""
    if "matrix" in node:
        matrix = _numbers(node["matrix"], 16, f"the matrix of {what}").reshape(4, 4).T
        if not np.allclose(matrix[3], [0, 0, 0, 1], atol=1e-6):
            raise GltfError(f"the matrix of {what} isn't affine")
        return matrix
    matrix = np.eye(4)
    if "rotation" in node:
        x, y, z, w = _numbers(node["rotation"], 4, f"the rotation of {what}")
        norm = math.sqrt(x * x + y * y + z * z + w * w)
        if norm < 1e-12:
            raise GltfError(f"the rotation of {what} is zero")
        x, y, z, w = x / norm, y / norm, z / norm, w / norm
        matrix[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    if "scale" in node:
        matrix[:3, :3] *= _numbers(node["scale"], 3, f"the scale of {what}")
    if "translation" in node:
        matrix[:3, 3] = _numbers(node["translation"], 3, f"the translation of {what}")
    return matrix


def _faces(order: Int64, mode: int, what: str, max_faces: int) -> Int64:
    """Triangles of a list, a strip or a fan of vertices, (F, 3)."""
    count = len(order) // 3 if mode == _TRIANGLES else max(len(order) - 2, 0)
    if count > max_faces:
        raise TooManyFacesError
    if mode == _TRIANGLES:
        if len(order) % 3:
            raise GltfError(f"{what} has {len(order):,} corners, which make no triangles")
        return order.reshape(-1, 3)
    if mode == _FAN:
        return np.stack([order[1 : count + 1], order[2:], np.repeat(order[:1], count)], axis=1)
    strip = np.stack([order[:count], order[1 : count + 1], order[2 : count + 2]], axis=1)
    strip[1::2] = strip[1::2, [0, 2, 1]]
    return strip
