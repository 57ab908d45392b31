"""What every stage is given."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from pnabs.batch import Executor
from pnabs.settings import Settings
from pnabs.stages.plan import homes
from pnabs.stages.progress import Reporter
from pnabs.store.run import RunFolder, Variant


@dataclass(frozen=True, slots=True)
class Context:
    """One run under way.

    Attributes
    ----------
    job
        The settings of `main`.
    variants
        Name -> settings of each variant, `main` first.
    catalogue
        The run's catalogue.
    selected
        Categories that sharded stages are limited to (`--category`); None for all.
    executor
        Makes an executor for the sharded stages.
    max_failed
        Per cent of the models that may fall out of a stage.
    interrupted
        The signal that asked the run to stop, or None.
    start_ray
        Starts or joins Ray, once; called by what needs it.
    owns_ray
        Whether Ray was started here and ends with the run.
    problems
        What went wrong without stopping the run, to be told at its end.
    """

    job: Settings
    variants: dict[str, Settings]
    run: RunFolder
    catalogue: pa.Table
    selected: frozenset[str] | None
    executor: Callable[[], Executor]
    reporter: Reporter
    events: Callable[..., None]
    max_failed: float
    interrupted: Callable[[], int | None]
    start_ray: Callable[[], None] = lambda: None
    owns_ray: Callable[[], bool] = lambda: False
    problems: list[str] = field(default_factory=list)

    def home(self, stage: str, variant: str) -> Variant:
        """Where a variant's results of a stage lie: its own folder or an equal one's."""
        return self.run.variant(homes(self.variants, stage)[variant])

    def shards(self) -> Iterator[tuple[str, list[dict[str, Any]]]]:
        """Each shard with its rows of the catalogue, which is sorted by shard and row."""
        runs = pc.run_end_encode(self.catalogue["shard"].combine_chunks())
        start = 0
        for shard, end in zip(runs.values.to_pylist(), runs.run_ends.to_pylist(), strict=True):
            yield shard, self.catalogue.slice(start, end - start).to_pylist()
            start = end


def read_shard_rows(catalogue: Path, shard: str) -> list[dict[str, Any]]:
    """The catalogue's rows of one shard, read by a worker, in row order."""
    table = pq.read_table(catalogue, filters=[("shard", "=", shard)])
    rows: list[dict[str, Any]] = table.to_pylist()
    return rows


def split_shard(shard: str) -> tuple[str, int]:
    """Category and number of a shard's name `<category>-<00000>`."""
    category, _, number = shard.rpartition("-")
    return category, int(number)


def model_rng(seed: int, stage: str, category: str, model_id: str) -> np.random.Generator:
    """A model's own random numbers: from the job's seed and its name, never from order or time."""
    name = f"{seed}/{stage}/{category}/{model_id}".encode()
    return np.random.default_rng(int.from_bytes(hashlib.sha256(name).digest()[:16], "big"))
