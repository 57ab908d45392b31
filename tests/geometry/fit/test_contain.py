"""Boxes cut down to bounds: known answers, and what holds of any box."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pnabs.geometry.cuboid import UNIT_CORNERS
from pnabs.geometry.fit.assembly import Box
from pnabs.geometry.fit.contain import Bounds, contain
from pnabs.geometry.types import Float64
from tests.geometry.fit.shapes import PLANE
from tests.geometry.fit.test_box import random_box

SEEDS = st.integers(0, 2**32 - 1)
LEAST = 0.12
WIDE = Bounds(np.array([20.0, 20.0, 20.0]), LEAST, 0.15, PLANE)


def upright(low: tuple[float, ...], high: tuple[float, ...]) -> Box:
    """A box between two corners, from the grid's centre."""
    ends = np.array([low, high], dtype=float)
    return Box(PLANE + ends.mean(axis=0), np.eye(3), (ends[1] - ends[0]) / 2)


def ends(box: Box | None) -> Float64:
    """Its bounds from the grid's centre."""
    assert box is not None
    return box.bounds() - PLANE


def corners(box: Box) -> Float64:
    return np.asarray(box.centre + (2 * UNIT_CORNERS * box.half) @ box.axes.T)


def test_a_box_inside_is_itself() -> None:
    box = upright((-20, -3, -4), (20, 5, 6))
    assert contain(box, WIDE) is box


def test_a_box_along_the_grid_becomes_its_intersection_with_the_bounds() -> None:
    bounds = WIDE._replace(half=np.array([29.1, 0.2, 12.3]))
    box = upright((-30, -1, 5), (30, 0, 12))
    np.testing.assert_allclose(
        ends(contain(box, bounds)), [[-29.1, -0.2, 5], [29.1, 0, 12]], atol=1e-12
    )
    # its own axes may come in any order
    other = box._replace(axes=-np.eye(3)[:, [1, 0, 2]], half=box.half[[1, 0, 2]])
    np.testing.assert_allclose(ends(contain(other, bounds)), ends(contain(box, bounds)))


def test_no_side_becomes_shorter_than_the_least_and_it_is_placed_inside() -> None:
    edge = upright((-5, 19.95, -5), (5, 21, 5))
    np.testing.assert_allclose(ends(contain(edge, WIDE))[:, 1], [20 - LEAST, 20])
    flat = WIDE._replace(half=np.array([20.0, 0.0, 20.0]))
    for low, high in ((-0.5, 0.5), (0.0, 1.0), (-1.0, 0.0)):
        sheet = upright((-5, low, -5), (5, high, 5))
        np.testing.assert_allclose(ends(contain(sheet, flat))[:, 1], [-LEAST / 2, LEAST / 2])


def test_a_box_beyond_the_bounds_is_none() -> None:
    assert contain(upright((-5, 20.5, -5), (5, 22, 5)), WIDE) is None
    turned = Box(
        np.array([PLANE, PLANE, PLANE - 40]), Rotation.random(rng=1).as_matrix(), np.ones(3)
    )
    assert contain(turned, WIDE) is None


def test_a_turned_square_shrinks_to_the_largest_that_fits() -> None:
    quarter = Rotation.from_euler("z", np.pi / 4).as_matrix()
    box = Box(np.full(3, PLANE), quarter, np.array([5.0, 5.0, 25.0]))
    bounds = Bounds(np.array([6.0, 20.0, 20.0]), LEAST, 0.0, PLANE)
    inner = contain(box, bounds)
    assert inner is not None
    np.testing.assert_allclose(inner.half, [6 / np.sqrt(2), 6 / np.sqrt(2), 20])
    np.testing.assert_allclose(inner.centre, PLANE)
    # along z, which is its own axis, it ends at the bounds; along x it may stand out
    roomy = contain(box, bounds._replace(tolerance=0.5))
    assert roomy is not None
    np.testing.assert_allclose(roomy.half, [6.5 / np.sqrt(2), 6.5 / np.sqrt(2), 20])


def test_an_end_is_cut_where_it_costs_least() -> None:
    # a plank that leans by a little: 0.5 of its length is less than 0.05 of its thickness
    lean = Rotation.from_euler("z", np.arcsin(0.1)).as_matrix()
    box = Box(np.full(3, PLANE), lean, np.array([15.0, 0.5, 4.0]))
    top = ends(box)[1, 1]
    inner = contain(box, Bounds(np.array([30.0, top - 0.1, 30.0]), LEAST, 0.0, PLANE))
    assert inner is not None
    np.testing.assert_allclose(inner.half, [14.0, 0.5, 4.0])  # both ends lose one of 30
    thick = box._replace(half=np.array([4.0, 15.0, 4.0]))
    top = ends(thick)[1, 1]
    inner = contain(thick, Bounds(np.array([30.0, top - 0.1, 30.0]), LEAST, 0.0, PLANE))
    assert inner is not None
    np.testing.assert_allclose(inner.half, [4.0, 15 - 0.1 / np.sqrt(0.99), 4.0])


@given(SEEDS, st.booleans(), st.floats(0, 0.5))
@settings(deadline=None, max_examples=200)
def test_any_box_ends_up_inside(seed: int, aligned: bool, tolerance: float) -> None:
    rng = np.random.default_rng(seed)
    box = random_box(seed, aligned=aligned)
    bounds = Bounds(rng.uniform(3, 30, 3), LEAST, 0.0 if aligned else tolerance, PLANE)
    inner = contain(box, bounds)
    low, high = ends(box)
    if inner is None:
        assert np.any(low > bounds.half + bounds.tolerance) or np.any(
            high < -bounds.half - bounds.tolerance
        )
        return
    assert np.all(np.abs(ends(inner)) <= bounds.half + bounds.tolerance + 1e-7)
    assert np.all(inner.half >= LEAST / 2 - 1e-12)
    np.testing.assert_array_equal(inner.axes, box.axes)
    # it is a part of the box, unless that has hardly any inside
    outward = np.abs((corners(inner) - box.centre) @ box.axes) - box.half
    assert outward.max() < 1e-9 or inner.half.min() <= LEAST / 2 + 1e-12
    if aligned:
        whole = np.minimum(high, bounds.half) - np.maximum(low, -bounds.half)
        np.testing.assert_allclose(
            ends(inner)[1] - ends(inner)[0], np.maximum(whole, LEAST), atol=1e-9
        )


@given(SEEDS)
@settings(deadline=None, max_examples=100)
def test_one_end_is_cut_off_better_than_by_any_side_alone(seed: int) -> None:
    box = random_box(seed)._replace(centre=np.full(3, PLANE))
    reach = ends(box)[1]
    over = min(0.3 * reach[0], 2.0)
    moved = box._replace(centre=box.centre + np.array([over, 0, 0]))
    inner = contain(moved, Bounds(np.array([reach[0], 90.0, 90.0]), LEAST, 0.0, PLANE))
    assert inner is not None
    slope = np.abs(box.axes[0])
    alone = [
        box.half.prod() * (1 - over / (2 * slope[k] * box.half[k]))
        for k in range(3)
        if 2 * slope[k] * box.half[k] > over
    ]
    assert inner.half.prod() >= max(alone, default=0.0) - 1e-9
    assert ends(inner)[1, 0] == pytest.approx(reach[0])


@given(SEEDS, st.booleans())
@settings(deadline=None, max_examples=50)
def test_mirror_images_stay_so(seed: int, centred: bool) -> None:
    rng = np.random.default_rng(seed)
    box = random_box(seed)
    if centred:
        turned = Rotation.from_euler("x", rng.uniform(0, np.pi)).as_matrix()
        box = box._replace(axes=turned, centred=True)
        box.centre[0] = PLANE
    bounds = Bounds(rng.uniform(3, 30, 3), LEAST, 0.15, PLANE)
    inner, image = contain(box, bounds), contain(box.mirrored(PLANE), bounds)
    assert (inner is None) == (image is None)
    if inner is not None and image is not None:
        np.testing.assert_allclose(inner.mirrored(PLANE).centre, image.centre, atol=1e-9)
        np.testing.assert_allclose(inner.half, image.half, atol=1e-9)
        assert not centred or inner.centre[0] == PLANE
