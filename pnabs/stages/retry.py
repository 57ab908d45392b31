"""retry: quarantined models once more."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from pnabs.stages.errors import UsageError
from pnabs.stages.job import with_overrides
from pnabs.stages.options import Options, Retry
from pnabs.stages.progress import Reporter
from pnabs.stages.run import Result, run_job
from pnabs.stages.status import stored_job
from pnabs.store.run import RunFolder


def retry(
    root: Path, which: Retry, overrides: Sequence[str], options: Options, reporter: Reporter
) -> Result:
    """Run a job as it was last run, and its quarantined models again.

    Parameters
    ----------
    overrides
        Settings to replace, as `key=value`; those of `runtime` change no other result.

    Raises
    ------
    RunError
        As `run_job`, and when the run has no such stage.
    """
    run = RunFolder(root)
    job = with_overrides(stored_job(run), overrides, reporter.say)
    settings = job.settings.model_copy(update={"out": root.absolute()})
    stages = run.ledger.stages()
    if which.stage is not None and which.stage not in stages:
        raise UsageError(f"--stage: the run has no {which.stage}; there are {', '.join(stages)}")
    found = sum(
        which.kind in (None, kind)
        for stage in stages
        if which.stage in (None, stage)
        for entry in run.ledger.index(stage).values()
        for _, kind in entry.fallen
    )
    reporter.say(f"{found} quarantined models are tried again")
    again = dataclasses.replace(options, retry=which)
    return run_job(dataclasses.replace(job, settings=settings), again, reporter)
