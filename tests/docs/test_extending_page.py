"""The examples of the page on extending: registered as it says, and at work."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
import torch
import trimesh

from pnabs import settings
from pnabs.dataset import layouts, scan
from pnabs.formats import FORMATS, from_json, single
from pnabs.geometry.types import cell_centres
from pnabs.model import losses
from pnabs.model.data import TrainingSet
from pnabs.model.network import CuboidNetwork
from pnabs.model.objective import Objective
from pnabs.report import build_tables, compare, measures
from pnabs.store import metrics
from tests.docs.pages import DOCS, block

PAGE = "extending.md"
Maker = Callable[[str], ModuleType]


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> Maker:
    """Makes the page's new file, `pnabs.formats.obj` say, from the block below its name."""

    def make(name: str) -> ModuleType:
        path = f"`{name.replace('.', '/')}.py`:\n\n```python\n"
        text = (DOCS / "pages" / PAGE).read_text()
        code = text.partition(path)[2].partition("\n```")[0]
        assert code, f"the page has no {name}"
        made = ModuleType(name)
        monkeypatch.setitem(sys.modules, name, made)
        exec(compile(code, name, "exec"), made.__dict__)
        return made

    return make


def entry(line: str, names: dict[str, Any]) -> dict[str, Any]:
    """A registry's line, as the dict it is a line of."""
    found: dict[str, Any] = eval("{" + line + "}", names)
    return found


def test_a_layout(module: Maker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(layouts, "LAYOUTS", dict(layouts.LAYOUTS))
    monkeypatch.setattr("pnabs.dataset.catalogue.LAYOUTS", layouts.LAYOUTS)
    new = module("pnabs.dataset.modelnet")
    exec(block(PAGE, "python", "LAYOUTS["), {**vars(new), "LAYOUTS": layouts.LAYOUTS})
    for name in ("chair/train/chair_1.off", "chair/test/chair_2.OFF", "chair/test/notes.txt"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("OFF\n")
    fields = settings.Dataset(root=tmp_path).model_dump() | {"layout": "modelnet"}
    table = scan(settings.Dataset.model_construct(**fields), tmp_path)
    assert table["model_id"].to_pylist() == ["chair_1", "chair_2"]
    assert table["source"].to_pylist() == ["chair/train/chair_1.off", "chair/test/chair_2.OFF"]
    assert table["reason"].to_pylist() == ["", ""]


def test_a_format(module: Maker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    new = module("pnabs.formats.off")
    names = {**vars(new), "single": single}
    ((name, known),) = entry(block(PAGE, "python", '"off":'), names).items()
    monkeypatch.setitem(FORMATS, name, known)
    example = from_json(block("abstraction.md", "json", "pnabs/abstraction").encode())
    example.save(tmp_path / "chair.off")
    data = (tmp_path / "chair.off").read_bytes()
    mesh = trimesh.load_mesh(io.BytesIO(data), file_type="off", process=False)
    assert mesh.is_watertight
    np.testing.assert_allclose(mesh.bounds, [[9, -0.5, -3.6], [11, 1.2, -2.4]], atol=1e-6)


def test_a_loss(module: Maker, monkeypatch: pytest.MonkeyPatch) -> None:
    new = module("pnabs.model.overlap")
    names = {**vars(new), "Term": losses.Term}
    ((name, term),) = entry(block(PAGE, "python", "Term(overlap"), names).items()
    monkeypatch.setitem(losses.TERMS, name, term)
    field = block(PAGE, "python", "overlap: NonNegativeFloat")
    body = "class Weights(LossWeights):\n" + "".join(f"    {x}\n" for x in field.splitlines())
    scope: dict[str, Any] = {**vars(settings)}
    exec(body, scope)
    weights = scope["Weights"]
    assert name not in losses.active_terms("positive", "initial", weights())
    assert losses.active_terms("positive", "initial", weights(overlap=0.5))[name] == 0.5
    assert name not in losses.active_terms("negative", "initial", weights(overlap=0.5))

    training = settings.Training().model_copy(update={"losses": weights(overlap=0.5)})
    network = CuboidNetwork(12, settings.Network(channels=(2, 2, 2, 2, 2)), torch.zeros(12, 3))
    batch = box().batch(np.arange(2), training, torch.Generator().manual_seed(0))
    objective = Objective(network, "positive", "initial", training)
    values = objective(batch, 0.0, torch.Generator().manual_seed(0))
    # All cuboids start about one place: most points there are held by several.
    assert values[name] > 0
    values["total"].backward()
    assert all(p.grad is not None for p in network.initial_decoder.parameters())
    one = torch.tensor([[[0.5, 0.5, 0.5, 1.0, 0, 0, 0, 0, 0, 0]]])
    for cuboids, expected in ((one, 0.0), (one.repeat(1, 3, 1), 2.0)):
        points = torch.zeros(1, 4, 3)
        view = losses.View(
            (cuboids,), replace(batch, points=points), training, 0.0, torch.Generator()
        )
        assert term.value(view) == expected


def box() -> TrainingSet:
    """Two boxes of half the unit cube's side, with samples about the centre alone."""
    axis = np.abs(cell_centres(32)) < 0.25
    solid = axis[:, None, None] & axis[:, None] & axis
    points = np.random.default_rng(0).uniform(-0.1, 0.1, (2, 512, 3)).astype(np.float16)
    return TrainingSet(
        occupancy=np.packbits(np.stack([solid, solid]).reshape(2, -1), axis=1),
        sdf=np.zeros((2, 32, 32, 32), np.float16),
        surface=points,
        interior=points,
        mirror=np.full(2, -1, np.int8),
    )


def test_a_metric(module: Maker, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    new = module("pnabs.geometry.missed")
    found: dict[str, float] = {}
    shape = np.zeros((4, 4, 4), bool)
    shape[:2] = True
    result = np.zeros_like(shape)
    result[1:] = True
    names = {
        "found": found,
        "reference": SimpleNamespace(occupancy_64=shape),
        "result": SimpleNamespace(occupancy={64: result}.__getitem__),
    }
    exec(block(PAGE, "python", 'found["missed'), {**vars(new), **names})
    assert found == {"missed": 0.5}

    (measure,) = eval("(" + block(PAGE, "python", "Measure(") + ")", vars(measures))
    columns = [column for _, column in measure.columns]
    schema = metrics.SCHEMA
    for column in columns:
        schema = schema.append(pa.field(column, pa.float64()))
    monkeypatch.setattr(metrics, "SCHEMA", schema)
    monkeypatch.setattr(compare, "MEASURES", (*measures.MEASURES, measure))
    monkeypatch.setattr(measures, "COLUMNS", (*measures.COLUMNS, *columns))
    one = {"category": "a", "split": "test", "status": "ok", **found}
    path = tmp_path / "a-00000.parquet"
    metrics.write_metrics(tmp_path, path, [{**one, "model_id": str(i)} for i in range(6)])
    tables = build_tables({"main": metrics.read_metrics([path])}, np.random.default_rng(0))
    cropped = tables["missed"].row("cropped")
    assert cropped is not None
    assert cropped.summary == 50.0
