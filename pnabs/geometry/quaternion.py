"""Unit quaternions as arrays, w first, Hamilton's product, active rotations."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pnabs.geometry.types import Float64


def normalise(quaternions: ArrayLike) -> Float64:
    """Quaternions of length one.

    Parameters
    ----------
    quaternions : (..., 4) float, w first
        One of length zero, or with a number that is not finite, becomes the identity.

    Returns
    -------
    (..., 4) float64
    """
    q = np.asarray(quaternions, dtype=np.float64)
    norm = np.linalg.norm(q, axis=-1, keepdims=True)
    usable = np.isfinite(norm) & (norm > 0)
    return np.where(usable, q / np.where(usable, norm, 1.0), [1.0, 0.0, 0.0, 0.0])


def to_matrix(quaternions: ArrayLike) -> Float64:
    """Rotation matrices that act on column vectors.

    Parameters
    ----------
    quaternions : (..., 4) float, w first
        Normalised before use.

    Returns
    -------
    (..., 3, 3) float64
    """
    w, x, y, z = np.moveaxis(normalise(quaternions), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def multiply(left: ArrayLike, right: ArrayLike) -> Float64:
    """Hamilton's product: the rotation `right` followed by `left`.

    Parameters
    ----------
    left, right : (..., 4) float, w first

    Returns
    -------
    (..., 4) float64
    """
    a = np.asarray(left, dtype=np.float64)
    b = np.asarray(right, dtype=np.float64)
    w = a[..., :1] * b[..., :1] - np.sum(a[..., 1:] * b[..., 1:], axis=-1, keepdims=True)
    v = a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:] + np.cross(a[..., 1:], b[..., 1:])
    return np.concatenate([w, v], axis=-1)


def from_rotation_vector(vectors: ArrayLike) -> Float64:
    """Quaternions of rotations by the vectors' lengths, in radians, about their directions.

    Parameters
    ----------
    vectors : (..., 3) float

    Returns
    -------
    (..., 4) float64, w first
    """
    v = np.asarray(vectors, dtype=np.float64)
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), 0.5 * np.sinc(angle / (2 * np.pi)) * v], axis=-1)


def mirror(quaternions: NDArray[np.floating], axis: int) -> NDArray[np.floating]:
    """Rotations seen in the mirror: M R M, where M negates coordinate `axis`.

    Parameters
    ----------
    quaternions : (..., 4) float, w first
    axis : int
        0 for x, 1 for y, 2 for z.

    Returns
    -------
    (..., 4) float, of the input's type
    """
    signs = np.array([1, -1, -1, -1], dtype=quaternions.dtype)
    signs[1 + axis] = 1
    return quaternions * signs
