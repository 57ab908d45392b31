"""What a run would do."""

from __future__ import annotations

import dataclasses

from pnabs.stages.folder import kept_weights
from pnabs.stages.identity import check_identity, given_weights
from pnabs.stages.job import Job
from pnabs.stages.networks import check_networks
from pnabs.stages.options import Options
from pnabs.stages.progress import Reporter
from pnabs.stages.run import select
from pnabs.stages.scan import scan
from pnabs.stages.shards import Shards
from pnabs.stages.status import StageStatus, context_of, render, status
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
    check_networks(job)
    run = RunFolder(job.settings.out)
    accept = options.accept or not run.ledger.stages()
    identity = run.read_identity(anew=accept)
    check_identity(identity, job.settings, accept=accept)
    job = job.in_order_of(identity)
    catalogue = scan(job.settings, run, identity, reporter, accept=accept).catalogue
    kept = kept_weights(job, run, identity, options)
    shards = Shards.of_table(catalogue)
    context = context_of(job, run, reporter, shards, given=given_weights(job), kept=kept)
    context = dataclasses.replace(
        context, selected=select(list(context.shards.counts), options.categories)
    )
    stages = status(context)
    if options.stages:
        stages = [item for item in stages if _stage(item) in options.stages]
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


def _stage(item: StageStatus) -> str:
    """The stage that a line of the status belongs to; both phases of a module to its own."""
    name = item.stage.partition("@")[0]
    return name.partition("-")[0].replace(" ", "-") if name.startswith("train ") else name
