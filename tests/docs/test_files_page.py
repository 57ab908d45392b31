"""The library's examples on the page about meshes without a dataset."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import pnabs
from tests.docs.pages import block

PAGE = "files.md"


def test_a_mesh_to_its_boxes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    trimesh.creation.box((1, 2, 1)).export("chair.obj")
    exec(block(PAGE, "python", "pnabs.abstract("), {})
    assert " positives, " in capsys.readouterr().out
    assert (tmp_path / "boxes.glb").read_bytes()[:4] == b"glTF"


def test_editing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    example = block("abstraction.md", "json", "pnabs/abstraction")
    Path("abstraction.json").write_text(example)
    exec(block(PAGE, "python", ".edited("), {})
    assert capsys.readouterr().out.startswith("True ")
    before, after = pnabs.load("abstraction.json"), pnabs.load("taller.json")
    assert (len(before.negatives), len(after.negatives)) == (1, 0)
    np.testing.assert_allclose(
        after.positives.translation[1] - before.positives.translation[1], [0, 0.1, 0], atol=1e-7
    )
    assert (tmp_path / "taller.glb").exists()


def test_levels(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    parts = [trimesh.creation.box(bounds=[[0, 0, 0], [1, 0.2, 1]])]
    parts += [trimesh.creation.box(bounds=[[x, -1, 0], [x + 0.2, 0.1, 1]]) for x in (0, 0.8)]
    trimesh.util.concatenate(parts).export("chair.obj")
    exec(block("abstraction.md", "python", "levels"), {})
    assert capsys.readouterr().out.startswith("8 ")
    assert (tmp_path / "far.glb").exists()
