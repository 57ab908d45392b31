"""A whole run: what is missing, stage after stage."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from pnabs.batch import Executor, WorkerLimits
from pnabs.dataset.synsets import resolve_category
from pnabs.stages import abstract, difference, ingest, report, train
from pnabs.stages.context import Context
from pnabs.stages.errors import InterruptedRunError, StorageError, is_storage, storage_message
from pnabs.stages.folder import held, open_folder
from pnabs.stages.identity import given_weights
from pnabs.stages.interrupts import Interrupts
from pnabs.stages.job import Job
from pnabs.stages.lazy_ray import LazyRay
from pnabs.stages.networks import check_networks
from pnabs.stages.options import Options
from pnabs.stages.plan import STAGES
from pnabs.stages.progress import Reporter
from pnabs.store.events import EventLog
from pnabs.store.run import RunFolder


@dataclass(frozen=True, slots=True)
class Result:
    """How a run ended: tables as text (when reported), problems, the exit code they make."""

    tables: str
    page: Path | None
    problems: tuple[str, ...]

    @property
    def exit_code(self) -> int:
        """0, or 3 when too much failed."""
        return 3 if self.problems else 0


def run_job(
    job: Job,
    options: Options,
    reporter: Reporter,
    executor: Callable[[WorkerLimits], Executor] | None = None,
) -> Result:
    """Do what is missing of a job.

    Parameters
    ----------
    executor
        Replaces the Ray actors of the sharded stages.

    Raises
    ------
    pnabs.stages.job.JobError
        When weights that the job gives aren't there.
    RunError
        With its exit code: refused, interrupted, too much failed, or nothing to work on.
    pnabs.dataset.errors.DatasetError
        When the dataset can't be used.
    """
    check_networks(job)
    run = RunFolder(job.settings.out)
    interrupts = Interrupts()
    go_on = f"To go on: {options.command or 'run again'}"
    with ExitStack() as stack:
        stack.enter_context(interrupts.installed())
        token = stack.enter_context(held(run.root))
        try:
            context = _context(job, options, reporter, interrupts, token, stack, executor)
            return _do(context, options, interrupts)
        except InterruptedRunError as error:
            raise InterruptedRunError(f"{error}. {go_on}", error.exit_code) from None
        except OSError as error:
            if not is_storage(error):
                raise
            said = storage_message(error)
            raise StorageError(f"{said}. What is committed stays. {go_on}") from error


def _context(
    job: Job,
    options: Options,
    reporter: Reporter,
    interrupts: Interrupts,
    token: str,
    stack: ExitStack,
    executor: Callable[[WorkerLimits], Executor] | None,
) -> Context:
    run, runtime = RunFolder(job.settings.out), job.settings.runtime
    job, shards, kept = open_folder(run, job, options, reporter, interrupts)
    events = EventLog(run.root, "driver")
    stack.callback(events.close)
    ray = LazyRay(options.address, run.root, reporter, interrupts, stack)
    limits = WorkerLimits(
        runtime.deadline, runtime.memory, runtime.isolation == "child", runtime.stall
    )
    return Context(
        job=job.settings,
        variants=job.variants(),
        run=run,
        shards=shards,
        selected=select(list(shards.counts), options.categories),
        executor=lambda: executor(limits) if executor else ray.executor(limits, runtime),
        reporter=reporter,
        events=events,
        max_failed=runtime.max_failed if options.max_failed is None else options.max_failed,
        interrupted=interrupts,
        start_ray=ray.start,
        owns_ray=lambda: ray.owned,
        token=token,
        given_weights=given_weights(job),
        kept_weights=kept,
    )


def select(available: Sequence[str], categories: Sequence[str]) -> frozenset[str] | None:
    """The categories that sharded stages are limited to, by name or alias; None for all."""
    if not categories:
        return None
    return frozenset(resolve_category(name, available) for name in categories)


def _do(context: Context, options: Options, interrupts: Interrupts) -> Result:
    stages = options.stages or STAGES
    jobs = context.variants
    if "ingest" in stages:
        ingest.run(context)
    for name, job in jobs.items():
        trained = job.weights is None
        cropped = trained and job.abstract.negatives

        def at_home(stage: str, name: str = name) -> bool:
            return stage in stages and context.homes(stage)[name] == name

        if trained and at_home("train-positive"):
            train.run(context, name, "positive")
        if cropped and at_home("difference"):
            difference.run(context, name)
        if cropped and at_home("train-negative"):
            train.run(context, name, "negative")
        if at_home("abstract"):
            abstract.run(context, name)
    tables, page = "", None
    if "report" in stages:
        with interrupts.at_once("the report was being made"):
            tables = report.run(context, options.command)
        page = context.run.report / "index.html"
    return Result(tables, page, tuple(context.problems))
