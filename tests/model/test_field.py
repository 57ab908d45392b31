from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.interpolate import RegularGridInterpolator

from pnabs.geometry.types import cell_centres, grid_points
from pnabs.model.field import interpolate
from tests.model.shapes import box_sdf

LOW, HIGH = np.array([-0.1, -0.3, -0.45]), np.array([0.3, 0.05, 0.2])


@pytest.fixture
def field() -> torch.Tensor:
    return torch.from_numpy(box_sdf(grid_points(32), LOW, HIGH)).view(1, 1, 32, 32, 32)


def test_cell_centres_give_their_own_values(field: torch.Tensor) -> None:
    points = torch.from_numpy(grid_points(32))[None]
    np.testing.assert_allclose(interpolate(field, points)[0], field.flatten(), atol=1e-9)


def test_trilinear_between_and_hull_distance_beyond(
    field: torch.Tensor, rng: np.random.Generator
) -> None:
    axis = cell_centres(32)
    lookup = RegularGridInterpolator((axis, axis, axis), field[0, 0].numpy())
    points = rng.uniform(-0.9, 0.9, (500, 3))
    clamped = points.clip(axis[0], axis[-1])
    expected = lookup(clamped) + np.linalg.norm(points - clamped, axis=1)
    found = interpolate(field, torch.from_numpy(points)[None])[0]
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_registration_with_an_off_centre_box(field: torch.Tensor, rng: np.random.Generator) -> None:
    # Where a face's plane is nearest, the field is linear: interpolation is exact there.
    across = rng.uniform(-0.1, 0.1, (50, 1))
    points = np.hstack([rng.uniform(0.31, 0.5, (50, 1)), across - 0.12, across - 0.12])
    found = interpolate(field, torch.from_numpy(points)[None])[0]
    np.testing.assert_allclose(found, points[:, 0] - HIGH[0], atol=1e-9)


def test_gradient_by_finite_differences(field: torch.Tensor, rng: np.random.Generator) -> None:
    points = torch.from_numpy(rng.uniform(-0.7, 0.7, (1, 10, 3))).requires_grad_()
    assert torch.autograd.gradcheck(lambda p: interpolate(field, p), points)


def test_samples_of_a_batch_keep_apart(field: torch.Tensor) -> None:
    points = torch.zeros((2, 3, 3), dtype=torch.float64)
    found = interpolate(torch.cat([field, field + 1]), points)
    np.testing.assert_allclose(found[1] - found[0], 1)
