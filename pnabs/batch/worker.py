"""A worker: one shard after another, each model in the worker's isolated child."""

from __future__ import annotations

import resource
import time
from dataclasses import dataclass, replace
from typing import Any

from pnabs.batch.child import IsolatedChild
from pnabs.batch.work import Outcome, ShardWork, WorkerLimits


@dataclass(frozen=True, slots=True)
class ShardDone:
    """A shard whose data is written; it counts once the caller commits it.

    `outcomes` have no values any more; `peak_memory` is in bytes, of the worker and
    of its largest child.
    """

    shard: str
    outcomes: tuple[Outcome, ...]
    outputs: dict[str, dict[str, Any]]
    notes: dict[str, dict[str, Any]]
    seconds: float
    peak_memory: int


class ShardWorker:
    """Runs shards of one stage; lives in a Ray actor or in the caller's process."""

    def __init__(self, work: ShardWork, limits: WorkerLimits) -> None:
        self._work = work
        self._child = IsolatedChild(work.task, limits, work.preload)
        self._ready = False
        self._models = 0

    def run(self, shard: str) -> ShardDone:
        """Process every model of a shard and write the results.

        A model that fails in any way but by invalid input gets one more try, alone
        in a fresh child, after the others; its second outcome is its verdict.
        """
        started = time.perf_counter()
        if not self._ready:
            self._work.setup()
            self._ready = True
        outcomes: list[Outcome] = []
        again: list[tuple[int, Any]] = []
        for model_id, payload in self._work.payloads(shard):
            outcome = self._child.run(model_id, payload)
            if outcome.kind in ("ok", "invalid"):
                self._models += 1
            else:
                again.append((len(outcomes), payload))
            outcomes.append(outcome)
        for position, payload in again:
            self._child.restart()
            outcome = self._child.run(outcomes[position].model_id, payload)
            outcomes[position] = replace(outcome, attempts=2)
            self._models += 1
        committed = self._work.commit(shard, outcomes)
        return ShardDone(
            shard,
            tuple(replace(outcome, value=None) for outcome in outcomes),
            committed.outputs,
            committed.notes,
            time.perf_counter() - started,
            _peak_memory(),
        )

    def models_done(self) -> int:
        """Models with a verdict since the worker started."""
        return self._models

    def close(self) -> None:
        """End the child."""
        self._child.close()


def _peak_memory() -> int:
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    return (own + children) * 1024
