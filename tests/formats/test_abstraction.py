"""An abstraction makes its mesh again, wherever it comes from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pnabs.formats import WRITERS, Abstraction, from_json, to_glb, to_json
from pnabs.geometry.solidify import SolidResult, solidify
from pnabs.geometry.types import Cuboids
from pnabs.settings import Abstract
from tests.geometry.boxes import axis_aligned, random_cuboids

EDGE_TO_EDGE = axis_aligned(
    ([0.5, 0.5, 0.5], [0.25, 0.25, 0]), ([0.5, 0.5, 0.5], [-0.25, -0.25, 0])
)
"""Boxes that meet in an edge: their crop passes its check after jitter alone."""


def made(positives: Cuboids, negatives: Cuboids) -> tuple[Abstraction, SolidResult]:
    solid = solidify(positives, negatives, Abstract(), np.random.default_rng(3))
    transform = np.array([[2.0, 0, 0, 5], [0, 2, 0, 6], [0, 0, 2, 7], [0, 0, 0, 1]])
    abstraction = Abstraction.from_solid(
        solid,
        category="chair",
        model_id="one",
        positives=positives,
        negatives=negatives,
        transform=transform,
        metrics={"faces": len(solid.mesh.faces)},
        provenance={"seed": 3},
    )
    return abstraction, solid


@pytest.mark.parametrize("positives", [random_cuboids(0, 8), EDGE_TO_EDGE])
def test_mesh_is_made_again_exactly_from_json(positives: Cuboids) -> None:
    abstraction, solid = made(positives, random_cuboids(1, 4, high=0.2, spread=0.1))
    read = from_json(to_json(abstraction))
    assert read.solid.vertices.tobytes() == solid.mesh.vertices.tobytes()
    assert read.solid.faces.tobytes() == solid.mesh.faces.tobytes()
    assert read.mesh().vertices.tobytes() == abstraction.mesh().vertices.tobytes()
    assert to_glb(read) == to_glb(abstraction)


def test_jitter_is_part_of_the_record() -> None:
    abstraction, _ = made(EDGE_TO_EDGE, Cuboids.empty())
    assert abstraction.crop["jitter_attempt"] > 0
    assert abstraction.check["ok"] is True


def test_mesh_is_placed_in_the_input() -> None:
    abstraction, _ = made(axis_aligned(([0.5, 0.4, 0.3], [0, 0, 0])), Cuboids.empty())
    vertices = abstraction.mesh().vertices
    np.testing.assert_allclose(vertices.min(axis=0), [4.5, 5.6, 6.7], atol=1e-6)
    np.testing.assert_allclose(vertices.max(axis=0), [5.5, 6.4, 7.3], atol=1e-6)


@pytest.mark.parametrize("suffix", sorted(WRITERS))
def test_save_writes_what_the_suffix_names(tmp_path: Path, suffix: str) -> None:
    abstraction, _ = made(random_cuboids(0, 3), Cuboids.empty())
    abstraction.save(tmp_path / f"a{suffix.upper()}")
    assert (tmp_path / f"a{suffix.upper()}").read_bytes() == WRITERS[suffix](abstraction)


def test_unknown_suffixes_are_refused_with_the_known(tmp_path: Path) -> None:
    abstraction, _ = made(random_cuboids(0, 3), Cuboids.empty())
    with pytest.raises(ValueError, match=r"choose one of \.glb, \.json"):
        abstraction.save(tmp_path / "a.xyz")
    assert not list(tmp_path.iterdir())
