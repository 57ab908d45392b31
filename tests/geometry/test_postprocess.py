"""The post-process, rule by rule, and its laws on random shapes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as law
from hypothesis import strategies as st

from pnabs import settings
from pnabs.geometry import cuboid
from pnabs.geometry.postprocess import TOUCH, PostprocessReport, postprocess
from pnabs.geometry.types import GRID_SIDE, THETA_D, Bool, Cuboids, Float32, grid_points
from tests.geometry.boxes import axis_aligned, random_cuboids, surface_of

VOXEL = GRID_SIDE / 32
TABLE = axis_aligned(
    ([0.9, 0.1, 0.9], [0, 0.35, 0]),
    ([0.1, 0.7, 0.9], [-0.4, -0.05, 0]),
    ([0.1, 0.7, 0.9], [0.4, -0.05, 0]),
)
"""A table with two panels for legs: open between x = -0.35 and 0.35, below y = 0.3."""


def clean(
    negatives: Cuboids,
    *,
    surface: Float32 | None = None,
    difference: Bool | None = None,
    shape: Cuboids = TABLE,
    **options: object,
) -> tuple[Cuboids, PostprocessReport]:
    occupancy = cuboid.voxelise(shape, 64, raise_thin=False)
    if difference is None:
        difference = ~cuboid.voxelise(shape, 32, raise_thin=False)
    return postprocess(
        negatives,
        surface_of(shape, 10_000) if surface is None else surface,
        occupancy,
        difference,
        settings.Abstract(**options),  # type: ignore[arg-type]
    )


def between_legs(width: float, height: float) -> Cuboids:
    """A negative that hangs from a height below the top, centred between the legs."""
    return axis_aligned(([width, height, 0.8], [0, -0.1, 0]))


def test_one_too_large_shrinks_until_it_only_touches() -> None:
    kept, report = clean(between_legs(0.74, 0.6))
    assert report == PostprocessReport(predicted=1, shrunk=1, kept=1)
    np.testing.assert_allclose(kept.scale[0, 0], 0.7, atol=2.5 * TOUCH)
    # Only the sides at fault give way.
    np.testing.assert_allclose(kept.scale[0, 1:], [0.6, 0.8], atol=1e-6)


def test_one_too_small_grows_to_touch_on_each_side() -> None:
    kept, report = clean(between_legs(0.66, 0.74))
    assert report == PostprocessReport(predicted=1, grown=1, kept=1)
    np.testing.assert_allclose(kept.scale[0, 0], 0.7, atol=3 * TOUCH)
    # The top is at 0.3, 0.4 above the centre: reached although the legs were met first.
    np.testing.assert_allclose(kept.scale[0, 1], 0.8, atol=3 * TOUCH)
    np.testing.assert_allclose(kept.scale[0, 2], 0.8 + 2 * THETA_D, atol=1e-6)


def test_one_that_touches_stays_as_it_is() -> None:
    surface = surface_of(TABLE, 10_000)
    grown, _ = clean(between_legs(0.66, 0.74), surface=surface)
    again, report = clean(grown, surface=surface)
    assert report == PostprocessReport(predicted=1, kept=1)
    np.testing.assert_array_equal(again.as_vector(), grown.as_vector())


def test_a_sample_deeper_than_theta_d_discards() -> None:
    wide = between_legs(0.7 + 2 * THETA_D + 2e-3, 0.6)
    assert clean(wide)[1] == PostprocessReport(predicted=1, discarded_deep=1)
    narrower = between_legs(0.7 + 2 * THETA_D - 2e-3, 0.6)
    assert clean(narrower)[1] == PostprocessReport(predicted=1, shrunk=1, kept=1)


def test_one_buried_in_the_shape_overlaps() -> None:
    block = axis_aligned(([0.9, 0.9, 0.9], [0, 0, 0]))
    buried = axis_aligned(([0.2, 0.2, 0.2], [0.05, 0, 0]))
    kept, report = clean(buried, shape=block)
    assert len(kept) == 0
    assert report == PostprocessReport(predicted=1, grown=1, discarded_overlap=1)
    tolerant = clean(buried, shape=block, max_overlap=1.0)[1]
    assert tolerant.discarded_overlap == 0


@pytest.mark.parametrize(("extra", "discarded"), [(-2e-3, 0), (2e-3, 1)])
def test_one_too_far_away_is_discarded(extra: float, discarded: int) -> None:
    # Below the floor by what growing and the largest gap cover together.
    floor = -0.4
    gap = THETA_D + 0.5 * VOXEL + extra
    away = axis_aligned(([0.6, 0.05, 0.2], [0, floor - 0.025 - gap, 0]))
    wall = axis_aligned(([0.9, 0.1, 0.9], [0, floor + 0.05, 0]))
    report = clean(away, shape=wall)[1]
    assert report.discarded_gap == discarded
    assert report.kept == 1 - discarded


def test_one_without_use_is_idle() -> None:
    nothing = np.zeros((32, 32, 32), dtype=np.bool_)
    assert clean(between_legs(0.66, 0.7), difference=nothing)[1] == PostprocessReport(
        predicted=1, grown=1, discarded_idle=1
    )
    broken = np.full((1, 10), np.nan, dtype=np.float32)
    not_finite = Cuboids(broken[:, :3], broken[:, 3:7], broken[:, 7:])
    assert clean(not_finite)[1] == PostprocessReport(predicted=1, discarded_idle=1)
    # A slice through the table's top can only shrink to nothing.
    slice_ = axis_aligned(([0.2, 0.002, 0.2], [0, 0.4, 0]))
    assert clean(slice_)[1] == PostprocessReport(predicted=1, shrunk=1, discarded_idle=1)


def test_of_two_that_coincide_the_greater_stays() -> None:
    two = axis_aligned(([0.3, 0.6, 0.8], [0.01, -0.1, 0]), ([0.4, 0.6, 0.8], [0.0, -0.1, 0]))
    kept, report = clean(two, max_gap=50.0)
    assert report.suppressed == 1
    assert kept.scale[0, 0] > 0.4
    kept, report = clean(two, max_gap=50.0, suppression=1.0)
    assert report.kept == 2
    # Volume alone does not win: the share in V_delta counts as well.
    difference = np.zeros((32, 32, 32), dtype=np.bool_)
    difference[16:] = True
    left, right = ([0.5, 0.5, 0.8], [-0.08, -0.1, 0]), ([0.4, 0.5, 0.8], [0.1, -0.1, 0])
    kept, report = clean(
        axis_aligned(left, right), difference=difference, max_gap=50.0, suppression=0.3
    )
    assert report.suppressed == 1
    assert kept.translation[0, 0] == pytest.approx(0.1)


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_either_share_in_common_suppresses(order: list[int]) -> None:
    # Most of the small one lies in the large one, which holds less of V_delta: the small one
    # stays, although only a tenth of the large one lies in it.
    small, large = ([0.2] * 3, [0.0, -0.1, 0.0]), ([0.3, 0.4, 0.4], [0.11, -0.1, 0.0])
    points = grid_points(32)
    inside = (np.abs(points - [0.0, -0.1, 0.0]) < 0.1 + THETA_D).all(axis=1)
    kept, report = clean(
        axis_aligned(*[(small, large)[i] for i in order]),
        difference=inside.reshape(32, 32, 32),
        max_gap=50.0,
    )
    assert report.suppressed == 1
    assert kept.translation[0, 0] == 0


@pytest.mark.parametrize(("share", "discarded"), [(0.012, 0), (0.03, 1)])
def test_overlap_counts_where_no_sample_tells_of_it(share: float, discarded: int) -> None:
    negative = axis_aligned(([0.5, 0.5, 0.5], [0, 0, 0]))
    side = 0.5 * share ** (1 / 3)
    touching = np.array([[0.25, 0, 0, 1, 0, 0]], dtype=np.float32)
    _, report = clean(
        negative,
        surface=touching,
        shape=axis_aligned(([side] * 3, [0.01, 0.02, 0.03])),
        difference=np.ones((32, 32, 32), dtype=np.bool_),
    )
    assert (report.grown, report.shrunk) == (0, 0)
    assert report.discarded_overlap == discarded


def test_switched_off_nothing_is_touched() -> None:
    negatives = random_cuboids(0, 8)
    kept, report = clean(negatives, postprocess=False)
    np.testing.assert_array_equal(kept.as_vector(), negatives.as_vector())
    assert report == PostprocessReport(predicted=8, kept=8)
    assert clean(Cuboids.empty())[1] == PostprocessReport(predicted=0)


@law(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_kept_ones_only_touch_and_change_by_theta_d_at_most(seed: int) -> None:
    shape = random_cuboids(seed, 3, low=0.1)
    surface = surface_of(shape, 1500)
    negatives = random_cuboids(seed + 1, 10, low=0.0, high=0.4, spread=0.45)
    kept, report = clean(negatives, surface=surface, shape=shape)

    # A sample's depth in a box is the least of its distances from the six sides.
    for one in range(len(kept)):
        inner = np.abs(cuboid.local(surface[:, :3], kept[one : one + 1])[0])
        deepest = (kept.scale[one].astype(np.float64) / 2 - inner).min(axis=1).max()
        assert deepest <= TOUCH
        assert -deepest <= 0.5 * VOXEL * np.sqrt(3)

        # Which one it was, centre and axes unchanged.
        same = np.flatnonzero((negatives.translation == kept.translation[one]).all(axis=1))
        assert len(same) == 1
        np.testing.assert_array_equal(negatives.rotation[same[0]], kept.rotation[one])
        change = np.abs(kept.scale[one].astype(np.float64) - negatives.scale[same[0]]) / 2
        assert change.max() <= THETA_D + 1e-7
    assert report.predicted == len(negatives)
    assert report.kept == len(kept)
    discarded = (
        report.discarded_deep
        + report.discarded_overlap
        + report.discarded_gap
        + report.discarded_idle
    )
    assert report.predicted == discarded + report.suppressed + report.kept


@law(deadline=None, max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_a_negative_fares_the_same_without_its_mates(seed: int) -> None:
    shape = random_cuboids(seed, 3, low=0.1)
    surface = surface_of(shape, 1500)
    negatives = random_cuboids(seed + 1, 5, low=0.0, high=0.3, spread=0.45)
    together, _ = clean(negatives, surface=surface, shape=shape, suppression=1.0)
    alone = [
        clean(negatives[i : i + 1], surface=surface, shape=shape, suppression=1.0)[0].as_vector()
        for i in range(len(negatives))
    ]
    assert together.as_vector().tobytes() == np.concatenate(alone).tobytes()


@law(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_kept_ones_stay_out_of_the_shape_near_it_and_apart(seed: int) -> None:
    shape = random_cuboids(seed, 3, low=0.1)
    surface = surface_of(shape, 1500)
    # Many, and close together.
    negatives = random_cuboids(seed + 1, 24, low=0.1, high=0.4, spread=0.25)
    kept, _ = clean(negatives, surface=surface, shape=shape)
    occupancy = cuboid.voxelise(shape, 64, raise_thin=False)
    cells = grid_points(64)[occupancy.ravel()]
    points = cuboid.sample_volume(kept, 4000, np.random.default_rng(seed)).astype(np.float64)
    for one in range(len(kept)):
        # Independent of the lattice that decides: the cells' centres, a share of its volume.
        mine = kept[one : one + 1]
        overlap = np.count_nonzero(cuboid.contains(cells, mine)) * (1.1 / 64) ** 3
        assert overlap <= 0.02 * cuboid.volumes(mine)[0] + 0.05 * cuboid.volumes(mine)[0]
        # As the nearest surface sample has it, along the cuboid's own axes.
        beyond = np.abs(cuboid.local(surface[:, :3], mine)[0]) - mine.scale[0] / 2
        assert beyond.max(axis=1).min() <= 0.5 * VOXEL + 1e-6
        for other in range(len(kept)):
            share = cuboid.contains(points[one], kept[other : other + 1]).mean()
            assert other == one or share <= 0.6 + 0.03
