"""What an abstraction is measured by, on cuboids measured against cuboids."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest

from pnabs.geometry import metrics
from pnabs.geometry.measure import measure, warm_up
from pnabs.geometry.reference import Boundary, Reference
from pnabs.geometry.sampling import draw_on_triangles
from pnabs.geometry.solidify import SolidResult, solidify
from pnabs.geometry.types import Cuboids
from pnabs.settings import Abstract
from tests.geometry.boxes import axis_aligned, random_cuboids

OPTIONS = Abstract(metric_samples=2000)
NAMES = {
    *("closed", "volume_iou", "covered", "excess", "coverage", "beyond", "iou_128"),
    *("out_99", "out_max", "miss_99", "miss_max"),
    *("out_99_units", "out_max_units", "miss_99_units", "miss_max_units"),
    *("shape_pieces", "result_pieces", "bodies"),
    *("iou_32", "iou_64", "iou_mesh_64", "iou_32_positives", "iou_64_positives"),
    *("cd_l1", "cd_l2", "cd_surface"),
    *("cd_l1_positives", "cd_l2_positives", "cd_surface_positives"),
    *("cd_l1_floor", "cd_l2_floor"),
    *("open_space", "open_space_positives", "faces"),
}


def measured(
    positives: Cuboids, negatives: Cuboids, shape: Cuboids, removed: Cuboids | None = None
) -> tuple[dict[str, float | int], SolidResult]:
    """Cuboids measured against a shape that is itself made of cuboids."""
    solid = solidify(positives, negatives, OPTIONS, np.random.default_rng(1))
    removed = removed or Cuboids.empty()
    reference = reference_of(shape, removed)
    return measure(positives, negatives, solid, reference, OPTIONS, (4, 5)), solid


def reference_of(shape: Cuboids, removed: Cuboids) -> Reference:
    mesh = solidify(shape, removed, OPTIONS, np.random.default_rng(2)).mesh
    corners = mesh.triangles
    points, face = draw_on_triangles(corners, 10_000, np.random.default_rng(3))
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[face]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    cells = (metrics.predicted_occupancy(shape, removed, side, 2e-3) for side in (32, 64, 128))
    return Reference(
        *cells,
        surface=np.concatenate([points, normal], axis=1).astype(np.float32),
        boundary=Boundary(mesh.vertices, mesh.faces, np.zeros(len(mesh.faces), bool), 0.005, ""),
        transform=np.eye(4),
        extent=np.ones(3),
    )


def test_an_exact_abstraction_scores_full_marks() -> None:
    positives = axis_aligned(([0.9, 0.8, 0.7], [0, 0, 0]))
    negatives = axis_aligned(([0.5, 0.5, 1.0], [0, 0, 0]))
    found, solid = measured(positives, negatives, positives, negatives)
    assert set(found) == NAMES
    for name in ("iou_32", "iou_64", "iou_128", "iou_mesh_64", "open_space", "coverage"):
        assert found[name] == 1
    # A tunnel of 0.5 x 0.5 in 0.9 x 0.8, within half a cell.
    assert found["iou_64_positives"] == pytest.approx(1 - 0.25 / 0.72, abs=0.03)
    assert found["open_space_positives"] == 0
    assert found["cd_surface"] < 1.0
    assert found["cd_surface_positives"] > 20
    # Chamfer distances are no more than their floor, where the samples are as many.
    assert found["cd_l1"] < found["cd_l1_floor"]
    assert found["volume_iou"] == pytest.approx(1, abs=1e-6)
    assert found["faces"] == len(solid.mesh.faces)
    assert found["bodies"] == 1


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
    assert (found["iou_64"], found["iou_mesh_64"], found["faces"], found["bodies"]) == (0, 0, 0, 0)
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


def test_the_mesh_is_measured_as_written() -> None:
    """A mesh with its debris dropped is not the cuboids' volume."""
    positives = axis_aligned(([0.6] * 3, [-0.1, 0, 0]), ([0.1] * 3, [0.4, 0, 0]))
    _, solid = measured(positives, Cuboids.empty(), positives)
    assert len(solid.mesh.dropped) == 0
    bare = solidify(positives, Cuboids.empty(), Abstract(debris=0.2), np.random.default_rng(0))
    reference = reference_of(positives, Cuboids.empty())
    figures = [
        measure(positives, Cuboids.empty(), one, reference, OPTIONS, (0, 1))
        for one in (solid, bare)
    ]
    assert figures[0]["iou_mesh_64"] == 1
    assert figures[1]["iou_mesh_64"] < 1
    lost = 0.1**3 / (0.1**3 + 0.6**3)
    assert figures[1]["covered"] == pytest.approx(1 - lost, rel=1e-4)
    assert figures[1]["bodies"] == 1


def test_warm_up_loads_the_check() -> None:
    warm_up()
    assert "pymeshlab" in sys.modules
