"""A worker: one shard after another, each model in the worker's isolated child."""

from __future__ import annotations

import os
import resource
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from pnabs.batch.child import InProcess, IsolatedChild
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


@dataclass(frozen=True, slots=True)
class Activity:
    """What a worker is at: changes whenever it gets on.

    Attributes
    ----------
    models
        Models of the present shard that have a verdict.
    what
        Model, or what is done for the shard as a whole.
    seconds
        How long it has been at that.
    """

    shard: str
    models: int
    what: str
    seconds: float


class ShardWorker:
    """Runs shards of one stage; lives in a Ray actor or in the caller's process."""

    def __init__(self, work: ShardWork, limits: WorkerLimits) -> None:
        self._work = work
        runner = IsolatedChild if limits.isolated else InProcess
        self._child = runner(work.task, limits, work.preload)
        self.where = f"{socket.gethostname()} ({os.getpid()})"
        self._ready = False
        self._models = 0
        self._at("", "waiting for a shard")

    def check(self) -> None:
        """See whether the worker can do its work, and make it ready.

        Raises
        ------
        Unavailable
            When it can't, saying what is out of reach.
        """
        self._work.check()
        self._child.start()

    def run(self, shard: str, on_model: Callable[[int], None] | None = None) -> ShardDone:
        """Process every model of a shard and write the results.

        A model that fails in any way but by invalid input gets one more try, alone
        in a fresh child, after the others; its second outcome is its verdict.

        Parameters
        ----------
        on_model
            Called after each verdict with their number so far; what it raises ends the shard.

        Raises
        ------
        Unavailable
            When something is missing that no model is to blame for.
        """
        started = time.perf_counter()
        self._models = 0
        if not self._ready:
            self._at(shard, "loading")
            self._work.setup()
            self._ready = True
        outcomes: list[Outcome] = []
        again: list[tuple[int, Any]] = []
        self._at(shard, "reading")
        for model_id, payload in self._work.payloads(shard):
            outcome = self._try(shard, model_id, payload)
            if outcome.kind in ("ok", "invalid"):
                self._verdict(on_model)
            else:
                again.append((len(outcomes), payload))
            outcomes.append(outcome)
        for position, payload in again:
            self._child.restart()
            outcome = self._try(shard, outcomes[position].model_id, payload)
            outcomes[position] = replace(outcome, attempts=2)
            self._verdict(on_model)
        self._at(shard, "writing")
        self._work.check()
        committed = self._work.commit(shard, outcomes)
        self._at("", "waiting for a shard")
        return ShardDone(
            shard,
            tuple(replace(outcome, value=None) for outcome in outcomes),
            committed.outputs,
            committed.notes,
            time.perf_counter() - started,
            _peak_memory(),
        )

    def activity(self) -> Activity:
        """What the worker is at; may be asked from another thread."""
        shard, what, since = self._now
        return Activity(shard, self._models, what, time.monotonic() - since)

    def close(self) -> None:
        """End the child."""
        self._child.close()

    def abandon(self) -> None:
        """From another thread: make the shard in flight end at once, by `Unavailable`."""
        self._child.abandon()

    def _try(self, shard: str, model_id: str, payload: Any) -> Outcome:
        self._at(shard, f"model {model_id}")
        outcome = self._child.run(model_id, payload)
        if outcome.kind == "timeout":
            # A disk that hangs looks like a model that hangs; this hangs too, or raises.
            self._at(shard, f"looking at the storage after model {model_id}")
            self._work.check()
        return outcome

    def _verdict(self, on_model: Callable[[int], None] | None) -> None:
        self._models += 1
        if on_model:
            on_model(self._models)

    def _at(self, shard: str, what: str) -> None:
        self._now = shard, what, time.monotonic()


def _peak_memory() -> int:
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    return (own + children) * 1024
