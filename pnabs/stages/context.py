"""What every stage is given."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from pnabs.batch import Executor
from pnabs.settings import Settings
from pnabs.stages.plan import homes
from pnabs.stages.progress import Reporter
from pnabs.stages.shards import Shards
from pnabs.stages.training_models import TrainingModels
from pnabs.store.run import RunFolder, Variant


@dataclass(frozen=True, slots=True)
class Context:
    """One run under way.

    Attributes
    ----------
    job
        The settings that no variant changes: what comes before training, and the report.
    variants
        Name -> settings of each variant, `main` first.
    shards
        The run's catalogue, by shard.
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
    token
        By which workers know that this driver still holds the run folder.
    given_weights
        Digests of the weights that the job gives, as `identity.given_weights` has them.
    kept_weights
        Fingerprints of the training phases whose weights the user kept, from run.json.
    training
        The models of a split by the stage that names them and the split, as last found, with
        the ledger's state then; see `phases.training_models`.
    problems
        What went wrong without stopping the run, to be told at its end.
    """

    job: Settings
    variants: dict[str, Settings]
    run: RunFolder
    shards: Shards
    selected: frozenset[str] | None
    executor: Callable[[], Executor]
    reporter: Reporter
    events: Callable[..., None]
    max_failed: float
    interrupted: Callable[[], int | None]
    start_ray: Callable[[], None] = lambda: None
    owns_ray: Callable[[], bool] = lambda: False
    token: str = ""
    given_weights: Mapping[str, str] = field(default_factory=dict)
    kept_weights: dict[str, str] = field(default_factory=dict)
    training: dict[tuple[str, str], tuple[tuple[int, int], TrainingModels]] = field(
        default_factory=dict
    )
    problems: list[str] = field(default_factory=list)

    def home(self, stage: str, variant: str) -> Variant:
        """Where a variant's results of a stage lie: its own folder or an equal one's."""
        return self.run.variant(self.homes(stage)[variant])

    def homes(self, stage: str) -> dict[str, str]:
        """The variant in whose folder each variant's results of a stage lie."""
        return homes(self.variants, stage, self.given_weights)

    @property
    def catalogue(self) -> pa.Table:
        """The run's catalogue."""
        return self.shards.catalogue


def read_shard_rows(catalogue: Path, shard: str) -> list[dict[str, Any]]:
    """The catalogue's rows of one shard, read by a worker, in row order."""
    status = catalogue.stat()
    file, ranges = _open(catalogue, status.st_mtime_ns, status.st_size)
    groups = [i for i, (low, high) in enumerate(ranges) if low <= shard <= high]
    table = file.read_row_groups(groups, use_threads=False)
    rows: list[dict[str, Any]] = table.filter(pc.equal(table["shard"], shard)).to_pylist()
    return rows


@functools.lru_cache(maxsize=1)
def _open(catalogue: Path, mtime_ns: int, size: int) -> tuple[Any, list[tuple[str, str]]]:
    """A catalogue with the first and last shard by name of each of its row groups."""
    file = pq.ParquetFile(catalogue)
    column = file.schema_arrow.get_field_index("shard")
    groups = (file.metadata.row_group(i).column(column) for i in range(file.num_row_groups))
    return file, [(group.statistics.min, group.statistics.max) for group in groups]


def split_shard(shard: str) -> tuple[str, int]:
    """Category and number of a shard's name `<category>-<00000>`."""
    category, _, number = shard.rpartition("-")
    return category, int(number)
