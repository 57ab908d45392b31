"""An abstraction makes its mesh again, wherever it comes from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pnabs.formats import FORMATS, Abstraction, from_json, to_glb, to_json
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


@pytest.mark.parametrize("name", FORMATS)
def test_save_writes_what_the_suffix_names(tmp_path: Path, name: str) -> None:
    abstraction, _ = made(random_cuboids(0, 3), random_cuboids(1, 2))
    abstraction.save(tmp_path / f"a{FORMATS[name].suffix}")
    files = {
        path.relative_to(tmp_path).as_posix(): path.read_bytes()
        for path in tmp_path.rglob("*")
        if path.is_file()
    }
    assert files == FORMATS[name].write(abstraction, "a")


@pytest.mark.parametrize("name", FORMATS)
def test_levels_have_files_of_their_own_beside(tmp_path: Path, name: str) -> None:
    coarser, _ = made(random_cuboids(5, 2), Cuboids.empty())
    finest, _ = made(random_cuboids(0, 3), random_cuboids(1, 2))
    both = replace(finest, levels={2: replace(coarser, origins=[[0], [1, 2]])})
    both.save(tmp_path / f"a{FORMATS[name].suffix}")
    files = {p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*") if p.is_file()}
    own = set(FORMATS[name].write(finest, "a"))
    beside = set() if name == "json" else set(FORMATS[name].write(coarser, "a.level2"))
    assert files == own | beside
    read = from_json(to_json(both)).levels[2]
    assert read.solid.vertices.tobytes() == coarser.solid.vertices.tobytes()


def test_a_suffix_in_capitals_names_its_format(tmp_path: Path) -> None:
    abstraction, _ = made(random_cuboids(0, 3), Cuboids.empty())
    abstraction.save(tmp_path / "a.GLB")
    assert (tmp_path / "a.GLB").read_bytes() == to_glb(abstraction)


def test_unknown_suffixes_are_refused_with_the_known(tmp_path: Path) -> None:
    abstraction, _ = made(random_cuboids(0, 3), Cuboids.empty())
    with pytest.raises(ValueError, match=r"choose one of \.json, \.glb"):
        abstraction.save(tmp_path / "a.xyz")
    assert not list(tmp_path.iterdir())


def test_an_edited_abstraction_is_cropped_and_checked_anew() -> None:
    block = axis_aligned(([0.5, 0.5, 0.5], [0, 0, 0]), ([0.1, 0.1, 0.6], [0.4, 0, 0]))
    notch = axis_aligned(([0.1, 0.1, 1.0], [0.2, 0.2, 0]), ([0.2, 0.2, 1.0], [0, 0, 0]))
    abstraction, solid = made(block, notch)
    filled = abstraction.edited(negatives=notch.without(0, 1))
    moved = filled.edited(positives=block.moved(1, [0, 0.2, 0]).resized(0, [0.4, 0.5, 0.5]))
    assert volume(filled) == pytest.approx(0.125 + 0.006, rel=1e-6)
    assert volume(moved) == pytest.approx(0.1 + 0.006, rel=1e-6)
    assert len(moved.negatives) == 0
    assert moved.check["ok"]
    assert moved.metrics["faces"] == len(moved.solid.faces)
    assert "iou_64" not in moved.metrics
    assert moved.provenance == {"seed": 3, "edited": True}
    assert from_json(to_json(moved)).solid.vertices.tobytes() == moved.solid.vertices.tobytes()
    # The first is as it was.
    assert len(abstraction.negatives) == 2
    assert abstraction.solid.vertices.tobytes() == solid.mesh.vertices.tobytes()


def test_an_edit_that_touches_itself_gets_its_jitter() -> None:
    abstraction, _ = made(axis_aligned(([0.5, 0.5, 0.5], [0, 0, 0])), Cuboids.empty())
    edge = abstraction.edited(positives=EDGE_TO_EDGE)
    assert edge.check["ok"]
    assert edge.crop["jitter_attempt"] > 0
    back = edge.edited(positives=abstraction.positives)
    assert back.crop["jitter_attempt"] == 0


def test_cuboids_can_be_joined_and_know_their_number() -> None:
    first, second = random_cuboids(0, 3), random_cuboids(1, 2)
    joined = first.joined(second)
    assert (
        joined.as_vector().tobytes()
        == np.concatenate([first.as_vector(), second.as_vector()]).tobytes()
    )
    assert joined.without(0, 1, 2).as_vector().tobytes() == second.as_vector().tobytes()
    for change in (lambda: first.without(3), lambda: first.moved(3, [0, 0, 0])):
        with pytest.raises(IndexError):
            change()


def volume(abstraction: Abstraction) -> float:
    """In the normalised frame."""
    return float(np.linalg.det(abstraction.solid.triangles).sum() / 6)


@pytest.mark.parametrize("sides", [[-0.1, 0.1, 0.1], [np.nan, 0.1, 0.1], [np.inf, 0.1, 0.1]])
def test_an_edit_that_is_no_cuboid_is_refused(sides: list[float]) -> None:
    abstraction, _ = made(random_cuboids(0, 3), Cuboids.empty())
    with pytest.raises(ValueError, match="positives: cuboid 1 has a side that is negative"):
        abstraction.edited(positives=abstraction.positives.resized(1, sides))
