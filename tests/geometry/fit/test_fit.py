"""Boxes from solids: as few as it takes, within the budget, symmetric and exact."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pnabs.geometry import quaternion
from pnabs.geometry.cuboid import corners
from pnabs.geometry.fit.build import Terms
from pnabs.geometry.fit.fit import Fitted, fit
from pnabs.geometry.metrics import iou, predicted_occupancy
from pnabs.geometry.quaternion import to_matrix
from pnabs.geometry.types import Bool, Cuboids
from tests.geometry.boxes import random_cuboids
from tests.geometry.fit.shapes import (
    CELL,
    CRATE,
    HOLLOW,
    TABLE,
    extent,
    occupied,
    surface,
    upright,
)

NONE = Cuboids.empty()
MIN_SIDE = 2e-3


def fitted(
    positives: Cuboids,
    negatives: Cuboids = NONE,
    *,
    mirror: int = -1,
    budget: int = 20,
    price: float = 0.004,
    allowed: bool = True,
    seed: int = 0,
    levels: tuple[int, ...] = (),
    start: tuple[Cuboids, Cuboids] | None = None,
    scattered: bool = True,
    strict: bool = False,
) -> tuple[Fitted, Bool]:
    shape = occupied(positives, negatives)
    found = fit(
        shape,
        occupied(positives, negatives, 192),
        surface(positives, negatives),
        mirror,
        Terms(budget, price, negatives=None if allowed else 0),
        np.random.default_rng(seed),
        extent=extent(positives),
        min_side=MIN_SIDE,
        sizes=levels,
        start=start,
        scattered=scattered,
        strict=strict,
    )
    return found, shape


def agreement(found: Fitted, shape: Bool) -> float:
    return iou(predicted_occupancy(found.positives, found.negatives, 64, MIN_SIDE), shape)


@pytest.mark.parametrize("mirror", [-1, 0, 1, 2])
def test_a_plain_box_takes_one_box_with_its_exact_sides(mirror: int) -> None:
    box = upright(((30.3, 20.2, 11.1), (0, 0, 0)))
    found, shape = fitted(box, mirror=mirror)
    assert (len(found.positives), len(found.negatives)) == (1, 0)
    assert found.centred == (mirror >= 0)
    assert found.aligned == 1
    assert agreement(found, shape) == 1
    np.testing.assert_allclose(found.positives.scale, box.scale, atol=1e-5)
    np.testing.assert_allclose(found.positives.translation, box.translation, atol=1e-5)
    np.testing.assert_array_equal(found.positives.rotation, [[1, 0, 0, 0]])


def test_a_turned_box_takes_one_box_turned_alike() -> None:
    box = Cuboids.from_vector(np.array([[0.6, 0.3, 0.2, 0.9, 0.2, 0.3, 0.1, 0, 0, 0]]))
    found, _ = fitted(box)
    assert (len(found.positives), len(found.negatives)) == (1, 0)
    assert found.aligned == 0
    own, true = corners(found.positives)[0], corners(box)[0]
    nearest = np.linalg.norm(own[:, None] - true, axis=-1).min(axis=1)
    assert nearest.max() < CELL


def test_a_table_takes_its_parts_which_overlap_and_mirror_exactly() -> None:
    found, shape = fitted(TABLE, mirror=0)
    assert (len(found.positives), len(found.negatives)) == (5, 0)
    assert agreement(found, shape) == 1
    assert (found.pairs, found.centred, found.aligned) == (2, 1, 5)
    flip = np.array([1, 1, 1, 1, 1, 1, 1, -1, 1, 1])
    rows = [found.positives.as_vector(), found.positives.as_vector() * flip]
    ordered = [row[np.lexsort(np.round(row, 6).T)] for row in rows]
    np.testing.assert_array_equal(ordered[0], ordered[1])
    # the legs reach into the top, by a thousandth
    top = found.positives[found.positives.scale[:, 0] > 0.5]
    legs = found.positives[found.positives.scale[:, 0] < 0.2]
    under = top.translation[0, 1] - top.scale[0, 1] / 2
    np.testing.assert_allclose(
        legs.translation[:, 1] + legs.scale[:, 1] / 2 - under, 1e-3, atol=1e-5
    )


def test_one_negative_takes_the_place_of_several_positives() -> None:
    found, shape = fitted(CRATE, HOLLOW, mirror=0)
    assert (len(found.positives), len(found.negatives)) == (1, 1)
    assert agreement(found, shape) == 1
    # it reaches out of the opening it makes
    above = found.negatives.translation[0, 1] + found.negatives.scale[0, 1] / 2
    assert above > found.positives.translation[0, 1] + found.positives.scale[0, 1] / 2 + CELL / 2
    without, _ = fitted(CRATE, HOLLOW, mirror=0, allowed=False)
    assert len(without.negatives) == 0
    assert len(without.positives) > 2
    assert agreement(without, shape) > 0.99


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_pairs_mirror_to_the_last_bit_across_any_axis(axis: int) -> None:
    one = random_cuboids(41, 3, spread=0.2)
    image = Cuboids(one.scale, quaternion.mirror(one.rotation, axis), one.translation.copy())
    image.translation[:, axis] *= -1
    found, shape = fitted(one.joined(image), mirror=axis, levels=(4,))
    assert found.pairs > 0
    for boxes in (found, found.coarser[4]):
        cells = predicted_occupancy(boxes.positives, boxes.negatives, 64, 2e-3)
        np.testing.assert_array_equal(cells, np.flip(cells, axis))
        rows = {row.tobytes() for row in np.abs(boxes.positives.as_vector())}
        rows |= {row.tobytes() for row in np.abs(boxes.negatives.as_vector())}
        own = int(np.sum(boxes.positives.translation[:, axis] == 0))
        own += int(np.sum(boxes.negatives.translation[:, axis] == 0))
        total = len(boxes.positives) + len(boxes.negatives)
        assert 2 * (len(rows) - own) + own == total
    assert agreement(found, shape) > 0.85


@given(st.integers(0, 2**32 - 1), st.integers(1, 7), st.sampled_from([-1, 0, 2]))
@settings(deadline=None, max_examples=4)
def test_the_budget_holds_and_every_box_is_sound(seed: int, budget: int, mirror: int) -> None:
    shape = random_cuboids(seed, 4)
    found, solid = fitted(shape, random_cuboids(seed + 1, 2), mirror=mirror, budget=budget)
    if not solid.any():
        return
    assert 0 < len(found.positives) + len(found.negatives) <= budget
    for boxes in (found.positives, found.negatives):
        assert np.isfinite(boxes.as_vector()).all()
        assert (boxes.scale >= MIN_SIDE).all()
    assert agreement(found, solid) > 0


def test_more_boxes_agree_better_and_a_high_price_takes_few() -> None:
    shape, hole = random_cuboids(7, 5), random_cuboids(8, 2)
    ious = []
    for budget in (1, 3, 9):
        found, solid = fitted(shape, hole, budget=budget, price=0.0005)
        ious.append(agreement(found, solid))
    assert ious[0] + 0.1 < ious[1] < ious[2]
    dear, _ = fitted(shape, hole, price=0.05)
    cheap, _ = fitted(shape, hole, price=0.001)
    assert len(dear.positives) + len(dear.negatives) < len(cheap.positives) + len(cheap.negatives)


def test_same_seed_same_boxes() -> None:
    shape, hole = random_cuboids(17, 5), random_cuboids(18, 2)
    one, two = (fitted(shape, hole, seed=3)[0] for _ in range(2))
    assert one.positives.as_vector().tobytes() == two.positives.as_vector().tobytes()
    assert one.negatives.as_vector().tobytes() == two.negatives.as_vector().tobytes()


def test_a_start_is_gone_on_with_where_it_is_better() -> None:
    positives, negatives = random_cuboids(27, 6), random_cuboids(28, 2)
    shape = occupied(positives, negatives)
    predicted = iou(predicted_occupancy(positives, negatives, 64, 2e-3), shape)
    found, _ = fitted(positives, negatives, start=(positives, negatives))
    boxes = len(found.positives) + len(found.negatives)
    assert agreement(found, shape) - 0.004 * boxes >= predicted - 0.004 * 8 - 0.002


def test_starts_on_both_sides_of_the_plane_become_one_symmetric_set() -> None:
    found, shape = fitted(TABLE, mirror=0, start=(TABLE, NONE), scattered=False)
    assert len(found.positives) == 5
    assert agreement(found, shape) == 1


@pytest.mark.parametrize("cells", [(slice(0, 1),) * 3, (slice(31, 33), slice(5, 6), slice(0, 2))])
def test_the_smallest_shapes_have_boxes_too(cells: tuple[slice, slice, slice]) -> None:
    shape = np.zeros((64, 64, 64), dtype=bool)
    shape[cells] = True
    for mirror in (-1, 0):
        found = fit(
            shape,
            shape.repeat(3, 0).repeat(3, 1).repeat(3, 2),
            np.zeros((1, 6), np.float32),
            mirror,
            Terms(20, 0.004),
            np.random.default_rng(0),
            extent=np.full(3, 1.1),
            min_side=MIN_SIDE,
        )
        assert agreement(found, shape) == 1


def test_a_detail_on_one_side_alone_is_kept() -> None:
    lopsided = TABLE.joined(upright(((6, 6, 6), (16, 25, 0))))
    found, shape = fitted(lopsided, mirror=0)
    assert agreement(found, shape) > 0.99
    assert found.pairs == 2
    assert len(found.positives) == 6


def test_levels_are_nested_and_keep_the_symmetry() -> None:
    shape = TABLE.joined(upright(((44, 3, 3), (0, -12, 11)), ((44, 3, 3), (0, -12, -11))))
    found, solid = fitted(shape, mirror=0, levels=(2, 1, 4))
    assert list(found.coarser) == [4, 2, 1]
    finest = len(found.positives) + len(found.negatives)
    finer = [{index} for index in range(finest)]
    last = 1.0
    for size, level in found.coarser.items():
        count = len(level.positives) + len(level.negatives)
        assert 0 < count <= size
        origins = [set(origin) for origin in level.origins]
        assert len(origins) == count
        assert sum(map(len, origins)) == len(set().union(*origins))
        for finer_one in finer:  # each box of the finer level is in one coarser box, or gone
            assert all(finer_one <= one or not finer_one & one for one in origins)
        agrees = iou(predicted_occupancy(level.positives, level.negatives, 64, 2e-3), solid)
        assert agrees <= last
        last, finer = agrees, origins
        mirrored = predicted_occupancy(level.positives, level.negatives, 64, 2e-3)[::-1]
        np.testing.assert_array_equal(
            mirrored, predicted_occupancy(level.positives, level.negatives, 64, 2e-3)
        )


def test_a_table_that_stands_askew_has_axes_of_its_own() -> None:
    turn = [np.cos(np.pi / 12), 0, np.sin(np.pi / 12), 0]
    rows = upright(
        ((50, 5, 30), (0, 20, 0)),
        *(((7, 40, 7), (x, -1, z)) for x in (-20, 20) for z in (-11, 11)),
    ).as_vector()
    rows[:, 3:7] = turn
    rows[:, 7:] = rows[:, 7:] @ to_matrix(turn).T
    found, shape = fitted(Cuboids.from_vector(rows))
    assert agreement(found, shape) > 0.98
    assert (len(found.positives), len(found.negatives)) == (5, 0)
    axes = to_matrix(found.positives.rotation)
    own = axes[np.argmax(found.positives.scale.prod(axis=1))]
    apart = np.abs(own.T @ axes).max(axis=1).min(axis=1)
    assert np.count_nonzero(apart > 1 - 1e-6) >= 4
