"""What the runner is given, and what it says of each model."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

Kind = Literal["ok", "invalid", "error", "crash", "timeout", "memory"]


class InvalidInput(Exception):
    """Raised by a task for a model whose input can't be used; the verdict is final."""


class Unavailable(Exception):
    """Something that no model is to blame for is missing: a disk, the dataset, the run folder.

    Raised by a task or by a shard's work, it ends the shard without a verdict on anyone; raised
    by an executor, it ends the stage.
    """


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one model; `value` is what the task returned when `kind` is ok."""

    model_id: str
    kind: Kind
    value: Any = None
    reason: str = ""
    attempts: int = 1
    traceback: str = ""


@dataclass(frozen=True, slots=True)
class Committed:
    """What a shard's commit wrote: file digests, and a small note a finished model."""

    outputs: dict[str, dict[str, Any]]
    notes: dict[str, dict[str, Any]]


@dataclass(frozen=True, slots=True)
class WorkerLimits:
    """What one model may cost, and when a worker counts as dead.

    Attributes
    ----------
    deadline
        Seconds a model.
    memory
        Bytes a model beyond the worker's own.
    isolated
        Whether models run in a child process; without one, neither limit holds and a crash is
        the worker's.
    stall
        Seconds without any progress after which a worker is given up, beyond what its model
        may take.
    """

    deadline: float
    memory: int
    isolated: bool = True
    stall: float = 600.0


class ShardWork(Protocol):
    """One stage's work on a shard; picklable, so that it can travel to a worker."""

    preload: tuple[str, ...]
    """Modules that children find imported (their server imports them once)."""

    @property
    def task(self) -> Callable[[Any], Any]:
        """Picklable function of a payload, run in an isolated child, one model at a time."""

    def check(self) -> None:
        """Whether all that the work reads and writes is within reach of this process.

        Called before a worker's first shard, before each commit and after a failure.

        Raises
        ------
        Unavailable
            Naming what isn't there.
        """

    def setup(self) -> None:
        """Load what the worker itself needs, once."""

    def payloads(self, shard: str) -> Iterable[tuple[str, Any]]:
        """Model ids and what the task is given for each; runs in the worker."""

    def commit(self, shard: str, outcomes: Sequence[Outcome]) -> Committed:
        """Write a shard's results and read them back; runs in the worker."""
