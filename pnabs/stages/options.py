"""What a command line asks of a run beyond its job."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Retry:
    """Which quarantined models to try again: of a stage and a kind, or of any."""

    stage: str | None = None
    kind: str | None = None


@dataclass(frozen=True, slots=True)
class Options:
    """What a command line adds to a job.

    Attributes
    ----------
    address
        Ray's address; None starts one here, or joins the one of RAY_ADDRESS.
    stages
        Stages to do; all when empty.
    categories
        Categories to do, by name or alias; all when empty.
    max_failed
        Per cent of the models that may fall out of a stage; the job's when None.
    accept
        Redo what changed settings, inputs or versions call for.
    keep_weights
        Don't train again because of changed or added models.
    retry
        Quarantined models to try again.
    command
        The command that makes the run again.
    """

    address: str | None = None
    stages: Sequence[str] = ()
    categories: Sequence[str] = ()
    max_failed: float | None = None
    accept: bool = False
    keep_weights: bool = False
    retry: Retry | None = None
    command: str = ""
