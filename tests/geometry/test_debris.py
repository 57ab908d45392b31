"""Pieces and debris."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from pnabs.geometry.crop import CropResult, crop
from pnabs.geometry.debris import drop_debris, find_pieces
from pnabs.geometry.types import Cuboids
from tests.geometry.boxes import axis_aligned, random_cuboids


def cropped(positives: Cuboids, negatives: Cuboids | None = None) -> CropResult:
    return crop(positives, negatives or Cuboids.empty(), min_side=2e-3)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_pieces_are_those_of_trimesh(seed: int) -> None:
    result = cropped(random_cuboids(seed, 8, high=0.25), random_cuboids(seed + 1, 4, high=0.5))
    pieces = find_pieces(result)
    mesh = trimesh.Trimesh(result.vertices, result.faces, process=False)
    shells = mesh.split(only_watertight=False)
    outer = [shell for shell in shells if shell.volume > 0]
    if len(outer) == len(shells):  # no void
        assert sorted(pieces.area) == pytest.approx(sorted(s.area for s in shells), rel=1e-9)
        assert sorted(pieces.volume) == pytest.approx(sorted(s.volume for s in shells), rel=1e-6)
    assert len(pieces) == len(outer)
    assert pieces.area.sum() == pytest.approx(mesh.area, rel=1e-9)


def test_small_pieces_go_and_the_rest_stays_as_it_is() -> None:
    positives = axis_aligned(
        ([0.5, 0.5, 0.5], [-0.2, 0, 0]),
        ([0.02, 0.02, 0.02], [0.3, 0, 0]),
        ([0.03, 0.03, 0.03], [0.4, 0, 0]),
        ([0.2, 0.2, 0.2], [0.3, 0.3, 0]),
    )
    kept, dropped, pieces = drop_debris(cropped(positives), 0.01)
    areas = 6 * np.array([0.5, 0.02, 0.03, 0.2]) ** 2
    assert pieces == 2
    assert set(kept.source) == {0, 3}
    assert [piece["area"] for piece in dropped] == pytest.approx(areas[[2, 1]], rel=1e-5)
    assert [piece["share"] for piece in dropped] == pytest.approx(
        areas[[2, 1]] / areas.sum(), rel=1e-5
    )
    assert [piece["volume"] for piece in dropped] == pytest.approx([2.7e-5, 8e-6], rel=1e-4)
    mesh = trimesh.Trimesh(kept.vertices, kept.faces, process=False)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(0.125 + 0.008, rel=1e-5)
    assert len(np.unique(kept.faces)) == len(kept.vertices)


def test_threshold_counts_the_total_area() -> None:
    # 96 : 4 by area.
    two = axis_aligned(([0.48990, 0.48990, 0.48990], [-0.2, 0, 0]), ([0.1] * 3, [0.3, 0, 0]))
    share = find_pieces(cropped(two)).area.min() / find_pieces(cropped(two)).area.sum()
    assert share == pytest.approx(0.04, rel=1e-3)
    assert drop_debris(cropped(two), 0.0399)[2] == 2
    assert drop_debris(cropped(two), 0.0401)[2] == 1


def test_largest_always_stays() -> None:
    result = cropped(axis_aligned(*[([0.05] * 3, [0.1 * k, 0, 0]) for k in range(5)]))
    kept, dropped, pieces = drop_debris(result, 1.0)
    assert (len(kept.faces), len(dropped), pieces) == (12, 4, 1)


def test_a_void_belongs_to_the_piece_around_it() -> None:
    # A small box with a void, within the void of a large one.
    positives = axis_aligned(([0.8] * 3, [0, 0, 0]))
    result = cropped(positives, axis_aligned(([0.6] * 3, [0, 0, 0])))
    inner = cropped(axis_aligned(([0.5] * 3, [0, 0, 0])), axis_aligned(([0.05] * 3, [0, 0, 0])))
    both = CropResult(
        np.concatenate([result.vertices, inner.vertices]),
        np.concatenate([result.faces, inner.faces + len(result.vertices)]),
        np.concatenate([result.source, inner.source]),
    )
    pieces = find_pieces(both)
    order = np.argsort(pieces.area)
    assert pieces.area[order] == pytest.approx([6 * (0.25 + 0.0025), 6 * (0.64 + 0.36)], rel=1e-6)
    assert pieces.volume[order] == pytest.approx([0.125 - 0.05**3, 0.512 - 0.216], rel=1e-5)
    # The tiny void stays with its piece although its own area is below the threshold.
    kept, dropped, count = drop_debris(both, 0.01)
    assert (len(kept.faces), dropped, count) == (48, [], 2)


def test_nothing_has_no_pieces() -> None:
    kept, dropped, pieces = drop_debris(CropResult.nothing(), 0.01)
    assert (kept.is_empty, dropped, pieces) == (True, [], 0)
