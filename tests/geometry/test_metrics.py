"""Metrics against brute force and known distances."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as law
from hypothesis import strategies as st
from scipy.spatial import Delaunay
from scipy.spatial.distance import cdist

from pnabs.geometry import cuboid, metrics
from pnabs.geometry.sampling import draw_on_triangles
from pnabs.geometry.solidify import SolidResult, solidify
from pnabs.geometry.types import Cuboids, cell_centres, grid_points
from pnabs.settings import Abstract
from tests.geometry.boxes import axis_aligned, random_cuboids, surface_of

OPTIONS = Abstract(metric_samples=2000)
NAMES = {
    *("iou_32", "iou_64", "iou_mesh_64", "iou_32_positives", "iou_64_positives"),
    *("cd_l1", "cd_l2", "cd_surface"),
    *("cd_l1_positives", "cd_l2_positives", "cd_surface_positives"),
    *("cd_l1_floor", "cd_l2_floor"),
    *("open_space", "open_space_positives", "faces", "pieces"),
}


def measured(
    positives: Cuboids, negatives: Cuboids, shape: Cuboids, removed: Cuboids | None = None
) -> tuple[dict[str, float | int], SolidResult]:
    """Cuboids measured against a shape that is itself made of cuboids."""
    solid = solidify(positives, negatives, OPTIONS, np.random.default_rng(1))
    removed = removed or Cuboids.empty()
    reference = solidify(shape, removed, OPTIONS, np.random.default_rng(2)).mesh.triangles
    points, face = draw_on_triangles(reference, 10_000, np.random.default_rng(3))
    normal = np.cross(reference[:, 1] - reference[:, 0], reference[:, 2] - reference[:, 0])[face]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    surface = np.concatenate([points, normal], axis=1).astype(np.float32)
    found = metrics.measure(
        positives,
        negatives,
        solid,
        occupancy=metrics.predicted_occupancy(shape, removed, 32, 2e-3),
        occupancy_64=metrics.predicted_occupancy(shape, removed, 64, 2e-3),
        surface=surface,
        options=OPTIONS,
        rng=np.random.default_rng(4),
    )
    return found, solid


def test_iou_counts_cells() -> None:
    a, b = np.zeros((2, 4, 4, 4), dtype=np.bool_)
    a[:2], b[1:3] = True, True
    assert metrics.iou(a, b) == pytest.approx(1 / 3)
    assert metrics.iou(a, a) == 1
    assert metrics.iou(np.zeros_like(a), np.zeros_like(a)) == 0


@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.integers(1, 40))
def test_chamfer_is_as_defined(seed: int, n: int, m: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(n, 3)), rng.normal(size=(m, 3))
    gaps = cdist(a, b)
    there, back = gaps.min(axis=1), gaps.min(axis=0)
    l1, l2 = metrics.chamfer(a, b)
    assert l1 == pytest.approx(1000 * (there.mean() + back.mean()) / 2, rel=1e-12)
    assert l2 == pytest.approx(1000 * ((there**2).mean() + (back**2).mean()), rel=1e-12)


def test_prediction_raises_positives_but_not_negatives() -> None:
    between = float(cell_centres(32)[16] + cell_centres(32)[17]) / 2
    plate = axis_aligned(([0.9, 0.004, 0.9], [0, between, 0]))
    block = axis_aligned(([0.9, 0.9, 0.9], [0, 0, 0]))
    none = Cuboids.empty()
    assert metrics.predicted_occupancy(plate, none, 32, 2e-3).any()
    assert not metrics.predicted_occupancy(plate, none, 32, 5e-3).any()
    np.testing.assert_array_equal(
        metrics.predicted_occupancy(block, plate, 32, 2e-3),
        metrics.predicted_occupancy(block, none, 32, 2e-3),
    )


def test_an_exact_abstraction_scores_full_marks() -> None:
    positives = axis_aligned(([0.9, 0.8, 0.7], [0, 0, 0]))
    negatives = axis_aligned(([0.5, 0.5, 1.0], [0, 0, 0]))
    found, solid = measured(positives, negatives, positives, negatives)
    assert set(found) == NAMES
    for name in ("iou_32", "iou_64", "iou_mesh_64", "open_space"):
        assert found[name] == 1
    # A tunnel of 0.5 x 0.5 in 0.9 x 0.8, within half a cell.
    assert found["iou_64_positives"] == pytest.approx(1 - 0.25 / 0.72, abs=0.03)
    assert found["open_space_positives"] == 0
    assert found["cd_surface"] < 1.0
    assert found["cd_surface_positives"] > 20
    # Chamfer distances are no more than their floor, where the samples are as many.
    assert found["cd_l1"] < found["cd_l1_floor"]
    assert found["faces"] == len(solid.mesh.faces)
    assert found["pieces"] == 1


def test_distance_of_two_plates() -> None:
    # Two squares' worth of surface, apart by 0.05 but for the rim.
    shape = axis_aligned(([0.9, 0.01, 0.9], [0, 0, 0]))
    found, _ = measured(axis_aligned(([0.9, 0.01, 0.9], [0, 0.05, 0])), Cuboids.empty(), shape)
    # Half of each plate's samples face the other at 0.04, half at 0.05.
    assert found["cd_surface"] == pytest.approx(45, abs=1)
    assert found["cd_l1"] == pytest.approx(45, abs=2)
    assert found["cd_l2"] == pytest.approx(2 * 2.05, abs=0.4)
    assert found["iou_mesh_64"] == 0


def test_without_negatives_both_have_the_same_figures() -> None:
    found, _ = measured(random_cuboids(0, 5), Cuboids.empty(), random_cuboids(1, 4))
    for name in ("iou_32", "iou_64", "cd_l1", "cd_l2", "cd_surface", "open_space"):
        assert found[name] == found[f"{name}_positives"]


def test_an_empty_result_has_no_distances() -> None:
    block = axis_aligned(([0.3, 0.3, 0.3], [0, 0, 0]))
    found, _ = measured(block, axis_aligned(([0.5] * 3, [0, 0, 0])), block)
    assert (found["iou_64"], found["iou_mesh_64"], found["faces"], found["pieces"]) == (0, 0, 0, 0)
    for name in ("cd_l1", "cd_l2", "cd_surface", "cd_l1_floor", "cd_l2_floor"):
        assert math.isnan(found[name])
    assert found["cd_surface_positives"] < 0.5
    assert found["open_space"] == 1


def test_same_seed_same_figures() -> None:
    arguments = (random_cuboids(2, 5), random_cuboids(3, 3), random_cuboids(4, 4))
    assert measured(*arguments)[0] == measured(*arguments)[0]


def test_floor_is_that_of_two_samplings() -> None:
    found, solid = measured(random_cuboids(5, 4), Cuboids.empty(), random_cuboids(6, 4))
    draws = [
        draw_on_triangles(solid.mesh.triangles, 2000, np.random.default_rng(k))[0] for k in (8, 9)
    ]
    assert found["cd_l1_floor"] == pytest.approx(metrics.chamfer(*draws)[0], rel=0.05)


@law(deadline=None, max_examples=8)
@given(st.integers(0, 2**32 - 1))
def test_distance_to_a_sampled_surface(seed: int) -> None:
    shape = random_cuboids(seed, 2, low=0.2, high=0.6)
    surface = surface_of(shape, 8000, seed)
    original = metrics.OriginalSurface(surface)
    rng = np.random.default_rng(seed)
    points = surface_of(shape, 500, seed + 1)[:, :3].astype(np.float64)
    points += rng.normal(0, 0.02, points.shape)
    dense = surface_of(shape, 50_000, seed + 2)
    expected, _ = metrics._nearest(metrics._tree(dense[:, :3].astype(np.float64)), points)
    nearest, index = metrics._nearest(original.tree, points)
    found = original.to_surface(points, nearest, index)
    assert np.all(found <= nearest + 1e-12)
    assert 1000 * found.mean() == pytest.approx(1000 * expected.mean(), abs=1.0)


@law(deadline=None, max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_hull_holds_the_centres_in_the_hull_of_whole_cells(seed: int) -> None:
    occupancy = cuboid.voxelise(random_cuboids(seed, 2), 12, raise_thin=True)
    half = (cell_centres(12)[1] - cell_centres(12)[0]) / 2
    centres = grid_points(12)
    corners = centres[occupancy.ravel()][:, None] + half * np.array(
        [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    )
    inside = Delaunay(corners.reshape(-1, 3)).find_simplex(centres, tol=1e-9) >= 0
    np.testing.assert_array_equal(metrics.hull_occupancy(occupancy).ravel(), inside)


def test_hull_of_one_cell_is_that_cell() -> None:
    occupancy = np.zeros((8, 8, 8), dtype=np.bool_)
    occupancy[3, 4, 5] = True
    np.testing.assert_array_equal(metrics.hull_occupancy(occupancy), occupancy)
    assert not metrics.hull_occupancy(np.zeros_like(occupancy)).any()


def test_open_space_of_a_u() -> None:
    shape = np.zeros((8, 8, 8), dtype=np.bool_)
    shape[1:7, 1, 1:7] = shape[1, 1:7, 1:7] = shape[6, 1:7, 1:7] = True
    gap = np.zeros_like(shape)
    gap[2:6, 2:7, 1:7] = True
    assert metrics.open_space(shape, shape) == 1
    assert metrics.open_space(shape, shape | gap) == 0
    half = shape.copy()
    half[2:4, 2:7, 1:7] = True
    assert metrics.open_space(shape, half) == 0.5
    block = gap  # convex: there is nothing to leave open
    assert metrics.open_space(block, np.ones_like(block)) == 1


def test_the_mesh_is_measured_as_written() -> None:
    """A mesh with its debris dropped is not the cuboids' volume."""
    positives = axis_aligned(([0.6] * 3, [-0.1, 0, 0]), ([0.1] * 3, [0.4, 0, 0]))
    _, solid = measured(positives, Cuboids.empty(), positives)
    assert len(solid.mesh.dropped) == 0
    bare = solidify(positives, Cuboids.empty(), Abstract(debris=0.2), np.random.default_rng(0))
    arguments = {
        "occupancy": metrics.predicted_occupancy(positives, Cuboids.empty(), 32, 2e-3),
        "occupancy_64": metrics.predicted_occupancy(positives, Cuboids.empty(), 64, 2e-3),
        "surface": surface_of(positives, 2000),
    }
    figures = [
        metrics.measure(
            positives,
            Cuboids.empty(),
            one,
            options=OPTIONS,
            rng=np.random.default_rng(0),
            **arguments,
        )
        for one in (solid, bare)
    ]
    assert figures[0]["iou_mesh_64"] == 1
    assert figures[1]["iou_mesh_64"] < 1
    assert figures[1]["pieces"] == 1


def test_warm_up_loads_the_check() -> None:
    metrics.warm_up()
    assert "pymeshlab" in sys.modules
