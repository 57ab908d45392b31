"""What is left of each positive, whole and in convex parts, against the analytic solid."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from pnabs.geometry import cuboid
from pnabs.geometry.inside import winding_number
from pnabs.geometry.parts import Part, convex_parts, cropped_parts
from pnabs.geometry.solidify import CropRecipe, make_solid
from pnabs.geometry.types import Cuboids
from tests.geometry.boxes import axis_aligned, random_cuboids

SEEDS = st.integers(0, 2**32 - 1)
PLAIN = CropRecipe(2e-3, 1e-4, 0, 0, debris=0.0)
BLOCK = axis_aligned(([0.6, 0.6, 0.2], [0, 0, 0]))
WINDOW = axis_aligned(([0.2, 0.2, 1.0], [0.05, 0, 0]))


def volume(part: Part) -> float:
    return float(np.linalg.det(part.vertices[part.faces]).sum() / 6)


def holds(parts: list[Part], points: np.ndarray) -> np.ndarray:
    """How many parts each point lies in."""
    inside = [winding_number(part.vertices[part.faces], points) > 0.5 for part in parts]
    return np.sum(inside, axis=0)


@settings(deadline=None, max_examples=25)
@given(SEEDS)
def test_parts_are_convex_and_together_what_is_left(seed: int) -> None:
    positives, negatives = random_cuboids(seed, 5), random_cuboids(seed + 1, 4)
    points = np.random.default_rng(seed).uniform(-0.5, 0.5, (200, 3))
    to_positive = np.stack([cuboid.union_sdf(points, positives[[i]]) for i in range(5)])
    to_negative = cuboid.union_sdf(points, negatives)
    clear = np.all(np.abs(to_positive) > 1e-6, axis=0) & (np.abs(to_negative) > 1e-6)
    whole, convex = (make(positives, negatives, PLAIN) for make in (cropped_parts, convex_parts))
    for part in convex:
        assert ConvexHull(part.vertices).volume == pytest.approx(volume(part), rel=1e-6)
    for source in range(5):
        expected = ((to_positive[source] < 0) & (to_negative > 0)).astype(int)
        for parts in (whole, convex):
            mine = [part for part in parts if part.source == source]
            np.testing.assert_array_equal(
                holds(mine, points)[clear] if mine else 0 * expected[clear], expected[clear]
            )
        volumes = [sum(volume(p) for p in parts if p.source == source) for parts in (whole, convex)]
        assert volumes[0] == pytest.approx(volumes[1], rel=1e-7, abs=1e-12)


@settings(deadline=None, max_examples=15)
@given(SEEDS)
def test_their_union_has_the_volume_of_the_result(seed: int) -> None:
    positives, negatives = random_cuboids(seed, 8), random_cuboids(seed + 1, 4)
    meshes = [
        trimesh.Trimesh(part.vertices, part.faces, process=False)
        for part in cropped_parts(positives, negatives, PLAIN)
    ]
    solid = make_solid(positives, negatives, PLAIN)
    whole = float(np.linalg.det(solid.triangles).sum() / 6)
    assert trimesh.boolean.union(meshes).volume == pytest.approx(whole, rel=1e-6)


def test_a_window_stays_open_between_four_boxes() -> None:
    parts = convex_parts(BLOCK, WINDOW, PLAIN)
    assert len(parts) == 4
    assert all(part.box is not None for part in parts)
    assert sum(volume(part) for part in parts) == pytest.approx((0.36 - 0.04) * 0.2, rel=1e-6)
    assert not holds(parts, np.array([[0.05, 0.0, 0.0], [0.14, 0.09, 0.09]])).any()


def test_a_cavity_stays_hollow() -> None:
    within = axis_aligned(([0.2, 0.2, 0.1], [0.05, 0, 0]), ([0.02, 0.02, 0.02], [-0.25, 0, 0]))
    expected = 0.6 * 0.6 * 0.2 - 0.2 * 0.2 * 0.1 - 0.02**3
    for parts in (cropped_parts(BLOCK, within, PLAIN), convex_parts(BLOCK, within, PLAIN)):
        assert sum(volume(part) for part in parts) == pytest.approx(expected, rel=1e-6)
        assert not holds(parts, np.array([[0.05, 0.0, 0.0], [-0.25, 0.0, 0.0]])).any()


def test_what_stays_convex_is_one_part() -> None:
    sloped = Cuboids.from_vector(np.array([[1, 1, 1, 0.92, 0, 0, 0.39, 0.6, 0.5, 0]]))
    (part,) = convex_parts(BLOCK, sloped, PLAIN)
    assert part.box is None
    half = axis_aligned(([0.6, 1.0, 1.0], [0.3, 0, 0]))
    (part,) = convex_parts(BLOCK, half, PLAIN)
    assert part.box is not None
    np.testing.assert_allclose(part.box.scale, [[0.3, 0.6, 0.2]], atol=1e-7)
    np.testing.assert_allclose(part.box.translation, [[-0.15, 0, 0]], atol=1e-7)


def test_what_nothing_touches_is_its_cuboid() -> None:
    positives = random_cuboids(5, 4)
    far = axis_aligned(([0.1, 0.1, 0.1], [5, 0, 0]))
    parts = convex_parts(positives, far, PLAIN)
    for index, part in enumerate(parts):
        assert part.source == index
        assert part.box is not None
        np.testing.assert_allclose(part.box.scale[0], positives.scale[index], rtol=1e-6)
        np.testing.assert_allclose(part.box.translation[0], positives.translation[index], atol=1e-7)


def test_a_positive_cut_in_two_has_two_parts() -> None:
    cut = axis_aligned(([0.1, 1, 1], [0, 0, 0]))
    for parts in (cropped_parts(BLOCK, cut, PLAIN), convex_parts(BLOCK, cut, PLAIN)):
        assert sorted(volume(part) for part in parts) == pytest.approx([0.03, 0.03], rel=1e-6)


def test_debris_is_in_no_part() -> None:
    positives = axis_aligned(([0.6, 0.6, 0.6], [0, 0, 0]), ([0.03, 0.03, 0.03], [0.45, 0, 0]))
    sliver = axis_aligned(([0.1, 0.5, 0.9], [0.24, 0, 0]))
    recipe = CropRecipe(2e-3, 1e-4, 0, 0, debris=0.05)
    solid = make_solid(positives, sliver, recipe)
    assert len(solid.dropped) == 1
    left = float(np.linalg.det(solid.triangles).sum() / 6)
    for make in (cropped_parts, convex_parts):
        assert {part.source for part in make(positives, sliver, PLAIN)} == {0, 1}
        parts = make(positives, sliver, recipe)
        assert {part.source for part in parts} == {0}
        assert sum(volume(part) for part in parts) == pytest.approx(left, rel=1e-6)


def test_parts_follow_the_jitter() -> None:
    positives = axis_aligned(
        ([0.5, 0.5, 0.5], [0.25, 0.25, 0]), ([0.5, 0.5, 0.5], [-0.25, -0.25, 0])
    )
    again = CropRecipe(2e-3, 1e-4, 7, 2, debris=0.0)
    parts = convex_parts(positives, Cuboids.empty(), again)
    vertices = np.concatenate([part.vertices for part in parts])
    solid = make_solid(positives, Cuboids.empty(), again).vertices
    np.testing.assert_allclose(vertices.min(axis=0), solid.min(axis=0), atol=1e-6)
    assert np.abs(vertices.max(axis=0) - [0.5, 0.5, 0.25]).max() > 1e-6


def test_nothing_has_no_parts() -> None:
    assert convex_parts(Cuboids.empty(), WINDOW, PLAIN) == []
    everything = axis_aligned(([2, 2, 2], [0, 0, 0]))
    assert cropped_parts(BLOCK, everything, PLAIN) == []
    assert convex_parts(BLOCK, everything, PLAIN) == []
