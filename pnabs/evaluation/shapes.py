"""The shapes that results are measured against: of a run, a dataset, or mesh files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from pnabs import settings
from pnabs.dataset import catalogue
from pnabs.dataset.errors import SourceError
from pnabs.dataset.files import find_files
from pnabs.dataset.layouts import LAYOUTS, any_mesh
from pnabs.dataset.names import printable
from pnabs.dataset.source import Dataset
from pnabs.dataset.splits import hash_split, read_split
from pnabs.dataset.synsets import resolve_category
from pnabs.evaluation.items import FileShape, ShapePlace, StoredShape
from pnabs.settings import Layout, Settings
from pnabs.stages.errors import RefusedError, UsageError
from pnabs.stages.plan import VERSIONS
from pnabs.stages.progress import Reporter
from pnabs.stages.status import stored_context
from pnabs.store.atomic import digest
from pnabs.store.run import RunFolder

SHAPENET: tuple[Layout, ...] = ("shapenet-v2", "shapenet-v1")
"""Layouts that are known by the names of their files."""


@dataclass(frozen=True, slots=True)
class ShapeEntry:
    """One shape.

    Attributes
    ----------
    split
        `train`, `val`, `test`, or `none`.
    mark
        Tells it from all others, and changes when it does.
    """

    category: str
    model_id: str
    split: str
    place: ShapePlace
    mark: str

    @property
    def label(self) -> str:
        """Category and id."""
        return f"{self.category}/{self.model_id}" if self.category else self.model_id


@dataclass(frozen=True, slots=True)
class Shapes:
    """The shapes of an evaluation.

    Attributes
    ----------
    entries
        By category and id.
    others
        Category and id of those that were left out by a choice.
    run
        The settings of the run that stored them; None where they are meshes.
    layout
        That a mesh's conventions follow.
    single
        Whether one mesh file was named.
    root
        What must be there to work with them.
    """

    entries: list[ShapeEntry]
    run: Settings | None
    layout: Layout
    single: bool
    root: str
    others: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Choice:
    """Which shapes to take, and how they lie.

    Attributes
    ----------
    layout
        Of a dataset; None finds out, and takes a folder without one as mesh files.
    split
        `hash`, or a csv in the form of ShapeNet's all.csv; None leaves it at the run's own, and at
        `hash` elsewhere.
    only
        Models of this split alone.
    categories
        These alone, by folder name or alias; all when empty.
    """

    layout: Layout | None = None
    split: Path | str | None = None
    only: str | None = None
    categories: tuple[str, ...] = ()


def find_shapes(given: Path | str, choice: Choice, without: Path) -> Shapes:
    """List the shapes in a path.

    Parameters
    ----------
    given
        A run folder, a dataset's folder, zip file or `s3://` URL, a folder of meshes, or a mesh.
    choice
    without
        Folder whose files are no shapes: that of the evaluation.

    Raises
    ------
    UsageError, pnabs.dataset.errors.DatasetError
        When there are none, or they can't be listed.
    """
    if isinstance(given, Path) and (given / "run.json").is_file():
        found = _of_run(given, choice)
    elif (layout := choice.layout or _layout(given)) is not None:
        found = _of_dataset(given, layout, choice)
    else:
        found = _of_files(Path(given), choice, without)
    entries = found.entries
    if choice.categories:
        available = sorted({entry.category for entry in entries})
        names = {resolve_category(name, available) for name in choice.categories}
        entries = [entry for entry in entries if entry.category in names]
    if choice.only is not None:
        splits = sorted({entry.split for entry in entries})
        entries = [entry for entry in entries if entry.split == choice.only]
        if not entries:
            raise UsageError(
                f"--only {choice.only}: no shape in {given} has that split; there are "
                f"{', '.join(splits)}"
            )
    if not entries:
        raise UsageError(f"there are no shapes in {given}")
    taken = {(entry.category, entry.model_id) for entry in entries}
    names_of = ((entry.category, entry.model_id) for entry in found.entries)
    others = tuple(name for name in names_of if name not in taken)
    return replace(found, entries=entries, others=others)


def _layout(given: Path | str) -> Layout | None:
    """The layout of a dataset by the names in it; None where it is but files."""
    if isinstance(given, Path) and given.is_file() and given.suffix.lower() != ".zip":
        return None
    if isinstance(given, Path) and not given.exists():
        return None
    dataset = Dataset(given)
    for name in SHAPENET:
        layout = LAYOUTS[name]
        try:
            if any_mesh(layout, dataset, layout.top(dataset)):
                return name
        except SourceError:
            continue
    return "folder" if dataset.is_archive or isinstance(given, str) else None


def _of_dataset(given: Path | str, layout: Layout, choice: Choice) -> Shapes:
    root = given.absolute() if isinstance(given, Path) else given
    split = "hash" if choice.split in (None, "hash") else Path(str(choice.split)).absolute()
    job = settings.Dataset(root=root, layout=layout, split=split)
    entries = [
        _file_entry(row["category"], row["model_id"], row["split"], FileShape(
            str(root), row["source"], PurePosixPath(row["source"].rpartition("!")[2]).suffix,
            row["reason"],
        ), [row["size"], row["mtime_ns"]])
        for row in catalogue.scan(job, Path.cwd()).to_pylist()
    ]  # fmt: skip
    return Shapes(entries, None, layout, False, str(root))


def _of_files(given: Path, choice: Choice, without: Path) -> Shapes:
    files = find_files([given], without)
    splits = None if choice.split in (None, "hash") else read_split(Path(str(choice.split)))
    entries = []
    for model_id, file in files.files.items():
        category, _, name = model_id.rpartition("/")
        if splits is None:
            split: str = hash_split(model_id, 1 / 3, 0.0)
        else:
            split = splits.get((category, name), "none")
        # A name that isn't UTF-8 comes with a reason, and is only shown.
        place = FileShape(str(file.root), printable(file.source), file.suffix, file.reason)
        status: list[object] = []
        if not file.reason:
            try:
                status = [*Dataset(file.root).stat(file.source)]
            except SourceError as error:
                status = [str(error)]
        entries.append(_file_entry("", model_id, split, place, status))
    return Shapes(entries, None, "folder", given.is_file(), str(files.root))


def _file_entry(
    category: str, model_id: str, split: str, place: FileShape, status: Sequence[object]
) -> ShapeEntry:
    mark = digest([place.root, place.source, place.suffix, place.reason, list(status)])
    return ShapeEntry(category, model_id, split, place, mark)


def _of_run(given: Path, choice: Choice) -> Shapes:
    if choice.split is not None or choice.layout is not None:
        option = "--split" if choice.split is not None else "--layout"
        raise UsageError(f"{option}: {given} is a run, which has its own")
    run = RunFolder(given.absolute())
    context = stored_context(run, Reporter(quiet=True))
    _check_version(run)
    entries = list(_stored(run, context.catalogue.to_pylist()))
    if not entries:
        raise UsageError(f"the run {given} has ingested nothing yet")
    return Shapes(entries, context.job, context.job.dataset.layout, False, str(run.root))


def _check_version(run: RunFolder) -> None:
    """Refuse a run whose shapes hold something else than this program's."""
    then = (run.read_identity() or {}).get("stage_versions", {}).get("ingest")
    if then != VERSIONS["ingest"]:
        raise RefusedError(
            f"the run {run.root} was ingested by another pnabs (stage version {then}, this one's "
            f"is {VERSIONS['ingest']}): run its job with --accept-changes, or give its dataset"
        )


def _stored(run: RunFolder, rows: Sequence[dict[str, object]]) -> Iterator[ShapeEntry]:
    """The models of shards that are ingested, with those that fell out."""
    index = run.ledger.index("ingest")
    for row in rows:
        shard, position = str(row["shard"]), int(str(row["row"]))
        entry = index.get(shard)
        if entry is None:
            continue
        fallen = dict(entry.fallen)
        model_id = str(row["model_id"])
        reason = f"ingest: {fallen[model_id]}" if model_id in fallen else ""
        mark = digest([str(run.root), shard, position, entry.digest, reason])
        place = StoredShape(shard, position, reason)
        yield ShapeEntry(str(row["category"]), model_id, str(row["split"]), place, mark)
