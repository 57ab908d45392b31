from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from pnabs.geometry.types import Cuboids, cell_centres, grid_points
from pnabs.model import cuboids as geometry
from tests.model.shapes import box_sdf, matrix, random_cuboids

BATCH, COUNT, POINTS = 2, 4, 150


def signed_reference(cuboids: Tensor, points: Tensor) -> np.ndarray:
    """(B, N, P) by scipy's rotations and the slab formula, box by box."""
    out = np.empty((*cuboids.shape[:2], points.shape[1]))
    for b, row in enumerate(cuboids.numpy()):
        for n, c in enumerate(row):
            local = (points[b].numpy() - c[7:]) @ matrix(c)
            out[b, n] = box_sdf(local, -c[:3] / 2, c[:3] / 2)
    return out


@pytest.fixture
def cuboids(rng: np.random.Generator) -> Tensor:
    return random_cuboids(rng, BATCH, COUNT)


@pytest.fixture
def points(rng: np.random.Generator) -> Tensor:
    return torch.from_numpy(rng.uniform(-0.6, 0.6, (BATCH, POINTS, 3)))


def test_rotations_follow_the_shared_convention(cuboids: Tensor) -> None:
    found = geometry.rotation_matrices(cuboids).numpy()
    expected = [[matrix(c) for c in row] for row in cuboids.numpy()]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_transform_is_the_definition_of_a_cuboid(cuboids: Tensor, rng: np.random.Generator) -> None:
    unit = torch.from_numpy(rng.uniform(-0.5, 0.5, (BATCH, COUNT, 5, 3)))
    found = geometry.transform(cuboids, unit)
    for b in range(BATCH):
        own = Cuboids.from_vector(cuboids[b].numpy())
        for n in range(COUNT):
            rotation = matrix(own.as_vector()[n].astype(np.float64))
            for k in range(5):
                expected = rotation @ (own.scale[n] * unit[b, n, k].numpy()) + own.translation[n]
                np.testing.assert_allclose(found[b, n, k], expected, atol=1e-6)


def test_distances(cuboids: Tensor, points: Tensor) -> None:
    expected = signed_reference(cuboids, points)
    assert (expected < -0.01).any()
    found = geometry.signed_distances(cuboids, points)
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("reach", [0.01, 0.2, 5.0])
def test_closeness_is_the_mean_over_all_pairs(
    cuboids: Tensor, points: Tensor, reach: float
) -> None:
    apart = np.maximum(signed_reference(cuboids, points), 0)
    found = float(geometry.closeness(cuboids, points, reach))
    assert found == pytest.approx(np.maximum(reach - apart, 0).mean(), abs=1e-12)


def test_closeness_of_what_is_far_away_is_zero_and_has_no_gradient(
    cuboids: Tensor, points: Tensor
) -> None:
    leaf = cuboids.clone().requires_grad_()
    value = geometry.closeness(leaf, points + 10, 0.1)
    (grad,) = torch.autograd.grad(value, leaf)
    assert float(value.detach()) == 0
    assert not grad.any()


def test_union_is_the_least(cuboids: Tensor, points: Tensor) -> None:
    expected = signed_reference(cuboids, points)
    np.testing.assert_array_equal(geometry.nearest(cuboids, points), expected.argmin(axis=1))
    found = geometry.union_signed_distance(cuboids, points)
    np.testing.assert_allclose(found, expected.min(axis=1), atol=1e-12)
    found = geometry.union_distance(cuboids, points)
    np.testing.assert_allclose(found, expected.min(axis=1).clip(0), atol=1e-12)


def test_union_gradient_equals_that_of_the_minimum(cuboids: Tensor, points: Tensor) -> None:
    def gradient(quick: bool) -> Tensor:
        leaf = cuboids.clone().requires_grad_()
        signed = geometry.union_signed_distance(leaf, points)
        if not quick:
            signed = geometry.signed_distances(leaf, points).amin(dim=1)
        signed.square().sum().backward()
        assert leaf.grad is not None
        return leaf.grad

    np.testing.assert_allclose(gradient(True), gradient(False), atol=1e-10)


@pytest.mark.parametrize(
    "function",
    [
        geometry.signed_distances,
        geometry.union_signed_distance,
        lambda c, p: geometry.closeness(c, p, 0.3),
    ],
)
def test_gradients_by_finite_differences(function: object, cuboids: Tensor, points: Tensor) -> None:
    leaf = cuboids[:1, :2].clone().requires_grad_()
    assert torch.autograd.gradcheck(lambda c: function(c, points[:1, :20]), leaf)  # type: ignore[operator]


def test_gradient_at_the_surface_and_in_the_centre_is_finite() -> None:
    cuboid = torch.tensor([[[0.2, 0.4, 0.6, 1, 0, 0, 0, 0, 0, 0]]], requires_grad=True)
    points = torch.tensor([[[0.0, 0, 0], [0.1, 0, 0], [0.1, 0.2, 0.3]]])
    for function in (geometry.signed_distances, geometry.union_signed_distance):
        (grad,) = torch.autograd.grad(function(cuboid, points).square().sum(), cuboid)
        assert torch.isfinite(grad).all()


def test_samples_fill_their_cuboid_evenly(cuboids: Tensor, generator: torch.Generator) -> None:
    samples = geometry.sample_volume(cuboids, 4000, generator)
    for b, row in enumerate(cuboids.numpy()):
        for n, c in enumerate(row):
            unit = (samples[b, n].numpy() - c[7:]) @ matrix(c) / c[:3]
            assert np.abs(unit).max() <= 0.5 + 1e-9
            np.testing.assert_allclose(unit.mean(axis=0), 0, atol=0.03)
            np.testing.assert_allclose(unit.var(axis=0), 1 / 12, atol=0.01)


@given(st.integers(0, 2**32 - 1), st.integers(0, 2))
def test_mirror_reflects_the_set(seed: int, axis: int) -> None:
    rng = np.random.default_rng(seed)
    cuboids = random_cuboids(rng, 1, 2)
    points = torch.from_numpy(rng.uniform(-0.6, 0.6, (1, 30, 3)))
    image = geometry.mirror(cuboids, torch.tensor([axis]))
    reflected = points.clone()
    reflected[..., axis] *= -1
    found = geometry.signed_distances(image, points)
    np.testing.assert_allclose(found, geometry.signed_distances(cuboids, reflected), atol=1e-12)
    mirrored = geometry.mirror_points(points, torch.tensor([axis]))
    np.testing.assert_array_equal(mirrored, reflected)


def test_mirror_without_plane_changes_nothing(cuboids: Tensor, points: Tensor) -> None:
    none = torch.tensor([-1, 0])
    assert torch.equal(geometry.mirror(cuboids, none)[0], cuboids[0])
    assert not torch.equal(geometry.mirror(cuboids, none)[1], cuboids[1])
    assert torch.equal(geometry.mirror_points(points, none)[0], points[0])


def test_soft_occupancy_hardens_with_falling_temperature(cuboids: Tensor, points: Tensor) -> None:
    inside = signed_reference(cuboids, points).min(axis=1) < 0
    logits = geometry.soft_occupancy(cuboids, points, 1e-6)
    np.testing.assert_array_equal(logits.numpy() > 0, inside)
    warm = geometry.soft_occupancy(cuboids, points, 0.03)
    np.testing.assert_allclose(warm * 0.03, logits * 1e-6, atol=1e-12)


def test_coverage_is_registered_with_the_grid() -> None:
    centres = cell_centres(32)
    cell = centres[1] - centres[0]
    # From the low face of cell 4 to the high face of cell 9 along x, and so on.
    low = np.array([centres[4], centres[10], centres[20]]) - cell / 2
    high = np.array([centres[9], centres[12], centres[20]]) + cell / 2
    vector = np.concatenate([high - low, [1, 0, 0, 0], (low + high) / 2])
    volume = geometry.coverage(torch.from_numpy(vector).float()[None, None])
    expected = np.zeros((32, 32, 32))
    expected[4:10, 10:13, 20:21] = 1
    np.testing.assert_allclose(volume[0, 0], expected, atol=1e-5)


def test_coverage_of_rotated_cuboids(cuboids: Tensor) -> None:
    found = geometry.coverage(cuboids).flatten(1).numpy()
    grid = torch.from_numpy(grid_points(32)).expand(BATCH, -1, 3)
    signed = geometry.signed_distances(cuboids, grid).amin(dim=1).numpy()
    np.testing.assert_array_equal(found > 0.5, signed < 0)
    cell = 1.1 / 32
    assert (found[signed > cell / 2 * np.sqrt(3)] == 0).all()


def test_lattice_has_the_symmetries_of_the_cube() -> None:
    points = geometry.lattice(3, torch.zeros(1))
    assert points.shape == (27, 3)
    assert points.abs().max() == 0.5
    turned = points[:, [1, 2, 0]] * torch.tensor([1.0, -1, 1])
    as_set = {tuple(p) for p in points.tolist()}
    assert {tuple(p) for p in turned.tolist()} == as_set
