"""Sets of cuboids that are hard to crop, by what makes them so."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pnabs.geometry import quaternion
from pnabs.geometry.types import Cuboids, Float64

IDENTITY = np.array([1.0, 0, 0, 0])


def rotated(rng: np.random.Generator, n: int) -> Float64:
    """General position."""
    return np.column_stack(
        [rng.uniform(0.05, 0.5, (n, 3)), rng.normal(size=(n, 4)), rng.uniform(-0.3, 0.3, (n, 3))]
    )


def aligned(rng: np.random.Generator, n: int) -> Float64:
    """Sides along the axes."""
    boxes = rotated(rng, n)
    boxes[:, 3:7] = IDENTITY
    return boxes


def snapped(rng: np.random.Generator, n: int) -> Float64:
    """Corners on a lattice: faces and edges coincide."""
    boxes = aligned(rng, n)
    boxes[:, :3] = rng.integers(1, 5, (n, 3)) / 8
    boxes[:, 7:] = rng.integers(-3, 4, (n, 3)) / 16
    return boxes


def touching(rng: np.random.Generator, n: int) -> Float64:
    """Each meets the one before in a face, an edge or a corner, and no more."""
    boxes = aligned(rng, n)
    for k in range(1, n):
        meet = rng.permutation([True, rng.random() < 0.5, rng.random() < 0.3])
        reach = (boxes[k, :3] + boxes[k - 1, :3]) / 2
        shift = np.where(meet, rng.choice([-1, 1], 3) * reach, rng.uniform(-0.5, 0.5, 3) * reach)
        boxes[k, 7:] = boxes[k - 1, 7:] + shift
    boxes[:, 7:] -= boxes[:, 7:].mean(axis=0)
    if rng.random() < 0.5:
        # One turn for all: they still meet, though not in numbers that are exact.
        boxes[:, 3:7] = rng.normal(size=4)
        boxes[:, 7:] = boxes[:, 7:] @ quaternion.to_matrix(boxes[0, 3:7]).T
    return boxes


def near_coplanar(rng: np.random.Generator, n: int) -> Float64:
    """Faces that all but coincide."""
    boxes = snapped(rng, n)
    boxes[:, 7:] += rng.uniform(-1e-7, 1e-7, (n, 3))
    return boxes


def degenerate(rng: np.random.Generator, n: int) -> Float64:
    """Sides of no length, next to none, or not a number."""
    boxes = rotated(rng, n)
    for row in range(0, n, 2):
        boxes[row, rng.integers(3)] = rng.choice([0.0, 1e-9, 1e-4, 2e-3, np.nan])
    return boxes


def duplicate(rng: np.random.Generator, n: int) -> Float64:
    """The same cuboids again, also with their axes exchanged."""
    boxes = rotated(rng, n)
    boxes[n // 2 :] = boxes[: n - n // 2]
    return boxes


MODES: dict[str, Callable[[np.random.Generator, int], Float64]] = {
    "rotated": rotated,
    "axis-aligned": aligned,
    "snapped": snapped,
    "touching": touching,
    "near-coplanar": near_coplanar,
    "degenerate": degenerate,
    "duplicate": duplicate,
}


def configuration(mode: str, seed: int, positives: int, negatives: int) -> tuple[Cuboids, Cuboids]:
    """Positives and negatives of one mode; where faces coincide, also those of one with another."""
    rng = np.random.default_rng([seed, list(MODES).index(mode)])
    boxes = MODES[mode](rng, positives + negatives)
    boxes = boxes[rng.permutation(len(boxes))]
    both = Cuboids.from_vector(boxes)
    return both[:positives], both[positives:]
