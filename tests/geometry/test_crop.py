"""Cropping against the analytic solid and Monte Carlo volumes."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from pnabs.geometry import cuboid
from pnabs.geometry.crop import CropResult, crop, to_float32_mesh
from pnabs.geometry.inside import winding_number
from pnabs.geometry.types import Cuboids
from tests.geometry.boxes import axis_aligned, random_cuboids

SEEDS = st.integers(0, 2**32 - 1)


def volume(result: CropResult) -> float:
    return float(np.linalg.det(result.vertices[result.faces]).sum() / 6)


@settings(deadline=None, max_examples=40)
@given(SEEDS)
def test_result_is_the_analytic_solid(seed: int) -> None:
    positives, negatives = random_cuboids(seed, 6), random_cuboids(seed + 1, 4)
    result = crop(positives, negatives, min_side=2e-3)
    points = np.random.default_rng(seed).uniform(-0.5, 0.5, (80, 3))
    added, removed = cuboid.union_sdf(points, positives), cuboid.union_sdf(points, negatives)
    clear = (np.abs(added) > 1e-6) & (np.abs(removed) > 1e-6)
    inside = winding_number(result.vertices[result.faces], points)
    np.testing.assert_allclose(inside, np.round(inside), atol=1e-6)
    np.testing.assert_array_equal(
        np.round(inside)[clear] == 1, ((added < 0) & (removed > 0))[clear]
    )


def test_volume_agrees_with_monte_carlo() -> None:
    positives, negatives = random_cuboids(7, 12, high=0.4), random_cuboids(8, 8, high=0.3)
    result = crop(positives, negatives, min_side=2e-3)
    n = 400_000
    points = np.random.default_rng(0).uniform(-1, 1, (n, 3))
    held = (cuboid.union_sdf(points, positives) < 0) & (cuboid.union_sdf(points, negatives) > 0)
    share = held.mean()
    deviation = np.sqrt(share * (1 - share) / n)
    assert abs(volume(result) / 8 - share) < 5 * deviation


def test_exact_volumes() -> None:
    block = axis_aligned(([0.6, 0.6, 0.6], [0, 0, 0]))
    tunnel = axis_aligned(([0.2, 0.2, 2.0], [0, 0, 0]))
    assert volume(crop(block, Cuboids.empty(), min_side=2e-3)) == pytest.approx(0.216, rel=1e-6)
    result = crop(block, tunnel, min_side=2e-3)
    assert volume(result) == pytest.approx(0.216 - 0.04 * 0.6, rel=1e-6)
    mesh = trimesh.Trimesh(result.vertices, result.faces, process=False)
    assert mesh.is_watertight
    assert mesh.euler_number == 0  # a ring


def test_faces_know_their_positive() -> None:
    positives = axis_aligned(
        ([0.2, 0.2, 0.2], [-0.4, 0, 0]),
        ([1e-6, 0.2, 0.2], [0, 0, 0]),  # too thin to take part
        ([0.2, 0.2, 0.2], [0.4, 0, 0]),
    )
    notch = axis_aligned(([0.1, 0.1, 0.1], [0.5, 0.1, 0.1]))
    result = crop(positives, notch, min_side=2e-3)
    assert set(result.source) == {0, 2}
    centres = result.vertices[result.faces].mean(axis=1)
    np.testing.assert_array_equal(result.source, np.where(centres[:, 0] < 0, 0, 2))


@settings(deadline=None, max_examples=20)
@given(SEEDS)
def test_every_face_lies_on_or_in_its_positive(seed: int) -> None:
    positives, negatives = random_cuboids(seed, 6), random_cuboids(seed + 1, 4)
    result = crop(positives, negatives, min_side=2e-3)
    centres = result.vertices[result.faces].mean(axis=1)
    depth = cuboid.depth(centres, positives)[result.source, np.arange(len(centres))]
    assert depth.max(initial=0) < 1e-6
    on_negative = np.abs(cuboid.union_sdf(centres, negatives)) < 1e-6
    assert np.abs(depth[~on_negative]).max(initial=0) < 1e-6


@pytest.mark.parametrize(
    "positives",
    [
        Cuboids.empty(),
        axis_aligned(([1e-4, 0.5, 0.5], [0, 0, 0])),
        axis_aligned(([np.nan, 0.5, 0.5], [0, 0, 0])),
        axis_aligned(([0.5, 0.5, 0.5], [np.inf, 0, 0])),
        axis_aligned(([0.2, 0.3, 0.2], [0, 0.1, 0])),  # swallowed
    ],
)
def test_nothing_left_is_empty_not_an_error(positives: Cuboids) -> None:
    result = crop(positives, axis_aligned(([1, 1, 1], [0, 0, 0])), min_side=2e-3)
    assert result.is_empty
    assert result.vertices.shape == (0, 3)
    assert result.faces.shape == (0, 3)


def test_degenerate_negatives_are_left_out() -> None:
    block = axis_aligned(([0.6, 0.6, 0.6], [0, 0, 0]))
    thin = axis_aligned(([1e-5, 1, 1], [0, 0, 0]), ([np.nan, 1, 1], [0, 0, 0]))
    assert volume(crop(block, thin, min_side=2e-3)) == pytest.approx(0.216, rel=1e-6)


def test_same_cuboids_same_bytes_and_jitter_from_the_generator_alone() -> None:
    positives, negatives = random_cuboids(3, 10), random_cuboids(4, 5)

    def made(seed: int | None) -> bytes:
        rng = None if seed is None else np.random.default_rng(seed)
        result = crop(positives, negatives, min_side=2e-3, jitter=1e-4 if rng else 0.0, rng=rng)
        return result.vertices.tobytes() + result.faces.tobytes() + result.source.tobytes()

    assert made(None) == made(None)
    assert made(1) == made(1)
    assert len({made(None), made(1), made(2)}) == 3


def test_jitter_moves_by_about_its_size() -> None:
    block = axis_aligned(([0.6, 0.6, 0.6], [0, 0, 0]))
    result = crop(block, Cuboids.empty(), min_side=2e-3, jitter=1e-4, rng=np.random.default_rng(0))
    moved = np.abs(np.abs(result.vertices) - 0.3).max()
    assert 1e-6 < moved < 5e-4
    with pytest.raises(ValueError, match="random generator"):
        crop(block, Cuboids.empty(), min_side=2e-3, jitter=1e-4)


def test_written_types() -> None:
    vertices, faces = to_float32_mesh(crop(random_cuboids(0, 2), Cuboids.empty(), min_side=2e-3))
    assert vertices.dtype == np.float32
    assert faces.dtype == np.int32


ONE_THREAD = """
import os, numpy as np
from pnabs.geometry.crop import crop
from tests.geometry.boxes import random_cuboids
threads = lambda: len(os.listdir("/proc/self/task"))
boxes, cores, before = random_cuboids(0, 8), os.sched_getaffinity(0), threads()
for _ in range(20):
    crop(boxes, boxes[:1], min_side=2e-3)
print(threads() - before, os.sched_getaffinity(0) == cores)
"""


@pytest.mark.skipif(len(getattr(os, "sched_getaffinity", lambda _: [0])(0)) < 2, reason="one core")
def test_a_crop_takes_one_thread_and_leaves_the_process_its_cores() -> None:
    done = subprocess.run([sys.executable, "-c", ONE_THREAD], capture_output=True, text=True)
    assert done.stdout.split() == ["0", "True"], done.stderr
