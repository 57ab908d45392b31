"""Scoring from Python."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydantic import ValidationError

import pnabs
from pnabs.evaluation import Evaluation
from pnabs.geometry.load import InvalidMeshError
from pnabs.geometry.types import Cuboids
from pnabs.stages.job import JobError
from tests.evaluate.solids import SETTINGS, box, moved, write


def score(shape: object, result: object, **options: object) -> dict[str, object]:
    return pnabs.score(shape, result, settings=SETTINGS, **options)


def test_one_result_in_memory() -> None:
    found = score(box((2, 2, 2), (5, 5, 5)), box((2, 1, 2), (5, 4.5, 5)))
    assert found["volume_iou"] == pytest.approx(0.5)
    assert found["miss_max_units"] == pytest.approx(1)
    assert (found["not_exact"], found["not_closed"], found["parts"]) == ("", "", 1)
    assert None not in found.values()


def test_parts_files_trimeshes_and_cuboids(tmp_path: Path) -> None:
    shape = write(tmp_path / "shape.obj", box((1, 2, 1)))
    halves = [box((1, 1, 1), (0, side, 0)) for side in (-0.5, 0.5)]
    for result in (halves, [write(tmp_path / f"{i}.obj", half) for i, half in enumerate(halves)]):
        assert score(shape, result)["volume_iou"] == pytest.approx(1)
    assert score(shape, trimesh.creation.box((1, 2, 1)))["volume_iou"] == pytest.approx(1)
    whole = Cuboids.from_vector(np.array([[1, 2, 1, 1, 0, 0, 0, 0, 0, 0]]))
    assert score(shape, whole)["volume_iou"] == pytest.approx(1)
    cut = whole.resized(0, (1, 0.5, 1))
    assert score(shape, (whole, cut))["volume_iou"] == pytest.approx(0.75)


def test_frames() -> None:
    shape, result = box((2, 4, 2), (5, 5, 5)), box((0.5, 1, 0.5))
    assert score(shape, result, frame="normalised")["volume_iou"] == pytest.approx(1)
    assert score(shape, result)["volume_iou"] == 0


def test_what_can_not_be_used(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"none.obj"):
        score(box(), tmp_path / "none.obj")
    (tmp_path / "bad.obj").write_text("nothing")
    with pytest.raises(InvalidMeshError):
        score(tmp_path / "bad.obj", box())
    with pytest.raises(ValidationError):
        pnabs.score(box(), box(), settings={"ingest": {"points": 3}})


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three boxes, halves of two of them, and the boxes themselves twice as large."""
    root = tmp_path_factory.mktemp("evaluate")
    for number, name in enumerate("abc"):
        sides = np.array([1, 2, 1 + number])
        write(root / "shapes" / f"{name}.obj", box(sides))
        write(root / "large" / f"{name}.obj", moved(box(sides), scale=2))
        if name != "c":
            write(root / "half" / f"{name}.obj", box(sides / (2, 1, 1), (sides[0] / 4, 0, 0)))
    return root


def evaluate(place: Path, results: object, **options: object) -> Evaluation:
    return pnabs.evaluate(place / "shapes", results, settings=SETTINGS, jobs=1, **options)


def test_sets_of_results(place: Path) -> None:
    found = evaluate(place, {"mine": place / "half", "theirs": place / "large"})
    rows = found.models.to_pylist()
    assert [(row["name"], row["model_id"]) for row in rows] == [
        (name, model) for model in "abc" for name in ("mine", "theirs")
    ]
    figures = {(row["name"], row["model_id"]): row["volume_iou"] for row in rows}
    assert figures["mine", "a"] == pytest.approx(0.5)
    assert figures["theirs", "a"] == pytest.approx(1 / 8)
    assert figures["mine", "c"] is None
    assert [row["status"] for row in rows if row["name"] == "mine"] == ["ok", "ok", "missing"]
    assert found.quarantine == ()
    assert found.exit_code == 0
    assert found.notices == (
        "results of 'mine': 1 of 3 shapes have none and count as 0: c",
        "results of 'theirs': 3 of 3 look scaled by 2",
    )
    assert "mine minus theirs" in found.text


def test_a_missing_result_counts_as_nothing_in_pairs(place: Path) -> None:
    tables = evaluate(place, [place / "half", place / "large"]).tables
    side_by_side = tables["variants/volume_iou"]
    (half,) = (row for row in side_by_side.rows if row.label == "half")
    # c, of which there is no half, counts as 0
    assert half.overall == pytest.approx(100 / 3)
    assert half.models == (3,)


def test_from_another_thread(place: Path) -> None:
    found: list[Evaluation] = []
    thread = threading.Thread(target=lambda: found.append(evaluate(place, place / "half")))
    thread.start()
    thread.join()
    assert found[0].models.num_rows == 3


def test_wrong_settings_are_told(place: Path) -> None:
    with pytest.raises(JobError, match=r"did you mean metric_samples"):
        pnabs.evaluate(
            place / "shapes", place / "half", settings={"abstract": {"metric_samples_": 1}}
        )
    with pytest.raises(JobError, match="only settings of ingest"):
        pnabs.evaluate(place / "shapes", place / "half", settings={"network": {"hidden": 1}})
