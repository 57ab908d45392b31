"""Work that `benchmarks.scale` gives to the runner, and the plain loop it is compared with."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pnabs.batch import Outcome
from pnabs.batch.work import Committed
from pnabs.settings import Settings
from pnabs.stages import ingest
from pnabs.stages.context import read_shard_rows
from pnabs.stages.reach import check_run
from pnabs.store.run import RunFolder


def nothing(row: dict[str, Any]) -> None:
    """The task of the stage that does nothing."""


@dataclass
class NoWork:
    """Reads its models' rows as any stage does, and does nothing with them."""

    out: Path
    token: str
    preload: tuple[str, ...] = ()
    task: Callable[[Any], Any] = nothing

    def check(self) -> None:
        """As every stage."""
        check_run(self.out, self.token)

    def setup(self) -> None:
        """Nothing."""

    def payloads(self, shard: str) -> Iterable[tuple[str, Any]]:
        """The catalogue's rows."""
        for row in read_shard_rows(self.out / "catalogue.parquet", shard):
            yield row["model_id"], row

    def commit(self, shard: str, outcomes: Sequence[Outcome]) -> Committed:
        """Nothing."""
        return Committed({}, {})


def plain_loop(job: Settings, shards: Sequence[str]) -> None:
    """What one would write without a runner: read, compute and store, one after the other."""
    work = ingest.IngestWork(job, "")
    task = work.task
    for shard in shards:
        rows = read_shard_rows(RunFolder(job.out).catalogue, shard)
        values = [(row["model_id"], task(row)) for row in rows]
        work.commit(shard, [Outcome(name, "ok", value=value) for name, value in values])
