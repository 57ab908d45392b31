"""retry: quarantined models once more."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pnabs.stages.errors import UsageError
from pnabs.stages.job import Job, with_overrides
from pnabs.stages.progress import Reporter
from pnabs.stages.run import Options, Result, held, run_job
from pnabs.stages.status import stored_job
from pnabs.store.run import RunFolder


def retry(
    root: Path,
    stage: str | None,
    kind: str | None,
    overrides: Sequence[str],
    options: Options,
    reporter: Reporter,
) -> Result | None:
    """Withdraw the records of shards with such models, and run the job.

    Parameters
    ----------
    stage, kind
        Which models; all when None.
    overrides
        Settings to replace, as `key=value`; those of `runtime` change no other result.

    Returns
    -------
    How the run ended; None when there was nothing to try.

    Raises
    ------
    RunError
        As `run_job`, and when the run has no such stage.
    """
    run = RunFolder(root)
    job: Job = with_overrides(stored_job(run), overrides)
    stages = run.ledger.stages()
    if stage is not None and stage not in stages:
        raise UsageError(f"--stage: the run has no {stage}; there are {', '.join(stages)}")
    with held(root):
        chosen = [
            (name, shard)
            for name in stages
            if stage in (None, name)
            for shard, entry in run.ledger.index(name).items()
            if any(kind in (None, fallen) for _, fallen in entry.fallen)
        ]
        for name, shard in chosen:
            run.ledger.withdraw(name, shard)
        for name in {name for name, _ in chosen}:
            run.ledger.save_index(name)
    if not chosen:
        return None
    reporter.say(f"{len(chosen)} shards with quarantined models are done again")
    return run_job(job, options, reporter)
