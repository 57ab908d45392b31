"""The difference volume against its definition, voxel by voxel, and a known box pair."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as law
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from pnabs import settings
from pnabs.geometry import cuboid
from pnabs.geometry.difference import Difference, difference, difference_volume
from pnabs.geometry.types import GRID_SIDE, THETA_D, Cuboids, cell_centres, grid_points
from tests.geometry.boxes import axis_aligned, random_cuboids, surface_of

VOXEL = GRID_SIDE / 32
SEEDS = st.integers(0, 2**32 - 1)


def shape_fields(shape: Cuboids) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    sdf = cuboid.union_sdf(grid_points(32), shape).reshape(32, 32, 32).astype(np.float32)
    return sdf < 0, sdf, surface_of(shape, 5000)


def take(
    positives: Cuboids, shape: Cuboids, *, preprocess: bool = True, seed: int = 0
) -> Difference | None:
    occupancy, sdf, surface = shape_fields(shape)
    return difference(
        positives,
        occupancy,
        sdf,
        surface,
        settings.Difference(preprocess=preprocess),
        surface_points=600,
        interior_points=400,
        rng=np.random.default_rng(seed),
    )


def expected_volume(positives: Cuboids, shape: Cuboids, theta: float) -> np.ndarray:
    """The definition, from its parts."""
    occupancy, sdf, _ = shape_fields(shape)
    inside = cuboid.contains(grid_points(32), positives).any(axis=0).reshape(occupancy.shape)
    volume = inside & ~occupancy
    around = np.pad(volume, 1)
    neighbours = [
        np.roll(around, step, axis)[1:-1, 1:-1, 1:-1] for axis in range(3) for step in (-1, 1)
    ]
    at_boundary = ~np.all(neighbours, axis=0)
    return volume & ~(at_boundary & (np.maximum(sdf, 0) < theta))


@law(deadline=None, max_examples=20)
@given(SEEDS, st.booleans())
def test_volume_is_as_defined(seed: int, preprocess: bool) -> None:
    positives = random_cuboids(seed, 3, low=0.2, high=0.9)
    shape = random_cuboids(seed + 1, 3, low=0.05)
    expected = expected_volume(positives, shape, THETA_D if preprocess else 0.0)
    found = take(positives, shape, preprocess=preprocess)
    if found is None:
        assert not expected.any()
    else:
        np.testing.assert_array_equal(found.occupancy, expected)


@pytest.mark.parametrize("seed", range(4))
def test_theta_d_is_the_same_on_a_finer_grid(seed: int) -> None:
    positives = random_cuboids(seed, 3, low=0.3, high=0.9)
    shape = random_cuboids(seed + 1, 3, low=0.05)
    points = grid_points(64)
    sdf = cuboid.union_sdf(points, shape).reshape(64, 64, 64).astype(np.float32)
    inside = cuboid.contains(points, positives).any(axis=0).reshape(sdf.shape)
    volume = inside & (sdf >= 0)
    around = np.pad(volume, 1)
    neighbours = [
        np.roll(around, step, axis)[1:-1, 1:-1, 1:-1] for axis in range(3) for step in (-1, 1)
    ]
    expected = volume & (np.all(neighbours, axis=0) | (sdf >= 1.1 / 32))
    found = difference_volume(positives, sdf < 0, sdf, settings.Difference())
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("preprocess", [True, False])
def test_field_is_as_defined_everywhere(preprocess: bool) -> None:
    positives = random_cuboids(3, 3, low=0.3, high=0.8)
    shape = random_cuboids(4, 2)
    found = take(positives, shape, preprocess=preprocess)
    assert found is not None
    points = grid_points(32)
    slabs = []
    for scale, turn, centre in zip(
        positives.scale, positives.rotation, positives.translation, strict=True
    ):
        local = Rotation.from_quat(turn, scalar_first=True).inv().apply(points - centre)
        gaps = np.abs(local) - scale / 2
        slabs.append(np.linalg.norm(gaps.clip(0), axis=1) + gaps.max(axis=1).clip(max=0))
    to_union = np.min(slabs, axis=0).reshape(32, 32, 32)
    _, sdf, _ = shape_fields(shape)
    theta = 1.1 / 32 if preprocess else 0.0
    np.testing.assert_allclose(found.sdf, np.maximum(to_union, theta - sdf), atol=1e-6)
    assert (found.sdf > 0.1).any()


@pytest.mark.parametrize("seed", range(4))
def test_samples_follow_the_nearer_surface(seed: int) -> None:
    positives = random_cuboids(seed, 4, low=0.3, high=0.8)
    shape = random_cuboids(seed + 50, 2)
    found = take(positives, shape)
    assert found is not None
    _, sdf, surface = shape_fields(shape)
    moved = (surface[:, :3].astype(float) + THETA_D * surface[:, 3:]).astype(np.float32)
    from_shape = cKDTree(moved).query(found.surface)[0] < 1e-6
    assert 0 < from_shape.sum() < len(found.surface)
    to_union = cuboid.union_sdf(grid_points(32), positives).reshape(sdf.shape)
    # Those of the positives lie on the outside of their union.
    on_union = cuboid.union_sdf(found.surface[~from_shape], positives)
    np.testing.assert_allclose(on_union, 0, atol=1e-5)
    for chosen, nearer in (
        (from_shape, np.abs(to_union) >= sdf.clip(0)),
        (~from_shape, np.abs(to_union) < sdf.clip(0)),
    ):
        voxels = cell_centres(32)[np.argwhere(found.occupancy & nearer)]
        gap, _ = cKDTree(voxels).query(found.surface[chosen])
        assert gap.max() <= VOXEL + 1e-6


def test_layer_at_the_shape_is_removed_and_no_other() -> None:
    # The shape is the lower part of the one positive, all faces between cell centres.
    centres = cell_centres(32)
    faces = (centres[[8, 20, 4, 28]] - VOXEL / 2).tolist()
    low, top, left, right = faces
    half_width = (right - left) / 2
    middle = (left + right) / 2
    shape = axis_aligned(
        ([2 * half_width, top - low, 2 * half_width], [middle, (low + top) / 2, middle])
    )
    high = float(centres[26] - VOXEL / 2)
    positives = axis_aligned(
        ([2 * half_width, high - low, 2 * half_width], [middle, (low + high) / 2, middle])
    )
    with_layer = take(positives, shape, preprocess=False)
    without = take(positives, shape)
    assert with_layer is not None
    assert without is not None
    np.testing.assert_array_equal(
        np.flatnonzero(with_layer.occupancy.any(axis=(0, 2))), np.arange(20, 26)
    )
    np.testing.assert_array_equal(
        np.flatnonzero(without.occupancy.any(axis=(0, 2))), np.arange(21, 26)
    )


def test_field_and_samples_belong_to_the_volume() -> None:
    shape = axis_aligned(([0.8, 0.3, 0.8], [0, -0.2, 0]))
    positives = axis_aligned(([0.8, 0.8, 0.8], [0, 0.05, 0]))
    found = take(positives, shape)
    assert found is not None
    # The rest is the box from theta_d above the shape to the positive's top.
    low, high = -0.05 + THETA_D, 0.45
    rest = axis_aligned(([0.8, high - low, 0.8], [0, (low + high) / 2, 0]))
    depth = cuboid.union_sdf(grid_points(32), rest).reshape(32, 32, 32)
    inside = depth < 0
    np.testing.assert_allclose(found.sdf[inside], depth[inside], atol=1e-6)
    assert found.surface.shape == (600, 3)
    assert found.interior.shape == (400, 3)
    assert np.abs(cuboid.union_sdf(found.surface, rest)).max() < 1e-6
    # Every side of it has samples, the one towards the shape too.
    for axis, value in ((0, -0.4), (0, 0.4), (1, low), (1, high), (2, -0.4), (2, 0.4)):
        assert np.count_nonzero(np.abs(found.surface[:, axis] - value) < 1e-6) > 20
    cells = np.floor((found.interior + GRID_SIDE / 2) / VOXEL).astype(int)
    assert found.occupancy[tuple(cells.T)].all()


@law(deadline=None, max_examples=10)
@given(SEEDS)
def test_surface_samples_lie_within_a_voxel_of_the_volume(seed: int) -> None:
    positives = random_cuboids(seed, 3, low=0.3, high=0.8)
    found = take(positives, random_cuboids(seed + 1, 2))
    if found is None:
        return
    kept = cell_centres(32)[np.argwhere(found.occupancy)]
    gap, _ = cKDTree(kept).query(found.surface)
    assert gap.max() <= VOXEL + 1e-6
    assert np.isfinite(found.sdf).all()


def test_few_candidates_are_drawn_again() -> None:
    centre = float(cell_centres(32)[16])
    tiny = axis_aligned(([0.03, 0.03, 0.03], [centre] * 3))
    far = axis_aligned(([0.1, 0.1, 0.1], [-0.4, -0.4, -0.4]))
    found = take(tiny, far)
    assert found is not None
    assert found.occupancy.sum() == 1
    assert len(found.surface) == 600
    # As many points as a kept voxel takes, in front of it the nearest ones.
    assert len(np.unique(found.surface, axis=0)) == settings.Difference().points_per_voxel


@pytest.mark.parametrize("preprocess", [True, False])
def test_positives_within_the_shape_leave_nothing(preprocess: bool) -> None:
    shape = axis_aligned(([0.8, 0.8, 0.8], [0, 0, 0]))
    assert take(random_cuboids(0, 3, high=0.2, spread=0.1), shape, preprocess=preprocess) is None
    assert take(Cuboids.empty(), shape, preprocess=preprocess) is None


def test_same_seed_same_bytes() -> None:
    positives, shape = random_cuboids(1, 3, low=0.3), random_cuboids(2, 3)
    first, again, other = (take(positives, shape, seed=seed) for seed in (5, 5, 6))
    assert first is not None
    assert again is not None
    assert other is not None
    assert first.surface.tobytes() == again.surface.tobytes()
    assert first.interior.tobytes() == again.interior.tobytes()
    assert first.surface.tobytes() != other.surface.tobytes()
    np.testing.assert_array_equal(first.occupancy, other.occupancy)
