"""Every measure on shapes whose truth is arithmetic, straight and turned, right and wrong."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pnabs.geometry.score import Result, score
from pnabs.geometry.types import Cuboids, Mesh
from pnabs.settings import Ingest
from tests.geometry.known_shapes import (
    block,
    inverted,
    joined,
    measured,
    of_blocks,
    pipe,
    reference_of,
    turned,
    united,
)

SMALL = 2e-4
"""Float32 and the boolean's own rounding, of a share."""

Place = Callable[[Mesh], Mesh]


def straight(mesh: Mesh) -> Mesh:
    return mesh


@pytest.fixture(params=[straight, turned], ids=["straight", "turned"])
def place(request: pytest.FixtureRequest) -> Place:
    return request.param


def tray() -> list[object]:
    """400 x 300 x 50 mm, walls and floor of 3 mm."""
    return [
        block(400, 3, 300, (0, 1.5, 0)),
        block(3, 50, 300, (-198.5, 25, 0)),
        block(3, 50, 300, (198.5, 25, 0)),
        block(400, 50, 3, (0, 25, -148.5)),
        block(400, 50, 3, (0, 25, 148.5)),
    ]


TRAY_VOLUME = 400 * 300 * 50 - 394 * 294 * 47


def shelf() -> list[object]:
    """800 x 1600 x 300 mm of 18 mm boards: two sides, five shelves."""
    sides = [block(18, 1600, 300, (x, 800, 0)) for x in (-391, 391)]
    return sides + [block(764, 18, 300, (0, 9 + 395.5 * k, 0)) for k in range(5)]


SHELF_VOLUME = 2 * 18 * 1600 * 300 + 5 * 764 * 18 * 300


def table() -> list[object]:
    """A top of 1200 x 30 x 800 mm on four legs of 50 mm."""
    legs = [block(50, 700, 50, (x, 350, z)) for x in (-550, 550) for z in (-350, 350)]
    return [block(1200, 30, 800, (0, 715, 0)), *legs]


TABLE_VOLUME = 1200 * 30 * 800 + 4 * 50 * 700 * 50


@pytest.mark.parametrize("thickness", [2, 5, 10, 20])
def test_plate(place: Place, thickness: float) -> None:
    """A plate as it is, and one as thick as a cell of the 64^3 grid makes it."""
    reference = reference_of(place(block(600, 400, thickness).mesh()))
    right = measured(reference, place(block(600, 400, thickness).mesh()))
    assert right["volume_iou"] == pytest.approx(1, abs=1e-4)
    assert right["covered"] == pytest.approx(1, abs=1e-4)
    assert right["excess"] == pytest.approx(0, abs=1e-4)
    assert (right["out_max_units"], right["miss_max_units"]) == pytest.approx((0, 0), abs=1e-3)
    assert right["coverage"] == 1

    wrong = measured(reference, place(block(618.75, 412.5, 20.6).mesh()))
    share = 600 * 400 * thickness / (618.75 * 412.5 * 20.6)
    assert wrong["volume_iou"] == pytest.approx(share, rel=1e-3)
    assert wrong["covered"] == pytest.approx(1, abs=1e-4)
    assert wrong["excess"] == pytest.approx(1 / share - 1, rel=1e-3)
    corner = math.dist((309.375, 206.25, 10.3), (300, 200, thickness / 2))
    assert wrong["out_max_units"] == pytest.approx(corner, rel=1e-4)
    assert wrong["miss_max"] == 0
    if thickness == 2:
        assert wrong["volume_iou"] < 0.1


def test_tray_with_thin_walls(place: Place) -> None:
    reference = reference_of(place(of_blocks(*tray())))
    right = measured(reference, place(united(*(one.mesh() for one in tray()))))
    assert right["volume_iou"] == pytest.approx(1, abs=SMALL)
    filled = measured(reference, place(block(400, 50, 300, (0, 25, 0)).mesh()))
    assert filled["volume_iou"] == pytest.approx(TRAY_VOLUME / (400 * 50 * 300), rel=1e-3)
    assert filled["excess"] == pytest.approx(394 * 294 * 47 / TRAY_VOLUME, rel=1e-3)
    # the lid of the filled tray lies over its floor, farthest from floor and walls
    assert filled["out_max_units"] == pytest.approx(47, rel=0.02)
    assert filled["coverage"] == 1


def test_shelf_with_boards_twice_as_thick(place: Place) -> None:
    reference = reference_of(place(of_blocks(*shelf())))
    right = measured(reference, place(united(*(one.mesh() for one in shelf()))))
    assert right["volume_iou"] == pytest.approx(1, abs=SMALL)
    thick = [block(36, 1600, 300, (x, 800, 0)) for x in (-382, 382)]
    thick += [block(728, 36, 300, (0, 9 + 395.5 * k, 0)) for k in range(5)]
    found = measured(reference, place(united(*(one.mesh() for one in thick))))
    # the lowest and the highest reach 9 mm beyond the sides
    volume = 2 * 36 * 1600 * 300 + 5 * 728 * 36 * 300
    common = SHELF_VOLUME
    assert found["covered"] == pytest.approx(1, abs=SMALL)
    assert found["volume_iou"] == pytest.approx(common / volume, rel=1e-3)
    assert found["out_max_units"] == pytest.approx(18, rel=0.3)
    assert found["beyond"] == pytest.approx(9 / 1600 if place is straight else 0, abs=4e-3)


def test_table_without_a_leg(place: Place) -> None:
    reference = reference_of(place(of_blocks(*table())))
    found = measured(reference, place(united(*(one.mesh() for one in table()[:-1]))))
    leg = 50 * 700 * 50
    assert found["covered"] == pytest.approx(1 - leg / TABLE_VOLUME, rel=1e-3)
    assert found["excess"] == pytest.approx(0, abs=SMALL)
    assert found["out_max_units"] == pytest.approx(0, abs=1e-2)
    # the missing foot is as far from the top as the leg is long
    assert found["miss_max_units"] == pytest.approx(700, rel=0.02)
    assert found["coverage"] < 0.97


def test_pipe_keeps_its_bore(place: Place) -> None:
    mesh = pipe(outer=50, inner=30, height=200, sides=32)
    polygon = 16 * math.sin(2 * math.pi / 32)
    reference = reference_of(place(mesh))
    assert measured(reference, place(mesh))["volume_iou"] == pytest.approx(1, abs=SMALL)
    plugged = measured(reference, place(pipe(50, 1, 200, 32)))
    assert plugged["excess"] == pytest.approx((30**2 - 1) / (50**2 - 30**2), rel=1e-3)
    around = measured(reference, place(block(100, 100, 200).mesh()))
    whole = polygon * (50**2 - 30**2) * 200
    assert around["volume_iou"] == pytest.approx(whole / (100 * 100 * 200), rel=1e-3)
    assert around["coverage"] == 1


def test_cavity_counts_as_open_but_its_wall_is_not_seen(place: Place) -> None:
    outer, inner = block(10, 10, 10), block(6, 6, 6)
    reference = reference_of(place(joined(outer.mesh(), inverted(inner.mesh()))))
    filled = measured(reference, place(outer.mesh()))
    assert filled["volume_iou"] == pytest.approx((1000 - 216) / 1000, abs=SMALL)
    assert filled["excess"] == pytest.approx(216 / (1000 - 216), rel=1e-3)
    assert (filled["out_max"], filled["miss_max"]) == pytest.approx((0, 0), abs=1e-6)
    hollow = measured(reference, place(joined(outer.mesh(), inverted(inner.mesh()))))
    assert hollow["volume_iou"] == pytest.approx(1, abs=SMALL)


def test_inward_part_outside_is_turned_outward(place: Place) -> None:
    one, other = block(10, 10, 10), block(4, 4, 4, (9, 0, 0))
    reference = reference_of(place(joined(one.mesh(), inverted(other.mesh()))))
    assert reference.boundary.not_exact == ""
    found = measured(reference, place(one.mesh()))
    assert found["covered"] == pytest.approx(1000 / 1064, rel=1e-3)


def test_sheet_has_its_documented_thickness(place: Place) -> None:
    corners = np.array([[-500, 0, -300], [500, 0, -300], [500, 0, 300], [-500, 0, 300]], float)
    sheet = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))
    reference = reference_of(place(sheet))
    assert reference.boundary.not_exact == "open"
    assert reference.boundary.sheet.all()
    size = reference.unit
    thickness = 0.005 * size
    right = measured(reference, place(block(1000, thickness, 600).mesh()))
    assert "volume_iou" not in right
    assert (right["out_max"], right["miss_max"]) == pytest.approx((0, 0), abs=1e-6)
    assert right["coverage"] == 1
    thick = measured(reference, place(block(1000, 4 * thickness, 600).mesh()))
    assert thick["out_max_units"] == pytest.approx(1.5 * thickness, rel=1e-3)
    assert thick["out_99_units"] == pytest.approx(1.5 * thickness, rel=1e-3)
    much = measured(reference, place(block(1000, 10 * thickness, 600).mesh()))
    assert much["iou_128"] < 0.5
    if place is straight:
        assert right["iou_128"] > 0.95
    thicker = reference_of(place(sheet), Ingest.model_validate({"solid": {"sheet": 0.02}}))
    assert measured(thicker, place(block(1000, 4 * thickness, 600).mesh()))["out_max"] < 1e-6


def test_bodies_a_hair_apart_are_one_piece(place: Place) -> None:
    apart = (block(10, 10, 10, (-5.005, 0, 0)), block(10, 10, 10, (5.005, 0, 0)))
    reference = reference_of(place(of_blocks(*apart)))
    found = measured(reference, place(of_blocks(*apart)))
    assert found["volume_iou"] == pytest.approx(1, abs=SMALL)
    assert (found["shape_pieces"], found["result_pieces"]) == (1, 1)
    bridged = measured(reference, place(block(20.01, 10, 10).mesh()))
    assert bridged["excess"] == pytest.approx(0.01 / 20, rel=1e-2)


def test_bodies_far_apart_are_two_pieces() -> None:
    apart = (block(10, 10, 10, (-10, 0, 0)), block(10, 10, 10, (10, 0, 0)))
    reference = reference_of(of_blocks(*apart))
    found = measured(reference, of_blocks(*apart))
    assert (found["shape_pieces"], found["result_pieces"]) == (2, 2)
    bridged = measured(reference, block(30, 10, 10).mesh())
    assert (bridged["shape_pieces"], bridged["result_pieces"]) == (2, 1)


def test_block_outside_is_seen_wherever_it_is(place: Place) -> None:
    """The grid ends at 0.55; what floats beyond it counts all the same."""
    shape, floating = block(10, 10, 10), block(2, 2, 2, (0, -9, 0))
    reference = reference_of(place(shape.mesh()))
    found = measured(reference, place(joined(shape.mesh(), floating.mesh())))
    assert found["excess"] == pytest.approx(8 / 1000, rel=1e-3)
    assert found["volume_iou"] == pytest.approx(1000 / 1008, rel=1e-3)
    assert found["out_max_units"] == pytest.approx(5, rel=1e-3)
    if place is straight:
        assert found["beyond"] == pytest.approx(0.5, rel=1e-4)


def test_missing_handle(place: Place) -> None:
    cup, handle = block(80, 100, 80), block(30, 40, 10, (54, 0, 0))
    reference = reference_of(place(united(cup.mesh(), handle.mesh())))
    found = measured(reference, place(cup.mesh()))
    missing = 29 * 40 * 10
    assert found["covered"] == pytest.approx(1 - missing / (80 * 100 * 80 + missing), rel=1e-4)
    assert found["miss_max_units"] == pytest.approx(29, rel=0.02)
    assert found["out_max"] == pytest.approx(0, abs=1e-6)
    assert 0.9 < found["coverage"] < 0.97


def test_doubled_thickness(place: Place) -> None:
    reference = reference_of(place(block(500, 10, 500).mesh()))
    found = measured(reference, place(block(500, 20, 500).mesh()))
    assert found["volume_iou"] == pytest.approx(0.5, rel=1e-3)
    assert found["out_99_units"] == pytest.approx(5, rel=1e-3)


@given(
    sides=st.tuples(*[st.floats(0.2, 1.0)] * 6),
    shift=st.tuples(*[st.floats(-0.6, 0.6)] * 3),
)
@settings(max_examples=15, deadline=None)
def test_two_boxes_anywhere(sides: tuple[float, ...], shift: tuple[float, float, float]) -> None:
    shape, result = block(*sides[:3]), block(*sides[3:], shift)
    low = np.maximum(shape.low, result.low)
    high = np.minimum(shape.high, result.high)
    common = float(np.prod(np.maximum(high - low, 0)))
    found = measured(reference_of(shape.mesh()), result.mesh())
    assert found["covered"] == pytest.approx(common / shape.volume, abs=1e-5)
    union = shape.volume + result.volume - common
    assert found["volume_iou"] == pytest.approx(common / union, abs=1e-5)
    assert found["excess"] == pytest.approx((result.volume - common) / shape.volume, abs=1e-4)
    assert 0 <= found["miss_99"] <= found["miss_max"]
    assert 0 <= found["out_99"] <= found["out_max"]


def test_open_shapes_are_measured_by_grid_and_distance(place: Place) -> None:
    """A box without its lid: not closed, counted so, and solid all the same."""
    mesh = block(10, 10, 10).mesh()
    up = mesh.triangles.mean(axis=1)[:, 1] > 4.9
    reference = reference_of(place(Mesh(mesh.vertices, mesh.faces[~up])))
    assert reference.boundary.not_exact == "open"
    assert not reference.boundary.sheet.any()
    found = measured(reference, place(mesh))
    assert "volume_iou" not in found
    assert found["out_max"] == pytest.approx(0, abs=1e-6)
    assert found["coverage"] == 1
    bigger = measured(reference, place(block(11, 11, 11).mesh()))
    assert bigger["out_99_units"] == pytest.approx(math.sqrt(0.5), rel=0.15)


def test_a_model_with_too_many_faces_is_not_measured() -> None:
    ingest = Ingest.model_validate({"limits": {"exact_faces": 11}})
    reference = reference_of(block(1, 1, 1).mesh(), ingest)
    assert reference.boundary.not_exact == "large"
    found = measured(reference, block(1, 1, 1).mesh())
    assert "volume_iou" not in found
    assert "out_99" not in found
    assert found["coverage"] == 1


def test_a_result_of_nothing_misses_all() -> None:
    reference = reference_of(block(1, 1, 1).mesh())
    nothing = Result(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
    found = score(reference, nothing, samples=100, seed=0)
    assert (found["volume_iou"], found["covered"], found["coverage"]) == (0, 0, 0)
    assert "out_99" not in found
    assert "miss_99" not in found


def test_an_open_result_has_no_exact_volume() -> None:
    mesh = block(1, 1, 1).mesh()
    reference = reference_of(mesh)
    found = measured(reference, Mesh(mesh.vertices, mesh.faces[1:]))
    assert "volume_iou" not in found
    assert found["out_max"] < 1e-6
    assert found["coverage"] > 0.9


def test_boxes_count_as_boxes_on_the_grids() -> None:
    """A plate of boxes thinner than a cell is raised to one, as the shape's thin part is."""
    plate = block(600, 400, 2).mesh()
    reference = reference_of(plate)
    sides = np.array([[1, 400 / 600, 2 / 600, 1, 0, 0, 0, 0, 0, 0]])
    boxes = (Cuboids.from_vector(sides), Cuboids.empty())
    result = Result(plate.vertices / 600, plate.faces, boxes, 1e-3)
    found = score(reference, result, samples=1000, seed=0)
    assert found["iou_64"] > 0.9
    assert found["volume_iou"] == pytest.approx(1, abs=1e-4)
