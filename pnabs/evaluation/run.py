"""An evaluation from what is given to what is said: what is missing is done, and committed."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pnabs import batch
from pnabs.batch.thread_executor import ThreadExecutor
from pnabs.evaluation.items import AbstractionFile, MeshFiles
from pnabs.evaluation.matching import ShapeIndex
from pnabs.evaluation.plan import Plan, Todo, batches
from pnabs.evaluation.reading import Frame
from pnabs.evaluation.results import Results, find_results
from pnabs.evaluation.rows import FALLEN, STAGE, Rows
from pnabs.evaluation.shapes import Choice, Shapes, find_shapes
from pnabs.evaluation.task import Measuring
from pnabs.evaluation.work import EvaluateWork
from pnabs.settings import Runtime, Settings
from pnabs.stages.errors import (
    InterruptedRunError,
    RefusedError,
    ShardsFailedError,
    StorageError,
    UsageError,
    is_storage,
    storage_message,
)
from pnabs.stages.folder import held
from pnabs.stages.interrupts import Interrupts
from pnabs.stages.job import Job, JobError, with_overrides
from pnabs.stages.lazy_ray import LazyRay
from pnabs.stages.progress import Reporter, Tracker
from pnabs.store.ledger import ModelVerdict, Record
from pnabs.store.lock import NotHeldError, check_held

if TYPE_CHECKING:
    from pnabs.evaluation.output import Evaluation

HIDDEN = ".evaluation"
"""Folder of the rows and the lock, below that of the tables."""

FILES = ("models.csv", "tables.csv", "tables.json", "tables.tex", "quarantine.jsonl")
"""What lies beside it."""

SETTABLE = ("ingest.", "abstract.metric_samples", "runtime.")
"""Settings that matter here; of a run's shapes, `ingest.` only in its limits."""

CLUSTER = 16
"""Workers that a cluster is taken to have when work is shared out."""

FAILURES_TOLD = 20
HOPELESS = 4
"""So many batches in a row that failed for causes not theirs end the work."""


@dataclass(frozen=True, slots=True)
class Request:
    """What is asked for.

    Attributes
    ----------
    shapes
        Path or `s3://` URL.
    results
        Name and path of each set of results.
    out
        Where rows and tables go.
    choice
        Which shapes, and how they lie.
    frame
        In which meshes and boxes are given.
    max_parts
        Results of more parts count as failures.
    seed
        None: the run's own, or 0.
    overrides
        Settings, as `key=value`.
    jobs
        Results at a time, without Ray.
    address
        Of a Ray cluster; `local` starts Ray here; None does without.
    retry
        Do again what couldn't be measured before.
    command
        That goes on.
    """

    shapes: Path | str
    results: tuple[tuple[str, Path], ...]
    out: Path
    choice: Choice = field(default_factory=Choice)
    frame: Frame = "input"
    max_parts: int | None = None
    seed: int | None = None
    overrides: tuple[str, ...] = ()
    jobs: int = 1
    address: str | None = None
    retry: bool = False
    command: str = ""


def run(request: Request, reporter: Reporter) -> Evaluation:
    """Measure what isn't measured yet, and write the tables.

    Raises
    ------
    pnabs.stages.job.JobError
        When a setting is wrong.
    RunError
        With its exit code: wrong usage, held by another, interrupted, or a disk that fails.
    pnabs.dataset.errors.DatasetError
        When the shapes can't be listed.
    """
    interrupts = Interrupts()
    go_on = f"To go on: {request.command or 'run it again'}"
    _check_out(request.out)
    with ExitStack() as stack:
        if threading.current_thread() is threading.main_thread():
            stack.enter_context(interrupts.installed())
        with interrupts.at_once("it looked at what is there"):
            shapes = find_shapes(request.shapes, request.choice, request.out)
            results = _results(request, shapes)
            job = _job(request, shapes, reporter)
            measuring = _measuring(request, shapes, job)
            plan = Plan.of(shapes.entries, results, measuring)
        token = stack.enter_context(held(request.out / HIDDEN))
        try:
            driver = _Driver(request, job.runtime, reporter, interrupts, token, stack)
            rows = driver.rows_of(plan, shapes, results, measuring)
            with interrupts.at_once("the tables were being made"):
                # Loads pictures and pages with it, which nobody waits for who gave wrong paths.
                from pnabs.evaluation.output import summarise, write

                evaluation = summarise(
                    shapes.entries,
                    results,
                    plan,
                    rows,
                    frame=request.frame,
                    only=request.choice.only,
                    max_parts=request.max_parts,
                    seed=measuring.seed,
                    max_failed=job.runtime.max_failed,
                )
                write(evaluation, request.out)
        except InterruptedRunError as error:
            raise InterruptedRunError(f"{error}. {go_on}", error.exit_code) from None
        except ShardsFailedError as error:
            raise ShardsFailedError(f"{error}\n{go_on}") from None
        except OSError as error:
            if not is_storage(error):
                raise
            raise StorageError(f"{storage_message(error)}. {go_on}") from error
    return evaluation


def _check_out(out: Path) -> None:
    there = [name for name in FILES if (out / name).exists()]
    if there and not (out / HIDDEN).is_dir():
        raise UsageError(
            f"{out / there[0]} is there and of no evaluation: give another folder with --out"
        )


def _results(request: Request, shapes: Shapes) -> list[Results]:
    names = [name for name, _ in request.results]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise UsageError(
            f"two sets of results are called {twice[0]!r}: name each with --name, in their order"
        )
    wanted = [(entry.category, entry.model_id) for entry in shapes.entries]
    index = ShapeIndex(wanted, shapes.others)
    return [
        find_results(path, name, index, shapes.single, request.out)
        for name, path in request.results
    ]


def _job(request: Request, shapes: Shapes, reporter: Reporter) -> Settings:
    """The settings that rows depend on, and how work is done."""
    stored = shapes.run
    for override in request.overrides:
        key = override.partition("=")[0]
        if not f"{key}.".startswith(SETTABLE) and not key.startswith(SETTABLE):
            known = "ingest, runtime and abstract.metric_samples"
            raise JobError(f"--set {override}: only settings of {known} matter here")
        if stored is not None and key.startswith("ingest") and "limits" not in key:
            raise JobError(
                f"--set {override}: {request.shapes} is a run, whose shapes are ingested already"
            )
    tree: dict[str, Any] = {
        "dataset": {"root": ".", "layout": shapes.layout},
        "out": request.out,
    }
    if stored is not None:
        kept = stored.model_dump(mode="json", include={"ingest", "seed"})
        tree |= {**kept, "abstract": {"metric_samples": stored.abstract.metric_samples}}
    if request.seed is not None:
        tree["seed"] = request.seed
    job = Job(Settings.model_validate(tree), {}, Path("pnabs evaluate"))
    return with_overrides(job, request.overrides, reporter.say).settings


def _measuring(request: Request, shapes: Shapes, job: Settings) -> Measuring:
    return Measuring(
        job.ingest, shapes.layout, job.seed, job.abstract.metric_samples, request.frame
    )


@dataclass(slots=True)
class _Driver:
    """Has the missing rows made."""

    request: Request
    runtime: Runtime
    reporter: Reporter
    interrupts: Interrupts
    token: str
    stack: ExitStack

    @property
    def folder(self) -> Path:
        return (self.request.out / HIDDEN).absolute()

    def rows_of(
        self, plan: Plan, shapes: Shapes, results: Sequence[Results], measuring: Measuring
    ) -> dict[str, dict[str, Any]]:
        """Fingerprint -> row of every item."""
        rows = Rows(self.folder)
        with self.interrupts.at_once("it looked at what is there"):
            done = self._known(rows)
            todo = batches(plan, done, CLUSTER if self.request.address else self.request.jobs)
        file = Todo(self.folder / "todo.jsonl")
        if todo:
            file.write(todo)
            work = EvaluateWork(
                self.folder, self.token, measuring, file, _roots(shapes, results), shapes.run
            )
            self._do(rows, work, todo, plan.items)
            done = self._known(rows)
        with self.interrupts.at_once("the tables were being made"):
            wanted = {name: done[name] for name in plan.fingerprints()}
            rows.keep({row["batch"] for row in wanted.values()})
            file.path.unlink(missing_ok=True)
        return wanted

    def _known(self, rows: Rows) -> dict[str, dict[str, Any]]:
        table, batch_of = rows.read()
        found = {}
        for row, name in zip(table.to_pylist(), batch_of, strict=True):
            failed = row["status"] in FALLEN
            again = self.request.retry and failed and not rows.is_fresh(name)
            # Of one that was tried again there may be two.
            if not again and not (failed and row["fingerprint"] in found):
                found[row["fingerprint"]] = row | {"batch": name}
        return found

    def _do(self, rows: Rows, work: EvaluateWork, todo: dict[str, Any], total: int) -> None:
        left = sum(len(items) for items in todo.values())
        failures: list[batch.ShardFailed] = []
        in_a_row = 0
        executor = self._executor()
        with self.reporter.track(STAGE, total, "results") as tracker:
            progress = _Progress(tracker, self.reporter, self.interrupts, total, total - left)
            progress.progress(0)
            try:
                for result in executor.map(work, list(todo), progress):
                    if isinstance(result, batch.ShardFailed):
                        failures.append(result)
                        in_a_row += 1
                        if in_a_row >= HOPELESS:
                            raise batch.Unavailable(result.reason)
                        continue
                    in_a_row = 0
                    self._commit(rows, result)
                    progress.committed(result)
            except batch.Unavailable as error:
                raise ShardsFailedError(f"evaluate ends here: {error}") from None
            finally:
                rows.ledger.save_index(STAGE)
        if failures:
            causes = "".join(f"\n  {one.shard}: {one.reason}" for one in failures[:FAILURES_TOLD])
            raise ShardsFailedError(
                f"evaluate: {len(failures)} of {len(todo)} batches could not be finished, for "
                f"causes that are no result's:{causes}\nWhat is committed stays."
            )

    def _executor(self) -> batch.Executor:
        runtime = self.runtime
        limits = batch.WorkerLimits(
            runtime.deadline, runtime.memory, runtime.isolation == "child", runtime.stall
        )
        address = self.request.address
        if address is None:
            return ThreadExecutor(limits, self.request.jobs)
        ray = LazyRay(
            None if address == "local" else address,
            self.folder,
            self.reporter,
            self.interrupts,
            self.stack,
        )
        return ray.executor(limits, runtime)

    def _commit(self, rows: Rows, result: batch.ShardDone) -> None:
        try:
            check_held(self.folder, self.token)
        except NotHeldError as error:
            raise RefusedError(f"{error}. This one ends; the other goes on.") from None
        rows.commit(
            Record(
                STAGE,
                result.shard,
                result.shard,
                tuple(ModelVerdict(one.model_id, one.kind) for one in result.outcomes),
                result.outputs,
            )
        )


def _roots(shapes: Shapes, results: Sequence[Results]) -> tuple[str, ...]:
    places = [found.place for one in results for found in one.of_shape.values()]
    read = {place.root for place in places if isinstance(place, AbstractionFile | MeshFiles)}
    return tuple(sorted({shapes.root, *read}))


@dataclass(slots=True)
class _Progress(batch.Watcher):
    """Tells how far it is, and ends the work when asked to."""

    tracker: Tracker
    reporter: Reporter
    interrupts: Interrupts
    total: int
    before: int
    seen: int = 0
    fallen: int = 0

    def progress(self, models: int) -> None:
        note = f"failed={self.fallen}" if self.fallen else ""
        self.tracker.update(min(self.before + self.seen + models, self.total), note)
        number = self.interrupts()
        if number is not None:
            raise InterruptedRunError(
                f"stopped; {self.before + self.seen} of {self.total} are committed, and stay",
                128 + number,
            )

    def warn(self, message: str) -> None:
        self.reporter.say(f"evaluate: {message}")

    def committed(self, done: batch.ShardDone) -> None:
        """Count a batch."""
        self.seen += len(done.outcomes)
        self.fallen += sum(outcome.kind != "ok" for outcome in done.outcomes)
        self.progress(0)
