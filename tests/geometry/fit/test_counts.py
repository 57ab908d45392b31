"""Boxes come, go and change, and what is known of them all stays true, by brute force."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pnabs.geometry.fit import bits
from pnabs.geometry.fit.assembly import Assembly, Target
from pnabs.geometry.types import Bool
from tests.geometry.fit.brute import Whole, some_box, some_boxes, some_target

SEEDS = st.integers(0, 2**32 - 1)
SIDES = st.sampled_from([64, 64, 128])


def check(assembly: Assembly, shape: Bool) -> None:
    """Cells, agreement and cover are those of the boxes."""
    target = assembly.target
    whole = Whole.of(assembly.boxes, target)
    added, removed = whole.added.copy(), whole.removed.copy()
    added[: target.low], removed[: target.low] = False, False
    np.testing.assert_array_equal(bits.unpack(assembly.added), added)
    np.testing.assert_array_equal(bits.unpack(assembly.removed), removed)
    assert assembly.iou() == pytest.approx(whole.iou(shape), rel=0, abs=1e-12)
    assert assembly.coverage() == pytest.approx(np.mean(whole.covered))
    merit = whole.iou(shape) + target.cover * np.mean(whole.covered)
    assert assembly.merit() == pytest.approx(merit)


def change(assembly: Assembly, rng: np.random.Generator, steps: int) -> None:
    """Add, take away and replace boxes at random."""
    for _ in range(steps):
        (new,) = some_boxes(rng, 1, assembly.target)
        what = rng.integers(3) if len(assembly) else 0
        index = int(rng.integers(max(len(assembly), 1)))
        if what == 0:
            assembly.add(new)
        elif what == 1:
            assembly.remove(index)
        else:
            assembly.replace(index, new._replace(sign=assembly.boxes[index].sign))


@given(SEEDS, SIDES, st.booleans())
@settings(deadline=None, max_examples=8)
def test_after_any_changes_all_is_as_of_the_boxes_left(seed: int, side: int, folded: bool) -> None:
    rng = np.random.default_rng(seed)
    target, shape = some_target(rng, side, folded=folded)
    assembly = Assembly(target, some_boxes(rng, 4, target))
    check(assembly, shape)
    twin, kept = assembly.copy(), list(assembly.boxes)
    change(assembly, rng, 12)
    check(assembly, shape)
    assert twin.boxes == kept
    check(twin, shape)


def test_after_changes_on_three_words_a_column_too() -> None:
    rng = np.random.default_rng(2)
    target, shape = some_target(rng, 192, folded=True)
    assembly = Assembly(target, some_boxes(rng, 3, target))
    change(assembly, rng, 5)
    check(assembly, shape)


@pytest.mark.parametrize("folded", [False, True])
@pytest.mark.parametrize("sign", [1, -1])
def test_many_boxes_over_the_same_cells_are_counted(sign: int, folded: bool) -> None:
    rng = np.random.default_rng(6)
    target, shape = some_target(rng, 64, folded=folded)
    assembly = Assembly(target, some_boxes(rng, 3, target))
    for _ in range(70):  # more than five digits hold, and than six
        box = some_box(rng, "turned", 64, sign)
        assembly.add(box._replace(centre=np.array([36.0, 30.0, 31.0])))
    check(assembly, shape)
    for left in (66, 33, 32, 31, 2, 0):
        while len(assembly) > left:
            assembly.remove(int(rng.integers(len(assembly))))
        check(assembly, shape)


@given(SEEDS, SIDES, st.booleans(), st.floats(0.2, 1))
@settings(deadline=None, max_examples=8)
def test_a_gain_is_the_difference_that_the_box_makes(
    seed: int, side: int, folded: bool, rate: float
) -> None:
    rng = np.random.default_rng(seed)
    target, shape = some_target(rng, side, folded=folded)
    found = some_boxes(rng, 6, target)
    # what a negative crops of a positive outside the grid it doesn't earn, nor do others lose
    assembly = Assembly(target, found)
    together = Whole.of(found, target).value(shape, target, rate)
    for index in (0, 3, 5):
        without = Whole.of(found[:index] + found[index + 1 :], target)
        expected = together - without.value(shape, target, rate)
        assert assembly.gain(index, rate) == pytest.approx(expected, rel=0, abs=1e-6)
    check(assembly, shape)


@given(SEEDS, st.booleans())
@settings(deadline=None, max_examples=6)
def test_a_trial_in_a_boxs_place_leaves_everything_as_it_was(seed: int, folded: bool) -> None:
    rng = np.random.default_rng(seed)
    target, shape = some_target(rng, 64, folded=folded)
    assembly = Assembly(target, some_boxes(rng, 6, target))
    kept = list(assembly.boxes)
    others = Assembly(target, kept[:2] + kept[3:])
    for start in (kept[2], some_box(rng, "turned", 64, kept[2].sign)):
        found, value = assembly.improved(2, start, 0.7, 2.0, 1.0)
        beside, expected = others.searched(start, 0.7, 2.0, 1.0)
        assert value == expected
        np.testing.assert_array_equal(found.centre, beside.centre)
    assert all(one is other for one, other in zip(assembly.boxes, kept, strict=True))
    check(assembly, shape)


@pytest.mark.parametrize("folded", [False, True])
def test_improving_all_boxes_keeps_count_of_them(folded: bool) -> None:
    rng = np.random.default_rng(8)
    target, shape = some_target(rng, 128, folded=folded)
    assembly = Assembly(target, some_boxes(rng, 6, target))
    before = assembly.merit()
    assembly.refine(assembly.iou(), 4.0, 1.0, 0.0)
    assert assembly.merit() > before
    check(assembly, shape)


def test_a_folded_shape_is_both_halves_laid_on_one_another() -> None:
    rng = np.random.default_rng(9)
    target, shape = some_target(rng, 128, folded=False)
    folded: Target = target.folded()
    near, far = bits.unpack(folded.near), bits.unpack(folded.far)
    np.testing.assert_array_equal(near[64:], shape[64:])
    np.testing.assert_array_equal(far[64:], shape[:64][::-1])
    assert not near[:64].any()
    assert not far[:64].any()
    assert 2 * folded.total == target.total == 2 * np.sum(shape)
    assert folded.points[:, 0].min() >= folded.plane == 63.5
    np.testing.assert_array_equal(folded.points[:, 1:], target.points[:, 1:])
