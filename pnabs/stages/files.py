"""`pnabs abstract`: mesh files to abstractions, without a dataset, training or Ray.

A mesh is done when its `abstraction.json` says that it was made from these bytes with
these settings; so the command goes on where it was stopped, and files may come, go and
change between two times.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pnabs import batch
from pnabs.batch.thread_executor import ThreadExecutor
from pnabs.dataset.files import Files
from pnabs.formats import from_json
from pnabs.geometry.check import faults
from pnabs.settings import Settings
from pnabs.stages.errors import (
    InterruptedRunError,
    ShardsFailedError,
    StorageError,
    is_storage,
    storage_message,
)
from pnabs.stages.file_state import QUARANTINE, RECORD, Quarantine, missing, recipe_of
from pnabs.stages.file_work import HIDDEN, FileWork
from pnabs.stages.folder import held
from pnabs.stages.interrupts import Interrupts
from pnabs.stages.job import Job, JobError, with_overrides
from pnabs.stages.networks import check_networks
from pnabs.stages.progress import Reporter, Tracker

HOPELESS = 4
"""So many meshes in a row that could not be seen to, for causes not theirs, end the work."""

SETTABLE = ("ingest", "difference", "abstract", "runtime")
"""Groups of settings that the command takes."""

LOADING_SECONDS = 10.0
"""When nothing was done for so long at first, the user is told why that may be."""

RESULTS_TOLD = 20
FAILURES_TOLD = 20
"""Results and failures that a message tells one by one."""


@dataclass(frozen=True, slots=True)
class Summary:
    """How it ended.

    Attributes
    ----------
    out
        Folder of the results.
    done
        Ids of the meshes that have their abstraction.
    fallen
        Quarantine lines of those that have none.
    allowed
        Per cent that may fall out.
    """

    out: Path
    done: list[str]
    fallen: list[dict[str, Any]]
    allowed: float

    @property
    def exit_code(self) -> int:
        """0, or 3 when more fell out than allowed."""
        share = len(self.fallen) / (len(self.done) + len(self.fallen))
        return 3 if 100 * share > self.allowed else 0

    @property
    def text(self) -> str:
        """For people to read: each abstraction where they are few, and what fell out."""
        lines = []
        if len(self.done) <= RESULTS_TOLD:
            lines += [_describe(self.out / name) for name in self.done]
        else:
            lines.append(f"{len(self.done)} meshes abstracted in {self.out}")
        if self.fallen:
            lines.append(f"{len(self.fallen)} fell out, as {self.out / QUARANTINE} tells:")
            lines += [
                f"  {entry['model_id']}: {entry['kind']}: {entry['reason']}"
                for entry in self.fallen[:FAILURES_TOLD]
            ]
            lines += ["  ..."] if len(self.fallen) > FAILURES_TOLD else []
        return "\n".join(lines) + "\n"


def files_job(
    files: Files,
    out: Path,
    weights: str,
    seed: int,
    formats: Sequence[str],
    overrides: Sequence[str],
    say: Callable[[str], None],
) -> Job:
    """The settings of the command as a job.

    Parameters
    ----------
    say
        Takes warnings about overrides.

    Raises
    ------
    pnabs.stages.job.JobError
        When an override is wrong.
    """
    tree = {
        "dataset": {"root": files.root, "layout": "folder"},
        "out": out,
        "weights": weights,
        "seed": seed,
        "abstract": {"formats": tuple(dict.fromkeys(["json", *formats]))},
    }
    for override in overrides:
        if override.partition(".")[0] not in SETTABLE:
            raise JobError(f"--set {override}: only settings of {', '.join(SETTABLE)} matter here")
    job = Job(Settings.model_validate(tree), {}, Path("pnabs abstract"))
    job = with_overrides(job, overrides, say)
    if "json" not in job.settings.abstract.formats:
        raise JobError("--set abstract.formats: json must be among them; or use --format")
    return job


def abstract_files(
    files: Files,
    job: Job,
    *,
    jobs: int,
    retry: bool,
    command: str,
    reporter: Reporter,
) -> Summary:
    """Do what is missing.

    Parameters
    ----------
    job
        Its dataset's root is the files', its `out` is where results go.
    jobs
        How many meshes at a time.
    retry
        Try again what was quarantined before.
    command
        That goes on.

    Raises
    ------
    pnabs.stages.job.JobError
        When the weights aren't there.
    RunError
        With its exit code: held by another, interrupted, or a disk that fails.
    """
    check_networks(job)
    settings = job.settings
    interrupts = Interrupts()
    go_on = f"To go on: {command}"
    with interrupts.installed(), held(settings.out / HIDDEN) as token:
        runtime = settings.runtime
        limits = batch.WorkerLimits(
            runtime.deadline, runtime.memory, runtime.isolation == "child", runtime.stall
        )
        total = len(files.files)
        try:
            with interrupts.at_once("it looked at what is there"):
                recipe = recipe_of(job)
                quarantine = Quarantine(settings.out / QUARANTINE)
                items = missing(files, settings, recipe, quarantine, reporter, retry=retry)
            work = FileWork(settings, recipe, token, {item.model_id: item for item in items})
            with reporter.track("abstract", total, "meshes") as tracker:
                progress = _Progress(
                    tracker, reporter, interrupts, quarantine, total, total - len(items)
                )
                _do(work, ThreadExecutor(limits, jobs), progress)
            quarantine.rewrite()
        except InterruptedRunError as error:
            raise InterruptedRunError(f"{error}. {go_on}", error.exit_code) from None
        except ShardsFailedError as error:
            raise ShardsFailedError(f"{error}\n{go_on}") from None
        except OSError as error:
            if not is_storage(error):
                raise
            raise StorageError(f"{storage_message(error)}. {go_on}") from error
    fallen = [quarantine.entries[name] for name in files.files if name in quarantine.entries]
    done = [name for name in files.files if name not in quarantine.entries]
    return Summary(settings.out, done, fallen, runtime.max_failed)


def _do(work: FileWork, executor: batch.Executor, progress: _Progress) -> None:
    failures: list[batch.ShardFailed] = []
    in_a_row = 0
    progress.progress(0)
    try:
        for result in executor.map(work, list(work.items), progress):
            if isinstance(result, batch.ShardFailed):
                failures.append(result)
                in_a_row += 1
                if in_a_row >= HOPELESS:
                    raise batch.Unavailable(result.reason)
                continue
            in_a_row = 0
            (outcome,) = result.outcomes
            progress.settle(outcome, work.mark(outcome.model_id) if outcome.kind != "ok" else "")
    except batch.Unavailable as error:
        raise ShardsFailedError(f"abstract ends here: {error}") from None
    if failures:
        causes = "".join(f"\n  {item.shard}: {item.reason}" for item in failures[:FAILURES_TOLD])
        more = "\n  ..." if len(failures) > FAILURES_TOLD else ""
        raise ShardsFailedError(
            f"{len(failures)} meshes could not be seen to, for causes that are not theirs:"
            f"{causes}{more}"
        )


@dataclass(slots=True)
class _Progress(batch.Watcher):
    """Tells how far it is, and ends the work when asked to."""

    tracker: Tracker
    reporter: Reporter
    interrupts: Interrupts
    quarantine: Quarantine
    total: int
    before: int
    fallen: int = 0
    seen: int = 0
    begun: float = field(default_factory=time.monotonic)

    def __post_init__(self) -> None:
        self.seen = self.before

    def progress(self, models: int) -> None:
        self._tell_why()
        note = f"quarantined={self.fallen}" if self.fallen else ""
        self.tracker.update(self.seen, note)
        number = self.interrupts()
        if number is not None:
            raise InterruptedRunError(
                f"stopped; {self.seen} of {self.total} meshes, or a few more, are done",
                128 + number,
            )

    def _tell_why(self) -> None:
        """Why nothing happens at first."""
        if self.seen == self.before and time.monotonic() - self.begun > LOADING_SECONDS:
            self.begun = math.inf
            self.reporter.say(
                "still loading; after an installation, kernels are compiled once, for a minute"
            )

    def settle(self, outcome: batch.Outcome, mark: str) -> None:
        """Take a verdict."""
        self.seen += 1
        self.fallen += outcome.kind != "ok"
        self.quarantine.settle(outcome, mark)
        self.progress(0)


def _describe(folder: Path) -> str:
    """One result in a line."""
    abstraction = from_json((folder / RECORD).read_bytes())
    counts = f"{len(abstraction.positives)} positives, {len(abstraction.negatives)} negatives"
    wrong = faults(abstraction.check)
    verdict = f"; CHECK FAILED: {', '.join(wrong)}" if wrong else ""
    return f"{folder}: {counts}{_agreement(abstraction.metrics)}{verdict}"


def _agreement(metrics: Mapping[str, float | int]) -> str:
    """Exact volumes where the mesh is closed, else the finest grid; and the distances."""
    text = ""
    if "volume_iou" in metrics:
        text += f"; exact volume IoU {100 * metrics['volume_iou']:.1f} %"
    elif "iou_128" in metrics:
        text += f"; not closed, IoU at 128^3 {100 * metrics['iou_128']:.1f} %"
    if "coverage" in metrics:
        text += f", coverage {100 * metrics['coverage']:.1f} %"
    told = [
        f"{label} {metrics[name]:.3g}"
        for label, name in (("stands out", "out_99_units"), ("misses", "miss_99_units"))
        if name in metrics
    ]
    return text + (f"; {', '.join(told)} (99th percentile, input's units)" if told else "")
