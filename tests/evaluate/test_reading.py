"""Anybody's result in its shape's frame: meshes that are closed or not, parts, boxes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pnabs.evaluation.reading import (
    Reading,
    from_abstraction,
    from_boxes,
    from_meshes,
    place,
)
from pnabs.evaluation.rows import METRICS
from pnabs.evaluation.task import measured
from pnabs.formats import Abstraction
from pnabs.geometry.fields import compute_fields
from pnabs.geometry.load import InvalidMeshError
from pnabs.geometry.reference import Reference
from pnabs.geometry.score import score
from pnabs.geometry.solidify import solidify
from pnabs.geometry.types import Cuboids, Float64, Mesh
from pnabs.settings import Abstract, Ingest
from tests.evaluate.solids import box, joined, moved

INGEST = Ingest(surface_points=500, interior_points=50, preview_faces=50)
HERE = np.eye(4)
IDENTITY = (1, 0, 0, 0)


@pytest.fixture(scope="module")
def cube() -> Reference:
    """The unit cube about the origin: its normalised frame is the input's."""
    return Reference.of(compute_fields(box(), INGEST, "folder", np.random.default_rng(0)))


def volume(reading: Reading) -> float:
    assert reading.result.solid is not None
    return float(reading.result.solid.volume())


def boxes(*rows: tuple[float, ...]) -> Float64:
    return np.array(rows, dtype=np.float64).reshape(-1, 10)


def test_a_closed_mesh_has_an_exact_volume(cube: Reference) -> None:
    half = from_meshes([box((1, 0.5, 1), (0, -0.25, 0))], HERE)
    assert (half.parts, half.bodies, half.not_closed) == (1, 1, "")
    found = measured(half, cube, 500, 0)
    assert found["volume_iou"] == pytest.approx(0.5)
    assert found["covered"] == pytest.approx(0.5)
    assert found["excess"] == pytest.approx(0)
    assert found["miss_max"] == pytest.approx(0.5)
    shifted = measured(from_meshes([box((1, 1, 1), (0.5, 0, 0))], HERE), cube, 500, 0)
    assert shifted["volume_iou"] == pytest.approx(1 / 3)
    assert shifted["excess"] == pytest.approx(0.5)
    assert shifted["beyond"] == pytest.approx(0.5)


def test_parts_are_united_whether_in_one_file_or_several() -> None:
    overlapping = box(), box((1, 1, 1), (0.5, 0, 0))
    for reading in (from_meshes(overlapping, HERE), from_meshes([joined(*overlapping)], HERE)):
        assert (reading.parts, reading.bodies, reading.not_closed) == (2, 1, "")
        assert volume(reading) == pytest.approx(1.5)


def test_parts_that_touch_are_no_trouble() -> None:
    # Welded, they have a face in common and are no surface any more.
    touching = box(), box((1, 1, 1), (1, 0, 0))
    for reading in (from_meshes(touching, HERE), from_meshes([joined(*touching)], HERE)):
        assert (reading.parts, reading.not_closed) == (2, "")
        assert volume(reading) == pytest.approx(2)


def test_a_cavity_stays_and_an_inward_mesh_is_turned() -> None:
    hole = box((0.5, 0.5, 0.5))
    hole = Mesh(hole.vertices, hole.faces[:, ::-1])
    hollow = from_meshes([joined(box(), hole)], HERE)
    assert volume(hollow) == pytest.approx(1 - 0.125)
    assert hollow.bodies == 1
    assert volume(from_meshes([hole], HERE)) == pytest.approx(0.125)


def test_bodies_are_counted() -> None:
    assert from_meshes([box(), box((1, 1, 1), (3, 0, 0))], HERE).bodies == 2


def test_each_face_with_vertices_of_its_own_is_one_component() -> None:
    mesh = box()
    soup = Mesh(mesh.triangles.reshape(-1, 3), np.arange(36).reshape(-1, 3))
    reading = from_meshes([soup], HERE)
    assert (reading.parts, reading.not_closed) == (1, "")
    assert volume(reading) == pytest.approx(1)


def test_what_is_not_closed_has_no_exact_figures(cube: Reference) -> None:
    mesh = box()
    reading = from_meshes([Mesh(mesh.vertices, mesh.faces[:-2])], HERE)
    assert (reading.not_closed, reading.bodies) == ("open", None)
    found = measured(reading, cube, 500, 0)
    assert not {"volume_iou", "covered", "excess", "iou_mesh_64"} & found.keys()
    assert found["iou_128"] > 0.9
    assert found["not_closed"] == "open"
    # an inward one is turned outward
    inward = from_meshes([Mesh(mesh.vertices, mesh.faces[:-2, ::-1])], HERE)
    assert measured(inward, cube, 500, 0)["iou_128"] == found["iou_128"]


def test_one_open_part_leaves_the_whole_open() -> None:
    mesh = box((1, 1, 1), (3, 0, 0))
    parts = [box(), Mesh(mesh.vertices, mesh.faces[:-1])]
    assert from_meshes(parts, HERE).not_closed == "open"


def test_meshes_far_from_the_shape_are_closed_all_the_same() -> None:
    # Welding's lattice is that of a normalised frame; this one lies far beyond.
    reading = from_meshes([moved(box(), scale=300, shift=-5000)], HERE)
    assert reading.not_closed == ""
    assert volume(reading) == pytest.approx(300**3, rel=1e-6)


def test_a_mesh_without_area_is_refused() -> None:
    flat = Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]]))
    with pytest.raises(InvalidMeshError, match="no face of non-zero area"):
        from_meshes([flat], HERE)


def test_boxes_are_cropped_and_measured(cube: Reference) -> None:
    whole = boxes((1, 1, 1, *IDENTITY, 0, 0, 0))
    cut = boxes((1, 0.25, 1, *IDENTITY, 0, 0.375, 0))
    reading = from_boxes(whole, cut, HERE)
    assert (reading.parts, reading.positives, reading.negatives) == (2, 1, 1)
    found = measured(reading, cube, 500, 0)
    assert found["volume_iou"] == pytest.approx(0.75)
    assert found["iou_64"] == pytest.approx(0.75, abs=0.02)


def test_boxes_are_brought_into_the_normalised_frame() -> None:
    # The shape is 100 long and lies at (1000, 0, 0).
    transform = np.diag([100.0, 100.0, 100.0, 1.0])
    transform[0, 3] = 1000
    turned = (np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8))
    given = boxes((50, 20, 10, *turned, 1000, 10, 0))
    reading = from_boxes(given, boxes(), np.linalg.inv(transform))
    assert reading.result.boxes is not None
    positives, negatives = reading.result.boxes
    assert len(negatives) == 0
    np.testing.assert_allclose(
        positives.as_vector(), [[0.5, 0.2, 0.1, *turned, 0, 0.1, 0]], atol=1e-6
    )
    assert volume(reading) == pytest.approx(0.01)


def test_boxes_without_any_side_are_nothing(cube: Reference) -> None:
    reading = from_boxes(boxes((1, 0, 1, *IDENTITY, 0, 0, 0)), boxes(), HERE)
    assert reading.result.is_empty
    found = measured(reading, cube, 500, 0)
    assert (found["volume_iou"], found["coverage"], found["not_closed"]) == (0, 0, "empty")


def abstraction(transform: Float64) -> Abstraction:
    """A box of half the height, at the bottom, with a bite taken out of it."""
    positives = Cuboids.from_vector(boxes((1, 0.5, 1, *IDENTITY, 0, -0.25, 0)))
    negatives = Cuboids.from_vector(boxes((0.5, 2, 0.5, *IDENTITY, 0, 0, 0)))
    solid = solidify(positives, negatives, Abstract(), np.random.default_rng(0))
    return Abstraction.from_solid(
        solid,
        category="",
        model_id="a",
        positives=positives,
        negatives=negatives,
        transform=transform,
        metrics={},
        provenance={},
    )


def test_an_abstraction_of_the_shape_is_taken_as_it_is(cube: Reference) -> None:
    given = abstraction(cube.transform)
    reading = from_abstraction(given, cube.transform)
    assert reading.result.boxes == (given.positives, given.negatives)
    assert np.array_equal(reading.result.vertices, given.solid.vertices)
    assert (reading.parts, reading.bodies, reading.not_closed) == (2, 1, "")
    assert measured(reading, cube, 500, 0)["volume_iou"] == pytest.approx(0.375)


def test_an_abstraction_normalised_otherwise_is_placed_by_its_transform() -> None:
    # The shape: a cube of 2 about (5, 6, 7).  The abstraction's own frame: twice as large, beside.
    mesh = box((2, 2, 2), (5, 6, 7))
    shape = Reference.of(compute_fields(mesh, INGEST, "folder", np.random.default_rng(0)))
    given = abstraction(shape.transform)
    before = measured(from_abstraction(given, shape.transform), shape, 500, 0)
    half = np.diag([0.5, 0.5, 0.5, 1.0])
    half[:3, 3] = 0.125, -0.25, 0.375
    other = replace(
        given,
        positives=place(given.positives, half),
        negatives=place(given.negatives, half),
        transform=shape.transform @ np.linalg.inv(half),
    )
    reading = from_abstraction(other, shape.transform)
    assert reading.result.boxes is not None
    for mine, theirs in zip(reading.result.boxes, (given.positives, given.negatives), strict=True):
        np.testing.assert_allclose(mine.as_vector(), theirs.as_vector(), atol=1e-6)
    after = measured(reading, shape, 500, 0)
    for name in ("volume_iou", "covered", "excess", "iou_32", "miss_max", "miss_max_units"):
        assert after[name] == pytest.approx(before[name], abs=1e-6)


def test_a_transform_that_turns_or_stretches_is_followed(cube: Reference) -> None:
    quarter = np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    turned = from_abstraction(abstraction(quarter), cube.transform)
    assert turned.result.boxes is not None
    # the bottom half has become the right half
    assert turned.result.boxes[0].translation[0] == pytest.approx([0.25, 0, 0], abs=1e-6)
    assert turned.result.vertices[:, 0].min() == pytest.approx(0, abs=1e-6)
    stretched = from_abstraction(abstraction(np.diag([1.0, 2.0, 1.0, 1.0])), cube.transform)
    assert stretched.result.boxes is None
    assert stretched.result.vertices[:, 1].min() == pytest.approx(-1, abs=1e-6)


def test_a_transform_that_makes_nothing_is_refused(cube: Reference) -> None:
    with pytest.raises(InvalidMeshError, match="transform"):
        from_abstraction(abstraction(np.diag([0.0, 0.0, 0.0, 1.0])), cube.transform)


def test_all_that_is_measured_has_its_column(cube: Reference) -> None:
    reading = from_meshes([box((1, 0.5, 1))], HERE)
    names = score(cube, reading.result, samples=500, seed=0).keys() - {"closed"}
    assert names <= set(METRICS)
    assert {"volume_iou", "coverage", "out_99", "iou_128", "beyond"} <= names
