"""What boxes are worth, alone and together."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pnabs.geometry.fit import bits
from pnabs.geometry.fit.assembly import Assembly, Box, Target
from pnabs.geometry.fit.box import outside
from pnabs.geometry.fit.search import LEAST_HALF, worth
from pnabs.geometry.types import Bool
from tests.geometry.fit.shapes import PLANE, contained, painted, whole
from tests.geometry.fit.test_box import beyond, random_box

SEEDS = st.integers(0, 2**32 - 1)


def blob(seed: int) -> Bool:
    """A shape that no box is."""
    grid = np.zeros((64, 64, 64), dtype=bool)
    for k in range(3):
        grid |= contained(random_box(seed + k))
    return grid


def boxes(seed: int, positives: int = 3, negatives: int = 2) -> list[Box]:
    signs = [1] * positives + [-1] * negatives
    return [random_box(seed + 10 + k)._replace(sign=sign) for k, sign in enumerate(signs)]


def solid(boxes: list[Box]) -> Bool:
    added = np.zeros((64, 64, 64), dtype=bool)
    removed = added.copy()
    for box in boxes:
        if box.sign > 0:
            added |= contained(box)
        else:
            removed |= contained(box)
    return added & ~removed


def strays(boxes: list[Box]) -> int:
    """Cells of the positives outside the grid."""
    return sum(beyond(box) for box in boxes if box.sign > 0)


def agreement(boxes: list[Box], shape: Bool) -> float:
    """IoU with a shape that has no cells outside the grid."""
    cells = solid(boxes)
    return float(np.sum(cells & shape) / (np.sum(cells | shape) + strays(boxes)))


@given(SEEDS)
@settings(deadline=None, max_examples=6)
def test_iou_is_that_of_the_cells(seed: int) -> None:
    shape, found = blob(seed), boxes(seed)
    assembly = Assembly(whole(bits.pack(shape)), found)
    assert assembly.iou() == pytest.approx(agreement(found, shape), abs=1e-12)


@given(SEEDS)
@settings(deadline=None, max_examples=6)
def test_a_folded_assembly_is_worth_what_the_whole_with_all_images_is(seed: int) -> None:
    shape, found = blob(seed), boxes(seed)
    folded = Assembly(whole(bits.pack(shape)).folded(), found)
    images = [image for box in found for image in (box, box.mirrored(PLANE))]
    assert folded.iou() == pytest.approx(agreement(images, shape), abs=1e-12)
    assert folded.size == len(images)


@given(SEEDS, st.floats(0.3, 1), st.integers(0, 4))
@settings(deadline=None, max_examples=6)
def test_a_gain_is_what_the_whole_loses_without_the_box(seed: int, rate: float, index: int) -> None:
    shape, found = blob(seed), boxes(seed)
    assembly = Assembly(whole(bits.pack(shape)), found)

    def score(boxes: list[Box]) -> float:
        cells = solid(boxes)
        wrong = np.sum(cells & ~shape) + strays(boxes)
        return float(2 * (np.sum(cells & shape) - rate * wrong))

    gain = score(found) - score(found[:index] + found[index + 1 :])
    assert assembly.gain(index, rate) == pytest.approx(gain)


@given(SEEDS, st.booleans())
@settings(deadline=None, max_examples=5)
def test_search_never_makes_a_box_worse_and_says_what_it_is_worth(
    seed: int, negative: bool
) -> None:
    shape, found = blob(seed), boxes(seed)
    assembly = Assembly(whole(bits.pack(shape)), found)
    sign = -1 if negative else 1
    field = assembly.field(sign)
    start = random_box(seed + 50)._replace(sign=sign)
    better, value = assembly.searched(start, 0.8, 2.0, 0.5)

    def worth_of(box: Box) -> float:
        return float(worth(*box[:3], field, 0.8, sign, False))

    assert value == pytest.approx(worth_of(better))
    assert value >= worth_of(start)
    assert better.half.min() >= LEAST_HALF
    np.testing.assert_allclose(better.axes.T @ better.axes, np.eye(3), atol=1e-9)


def test_search_finds_a_box_from_a_cell_within() -> None:
    true = Box(np.array([30.0, 20.0, 40.0]), np.eye(3), np.array([12.5, 7.5, 3.5]))
    target = whole(painted(true))
    assembly = Assembly(target, [])
    seed = Box(np.array([35.0, 16.0, 41.0]), np.eye(3), np.full(3, 0.5))
    found, value = assembly.searched(seed, 1.0, 4.0, 0.5)
    np.testing.assert_array_equal(painted(found), painted(true))
    assert value == target.total


def test_a_centred_box_stays_its_own_mirror_image() -> None:
    shape = blob(5)
    target = whole(bits.pack(shape | shape[::-1])).folded()
    assembly = Assembly(target, [])
    start = Box(np.array([PLANE, 30.0, 30.0]), np.eye(3), np.array([3.0, 2.0, 2.0]), centred=True)
    found, _ = assembly.searched(start, 0.8, 4.0, 0.25)
    assert not np.array_equal(found.half, start.half)
    assert found.centre[0] == PLANE
    np.testing.assert_array_equal(painted(found), painted(found.mirrored(PLANE)))


def test_a_block_outside_the_grid_costs_what_it_does_inside() -> None:
    shape = Box(np.array([30.0, 30, 30]), np.eye(3), np.full(3, 4.5))
    target = whole(painted(shape))
    costs = []
    for z in (50.0, 61.0, 90.0):  # inside the grid, half of it, outside
        block = Box(np.array([30.0, 30, z]), np.eye(3), np.full(3, 2.5))
        assembly = Assembly(target, [shape, block])
        assert assembly.iou() == pytest.approx(9**3 / (9**3 + 5**3))
        assert Assembly(target, [shape]).iou() == 1
        costs.append(assembly.gain(1, 0.9))
    assert costs == [pytest.approx(-0.9 * 2 * 5**3)] * 3


def test_a_negative_outside_the_grid_is_worth_nothing() -> None:
    shape = Box(np.array([30.0, 30, 57]), np.eye(3), np.array([4.5, 4.5, 6.5]))
    long = Box(np.array([30.0, 30, 60]), np.eye(3), np.array([4.5, 4.5, 9.5]))
    crop = Box(np.array([30.0, 30, 70]), np.eye(3), np.array([8.5, 8.5, 6.0]), -1)
    assembly = Assembly(whole(painted(shape)), [long, crop])
    assert assembly.gain(1, 0.9) == 0
    assert assembly.iou() == pytest.approx(13 / 19)


@pytest.mark.parametrize("centred", [False, True])
def test_a_folded_box_outside_costs_what_the_whole_does(centred: bool) -> None:
    shape = blob(11)
    shape |= shape[::-1]
    box = Box(np.array([PLANE, 30.0, 62.0]), np.eye(3), np.array([5.0, 3.5, 4.5]))
    if not centred:
        box = box._replace(centre=np.array([50.0, 30.0, 62.0]))
    images = [box] if centred else [box, box.mirrored(PLANE)]
    folded = Assembly(whole(bits.pack(shape)).folded(), [box._replace(centred=centred)])
    both = Assembly(whole(bits.pack(shape)), images)
    assert folded.iou() == both.iou() == pytest.approx(agreement(images, shape))
    gains = [both.gain(index, 0.7) for index in range(len(images))]
    assert folded.gain(0, 0.7) == pytest.approx(sum(gains) / 2)


@given(SEEDS)
@settings(deadline=None, max_examples=5)
def test_search_brings_a_turned_positive_into_its_room(seed: int) -> None:
    room = (20.0, 24.0, 18.0)
    target = whole(bits.pack(blob(seed)), room)
    assembly = Assembly(target, [])
    found, _ = assembly.searched(random_box(seed + 60), 0.8, 4.0, 0.25)
    assert outside(*found[:3], room, 64)[0] <= 1e-6


def test_changes_are_seen_and_a_copy_has_its_own() -> None:
    shape, found = blob(1), boxes(1)
    target = whole(bits.pack(shape))
    assembly = Assembly(target, found)
    twin = assembly.copy()
    twin.remove(0)
    twin.add(found[0])
    twin.replace(1, found[2])
    assert twin.iou() == pytest.approx(Assembly(target, twin.boxes).iou())
    assert assembly.iou() == pytest.approx(Assembly(target, found).iou())
    before = assembly.iou()
    assembly.refine(0.8, 2.0, 0.5, 0.0)
    assert assembly.iou() == pytest.approx(Assembly(target, assembly.boxes).iou())
    assert assembly.iou() > before


@given(SEEDS)
@settings(deadline=None, max_examples=3)
def test_many_boxes_over_one_another_come_and_go(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = blob(seed)
    many = [random_box(int(k)) for k in rng.integers(2**32, size=40)]
    assembly = Assembly(whole(bits.pack(shape)), many)
    assert assembly.iou() == pytest.approx(agreement(many, shape))
    for _ in range(35):
        index = int(rng.integers(len(assembly)))
        assembly.remove(index)
        many.pop(index)
    np.testing.assert_array_equal(bits.unpack(assembly.occupied()), solid(many))


@pytest.mark.parametrize("folded", [False, True])
def test_points_near_a_positive_and_not_deep_in_a_negative_are_covered(folded: bool) -> None:
    rng = np.random.default_rng(4)
    points, found = rng.uniform(0, 63, (300, 3)), boxes(4)
    target = Target.whole(bits.pack(blob(4)), points, 0.3, 1.5)
    target = target.folded() if folded else target
    assembly = Assembly(target, found)

    def holds(box: Box, margin: float) -> Bool:
        def one(box: Box) -> Bool:
            inside: Bool = np.all(
                np.abs((target.points - box.centre) @ box.axes) <= box.half + margin, axis=-1
            )
            return inside

        return one(box) | one(box.mirrored(PLANE)) if folded else one(box)

    near = np.any([holds(box, 1.5) for box in found if box.sign > 0], axis=0)
    deep = np.any([holds(box, -1.5) for box in found if box.sign < 0], axis=0)
    assert assembly.coverage() == pytest.approx(np.mean(near & ~deep))
    assert 0 < assembly.coverage() < 1
    assert assembly.merit() == pytest.approx(assembly.iou() + 0.3 * assembly.coverage())
    before, gain = assembly.coverage(), assembly.gain(0, 1.0)
    cells = Assembly(target._replace(cover=0.0), found).gain(0, 1.0)
    assembly.remove(0)
    lost = 0.3 * assembly.total * (before - assembly.coverage())
    assert gain - cells == pytest.approx(lost)
