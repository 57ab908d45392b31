"""What one box decides and is worth, and what the search says of it, by brute force."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pnabs.geometry.fit import bits
from pnabs.geometry.fit.assembly import ANYWHERE, Assembly, Box
from pnabs.geometry.fit.box import cells_beyond
from pnabs.geometry.fit.search import LEAST_HALF, Field, tally, worth
from pnabs.geometry.types import Bool
from tests.geometry.fit.brute import (
    KINDS,
    beyond,
    cells,
    near,
    some_box,
    some_boxes,
    some_target,
)

SEEDS = st.integers(0, 2**32 - 1)
SIDES = st.sampled_from([64, 64, 128])
SIGNS = st.sampled_from([1, -1])
PLACES = st.sampled_from(["whole", "folded", "centred"])


def random_field(rng: np.random.Generator, side: int, low: int) -> tuple[Field, list[Bool]]:
    """Any cells and points, and the cells as plain arrays."""
    words = (side, side, side // 64)
    grids = [rng.integers(0, 2**64, words, dtype=np.uint64) for _ in range(4)]
    if not low:
        grids[1] = grids[0]
    points = rng.uniform(0, side - 1, (50, 3))
    shape, image, added, removed = grids
    field = Field(shape, image, added, removed, low, ANYWHERE, points, 7.5, 0.03 * side)
    return field, [bits.unpack(grid) for grid in grids]


def by_brute_force(
    box: Box, field: Field, grids: list[Bool], *, folded: bool
) -> tuple[int, int, int]:
    """Hits, cells and points of the box, and of its image in the plane, each once."""
    shape, image, added, removed = grids
    side = len(shape)
    inside = cells(box, side)
    reach = box.sign * field.reach
    met = near(box, field.points, reach)
    if folded:
        inside = inside | inside[::-1]
        met = met | near(box.mirrored((side - 1) / 2), field.points, reach)
    inside[: field.low] = False
    inside &= (~added if box.sign > 0 else added) & ~removed
    hits = int(np.sum(shape & inside) + np.sum(image & inside))
    return hits, 2 * int(np.sum(inside)), int(np.sum(met))


def check_box(rng: np.random.Generator, box: Box, side: int, place: str) -> None:
    low, folded = (0 if place == "whole" else side // 2), place == "folded"
    field, grids = random_field(rng, side, low)
    hits, decided, met = by_brute_force(box, field, grids, folded=folded)
    assert tally(*box[:3], field, box.sign, folded) == (hits, decided)
    value = box.sign * (hits - 0.7 * (decided - hits) + field.weight * met)
    if box.sign > 0:
        value -= 0.7 * beyond(box, side) * (1 if place == "centred" else 2)
    assert worth(*box[:3], field, 0.7, box.sign, folded) == pytest.approx(value, abs=1e-6)


@pytest.mark.parametrize("kind", KINDS)
@given(SEEDS, SIDES, SIGNS, PLACES)
@settings(deadline=None, max_examples=8)
def test_a_box_decides_the_cells_and_points_that_it_holds(
    kind: str, seed: int, side: int, sign: int, place: str
) -> None:
    rng = np.random.default_rng(seed)
    box = some_box(rng, kind, side, sign, centred=place == "centred")
    check_box(rng, box, side, place)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("kind", KINDS)
@given(SEEDS, st.sampled_from([64, 128]))
@settings(deadline=None, max_examples=3)
def test_cells_of_a_box_and_its_image_that_overlap_count_once(
    kind: str, sign: int, seed: int, side: int
) -> None:
    rng = np.random.default_rng(seed)
    box = some_box(rng, kind, side, sign)
    box = box._replace(half=box.half + 1.5)
    offset = rng.uniform(-0.5, 0.5) * box.half.min()
    middle = side / 2 + (round(offset) if kind == "exact" else offset)
    box.centre[:] = middle, *np.clip(box.centre[1:], 1, side - 2)
    inside = cells(box, side)
    assert np.any(inside & inside[::-1])
    check_box(rng, box, side, "folded")


@pytest.mark.parametrize("place", ["whole", "folded", "centred"])
@pytest.mark.parametrize("sign", [1, -1])
def test_columns_of_three_words_are_counted_alike(place: str, sign: int) -> None:
    rng = np.random.default_rng(11)
    box = some_box(rng, "turned", 192, sign, centred=place == "centred")
    box.centre[1:], box.half[2] = 95.0, 80.0
    check_box(rng, box, 192, place)


@given(SEEDS, st.sampled_from(KINDS), st.sampled_from([64, 128]))
@settings(deadline=None, max_examples=20)
def test_cells_beyond_any_grid_are_counted_as_if_it_went_on(
    seed: int, kind: str, side: int
) -> None:
    rng = np.random.default_rng(seed)
    box = some_box(rng, kind, side)
    assert cells_beyond(*box[:3], side) == beyond(box, side)


@given(SEEDS, st.sampled_from(KINDS))
@settings(deadline=None, max_examples=6)
def test_a_scaled_box_holds_the_same_points_of_a_finer_grid(seed: int, kind: str) -> None:
    box = some_box(np.random.default_rng(seed), kind, 64)
    fine = cells(box.scaled(3), 192)
    np.testing.assert_array_equal(fine[1::3, 1::3, 1::3], cells(box, 64))


@given(SEEDS, SIDES, SIGNS, PLACES, st.sampled_from(KINDS), st.booleans())
@settings(deadline=None, max_examples=40)
def test_a_search_returns_what_its_box_is_worth(
    seed: int, side: int, sign: int, place: str, kind: str, narrow: bool
) -> None:
    rng = np.random.default_rng(seed)
    target, _ = some_target(rng, side, folded=place != "whole")
    if narrow:
        x, y, z = rng.uniform(0.2, 0.5, 3) * side
        target = target._replace(room=(x, y, z))
    assembly = Assembly(target, some_boxes(rng, 4, target))
    start = some_box(rng, kind, side, sign, centred=place == "centred")
    rate, step = rng.uniform(0.2, 1), rng.uniform(0.5, 6)
    found, value = assembly.searched(start, rate, step, step / 8)
    field = assembly.field(sign)

    def worth_of(box: Box) -> float:
        return worth(*box[:3], field, rate, sign, place == "folded")

    assert value == pytest.approx(worth_of(found), rel=0, abs=1e-6)
    assert value >= worth_of(start)
    assert found.half.min() >= min(LEAST_HALF, start.half.min())
    np.testing.assert_allclose(found.axes.T @ found.axes, np.eye(3), atol=1e-9)
    if place == "centred":
        assert found.centre[0] == target.plane
        assert found.axes[0, 0] == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_centred_box_of_a_shape_that_is_not_folded_is_searched_alike(sign: int) -> None:
    rng = np.random.default_rng(5)
    target, _ = some_target(rng, 64, folded=False)
    assembly = Assembly(target, some_boxes(rng, 4, target))
    for kind in KINDS:
        start = some_box(rng, kind, 64, sign, centred=True)
        found, value = assembly.searched(start, 0.6, 3.0, 0.5)
        expected = worth(*found[:3], assembly.field(sign), 0.6, sign, False)
        assert value == pytest.approx(expected, rel=0, abs=1e-6)
        assert found.centre[0] == target.plane
