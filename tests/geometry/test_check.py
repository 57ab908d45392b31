"""The final check must find what is broken, and pass what is whole."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pnabs.geometry import cuboid
from pnabs.geometry.check import check, faults
from tests.geometry.boxes import axis_aligned

Arrays = tuple[np.ndarray, np.ndarray]


def box() -> Arrays:
    mesh = cuboid.to_mesh(axis_aligned(([0.5, 0.3, 0.2], [0, 0, 0])))
    return mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32)


def two_boxes(offset: float) -> Arrays:
    mesh = cuboid.to_mesh(
        axis_aligned(([0.5, 0.3, 0.2], [0, 0, 0]), ([0.5, 0.3, 0.2], [offset, 0.1, 0.05]))
    )
    return mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32)


def test_a_whole_mesh_passes() -> None:
    report = check(*box())
    assert report.ok
    assert report.as_dict() == {
        "closed": True,
        "two_manifold": True,
        "self_intersections": 0,
        "duplicate_vertices": 0,
        "unreferenced_vertices": 0,
        "degenerate_faces": 0,
        "components": 1,
        "ok": True,
    }
    assert check(*two_boxes(2.0)).components == 2
    assert check(*two_boxes(2.0)).ok


def without_a_face(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    return vertices, faces[1:]


def with_a_fin(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    tip = np.float32([[1, 1, 1]])
    fin = np.array([[faces[0, 0], faces[0, 1], len(vertices)]], dtype=np.int32)
    return np.concatenate([vertices, tip]), np.concatenate([faces, fin])


def with_a_loose_vertex(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    return np.concatenate([vertices, np.float32([[1, 1, 1]])]), faces


def with_a_split_vertex(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    faces = faces.copy()
    faces[0, 0] = len(vertices)
    return np.concatenate([vertices, vertices[[box()[1][0, 0]]]]), faces


def with_a_flat_face(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    # A vertex halfway along an edge, its two faces split, one more face folded on the edge.
    a, b = faces[0, 0], faces[0, 1]
    middle = len(vertices)
    vertices = np.concatenate([vertices, (vertices[[a]] + vertices[[b]]) / 2])
    rest = [
        [middle if v == b else v for v in faces[0]],
        [middle if v == a else v for v in faces[0]],
    ]
    flat = [a, b, middle]
    return vertices, np.concatenate([faces[1:], np.array([*rest, flat], dtype=np.int32)])


@pytest.mark.parametrize(
    ("damage", "finding"),
    [
        (without_a_face, {"closed": False}),
        (with_a_fin, {"two_manifold": False}),
        (with_a_loose_vertex, {"unreferenced_vertices": 1}),
        (with_a_split_vertex, {"closed": False, "duplicate_vertices": 1}),
        (with_a_flat_face, {"degenerate_faces": 1}),
    ],
)
def test_damage_is_found(
    damage: Callable[[np.ndarray, np.ndarray], Arrays], finding: dict[str, object]
) -> None:
    report = check(*damage(*box()))
    assert not report.ok
    assert finding.items() <= report.as_dict().items()


def test_overlapping_shells_intersect() -> None:
    report = check(*two_boxes(0.2))
    assert report.closed
    assert report.self_intersections > 0
    assert not report.ok


@pytest.mark.parametrize(("gap", "number"), [(0.0, 1), (1e-9, 1), (5e-8, 0)])
def test_vertices_that_others_weld_are_duplicates(gap: float, number: int) -> None:
    corners = np.eye(4, 3, dtype=np.float32)
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    other = corners - np.float32([0.5, 0.5, 0.5])
    other[3] = corners[3] + np.float32([0, 0, -gap])
    report = check(np.concatenate([corners, other]), np.concatenate([faces, faces + 4]))
    assert report.duplicate_vertices == number


def test_boxes_that_share_an_edge_have_duplicate_vertices() -> None:
    mesh = cuboid.to_mesh(
        axis_aligned(([0.5, 0.5, 0.5], [0.25, 0.25, 0]), ([0.5, 0.5, 0.5], [-0.25, -0.25, 0]))
    )
    report = check(mesh.vertices.astype(np.float32), mesh.faces)
    assert report.duplicate_vertices == 2
    assert not report.ok


def test_an_empty_mesh_is_not_ok() -> None:
    report = check(np.zeros((0, 3), dtype=np.float32), np.zeros((0, 3), dtype=np.int32))
    assert report.components == 0
    assert not report.ok


def test_it_takes_only_what_is_written() -> None:
    vertices, faces = box()
    with pytest.raises(ValueError, match="float32"):
        check(vertices.astype(np.float64), faces)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="finite"):
        check(np.full_like(vertices, np.nan), faces)
    with pytest.raises(ValueError, match="outside 0"):
        check(vertices, faces + 1)


def test_bounds_of_the_input() -> None:
    vertices, faces = box()
    extent = np.array([0.5, 0.3, 0.2])
    assert check(vertices, faces, extent).within_bounds
    assert check(vertices, faces, extent - 2 * 0.0049).ok
    beyond = check(vertices, faces, extent - [0, 0, 2 * 0.0051])
    assert beyond.within_bounds is False
    assert beyond.is_sound
    assert not beyond.ok
    assert beyond.as_dict()["ok"] is False
    assert faults(beyond.as_dict()) == ["leaves the bounding box of its input"]


def test_faults_are_named() -> None:
    assert faults(check(*box()).as_dict()) == []
    vertices, faces = without_a_face(*box())
    assert faults(check(vertices, faces).as_dict()) == ["not closed"]
    nothing = check(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32), np.ones(3))
    assert faults(nothing.as_dict()) == ["empty"]
    vertices, faces = with_a_loose_vertex(*box())
    assert faults(check(vertices, faces).as_dict()) == ["1 unreferenced vertices"]
