"""Quaternions against scipy's rotations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pnabs.geometry import quaternion


def quaternions(n: int) -> np.ndarray:
    return quaternion.normalise(np.random.default_rng(n).normal(size=(n, 4)))


def as_rotation(q: np.ndarray) -> Rotation:
    return Rotation.from_quat(q[..., [1, 2, 3, 0]])


def test_matrices_are_those_of_scipy() -> None:
    q = quaternions(50)
    np.testing.assert_allclose(quaternion.to_matrix(q), as_rotation(q).as_matrix(), atol=1e-14)
    np.testing.assert_allclose(quaternion.to_matrix(3 * q), quaternion.to_matrix(q), atol=1e-14)


def test_products_compose_rotations() -> None:
    a, b = quaternions(30), quaternions(30)[::-1]
    expected = (as_rotation(a) * as_rotation(b)).as_matrix()
    np.testing.assert_allclose(
        quaternion.to_matrix(quaternion.multiply(a, b)), expected, atol=1e-14
    )


def test_rotation_vectors() -> None:
    vectors = np.random.default_rng(1).normal(size=(20, 3))
    vectors[0] = 0
    expected = Rotation.from_rotvec(vectors).as_matrix()
    found = quaternion.to_matrix(quaternion.from_rotation_vector(vectors))
    np.testing.assert_allclose(found, expected, atol=1e-14)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_mirrored_rotation_is_conjugated_by_the_reflection(axis: int) -> None:
    q = quaternions(20)
    reflection = np.eye(3)
    reflection[axis, axis] = -1
    expected = reflection @ quaternion.to_matrix(q) @ reflection
    np.testing.assert_allclose(
        quaternion.to_matrix(quaternion.mirror(q, axis)), expected, atol=1e-14
    )


def test_what_has_no_direction_is_the_identity() -> None:
    broken = np.array([[0.0, 0, 0, 0], [np.nan, 1, 0, 0], [np.inf, 0, 0, 0]])
    np.testing.assert_array_equal(quaternion.normalise(broken), [[1, 0, 0, 0]] * 3)
