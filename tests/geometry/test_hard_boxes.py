"""Crops of hard configurations: closed, two-manifold, checked, and the analytic solid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pnabs.geometry import cuboid
from pnabs.geometry.crop import croppable
from pnabs.geometry.inside import winding_number
from pnabs.geometry.solidify import SolidResult, make_solid, solidify
from pnabs.geometry.types import Bool, Cuboids, Float64
from pnabs.settings import Abstract
from tests.geometry.hard_boxes import MODES, configuration

OPTIONS = Abstract(debris=0.0)
POINTS = 24


def closed_and_two_manifold(triangles: Float64) -> bool:
    """Every directed edge between two places is there as often as its opposite (by position)."""
    _, corner = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    a, b = corner.reshape(-1, 3).ravel(), corner.reshape(-1, 3)[:, [1, 2, 0]].ravel()
    count = corner.max() + 1
    forward = np.bincount(a * count + b, minlength=0)
    backward = np.bincount(b * count + a, minlength=0)
    return bool(np.array_equal(forward, backward))


def analytic(
    points: Float64, positives: Cuboids, negatives: Cuboids, margin: float
) -> tuple[Bool, Bool]:
    """Whether each point is in the solid, and whether that is clear of its surface."""
    positives = positives[croppable(positives, OPTIONS.min_side)]
    negatives = negatives[croppable(negatives, OPTIONS.min_side)]
    added, removed = cuboid.union_sdf(points, positives), cuboid.union_sdf(points, negatives)
    return (added < 0) & (removed > 0), (np.abs(added) > margin) & (np.abs(removed) > margin)


def agrees(result: SolidResult, positives: Cuboids, negatives: Cuboids, seed: int) -> bool:
    points = np.random.default_rng(seed).uniform(-0.6, 0.6, (POINTS, 3))
    # A jitter of 1e-4 turns, shifts and grows.
    margin = 1e-3 if result.recipe.jitter_attempt else 1e-6
    inside, clear = analytic(points, positives, negatives, margin)
    found = winding_number(result.mesh.triangles, points)
    whole = np.abs(found - np.round(found)) < 1e-3
    return bool(np.all(whole[clear]) and np.array_equal((found > 0.5)[clear], inside[clear]))


def faults(mode: str, seeds: range) -> list[tuple[int, str]]:
    found = []
    for seed in seeds:
        positives, negatives = configuration(mode, seed, 12, 8)
        result = solidify(positives, negatives, OPTIONS, np.random.default_rng(seed))
        unmoved = make_solid(positives, negatives, replace(result.recipe, jitter_attempt=0))
        if result.is_empty:
            continue
        if not closed_and_two_manifold(unmoved.triangles):
            found.append((seed, "open before jitter"))
        if not result.check.ok:
            found.append((seed, f"fails its check: {result.check}"))
        elif not agrees(result, positives, negatives, seed):
            found.append((seed, "differs from the analytic solid"))
    return found


@pytest.mark.parametrize("mode", MODES)
def test_hard_configurations(mode: str) -> None:
    assert faults(mode, range(12)) == []


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
def test_ten_thousand_hard_configurations(mode: str) -> None:
    # 1,429 of each of seven modes.
    assert faults(mode, range(1000, 2429)) == []
