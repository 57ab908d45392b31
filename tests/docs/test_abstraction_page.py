"""The example of abstraction.json and the code that reads it."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from pnabs.formats import Abstraction, FormatError, from_json, to_json
from pnabs.formats.json_format import schema
from pnabs.geometry import cuboid
from pnabs.geometry.check import check
from tests.docs.pages import DOCS, block

PAGE = "abstraction.md"


@pytest.fixture
def example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Abstraction:
    """The page's example, in the current folder as abstraction.json."""
    data = block(PAGE, "json", "pnabs/abstraction").encode()
    monkeypatch.chdir(tmp_path)
    Path("abstraction.json").write_bytes(data)
    return from_json(data)


def test_the_example_is_written_as_shown(example: Abstraction) -> None:
    assert to_json(example) == Path("abstraction.json").read_bytes()


def test_the_example_is_true(example: Abstraction) -> None:
    solid = example.solid
    assert check(solid.vertices, solid.faces).as_dict() == example.check
    assert solid.dropped == example.debris["dropped"]
    assert len(solid.faces) == example.metrics["faces"]
    # The arch: a box of 1 x 0.5 x 0.6, the upright of 0.1 x 0.4 x 0.5 less what lies in the box,
    # and less what the negative takes, 0.7 x 0.4 (of which 0.35 lies in the box) x 0.6.
    a, b, c = np.moveaxis(solid.triangles, 1, 0)
    volume = np.einsum("fi,fi->", a, np.cross(b, c)) / 6
    assert volume == pytest.approx(0.3 + 0.1 * 0.35 * 0.5 - 0.7 * 0.35 * 0.6, rel=1e-5)


def test_reading_with_pnabs(example: Abstraction, capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, Any] = {}
    exec(block(PAGE, "python", "from_json"), names)
    assert capsys.readouterr().out.startswith("2 positives, 1 negatives\n")
    placed = names["mesh"].vertices
    np.testing.assert_allclose(placed.min(axis=0), [9, -0.5, -3.6], atol=1e-6)
    np.testing.assert_allclose(placed.max(axis=0), [11, 1.2, -2.4], atol=1e-6)
    exec(block(PAGE, "python", "merge_vertices"), names)
    np.testing.assert_allclose(names["mesh"].bounds, [placed.min(axis=0), placed.max(axis=0)])


def test_reading_without_pnabs(example: Abstraction) -> None:
    names: dict[str, Any] = {}
    exec(block(PAGE, "python", "json.loads"), names)
    transform = example.transform
    for mine, boxes in (("positives", example.positives), ("negatives", example.negatives)):
        expected = cuboid.corners(boxes) @ transform[:3, :3].T + transform[:3, 3]
        np.testing.assert_allclose(names[mine], expected, atol=1e-6)


def test_every_key_is_explained(example: Abstraction) -> None:
    text = (DOCS / "pages" / PAGE).read_text().partition("\n| Key |")[2].partition("\n## ")[0]
    told = {name.rpartition(".")[2] for name in re.findall(r"`([\w.…]+)`", text)}
    top = {"format", "version", "category", "model_id", "positives", "negatives", "transform"}
    below = {"scale", "rotation", "translation", "metrics", "area", "share", "volume"}
    keys = {*top, *below, *example.crop, *example.debris, *example.check, *example.provenance}
    assert keys - {"dropped"} <= told


def test_the_schema_takes_the_example_and_nothing_else(example: Abstraction) -> None:
    stored = json.loads((DOCS / "pages" / "abstraction.schema.json").read_text())
    assert stored == schema(), "run docs/reference.py"
    document = json.loads(to_json(example))
    validator = jsonschema.Draft202012Validator(stored)
    validator.check_schema(stored)
    validator.validate(document)
    for change in (
        {"version": 2},
        {"more": 1},
        {"positives": [{"scale": [1, 1]}]},
        {"metrics": {"iou_64": "high"}},
    ):
        assert not validator.is_valid({**document, **change})
        with pytest.raises(FormatError):
            from_json(json.dumps({**document, **change}).encode())
