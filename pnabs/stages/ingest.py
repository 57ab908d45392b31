"""ingest: meshes to solids, fields and samples.  The last stage that opens the dataset."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from pnabs import batch
from pnabs.batch.work import Committed
from pnabs.dataset.errors import DatasetError, SourceError
from pnabs.dataset.source import Dataset
from pnabs.geometry.fields import Fields, compute_fields
from pnabs.geometry.load import InvalidMeshError, parse_mesh
from pnabs.settings import Settings
from pnabs.stages import plans
from pnabs.stages.context import Context, model_rng, read_shard_rows, split_shard
from pnabs.stages.reach import check_dataset, check_run
from pnabs.stages.sharded import run_sharded
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
        options = self.job.ingest
        root, source = self.job.dataset.root, row["source"]
        try:
            reader = _Reader(root, source, options.limits.max_bytes)
            data = reader()
            suffix = PurePosixPath(source.rpartition("!")[2]).suffix.lower()
            try:
                mesh = parse_mesh(data, suffix, options.limits, reader.sibling)
            except InvalidMeshError:
                # What a sibling's disk does is no fault of the mesh.
                reader.raise_failure()
                raise
            rng = model_rng(self.job.seed, STAGE, row["category"], row["model_id"])
            fields = compute_fields(mesh, options, self.job.dataset.layout, rng)
        except (SourceError, InvalidMeshError) as error:
            # A model's file is missing: the model's fault, or the whole dataset's?
            check_dataset(root)
            text = str(error)
            raise batch.InvalidInput(text if source in text else f"{source}: {text}") from None
        return hashlib.sha256(data).hexdigest(), fields


class _Reader:
    """Reads a mesh and its siblings; tells a dataset that fails from a model that is bad."""

    def __init__(self, root: Path | str, source: str, max_bytes: int) -> None:
        self._root, self._source, self._max_bytes = root, source, max_bytes
        self._failure: Exception | None = None
        with self._watched():
            self._dataset = Dataset(root)
            self._sibling = self._dataset.sibling_reader(source, max_bytes)

    def __call__(self) -> bytes:
        with self._watched():
            return self._dataset.read(self._source, self._max_bytes)

    def sibling(self, name: str) -> bytes:
        with self._watched():
            return self._sibling(name)

    def raise_failure(self) -> None:
        """Raise again what a caller in between may have taken for the mesh's fault."""
        if self._failure is not None:
            raise self._failure

    @contextlib.contextmanager
    def _watched(self) -> Iterator[None]:
        try:
            yield
        except (DatasetError, OSError) as error:
            text = f"the dataset {self._root} can't be read: {error}"
            self._failure = batch.Unavailable(text)
            raise self._failure from None


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
        store = RunFolder(self.job.out).fields(self.job)
        category, number = split_shard(shard)
        arrays = {
            spec.name: np.zeros((len(outcomes), *spec.shape), spec.dtype) for spec in store.specs
        }
        notes = {}
        for row, outcome in enumerate(outcomes):
            if outcome.kind != "ok":
                continue
            source_digest, fields = outcome.value
            notes[outcome.model_id] = {"source_sha256": source_digest}
            arrays["valid"][row] = 1
            arrays["occupancy_64"][row] = np.packbits(fields.occupancy_64.reshape(-1))
            arrays["preview"][row, : len(fields.preview)] = fields.preview
            for name in ("occupancy", "sdf", "surface", "interior", "transform", "mirror"):
                arrays[name][row] = getattr(fields, name)
        return Committed(store.write_shard(category, number, arrays), notes)


def run(context: Context) -> None:
    """Do the stage."""
    store = context.run.fields(context.job)

    def prepare(shards: dict[str, int]) -> None:
        for category, count in shards.items():
            store.ensure(category, count)

    work = IngestWork(context.job, context.token)
    run_sharded(context, STAGE, work, plans.ingest(context), prepare)
