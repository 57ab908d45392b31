"""abstract: every shape to its abstraction, measured and written."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pnabs import batch
from pnabs.batch.work import Committed
from pnabs.formats import Abstraction, written
from pnabs.pipeline import Prediction, Predictor, Shape, finish
from pnabs.settings import Settings
from pnabs.stages import plans
from pnabs.stages.context import Context, read_shard_rows
from pnabs.stages.difference import models_of
from pnabs.stages.plan import recipe_digest
from pnabs.stages.plans import weights_of
from pnabs.stages.reach import check_run
from pnabs.stages.sharded import run_sharded
from pnabs.stages.stored import StoredShard
from pnabs.stages.writing import write_files
from pnabs.store.atomic import file_digest
from pnabs.store.boundaries import read_reasons
from pnabs.store.metrics import NUMBERS, write_metrics
from pnabs.store.run import RunFolder, versions

STAGE = "abstract"


@dataclass(frozen=True, slots=True)
class Finished:
    """An abstraction, and the files it is written in: name -> content."""

    abstraction: Abstraction
    files: dict[str, bytes]


@dataclass(frozen=True, slots=True)
class AbstractTask:
    """One model, in the isolated child: post-process, crop, check, measure, and its files."""

    job: Settings
    provenance: dict[str, Any]

    def __call__(self, payload: tuple[str, str, Prediction, Shape]) -> Finished:
        """Finish one prediction."""
        category, model_id, prediction, shape = payload
        abstraction = finish(
            prediction,
            shape,
            self.job.abstract,
            category=category,
            model_id=model_id,
            seed=self.job.seed,
            provenance=self.provenance,
        )
        return Finished(abstraction, written(abstraction, self.job.abstract.formats))


@dataclass
class AbstractWork:
    """A shard of fields to abstractions and metrics."""

    job: Settings
    home: str
    token: str
    positive: Path
    negative: Path | None
    provenance: dict[str, Any]
    preload: tuple[str, ...] = ("pnabs.stages.abstract", "pnabs.stages.warm_abstract")
    _predictor: Predictor | None = field(default=None, repr=False)

    @property
    def task(self) -> AbstractTask:
        """What the child runs."""
        return AbstractTask(self.job, self.provenance)

    def check(self) -> None:
        """See the run folder."""
        check_run(self.job.out, self.token)

    def setup(self) -> None:
        """Load the networks."""
        self._predictor = Predictor(
            self.positive, self.negative, self.job, self.job.runtime.threads
        )

    def payloads(self, shard: str) -> Iterable[tuple[str, Any]]:
        """The shard's models with what the networks predict for them."""
        run = RunFolder(self.job.out)
        models = models_of(run.ledger, read_shard_rows(run.catalogue, shard), shard)
        if not models or self._predictor is None:
            return
        stored = StoredShard(run, self.job, shard, [row["row"] for row in models])
        predictions = self._predictor(stored.occupancy, stored.sdf)
        for row, prediction, shape in zip(models, predictions, stored.shapes(), strict=True):
            yield row["model_id"], (row["category"], row["model_id"], prediction, shape)

    def commit(self, shard: str, outcomes: Sequence[batch.Outcome]) -> Committed:
        """Write each abstraction, then the shard's metrics: a row for every model there is."""
        run = RunFolder(self.job.out)
        variant = run.variant(self.home)
        finished = {o.model_id: o.value for o in outcomes if o.kind == "ok"}
        status = {outcome.model_id: str(outcome.kind) for outcome in outcomes}
        ingested = run.ledger.read("ingest", shard)
        for model in ingested.quarantined if ingested else ():
            status[model.model_id] = model.kind
        outputs: dict[str, Any] = {}
        rows = []
        reasons = read_reasons(run.boundaries(shard))
        for row in read_shard_rows(run.catalogue, shard):
            category, model_id = row["category"], row["model_id"]
            entry = {name: row[name] for name in ("category", "model_id", "split")}
            entry["status"] = status[model_id]
            entry["not_exact"] = reasons[row["row"]]
            result: Finished | None = finished.get(model_id)
            if result is not None:
                abstraction = result.abstraction
                entry |= {name: abstraction.metrics.get(name) for name in NUMBERS}
                entry["check_ok"] = abstraction.check["ok"]
                entry["positive_cuboids"] = abstraction.positives.as_vector().tolist()
                entry["negative_cuboids"] = abstraction.negatives.as_vector().tolist()
            files = {} if result is None else result.files
            for path in write_files(variant.abstraction(category, model_id), files):
                outputs[path.relative_to(run.root).as_posix()] = file_digest(path)
            rows.append(entry)
        outputs |= write_metrics(run.root, variant.metrics(shard), rows)
        return Committed(outputs, {})


def run(context: Context, variant: str) -> None:
    """Do the stage for a variant that has it at home."""
    job = context.variants[variant]
    positive, negative = weights_of(context, variant)
    provenance = {
        "pnabs": versions()["pnabs"],
        "recipe": recipe_digest(STAGE, job),
        "seed": job.seed,
    }
    work = AbstractWork(job, variant, context.token, positive, negative, provenance)
    name = context.run.variant(variant).stage(STAGE)
    run_sharded(context, name, work, plans.abstract(context, variant), lambda _: None)
