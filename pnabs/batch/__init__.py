"""The shard runner: workers on Ray or in this process, isolated children, verdicts.

It knows neither meshes nor networks nor the run folder: a `ShardWork` says what is
done with a shard, and the caller commits what comes back.
"""

from pnabs.batch.executor import Executor, InlineExecutor, ShardDone, ShardFailed, Watcher
from pnabs.batch.work import InvalidInput, Outcome, ShardWork, Unavailable, WorkerLimits

__all__ = [
    "Executor",
    "InlineExecutor",
    "InvalidInput",
    "Outcome",
    "ShardDone",
    "ShardFailed",
    "ShardWork",
    "Unavailable",
    "Watcher",
    "WorkerLimits",
]
