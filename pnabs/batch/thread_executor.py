"""Several workers in this process, a thread each: no Ray.

Models run in the workers' children, so the threads mostly wait.
"""

from __future__ import annotations

import importlib
import queue
import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from pnabs.batch.executor import ShardDone, ShardFailed, Watcher, serve
from pnabs.batch.work import ShardWork, Unavailable, WorkerLimits
from pnabs.batch.worker import ShardWorker

POLL_SECONDS = 0.2

END_SECONDS = 5.0
"""What threads may take to end once their children are gone."""


class ThreadExecutor:
    """Runs shards on so many workers.

    Parameters
    ----------
    limits
        Deadline and memory a model.
    workers
        How many.
    """

    def __init__(self, limits: WorkerLimits, workers: int) -> None:
        self._limits, self._workers = limits, workers

    def map(
        self, work: ShardWork, shards: Sequence[str], watcher: Watcher
    ) -> Iterator[ShardDone | ShardFailed]:
        """Results as workers finish them.

        Raises
        ------
        Unavailable
            When no worker could go on.
        """
        if not self._limits.isolated:
            # Some native libraries must see the main thread first.
            for name in work.preload:
                importlib.import_module(name)
        floor = _Floor(deque(shards))
        count = min(self._workers, len(shards))
        workers = [ShardWorker(work, self._limits) for _ in range(count)]
        threads = [
            threading.Thread(target=floor.work, args=(worker,), daemon=True) for worker in workers
        ]
        for thread in threads:
            thread.start()
        try:
            yield from floor.results(count, watcher)
        finally:
            floor.waiting.clear()
            for worker in workers:
                worker.abandon()
            end = time.monotonic() + END_SECONDS
            for thread in threads:
                thread.join(max(0.0, end - time.monotonic()))


@dataclass(frozen=True, slots=True)
class _Started:
    shard: str
    where: str


@dataclass(frozen=True, slots=True)
class _Ended:
    """A worker takes no more shards: there are none, or for this reason."""

    reason: Exception | None


@dataclass(slots=True)
class _Floor:
    """The shards between the workers, and what these tell the caller's thread."""

    waiting: deque[str]
    told: queue.SimpleQueue[ShardDone | ShardFailed | _Started | _Ended] = field(
        default_factory=queue.SimpleQueue
    )

    def work(self, worker: ShardWorker) -> None:
        """One worker's thread."""
        reason = None
        try:
            for result in serve(worker, self._taken(), _Teller(self)):
                self.told.put(result)
        except Exception as error:
            reason = error
        self.told.put(_Ended(reason))

    def results(self, workers: int, watcher: Watcher) -> Iterator[ShardDone | ShardFailed]:
        """What the workers finish, until none of them is left."""
        reason: Exception | None = None
        while workers:
            try:
                item = self.told.get(timeout=POLL_SECONDS)
            except queue.Empty:
                watcher.progress(0)
                continue
            if isinstance(item, _Started):
                watcher.started(item.shard, item.where)
            elif isinstance(item, _Ended):
                workers -= 1
                reason = item.reason or reason
                if reason is not None and not isinstance(reason, Unavailable):
                    raise reason
            else:
                yield item
        if reason is not None:
            raise reason

    def _taken(self) -> Iterator[str]:
        while self.waiting:
            try:
                yield self.waiting.popleft()
            except IndexError:  # another was quicker
                return


@dataclass(frozen=True, slots=True)
class _Teller(Watcher):
    floor: _Floor

    def started(self, shard: str, where: str) -> None:
        self.floor.told.put(_Started(shard, where))
