"""Where shards run: in this process, or on Ray (`ray_executor`)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from pnabs.batch.work import ShardWork, WorkerLimits
from pnabs.batch.worker import ShardDone, ShardWorker

__all__ = ["Executor", "InlineExecutor", "ShardDone", "ShardFailed"]


@dataclass(frozen=True, slots=True)
class ShardFailed:
    """A shard that could not be finished for a cause that is no model's: storage, a lost node."""

    shard: str
    reason: str


class Executor(Protocol):
    """Runs a stage's work over shards."""

    def map(
        self,
        work: ShardWork,
        shards: Sequence[str],
        on_progress: Callable[[int], None] | None = None,
    ) -> Iterator[ShardDone | ShardFailed]:
        """Results as they come, in any order; `on_progress` gets models done so far."""


class InlineExecutor:
    """One worker in this process, no Ray; models still run in an isolated child."""

    def __init__(self, limits: WorkerLimits) -> None:
        self._limits = limits

    def map(
        self,
        work: ShardWork,
        shards: Sequence[str],
        on_progress: Callable[[int], None] | None = None,
    ) -> Iterator[ShardDone | ShardFailed]:
        """Shards one after another."""
        worker = ShardWorker(work, self._limits)
        try:
            for shard in shards:
                try:
                    done: ShardDone | ShardFailed = worker.run(shard)
                except Exception as error:
                    done = ShardFailed(shard, f"{type(error).__name__}: {error}")
                if on_progress:
                    on_progress(worker.models_done())
                yield done
        finally:
            worker.close()
