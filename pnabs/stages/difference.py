"""difference: predicted positives minus shapes, what the negative module learns from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pnabs import batch
from pnabs.batch.work import Committed
from pnabs.geometry import difference as geometry
from pnabs.geometry.types import Cuboids
from pnabs.pipeline import Predictor, Shape, model_rng
from pnabs.settings import Settings
from pnabs.stages import plans
from pnabs.stages.context import Context, read_shard_rows, split_shard
from pnabs.stages.phases import weights_path
from pnabs.stages.reach import check_run
from pnabs.stages.sharded import run_sharded
from pnabs.stages.stored import StoredShard
from pnabs.store.ledger import Ledger
from pnabs.store.run import RunFolder

STAGE = "difference"


@dataclass(frozen=True, slots=True)
class DifferenceTask:
    """One model, in the isolated child: its difference volume, or None when empty."""

    job: Settings

    def __call__(self, payload: tuple[Cuboids, Shape]) -> geometry.Difference | None:
        """Form V_delta, pre-process and sample it."""
        positives, shape = payload
        samples = self.job.ingest.interior_points
        return geometry.difference(
            positives,
            shape.occupancy,
            shape.sdf,
            shape.surface,
            self.job.difference,
            surface_points=samples,
            interior_points=samples,
            rng=model_rng(self.job.seed, STAGE),
        )


@dataclass
class DifferenceWork:
    """A shard of fields to a shard of differences.zarr."""

    job: Settings
    home: str
    token: str
    positive: Path
    preload: tuple[str, ...] = ("pnabs.stages.difference",)
    _predictor: Predictor | None = field(default=None, repr=False)

    @property
    def task(self) -> DifferenceTask:
        """What the child runs."""
        return DifferenceTask(self.job)

    def check(self) -> None:
        """See the run folder."""
        check_run(self.job.out, self.token)

    def setup(self) -> None:
        """Load the positive network."""
        self._predictor = Predictor(self.positive, None, self.job, self.job.runtime.threads)

    def payloads(self, shard: str) -> Iterable[tuple[str, Any]]:
        """The shard's training and validation models with their predicted positives."""
        run = RunFolder(self.job.out)
        models = models_of(run.ledger, read_shard_rows(run.catalogue, shard), shard, plans.SPLITS)
        if not models or self._predictor is None:
            return
        stored = StoredShard(run, self.job, shard, [row["row"] for row in models])
        positives = self._predictor.positives(stored.occupancy)
        for row, boxes, shape in zip(models, positives, stored.shapes(), strict=True):
            yield row["model_id"], (boxes, shape)

    def commit(self, shard: str, outcomes: Sequence[batch.Outcome]) -> Committed:
        """Write the volumes in their models' rows; `valid` is 0 where V_delta is empty."""
        run = RunFolder(self.job.out)
        store = run.differences(run.variant(self.home), self.job)
        category, number = split_shard(shard)
        rows = {row["model_id"]: row["row"] for row in read_shard_rows(run.catalogue, shard)}
        arrays = {spec.name: np.zeros((len(rows), *spec.shape), spec.dtype) for spec in store.specs}
        notes: dict[str, dict[str, Any]] = {}
        for outcome in outcomes:
            if outcome.kind != "ok":
                continue
            if outcome.value is None:
                notes[outcome.model_id] = {"empty": True}
                continue
            row = rows[outcome.model_id]
            arrays["valid"][row] = 1
            for name in ("occupancy", "sdf", "surface", "interior"):
                arrays[name][row] = getattr(outcome.value, name)
        return Committed(store.write_shard(category, number, arrays), notes)


def models_of(
    ledger: Ledger, rows: list[dict[str, Any]], shard: str, splits: Sequence[str] | None = None
) -> list[dict[str, Any]]:
    """The catalogue's rows of a shard that came through ingest, of some splits or all."""
    record = ledger.read("ingest", shard)
    finished = {model.model_id for model in record.finished} if record else set()
    return [
        row
        for row in rows
        if row["model_id"] in finished and (splits is None or row["split"] in splits)
    ]


def run(context: Context, variant: str) -> None:
    """Do the stage for a variant that has it at home."""
    job = context.variants[variant]
    home = context.run.variant(variant)
    store = context.run.differences(home, job)

    def prepare(shards: dict[str, int]) -> None:
        for category, count in shards.items():
            store.ensure(category, count)

    work = DifferenceWork(job, variant, context.token, weights_path(context, variant, "positive"))
    run_sharded(context, home.stage(STAGE), work, plans.difference(context, variant), prepare)
