"""Where shards run: in this process, or on Ray (`ray_executor`)."""

from __future__ import annotations

import errno
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from pnabs.batch.work import ShardWork, Unavailable, WorkerLimits
from pnabs.batch.worker import ShardDone, ShardWorker

__all__ = [
    "Executor",
    "InlineExecutor",
    "ShardDone",
    "ShardFailed",
    "Watcher",
    "describe",
    "full_or_readonly",
    "serve",
]

_HOPELESS = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)


@dataclass(frozen=True, slots=True)
class ShardFailed:
    """A shard that could not be finished for a cause that is no model's: storage, a lost node."""

    shard: str
    reason: str


class Watcher:
    """Is told what goes on while shards run; what its methods raise ends the work."""

    def started(self, shard: str, where: str) -> None:
        """A worker was given a shard; `where` is its host and process."""

    def progress(self, models: int) -> None:
        """Models with a verdict in the shards in flight; comes twice a second on Ray."""

    def warn(self, message: str) -> None:
        """Something the user should know of: nothing moves, or a worker was left out."""


class Executor(Protocol):
    """Runs a stage's work over shards."""

    def map(
        self, work: ShardWork, shards: Sequence[str], watcher: Watcher
    ) -> Iterator[ShardDone | ShardFailed]:
        """Results as they come, in any order.

        Raises
        ------
        Unavailable
            When no shard could be finished any more: the disk is full, or what the work needs is
            out of every worker's reach.
        """


class InlineExecutor:
    """One worker in this process, no Ray; models still run in an isolated child."""

    def __init__(self, limits: WorkerLimits) -> None:
        self._limits = limits

    def map(
        self, work: ShardWork, shards: Sequence[str], watcher: Watcher
    ) -> Iterator[ShardDone | ShardFailed]:
        """Shards one after another."""
        yield from serve(ShardWorker(work, self._limits), shards, watcher)


def serve(
    worker: ShardWorker, shards: Iterable[str], watcher: Watcher
) -> Iterator[ShardDone | ShardFailed]:
    """Shards one after another by one worker, which is closed at the end.

    Raises
    ------
    Unavailable
        When the next shard would fail of the same as the last.
    """
    try:
        worker.check()
        for shard in shards:
            watcher.started(shard, worker.where)
            try:
                result: ShardDone | ShardFailed = worker.run(shard, _Through(watcher))
            except _Stopped as stopped:
                raise stopped.reason from None
            except Exception as error:
                result = ShardFailed(shard, describe(error))
                yield result
                if full_or_readonly(error):
                    raise Unavailable(result.reason) from error
                worker.check()
            else:
                yield result
    finally:
        worker.close()


class _Stopped(BaseException):
    def __init__(self, reason: Exception) -> None:
        self.reason = reason


@dataclass(frozen=True, slots=True)
class _Through:
    """Hands progress on; what the watcher raises is no failure of the shard."""

    watcher: Watcher

    def __call__(self, models: int) -> None:
        try:
            self.watcher.progress(models)
        except Exception as error:
            raise _Stopped(error) from None


def describe(error: BaseException) -> str:
    """An error in one line: known causes by their message, others with their type."""
    text = " ".join(str(error).split())
    return text if isinstance(error, Unavailable) else f"{type(error).__name__}: {text}"


def full_or_readonly(error: BaseException) -> bool:
    """Whether an error says that nothing can be written any more."""
    return isinstance(error, OSError) and error.errno in _HOPELESS
