"""Crop, debris, check and the second try."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pymeshlab
import pytest
import trimesh
from hypothesis import given
from hypothesis import settings as law
from hypothesis import strategies as st

from pnabs.geometry import solidify as room
from pnabs.geometry.check import check
from pnabs.geometry.solidify import MAX_JITTER_ATTEMPTS, SolidResult, make_solid, solidify
from pnabs.geometry.types import Cuboids
from pnabs.settings import Abstract
from tests.geometry.boxes import axis_aligned, random_cuboids


def made(positives: Cuboids, negatives: Cuboids, seed: int = 0) -> SolidResult:
    return solidify(positives, negatives, Abstract(), np.random.default_rng(seed))


def same(a: SolidResult, b: SolidResult) -> bool:
    pairs = [(a.mesh.vertices, b.mesh.vertices), (a.mesh.faces, b.mesh.faces)]
    pairs.append((a.mesh.source, b.mesh.source))
    return all(x.tobytes() == y.tobytes() for x, y in pairs) and a.recipe == b.recipe


@law(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["general", "snapped", "twins"]))
def test_result_passes_and_is_made_again_exactly(seed: int, kind: str) -> None:
    positives, negatives = random_cuboids(seed, 8), random_cuboids(seed + 1, 5)
    if kind == "snapped":
        rng = np.random.default_rng(seed)
        boxes = [(rng.integers(1, 5, 3) / 8, rng.integers(-3, 4, 3) / 16) for _ in range(13)]
        both = axis_aligned(*[(s.tolist(), t.tolist()) for s, t in boxes])
        positives, negatives = both[:8], both[8:]
    if kind == "twins":
        positives = positives[np.array([0, 0, 1, 1, 2])]
        negatives = negatives[np.array([0, 0, 1])]
    result = made(positives, negatives)
    assert result.check.ok or result.is_empty
    again = make_solid(positives, negatives, result.recipe)
    assert again.vertices.tobytes() == result.mesh.vertices.tobytes()
    assert again.faces.tobytes() == result.mesh.faces.tobytes()
    assert check(again.vertices, again.faces) == result.check
    assert same(result, made(positives, negatives))


def test_boxes_that_meet_in_an_edge_are_parted_by_jitter() -> None:
    positives = axis_aligned(
        ([0.5, 0.5, 0.5], [0.25, 0.25, 0]), ([0.5, 0.5, 0.5], [-0.25, -0.25, 0])
    )
    result = made(positives, Cuboids.empty())
    assert result.recipe.jitter_attempt > 0
    assert result.check.ok
    unmoved = make_solid(positives, Cuboids.empty(), replace(result.recipe, jitter_attempt=0))
    assert not check(unmoved.vertices, unmoved.faces).ok
    assert trimesh.Trimesh(result.mesh.vertices, result.mesh.faces).volume == pytest.approx(
        0.25, abs=1e-3
    )


def test_it_gives_up_after_three_tries(monkeypatch: pytest.MonkeyPatch) -> None:
    failing = replace(made(random_cuboids(0, 2), Cuboids.empty()).check, closed=False)
    monkeypatch.setattr(room, "check", lambda vertices, faces, extent=None: failing)
    result = made(random_cuboids(0, 2), Cuboids.empty())
    assert result.recipe.jitter_attempt == MAX_JITTER_ATTEMPTS
    assert not result.check.ok
    assert not result.is_empty


@pytest.mark.parametrize(
    "positives",
    [
        Cuboids.empty(),
        axis_aligned(([0.3, 0.3, 0.3], [0, 0, 0])),
        axis_aligned(([0, 0, 0], [0, 0, 0]), ([np.nan] * 3, [0, 0, 0])),
    ],
)
def test_nothing_left_is_empty_and_not_ok(positives: Cuboids) -> None:
    result = made(positives, axis_aligned(([0.9, 0.9, 0.9], [0, 0, 0])))
    assert result.is_empty
    assert not result.check.ok
    assert result.mesh.pieces == 0
    assert result.recipe.jitter_attempt == 0


def test_debris_is_left_out() -> None:
    positives = axis_aligned(([0.6, 0.6, 0.6], [0, 0, 0]), ([0.4, 0.02, 0.02], [0.4, 0, 0]))
    cut = axis_aligned(([0.2, 0.2, 0.2], [0.45, 0, 0]))  # leaves the rod's last 0.05
    result = made(positives, cut)
    assert result.mesh.pieces == 1
    (piece,) = result.mesh.dropped
    assert piece["volume"] == pytest.approx(0.05 * 0.02 * 0.02, rel=1e-3)
    assert result.mesh.vertices[:, 0].max() == pytest.approx(0.35, abs=1e-6)
    tolerant = solidify(positives, cut, Abstract(debris=0.0), np.random.default_rng(0))
    assert tolerant.mesh.pieces == 2


@law(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_pymeshlab_counts_the_pieces_that_were_kept(seed: int) -> None:
    # Many small ones, a few of which are debris.
    positives = random_cuboids(seed, 10, low=0.01, high=0.3, spread=0.5)
    result = made(positives, random_cuboids(seed + 1, 6, high=0.4, spread=0.5))
    meshes = pymeshlab.MeshSet(verbose=False)
    vertices = result.mesh.vertices.astype(np.float64)
    meshes.add_mesh(pymeshlab.Mesh(vertices, result.mesh.faces))
    meshes.generate_splitting_by_connected_components(delete_source_mesh=True)
    measures = []
    for mesh in meshes:
        meshes.set_current_mesh(mesh.id())
        measures.append(meshes.get_geometric_measures())
    # A sealed void is a surface of its own, and belongs to the piece around it.
    areas = [one["surface_area"] for one in measures if one["mesh_volume"] > 0]
    assert len(areas) == result.mesh.pieces
    assert len(measures) == result.check.components
    dropped = sum(piece["area"] for piece in result.mesh.dropped)
    total = sum(one["surface_area"] for one in measures) + dropped
    assert min(areas) >= 0.01 * total * (1 - 1e-5)
    assert all(piece["area"] < 0.01 * total * (1 + 1e-5) for piece in result.mesh.dropped)
    assert all(
        piece["share"] == pytest.approx(piece["area"] / total, rel=1e-4)
        for piece in result.mesh.dropped
    )
