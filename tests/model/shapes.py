"""Small shapes with known fields, and helpers of this folder's tests."""

from __future__ import annotations

import numpy as np
import torch
from scipy.spatial.transform import Rotation
from torch import Tensor

from pnabs.geometry.types import grid_points
from pnabs.model.data import TrainingSet

CHAIR = (
    ((-0.25, -0.05, -0.25), (0.25, 0.05, 0.25)),
    ((-0.25, 0.05, 0.17), (0.25, 0.5, 0.25)),
    ((-0.25, -0.5, -0.25), (-0.17, -0.05, 0.25)),
    ((0.17, -0.5, -0.25), (0.25, -0.05, 0.25)),
)
"""Axis-aligned boxes (low corner, high corner) that meet without overlap."""


def random_cuboids(
    rng: np.random.Generator, batch: int, count: int, dtype: torch.dtype = torch.float64
) -> Tensor:
    """Cuboids (B, N, 10) in general position."""
    scale = rng.uniform(0.05, 0.5, (batch, count, 3))
    rotation = rng.normal(size=(batch, count, 4))
    rotation /= np.linalg.norm(rotation, axis=-1, keepdims=True)
    translation = rng.uniform(-0.4, 0.4, (batch, count, 3))
    return torch.from_numpy(np.concatenate([scale, rotation, translation], axis=-1)).to(dtype)


def matrix(cuboid: np.ndarray) -> np.ndarray:
    """Rotation matrix of one cuboid (10,), from scipy."""
    return Rotation.from_quat(cuboid[3:7], scalar_first=True).as_matrix()


def box_sdf(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Signed distance to an axis-aligned box, from its three slabs."""
    gaps = np.maximum(low - points, points - high)
    outside = np.sqrt((gaps.clip(0) ** 2).sum(axis=1))
    return np.where((gaps < 0).all(axis=1), gaps.max(axis=1), outside)


def boxes_sdf(points: np.ndarray, boxes: tuple) -> np.ndarray:
    """Signed distance to a union of boxes: exact outside, a bound inside."""
    return np.min([box_sdf(points, np.array(lo), np.array(hi)) for lo, hi in boxes], axis=0)


def box_surface(rng: np.random.Generator, boxes: tuple, count: int) -> np.ndarray:
    """Points on the union's surface, (count, 3): those of a face that no other box covers."""
    found: list[np.ndarray] = []
    while len(found) < count:
        low, high = (np.array(c) for c in boxes[rng.integers(len(boxes))])
        point = rng.uniform(low, high)
        axis = rng.integers(3)
        point[axis] = (low, high)[rng.integers(2)][axis]
        if boxes_sdf(point[None], boxes)[0] > -1e-9:
            found.append(point)
    return np.array(found)


def training_set(
    shapes: list[tuple], *, seed: int = 0, surface: int = 300, interior: int = 300
) -> TrainingSet:
    """A training set of unions of boxes."""
    rng = np.random.default_rng(seed)
    grid = grid_points(32)
    sdf = np.array([boxes_sdf(grid, boxes) for boxes in shapes])
    inside = []
    for boxes in shapes:
        picks = rng.integers(len(boxes), size=interior)
        inside.append([rng.uniform(*boxes[pick]) for pick in picks])
    return TrainingSet(
        occupancy=np.packbits(sdf < 0, axis=1),
        sdf=sdf.reshape(-1, 32, 32, 32).astype(np.float16),
        surface=np.array([box_surface(rng, b, surface) for b in shapes]).astype(np.float16),
        interior=np.array(inside).astype(np.float16),
        mirror=np.zeros(len(shapes), dtype=np.int8),
        shape_interior=np.array(inside).astype(np.float16),
    )
