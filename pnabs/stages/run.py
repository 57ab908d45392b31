"""A whole run: what is missing, stage after stage."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pnabs.batch import Executor, WorkerLimits
from pnabs.dataset import catalogue as catalogues
from pnabs.dataset.synsets import resolve_category
from pnabs.stages import abstract, difference, ingest, report, train
from pnabs.stages.context import Context
from pnabs.stages.errors import (
    InterruptedRunError,
    RefusedError,
    StorageError,
    UsageError,
    is_storage,
    storage_message,
)
from pnabs.stages.identity import check_identity, given_weights
from pnabs.stages.interrupts import Interrupts
from pnabs.stages.job import Job, check_weights
from pnabs.stages.phases import find_weights
from pnabs.stages.plan import STAGES, VERSIONS, homes
from pnabs.stages.progress import Reporter
from pnabs.stages.scan import scan
from pnabs.stages.shards import Shards
from pnabs.store.atomic import digest, write_atomic
from pnabs.store.events import EventLog
from pnabs.store.lock import LockedError, run_lock
from pnabs.store.run import RunFolder


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
    check_weights(job)
    run = RunFolder(job.settings.out)
    interrupts = Interrupts()
    go_on = f"To go on: {options.command or 'run again'}"
    with ExitStack() as stack:
        stack.enter_context(interrupts.installed())
        token = stack.enter_context(held(run.root))
        try:
            context = open_run(job, options, reporter, interrupts, token, stack, executor)
            return _do(context, options, interrupts)
        except InterruptedRunError as error:
            raise InterruptedRunError(f"{error}. {go_on}", error.exit_code) from None
        except OSError as error:
            if not is_storage(error):
                raise
            said = storage_message(error)
            raise StorageError(f"{said}. What is committed stays. {go_on}") from error


@contextmanager
def held(run: Path) -> Iterator[str]:
    """Hold the run folder while the body runs; yields the token that its workers know it by.

    Raises
    ------
    RefusedError
        When another driver holds it.
    UsageError
        When it can't be written.
    """
    with ExitStack() as stack:
        try:
            token = stack.enter_context(run_lock(run))
        except LockedError as error:
            raise RefusedError(str(error)) from None
        except OSError as error:
            raise UsageError(f"can't write the run folder {run}: {error.strerror}") from None
        yield token


def open_run(
    job: Job,
    options: Options,
    reporter: Reporter,
    interrupts: Interrupts,
    token: str,
    stack: ExitStack,
    executor: Callable[[WorkerLimits], Executor] | None = None,
) -> Context:
    """The run's context, its folder opened or made; Ray is started when first needed."""
    settings = job.settings
    run = RunFolder(settings.out)
    # A folder in which nothing is done yet has nothing that could be redone.
    accept = options.accept or not run.ledger.stages()
    identity = run.read_identity(anew=accept)
    check_identity(identity, settings, accept=accept)
    with interrupts.at_once("listing the dataset"):
        found = scan(settings, run, identity, reporter, accept=accept)
    kept = _kept_weights(job, run, identity, options)
    run.sweep()
    # Before the catalogue, which takes edited files' new times, is written.
    _withdraw(run, found.edited, options)
    content = catalogues.to_bytes(found.catalogue)
    mark = digest(content)
    run.write_identity(
        settings,
        origins=job.origins,
        stage_versions=VERSIONS,
        dataset_fingerprint=catalogues.fingerprint(found.catalogue),
        catalogue=content,
        weights=given_weights(job),
        kept_weights=kept,
        command=options.command,
    )
    if not run.catalogue.exists() or run.catalogue.read_bytes() != content:
        write_atomic(run.catalogue, content)
    shards = Shards.of_file(run.catalogue, run.catalogue_index, mark)
    shards.save_index(run.catalogue_index, mark)
    # From here on nobody holds the models one by one.
    del content, found
    if accept:
        describe(job, run, shards)
    events = EventLog(run.root, "driver")
    stack.callback(events.close)
    started: list[bool] = []

    def start_ray() -> None:
        if started:
            return
        from pnabs.stages.cluster import ray_session

        reporter.say("starting Ray ..." if options.address is None else "joining Ray ...")
        try:
            with interrupts.at_once("Ray was starting"):
                started.append(stack.enter_context(ray_session(options.address, run.root)))
        except SystemExit:
            # While it starts, Ray answers SIGTERM itself.
            raise InterruptedRunError("stopped while Ray was starting", 143) from None
        interrupts.install()

    runtime = settings.runtime
    limits = WorkerLimits(
        runtime.deadline, runtime.memory, runtime.isolation == "child", runtime.stall
    )

    def on_ray() -> Executor:
        start_ray()
        from pnabs.batch.ray_executor import RayExecutor

        try:
            return RayExecutor(limits, runtime.actors, runtime.threads)
        except ValueError as error:
            raise UsageError(str(error)) from None

    allowed = runtime.max_failed if options.max_failed is None else options.max_failed
    return Context(
        job=settings,
        variants=job.variants(),
        run=run,
        shards=shards,
        selected=select(list(shards.counts), options.categories),
        executor=on_ray if executor is None else functools.partial(executor, limits),
        reporter=reporter,
        events=events,
        max_failed=allowed,
        interrupted=interrupts,
        start_ray=start_ray,
        owns_ray=lambda: any(started),
        token=token,
        kept_weights=kept,
    )


def _withdraw(run: RunFolder, edited: frozenset[str], options: Options) -> None:
    """Take back the records of what is to be done again though its fingerprint stays."""
    ledger = run.ledger
    chosen = {("ingest", shard) for shard in edited}
    if options.retry is not None:
        chosen |= {
            (stage, shard)
            for stage in ledger.stages()
            if options.retry.stage in (None, stage)
            for shard, entry in ledger.index(stage).items()
            if any(options.retry.kind in (None, kind) for _, kind in entry.fallen)
        }
    for stage, shard in chosen:
        ledger.withdraw(stage, shard)
    for stage in {stage for stage, _ in chosen}:
        ledger.save_index(stage)
        ledger.write_quarantine(stage)


def describe(job: Job, run: RunFolder, shards: Shards) -> list[Path]:
    """Bring the descriptions of the arrays that are there up to date; returns those changed."""
    variants = job.variants()
    stores = [run.fields(job.settings)]
    stores += [run.differences(run.variant(name), one) for name, one in variants.items()]
    return [
        path
        for store in stores
        for category, count in shards.counts.items()
        if (store.store / category).is_dir()
        for path in store.ensure(category, count)
    ]


def _kept_weights(
    job: Job, run: RunFolder, identity: dict[str, Any] | None, options: Options
) -> dict[str, str]:
    """The phases whose weights stay whatever the dataset is now, for run.json."""
    if options.keep_weights:
        return find_weights(job, run)
    # A change that is accepted without it trains again.
    return {} if options.accept or identity is None else dict(identity["kept_weights"])


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
            return stage in stages and homes(jobs, stage)[name] == name

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
