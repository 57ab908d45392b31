"""Frames: scaled, shifted and turned results are noticed, and put in words."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pnabs.evaluation.frames import TURNS, compare, describe, notice, turned
from pnabs.evaluation.reading import from_meshes, inverse, to_shape
from pnabs.geometry.fields import compute_fields
from pnabs.geometry.metrics import iou
from pnabs.geometry.reference import Reference
from pnabs.geometry.types import Mesh
from pnabs.settings import Ingest
from tests.evaluate.solids import box, ell, moved

INGEST = Ingest(surface_points=500, interior_points=50, preview_faces=50)
ABOUT_X = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])


@pytest.fixture(scope="module")
def shape() -> Reference:
    """The solid that looks alike from nowhere, far from the origin; its longest side is 4."""
    mesh = ell((10, 20, 30))
    return Reference.of(compute_fields(mesh, INGEST, "folder", np.random.default_rng(0)))


def row(shape: Reference, mesh: Mesh, frame: str = "input") -> dict[str, Any]:
    matrix = to_shape(frame, shape.transform)  # type: ignore[arg-type]
    result = from_meshes([mesh], matrix).result
    plain = iou(result.occupancy(32), shape.occupancy)
    other = shape.transform if frame == "input" else inverse(shape.transform)
    return {"iou_32": plain, **compare(shape, result, plain, other)}


def test_there_are_24_rotations_that_differ() -> None:
    assert TURNS.shape == (24, 3, 3)
    assert len({turn.tobytes() for turn in TURNS}) == 24
    assert np.array_equal(TURNS[0], np.eye(3))
    assert np.array_equal(TURNS[1], ABOUT_X)
    assert all(round(np.linalg.det(turn)) == 1 for turn in TURNS)


def test_grids_turn_as_points_do() -> None:
    cells = np.zeros((4, 4, 4), dtype=bool)
    cells[3, 1, 0] = True
    for turn in TURNS:
        place = turn @ (np.array([3, 1, 0]) - 1.5) + 1.5
        assert np.array_equal(np.argwhere(turned(cells, turn))[0], place)


@pytest.mark.parametrize(
    ("turn", "words"),
    [
        (ABOUT_X, "90 degrees about x (z up?)"),
        (ABOUT_X.T, "270 degrees about x (y up?)"),
        ([[0, 0, 1], [0, 1, 0], [-1, 0, 0]], "90 degrees about y"),
        ([[-1, 0, 0], [0, -1, 0], [0, 0, 1]], "180 degrees about z"),
        ([[0, 1, 0], [1, 0, 0], [0, 0, -1]], "180 degrees about (1, 1, 0)"),
        ([[0, 0, 1], [1, 0, 0], [0, 1, 0]], "120 degrees about (1, 1, 1) (z up?)"),
    ],
)
def test_rotations_in_words(turn: list[list[int]], words: str) -> None:
    assert describe(np.array(turn)) == words


def test_a_result_in_its_place_is_not_spoken_of(shape: Reference) -> None:
    found = [row(shape, ell((10, 20, 30)))]
    assert found[0]["iou_32"] == 1
    assert notice("x", found, "input") == ""


def test_a_bad_result_in_its_place_is_not_spoken_of(shape: Reference) -> None:
    assert notice("x", [row(shape, box((4, 4, 4), (10, 20, 30)))], "input") == ""


@pytest.mark.parametrize("number", range(1, 24))
def test_each_rotation_is_found(shape: Reference, number: int) -> None:
    centred = moved(ell((10, 20, 30)), shift=0)
    centre = shape.transform[:3, 3]
    about = Mesh(centred.vertices - centre, centred.faces)
    mesh = moved(about, TURNS[number])
    found = row(shape, Mesh(mesh.vertices + centre, mesh.faces))
    assert int(np.argmax(found["frame_turns"])) == number
    said = notice("x", [found], "input")
    # the box of the turned solid has its centre where the solid's box has
    assert said == f"results of 'x': 1 of 1 look turned by {describe(TURNS[number])}"


def test_scale_and_shift_are_found(shape: Reference) -> None:
    half = moved(ell((10, 20, 30)), scale=0.5)
    said = notice("x", [row(shape, half), row(shape, ell((10, 20, 30)))], "input")
    assert said == "results of 'x': 1 of 2 look scaled by 0.5 and shifted"
    low = row(shape, ell((10, 21.5, 30)))
    assert low["frame_shift"] == pytest.approx(1.5 / 4)
    assert low["frame_size"] == pytest.approx(1)
    assert notice("x", [low], "input") == "results of 'x': 1 of 1 look shifted"


def test_different_scales_are_told_as_a_range(shape: Reference) -> None:
    rows = [row(shape, moved(ell((10, 20, 30)), scale=scale)) for scale in (0.25, 2.0)]
    assert "2 of 2 look scaled by 0.25 to 2 and shifted" in notice("x", rows, "input")


def test_the_other_frame_is_proposed_where_it_fits(shape: Reference) -> None:
    normalised = moved(ell((10, 20, 30)))
    inward = inverse(shape.transform)
    normalised = Mesh(normalised.vertices @ inward[:3, :3].T + inward[:3, 3], normalised.faces)
    found = row(shape, normalised)
    assert found["frame_other"] == pytest.approx(1)
    said = notice("x", [found], "input")
    assert said.endswith("; are they in the normalised frame? try --frame normalised")
    back = row(shape, ell((10, 20, 30)), "normalised")
    assert notice("x", [back], "normalised").endswith("try --frame input")
    # neither is corrected
    assert found["iou_32"] < 0.1
    assert back["iou_32"] < 0.1


@pytest.mark.parametrize(
    ("scale", "shift", "words"),
    [(1e-9, 0.0, "scaled by 1e-09"), (1e9, 0.0, "scaled by 1e+09"), (1.0, 1e7, "look shifted")],
)
def test_absurd_places_are_no_trouble(
    shape: Reference, scale: float, shift: float, words: str
) -> None:
    assert words in notice("x", [row(shape, moved(ell(), scale=scale, shift=shift))], "input")
