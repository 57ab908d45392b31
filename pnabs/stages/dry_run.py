"""What a run would do."""

from __future__ import annotations

from pnabs.stages.identity import check_identity
from pnabs.stages.job import Job
from pnabs.stages.progress import Reporter
from pnabs.stages.run import Options, select
from pnabs.stages.scan import scan
from pnabs.stages.status import context_of, render, status
from pnabs.store.run import RunFolder


def dry_run(job: Job, options: Options, reporter: Reporter) -> str:
    """The stages with what is done and what is left, as text; writes nothing.

    Raises
    ------
    pnabs.stages.errors.RefusedError
        When the run itself would be refused.
    pnabs.dataset.errors.DatasetError
        When the dataset can't be used.
    """
    run = RunFolder(job.settings.out)
    check_identity(run.read_identity(), job.settings, accept=options.accept)
    catalogue = scan(job.settings, run, reporter, accept=options.accept, write=False)
    context = context_of(job, run, reporter, select(catalogue, options.categories))
    stages = status(context)
    if options.stages:
        stages = [item for item in stages if item.stage.partition("@")[0] in options.stages]
    left = sum(item.seconds_left or 0 for item in stages)
    known = all(item.seconds_left is not None or item.done == item.total for item in stages)
    lines = [
        f"{len(catalogue)} models in {len(catalogue['category'].unique())} categories "
        f"-> {job.settings.out}",
        "",
        render(stages),
    ]
    if left:
        lines.append(f"about {left:.0f} s left{'' if known else ', and what is not known yet'}\n")
    return "\n".join(lines)
