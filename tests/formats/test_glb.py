"""abstraction.glb, read back by trimesh and by hand."""

from __future__ import annotations

import io
import json
import struct

import numpy as np
import pytest
import trimesh

from pnabs.formats import Abstraction, to_glb
from pnabs.formats.gltf_document import colour
from pnabs.geometry.solidify import solidify
from pnabs.geometry.types import Cuboids
from pnabs.settings import Abstract
from tests.geometry.boxes import axis_aligned, random_cuboids


def abstraction(
    positives: Cuboids, negatives: Cuboids, transform: np.ndarray | None = None
) -> Abstraction:
    return Abstraction.from_solid(
        solidify(positives, negatives, Abstract(), np.random.default_rng(0)),
        category="chair",
        model_id="one",
        positives=positives,
        negatives=negatives,
        transform=np.eye(4) if transform is None else transform,
        metrics={},
        provenance={},
    )


def read(data: bytes) -> trimesh.Scene:
    return trimesh.load_scene(io.BytesIO(data), file_type="glb")


def document(data: bytes) -> dict[str, object]:
    length = struct.unpack_from("<I", data, 12)[0]
    found: dict[str, object] = json.loads(data[20 : 20 + length])
    return found


def test_pieces_merge_to_the_closed_mesh() -> None:
    one = abstraction(random_cuboids(0, 6), random_cuboids(1, 3))
    scene = read(to_glb(one))
    assert len(scene.geometry) == len(np.unique(one.solid.source))
    merged = scene.to_mesh()
    merged.merge_vertices(merge_tex=True, merge_norm=True)
    expected = one.mesh()
    assert merged.is_watertight
    assert merged.is_winding_consistent
    assert len(merged.faces) == len(expected.faces)
    assert merged.volume == pytest.approx(
        trimesh.Trimesh(expected.vertices, expected.faces).volume, rel=1e-9
    )


def test_a_mesh_far_from_the_origin_survives() -> None:
    transform = np.diag([0.8, 0.8, 0.8, 1.0])
    transform[:3, 3] = [1e6, -2e6, 3e6]
    positives = axis_aligned(([0.5, 0.4, 0.3], [0.1, 0.05, 0]))
    scene = read(to_glb(abstraction(positives, Cuboids.empty(), transform)))
    (node,) = scene.graph.nodes_geometry
    placed, name = scene.graph[node]
    np.testing.assert_array_equal(placed, transform)
    local = scene.geometry[name]
    assert local.volume == pytest.approx(0.06, rel=1e-6)
    np.testing.assert_allclose(
        scene.bounds - transform[:3, 3],
        0.8 * np.array([[-0.15, -0.15, -0.15], [0.35, 0.25, 0.15]]),
        atol=1e-7,
    )


def test_matrix_is_written_by_columns_and_extras_hold_the_cuboids() -> None:
    transform = np.array([[2.0, 0, 0, 5], [0, 2, 0, 6], [0, 0, 2, 7], [0, 0, 0, 1]])
    positives, negatives = random_cuboids(2, 3), random_cuboids(3, 1)
    node = document(to_glb(abstraction(positives, negatives, transform)))["nodes"][0]  # type: ignore[index]
    assert node["name"] == "solid"
    assert node["matrix"][12:15] == [5, 6, 7]
    extras = node["extras"]
    assert (extras["category"], extras["model_id"]) == ("chair", "one")
    for name, cuboids in (("positives", positives), ("negatives", negatives)):
        for record, vector in zip(extras[name], cuboids.as_vector(), strict=True):
            values = [*record["scale"], *record["rotation"], *record["translation"]]
            assert np.float32(values).tobytes() == vector.tobytes()


def test_layout_follows_the_standard() -> None:
    data = to_glb(abstraction(random_cuboids(4, 5), Cuboids.empty()))
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    json_length, json_kind = struct.unpack_from("<I4s", data, 12)
    bin_length, bin_kind = struct.unpack_from("<I4s", data, 20 + json_length)
    assert (json_kind, bin_kind) == (b"JSON", b"BIN\0")
    assert json_length % 4 == bin_length % 4 == 0
    assert 28 + json_length + bin_length == len(data)
    found = document(data)
    primitives = found["meshes"][0]["primitives"]  # type: ignore[index]
    assert {p["attributes"]["POSITION"] for p in primitives} == {0}
    position = found["accessors"][0]  # type: ignore[index]
    values = np.frombuffer(data, "<f4", 3 * position["count"], 28 + json_length).reshape(-1, 3)
    assert values.min(axis=0).tolist() == position["min"]
    assert values.max(axis=0).tolist() == position["max"]


def test_colours_are_apart() -> None:
    colours = np.array([colour(k) for k in range(20)])
    assert colours.min() >= 0
    assert colours.max() <= 1
    gaps = np.linalg.norm(colours[:, None] - colours[None], axis=-1) + np.eye(20)
    assert gaps.min() > 0.02
    assert min(gaps[k, k + 1] for k in range(19)) > 0.2


def test_an_empty_result_is_a_file_without_a_mesh() -> None:
    swallowed = abstraction(
        axis_aligned(([0.2] * 3, [0, 0, 0])), axis_aligned(([0.4] * 3, [0, 0, 0]))
    )
    found = document(to_glb(swallowed))
    assert "meshes" not in found
    assert "mesh" not in found["nodes"][0]  # type: ignore[index]
    assert len(read(to_glb(swallowed)).geometry) == 0


def test_same_abstraction_same_bytes() -> None:
    one, two = (abstraction(random_cuboids(0, 6), random_cuboids(1, 3)) for _ in range(2))
    assert to_glb(one) == to_glb(two)
