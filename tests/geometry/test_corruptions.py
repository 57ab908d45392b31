"""Meshes of known solid, spoilt in eleven ways: what `benchmarks/solids.py` measures, in small."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from benchmarks.known_solids import LEAST_CELLS, WAYS, KnownSolid, sample_solids
from pnabs.geometry.orient import prepare
from pnabs.geometry.solid import voxelise
from tests.geometry.soups import iou

LEAST_MEAN_WITHOUT_BOTTOMS = 0.93


@cache
def models() -> list[KnownSolid]:
    return [known for known in sample_solids(8) if np.count_nonzero(known.truth(32)) >= LEAST_CELLS]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("resolution", [32, 64])
def test_spoilt_models_keep_their_solid(way: str, resolution: int) -> None:
    scores = []
    # the finer truth takes longer to find
    for index, known in enumerate(models()[:: 1 if resolution == 32 else 6]):
        mesh = WAYS[way](known, np.random.default_rng([1, index]))
        scores.append(iou(voxelise(prepare(mesh), resolution), known.truth(resolution)))
    assert len(scores) >= 6
    if way.startswith("10 "):
        assert np.mean(scores) >= LEAST_MEAN_WITHOUT_BOTTOMS
    else:
        assert np.median(scores) >= 0.995
        assert np.quantile(scores, 0.1) >= 0.97
