"""Cuboids for tests."""

from __future__ import annotations

import numpy as np

from pnabs.geometry import cuboid
from pnabs.geometry.types import Cuboids, Float32


def random_cuboids(
    seed: int, n: int, *, low: float = 0.05, high: float = 0.5, spread: float = 0.3
) -> Cuboids:
    """Cuboids of any orientation about the origin."""
    rng = np.random.default_rng(seed)
    scale = rng.uniform(low, high, (n, 3))
    rotation = rng.normal(size=(n, 4))
    translation = rng.uniform(-spread, spread, (n, 3))
    return Cuboids.from_vector(np.concatenate([scale, rotation, translation], axis=1))


def axis_aligned(*boxes: tuple[list[float], list[float]]) -> Cuboids:
    """Cuboids without rotation, each given by its side lengths and its centre."""
    rows = [[*scale, 1.0, 0.0, 0.0, 0.0, *centre] for scale, centre in boxes]
    return Cuboids.from_vector(np.array(rows).reshape(-1, 10))


def surface_of(cuboids: Cuboids, n: int, seed: int = 0) -> Float32:
    """`n` samples, points and normals, of the surface of the cuboids' union."""
    rng = np.random.default_rng(seed)
    points = cuboid.sample_surface(cuboids, 4 * n, rng).reshape(-1, 6)
    points = points[cuboid.union_sdf(points[:, :3], cuboids) > -1e-6]
    return points[rng.choice(len(points), n, replace=False)]
