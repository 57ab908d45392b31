"""Training as a whole: that it learns, and that the number of workers doesn't decide what."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from pnabs.dataset.samples import write_collection
from pnabs.stages.context import split_shard
from pnabs.stages.errors import RefusedError
from pnabs.stages.job import JobError
from pnabs.stages.phases import training_models
from pnabs.stages.progress import Reporter
from pnabs.stages.run import Result
from pnabs.stages.status import status, stored_context
from pnabs.stages.training_data import load_training_set
from pnabs.store.run import RunFolder
from tests.system.conftest import Launcher

LAST = 3
"""Epochs at the end whose mean counts."""


def losses(run: Path, phase: str) -> list[float]:
    """The total loss of each epoch of a phase that was trained once."""
    (path,) = (run / "variants/main/checkpoints" / phase).glob("*/curves.json")
    return [point["total"] for point in json.loads(path.read_text())]


def test_training_begins_with_given_weights(
    finished: tuple[Path, Result], launch: Launcher, tmp_path: Path
) -> None:
    run, _ = finished
    begin = tmp_path / "begin"
    begin.mkdir()
    for module in ("positive", "negative"):
        folder = run / f"variants/main/checkpoints/{module}-refinement"
        (path,) = folder.glob("*/weights.safetensors")
        shutil.copy(path, begin / f"{module}.safetensors")
    out = tmp_path / "run"
    changes = [f"training.init_from={begin}", "training.epochs=1"]
    stages = ("scan", "ingest", "train-positive")
    launch(out, *changes, stages=stages)
    for phase in ("positive-initial", "positive-refinement"):
        assert losses(out, phase)[0] < 0.9 * losses(run, phase)[0]

    # Who only looks needs the run folder alone.
    begin.rename(tmp_path / "moved")
    lines = {
        line.stage: line for line in status(stored_context(RunFolder(out), Reporter(quiet=True)))
    }
    assert lines["train positive-refinement"].done == 1
    (tmp_path / "moved").rename(begin)

    other = tmp_path / "other"
    with pytest.raises(JobError, match=r"network\.positives is 5, theirs 6"):
        launch(other, *changes, "network.positives=5", stages=stages)
    # Other content under the same name is another training, and nobody's accident.
    (path,) = (run / "variants/main/checkpoints/positive-initial").glob("*/weights.safetensors")
    shutil.copy(path, begin / "positive.safetensors")
    with pytest.raises(
        RefusedError, match="weights main/init_from/positive: other content"
    ) as refused:
        launch(out, *changes, stages=stages)
    assert "train-positive" in str(refused.value)
    (begin / "positive.safetensors").unlink()
    with pytest.raises(JobError, match=r"training.init_from: there is no positive.safetensors in"):
        launch(out, *changes, stages=stages)


def test_separation_looks_at_the_original_solid(finished: tuple[Path, Result]) -> None:
    """The negative module's other samples are of the difference volumes."""
    context = stored_context(RunFolder(finished[0]), Reporter(quiet=True))
    models = training_models(context, "main", "negative")
    home = context.home("difference", "main")
    data = load_training_set(
        context.run, home, context.job, "negative", models, rank=0, world=1
    )  # fmt: skip
    fields, differences = (
        context.run.fields(context.job),
        context.run.differences(home, context.job),
    )
    first = 0
    for shard, rows in models.shards:
        category, number = split_shard(shard)
        solid, left = (
            store.read_shard(category, number, "interior", int(rows.max()) + 1)[rows]
            for store in (fields, differences)
        )
        part = slice(first, first := first + len(rows))
        assert data.shape_interior is not None
        np.testing.assert_array_equal(data.shape_interior[part], solid.astype(np.float16))
        np.testing.assert_array_equal(data.interior[part], left.astype(np.float16))
        assert not np.array_equal(solid, left)
    assert first == len(data) > 0


@pytest.mark.slow
def test_two_workers_end_where_one_does_within_noise(
    ray_session: None, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    root = tmp_path_factory.mktemp("more-samples")
    write_collection(root, per_category=12, categories=["chair", "bench", "lamp", "sofa"])
    launch = Launcher(root)

    def trained(name: str, *overrides: str) -> dict[str, np.ndarray]:
        out = tmp_path / name
        stages = ("scan", "ingest", "train-positive")
        longer = ("training.epochs=50", "training.batch_size=4", "training.learning_rate=0.003")
        launch(out, *longer, *overrides, stages=stages)
        ends = {}
        for phase in ("positive-initial", "positive-refinement"):
            (path,) = (out / "variants/main/checkpoints" / phase).glob("*/curves.json")
            curves = json.loads(path.read_text())
            values = np.array([[point["total"], point["iou_32"]] for point in curves])
            # It has learnt: else there would be nothing to compare.
            if phase == "positive-initial":
                assert values[-1, 0] < 0.7 * values[0, 0]
            ends[phase] = values[-LAST:].mean(axis=0)
        return ends

    one = [trained(f"one-{seed}", "training.workers=1", f"seed={seed}") for seed in range(3)]
    two = trained("two", "training.workers=2")
    for phase, found in two.items():
        seeds = np.array([run[phase] for run in one])
        middle = seeds.mean(axis=0)
        noise = np.maximum(np.abs(seeds - middle).max(axis=0), 0.03 * middle)
        assert (np.abs(found - middle) <= 3 * noise).all(), (phase, seeds, found)
