"""`pnabs abstract`: mesh files to abstractions, without a dataset, training or Ray.

A mesh is done when its `abstraction.json` says that it was made from these bytes with
these settings; so the command goes on where it was stopped, and files may come, go and
change between two times.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pnabs
from pnabs import batch
from pnabs.batch.thread_executor import ThreadExecutor
from pnabs.batch.work import Committed
from pnabs.dataset.errors import SourceError
from pnabs.dataset.files import File, Files
from pnabs.dataset.source import Dataset
from pnabs.formats import FORMATS, STEM, Abstraction, FormatError, from_json, written
from pnabs.pipeline import Abstractor
from pnabs.settings import Settings
from pnabs.stages.errors import (
    InterruptedRunError,
    ShardsFailedError,
    StorageError,
    is_storage,
    storage_message,
)
from pnabs.stages.folder import held
from pnabs.stages.head_start import PRELOAD
from pnabs.stages.identity import given_weights
from pnabs.stages.interrupts import Interrupts
from pnabs.stages.job import Job, JobError, check_weights, with_overrides
from pnabs.stages.plan import fingerprint, recipe_digest
from pnabs.stages.progress import Reporter, Tracker
from pnabs.stages.reach import check_dataset, check_run
from pnabs.stages.reading import blamed, read_mesh
from pnabs.stages.writing import clear_partials, write_files
from pnabs.store.atomic import write_atomic

RECORD = f"{STEM}.json"
"""The file that says that a mesh is done, written last; all other formats follow from it."""

HIDDEN = ".pnabs"
"""Folder of the lock, below the results; no mesh below a hidden folder is ever taken."""

QUARANTINE = "quarantine.jsonl"

HOPELESS = 4
"""So many meshes in a row that could not be seen to, for causes not theirs, end the work."""

SETTABLE = ("ingest", "difference", "abstract", "runtime")
"""Groups of settings that the command takes."""

RESULTS_TOLD = 20
FAILURES_TOLD = 20
"""Results and failures that a message tells one by one."""


@dataclass(frozen=True, slots=True)
class Item:
    """A mesh to be seen to.

    Attributes
    ----------
    known
        Its `abstraction.json`, where that is of this mesh and these settings.
    formats
        Those to be written; of a mesh that isn't known, all.
    """

    model_id: str
    file: File
    known: bytes | None
    formats: tuple[str, ...]


@dataclass(slots=True)
class FileTask:
    """One mesh, in the isolated child: from its file to the files of its abstraction."""

    job: Settings
    recipe: str
    _abstractor: Abstractor | None = field(default=None, repr=False)

    def __call__(self, item: Item) -> dict[str, bytes]:
        """File name -> content, the record last."""
        if item.known is not None:
            return written(from_json(item.known), item.formats)
        abstraction = self._abstract(item)
        files = written(abstraction, [name for name in item.formats if name != "json"])
        return files | written(abstraction, ["json"])

    def _abstract(self, item: Item) -> Abstraction:
        file = item.file
        if file.reason:
            raise batch.InvalidInput(f"{file.source}: {file.reason}")
        with blamed(file.root, file.source):
            read = read_mesh(file.root, file.source, self.job.ingest.limits, file.suffix)
            provenance: dict[str, Any] = {
                "pnabs": pnabs.__version__,
                "seed": self.job.seed,
                "source_sha256": read.sha256,
                "fingerprint": _fingerprint(self.recipe, read.sha256, read.siblings),
            }
            if read.siblings:
                provenance["siblings"] = sorted(read.siblings)
            return self._loaded()(
                read.mesh, category="", model_id=item.model_id, provenance=provenance
            )

    def _loaded(self) -> Abstractor:
        """The networks; what is wrong with them is no mesh's fault."""
        if self._abstractor is None:
            try:
                self._abstractor = Abstractor(self.job)
            except Exception as error:
                text = f"the networks can't be loaded: {error}"
                raise batch.Unavailable(text) from error
        return self._abstractor


@dataclass
class FileWork:
    """Meshes to results, each a shard of its own."""

    job: Settings
    recipe: str
    token: str
    items: dict[str, Item]
    preload: tuple[str, ...] = PRELOAD

    @property
    def task(self) -> FileTask:
        """What the child runs."""
        return FileTask(self.job, self.recipe)

    def check(self) -> None:
        """See the meshes' and the results' folder."""
        check_dataset(self.job.dataset.root)
        check_run(self.job.out / HIDDEN, self.token)

    def mark(self, model_id: str) -> str:
        """What the verdict on a mesh depends on."""
        return _mark(self.job, self.recipe, self.items[model_id].file, ())

    def setup(self) -> None:
        """Nothing: all work is the child's."""

    def payloads(self, shard: str) -> Iterable[tuple[str, Item]]:
        """The one mesh."""
        yield shard, self.items[shard]

    def commit(self, shard: str, outcomes: Sequence[batch.Outcome]) -> Committed:
        """Write the results of the one mesh; of one that fell out, remove what is there."""
        (outcome,) = outcomes
        folder, item = self.job.out / shard, self.items[shard]
        if outcome.kind == "ok" and item.known is not None:
            clear_partials(folder)
            for name, data in outcome.value.items():
                write_atomic(folder / name, data)
        elif outcome.kind == "ok" or folder.is_dir():
            write_files(folder, outcome.value or {})
        return Committed({}, {})


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
) -> Job:
    """The settings of the command as a job.

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
    job = with_overrides(job, overrides)
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
    check_weights(job)
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
                recipe = _recipe(job)
                quarantine = _Quarantine(settings.out / QUARANTINE)
                items = _missing(files, settings, recipe, quarantine, reporter, retry=retry)
            work = FileWork(settings, recipe, token, {item.model_id: item for item in items})
            with reporter.track("abstract", total, "meshes") as tracker:
                progress = _Progress(tracker, interrupts, quarantine, total, total - len(items))
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
    interrupts: Interrupts
    quarantine: _Quarantine
    total: int
    seen: int
    fallen: int = 0

    def progress(self, models: int) -> None:
        note = f"quarantined={self.fallen}" if self.fallen else ""
        self.tracker.update(self.seen, note)
        number = self.interrupts()
        if number is not None:
            raise InterruptedRunError(
                f"stopped; {self.seen} of {self.total} meshes, or a few more, are done",
                128 + number,
            )

    def settle(self, outcome: batch.Outcome, mark: str) -> None:
        """Take a verdict."""
        self.seen += 1
        self.fallen += outcome.kind != "ok"
        self.quarantine.settle(outcome, mark)
        self.progress(0)


class _Quarantine:
    """The list of meshes that fell out: a line each, written at once."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.entries: dict[str, dict[str, Any]] = {}
        for line in path.read_text().splitlines() if path.exists() else ():
            try:
                entry = json.loads(line)
                self.entries[entry["model_id"]] = entry
            except (ValueError, KeyError, TypeError):
                continue  # cut short by a kill

    def settle(self, outcome: batch.Outcome, mark: str) -> None:
        """Take a verdict; `mark` tells when it no longer holds."""
        if outcome.kind == "ok":
            self.entries.pop(outcome.model_id, None)
            return
        entry = {
            "model_id": outcome.model_id,
            "kind": outcome.kind,
            "reason": outcome.reason,
            "attempts": outcome.attempts,
            "traceback": outcome.traceback,
            "fingerprint": mark,
        }
        self.entries[outcome.model_id] = entry
        with self._path.open("a") as stream:
            stream.write(f"\n{json.dumps(entry)}\n")
            stream.flush()
            os.fsync(stream.fileno())

    def rewrite(self) -> None:
        """One line each, by id; no file when nothing fell out."""
        if self.entries:
            lines = (json.dumps(self.entries[name]) + "\n" for name in sorted(self.entries))
            write_atomic(self._path, "".join(lines).encode())
        else:
            self._path.unlink(missing_ok=True)


def _describe(folder: Path) -> str:
    """One result in a line."""
    abstraction = from_json((folder / RECORD).read_bytes())
    counts = f"{len(abstraction.positives)} positives, {len(abstraction.negatives)} negatives"
    verdict = "" if abstraction.check["ok"] else ", FAILED its check"
    iou = abstraction.metrics.get("iou_64")
    figure = "" if iou is None else f", IoU at 64^3 {100 * iou:.1f} %"
    return f"{folder}: {counts}{figure}{verdict}"


def _recipe(job: Job) -> str:
    """What results depend on beside the mesh; not on formats, which follow from the record."""
    settings = job.settings
    plain = settings.model_copy(
        update={"abstract": settings.abstract.model_copy(update={"formats": ("json",)})}
    )
    return fingerprint(recipe_digest("abstract", plain), given_weights(job))


def _missing(
    files: Files,
    settings: Settings,
    recipe: str,
    quarantine: _Quarantine,
    reporter: Reporter,
    *,
    retry: bool,
) -> list[Item]:
    """The meshes with something to be done."""
    formats = settings.abstract.formats
    items, changed = [], []
    for model_id, file in files.files.items():
        folder = settings.out / model_id
        record, before = _read(folder / RECORD), quarantine.entries.get(model_id)
        item = Item(model_id, file, None, formats)
        known = None if record is None else _provenance(record)
        if known is None and (before is None or retry):
            items.append(item)
            continue
        mark = _mark(settings, recipe, file, (known or {}).get("siblings", ()))
        if known is not None and known.get("fingerprint") == mark:
            quarantine.entries.pop(model_id, None)
            lacking = tuple(
                name for name in formats if not (folder / f"{STEM}{FORMATS[name].suffix}").exists()
            )
            if lacking:
                items.append(Item(model_id, file, record, lacking))
        # What a .gltf that fell out names may be there by now.
        elif before is None or retry or before.get("fingerprint") != mark or file.suffix == ".gltf":
            items.append(item)
            changed += [model_id] if known is not None else []
    if changed:
        reporter.say(
            f"{len(changed)} results, such as {changed[0]}, are of other settings or of a mesh "
            "that has changed: they are made again"
        )
    return items


def _mark(settings: Settings, recipe: str, file: File, siblings: Iterable[str]) -> str:
    """What the result of a file depends on, as it is now."""
    most = settings.ingest.limits.max_bytes
    dataset = Dataset(file.root)
    digests = {}
    try:
        own = _sha256(dataset.read(file.source, most))
        read = dataset.sibling_reader(file.source, most)
        digests = {name: _sha256(read(name)) for name in siblings}
    except SourceError:
        own = ""
    return _fingerprint(recipe, own, digests)


def _fingerprint(recipe: str, sha256: str, siblings: Mapping[str, str]) -> str:
    return fingerprint(recipe, {"mesh": sha256, "siblings": dict(siblings)})


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _provenance(record: bytes) -> dict[str, Any] | None:
    """What a record says of its making; None where it is damaged."""
    try:
        return from_json(record).provenance
    except FormatError:
        return None


def _read(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        return None
