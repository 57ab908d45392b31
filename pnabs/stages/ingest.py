"""ingest: meshes to solids, fields and samples.  The last stage that opens the dataset."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pnabs import batch
from pnabs.batch.work import Committed
from pnabs.geometry.fields import Fields, compute_fields
from pnabs.geometry.reference import Boundary
from pnabs.pipeline import model_rng
from pnabs.settings import Settings
from pnabs.stages import plans
from pnabs.stages.context import Context, read_shard_rows, split_shard
from pnabs.stages.reach import check_dataset, check_run
from pnabs.stages.reading import blamed, read_mesh
from pnabs.stages.sharded import run_sharded
from pnabs.store.boundaries import write_boundaries
from pnabs.store.run import RunFolder

STAGE = "ingest"


@dataclass(frozen=True, slots=True)
class IngestTask:
    """One model, in the isolated child: read, parse, make fields."""

    job: Settings

    def __call__(self, row: dict[str, Any]) -> tuple[str, Fields]:
        """SHA-256 of the mesh's bytes, and its fields.

        Raises
        ------
        pnabs.batch.InvalidInput
            When the model has no readable mesh.
        pnabs.batch.Unavailable
            When the dataset is gone, or its disk or network fails.
        """
        if row["reason"]:
            raise batch.InvalidInput(row["reason"])
        options, root = self.job.ingest, self.job.dataset.root
        with blamed(root, row["source"]):
            read = read_mesh(root, row["source"], options.limits)
            rng = model_rng(self.job.seed, STAGE)
            fields = compute_fields(read.mesh, options, self.job.dataset.layout, rng)
            return read.sha256, fields


@dataclass
class IngestWork:
    """A shard of meshes to a shard of RUN/fields.zarr."""

    job: Settings
    token: str
    preload: tuple[str, ...] = ("pnabs.stages.ingest", "pnabs.stages.warm_ingest")

    @property
    def task(self) -> IngestTask:
        """What the child runs."""
        return IngestTask(self.job)

    def check(self) -> None:
        """See the run folder and the dataset."""
        check_run(self.job.out, self.token)
        check_dataset(self.job.dataset.root)

    def setup(self) -> None:
        """Nothing: all work is the child's."""

    def payloads(self, shard: str) -> Iterable[tuple[str, Any]]:
        """The catalogue's rows of the shard."""
        for row in read_shard_rows(RunFolder(self.job.out).catalogue, shard):
            yield str(row["model_id"]), row

    def commit(self, shard: str, outcomes: Sequence[batch.Outcome]) -> Committed:
        """Write the shard's rows; a model that fell out stays zero with `valid` 0."""
        run = RunFolder(self.job.out)
        store = run.fields(self.job)
        category, number = split_shard(shard)
        arrays = {
            spec.name: np.zeros((len(outcomes), *spec.shape), spec.dtype) for spec in store.specs
        }
        notes = {}
        boundaries: list[Boundary | None] = [None] * len(outcomes)
        for row, outcome in enumerate(outcomes):
            if outcome.kind != "ok":
                continue
            source_digest, fields = outcome.value
            notes[outcome.model_id] = {"source_sha256": source_digest}
            arrays["valid"][row] = 1
            for name in ("occupancy_64", "occupancy_128", "occupancy_192"):
                arrays[name][row] = np.packbits(getattr(fields, name).reshape(-1))
            arrays["preview"][row, : len(fields.preview)] = fields.preview
            for name in (
                *("occupancy", "sdf", "surface", "interior"),
                *("transform", "mirror", "extent"),
            ):
                arrays[name][row] = getattr(fields, name)
            boundaries[row] = fields.boundary
        outputs = store.write_shard(category, number, arrays)
        outputs |= write_boundaries(run.root, run.boundaries(shard), boundaries)
        return Committed(outputs, notes)


def run(context: Context) -> None:
    """Do the stage."""
    store = context.run.fields(context.job)

    def prepare(shards: dict[str, int]) -> None:
        for category, count in shards.items():
            store.ensure(category, count)

    work = IngestWork(context.job, context.token)
    run_sharded(context, STAGE, work, plans.ingest(context), prepare)
