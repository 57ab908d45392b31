"""Somebody's results: what there is of them, and what each is known by."""

from __future__ import annotations

import os
import posixpath
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from pnabs.dataset.errors import DatasetError, SourceError
from pnabs.dataset.layouts import MESH_SUFFIXES
from pnabs.dataset.names import is_hidden, printable
from pnabs.dataset.source import Dataset
from pnabs.evaluation.boxes import read_boxes
from pnabs.evaluation.items import AbstractionFile, MeshFiles, ResultPlace
from pnabs.evaluation.matching import Key, Matched, ShapeIndex, as_path, match
from pnabs.formats import STEM
from pnabs.stages.errors import UsageError
from pnabs.store.atomic import digest

RECORD = f"{STEM}.json"
TABLES = (".csv", ".npz")


@dataclass(frozen=True, slots=True)
class Found:
    """One result.

    Attributes
    ----------
    place
        Where it lies.
    mark
        Changes when it does.
    label
        How messages name it.
    """

    place: ResultPlace
    mark: str
    label: str


@dataclass(frozen=True, slots=True)
class Results:
    """A set of results, by the shapes that they belong to.

    Attributes
    ----------
    name
        Of the set.
    of_shape
        Number of a shape -> its result.
    without
        Labels of the results that belong to no shape.
    """

    name: str
    of_shape: dict[int, Found]
    without: list[str]


def find_results(given: Path, name: str, index: ShapeIndex, single: bool, without: Path) -> Results:
    """What a path holds of results, and the shapes that they are of.

    Parameters
    ----------
    given
        A folder or zip file of results, a run folder, a mesh, an abstraction.json, or a table of
        boxes.
    name
        What the set is called.
    index
        The shapes.
    single
        The shape was named as a file, so a lone result is its result, whatever it is called.
    without
        Folder whose files are no results: that of the evaluation.

    Raises
    ------
    UsageError
        When there is nothing, it can't be read, or it isn't clear what belongs where.
    """
    listed = _listed(given, without)
    keys, found = [key for key, _ in listed], [one for _, one in listed]
    paired = Matched({0: [0]}, []) if single and len(found) == 1 else None
    matched = paired or match(index, keys, name)
    return Results(
        name,
        {
            shape: _joined([found[i] for i in numbers])
            for shape, numbers in matched.of_shape.items()
        },
        [keys[i].label for i in matched.without],
    )


def _joined(found: Sequence[Found]) -> Found:
    """A result, or the parts of one together."""
    if len(found) == 1:
        return found[0]
    places = [one.place for one in found]
    if not all(isinstance(place, MeshFiles) for place in places):
        raise UsageError(f"{found[0].label} and {found[1].label} are results of one shape")
    meshes = [place for place in places if isinstance(place, MeshFiles)]
    sources = tuple(source for place in meshes for source in place.sources)
    mark = digest([one.mark for one in found])
    return Found(MeshFiles(meshes[0].root, sources), mark, posixpath.dirname(found[0].label))


def _listed(given: Path, without: Path) -> list[tuple[Key, Found]]:
    """All results in a path with what they are known by, sorted."""
    if not given.exists():
        raise UsageError(f"there are no results {given}")
    suffix = given.suffix.lower()
    if given.is_file() and suffix in TABLES:
        return [
            (
                Key(as_path(category, model_id), "/".join(as_path(category, model_id))),
                Found(boxes, digest([boxes.positives, boxes.negatives, boxes.reason]), model_id),
            )
            for (category, model_id), boxes in read_boxes(given).items()
        ]
    if given.is_file() and suffix != ".zip":
        return [_of_file(given)]
    folder = _variant(given) if given.is_dir() else given
    try:
        return list(_of_folder(folder, os.path.realpath(without)))
    except (SourceError, DatasetError) as error:
        raise UsageError(f"the results {given} can't be listed: {error}") from None


def _variant(given: Path) -> Path:
    """The main variant of a run folder; any other folder itself."""
    if not (given / "run.json").is_file():
        return given
    main = given / "variants" / "main"
    if not main.is_dir():
        raise UsageError(f"the run {given} has no results yet: there is no {main}")
    return main


def _of_file(path: Path) -> tuple[Key, Found]:
    known = (*MESH_SUFFIXES, *TABLES)
    dataset = Dataset(path.parent)
    if path.suffix.lower() == ".json":
        place: ResultPlace = AbstractionFile(str(dataset.root), path.name)
    elif path.suffix.lower() in MESH_SUFFIXES:
        place = MeshFiles(str(dataset.root), (path.name,))
    else:
        raise UsageError(
            f"{path} holds no results that can be read: known are folders and files "
            f"{', '.join((*known, '.json'))}"
        )
    # A file that is named by its format alone is known by its folder.
    trailing = int(path.stem == STEM)
    key = Key((path.stem,), path.name, trailing, path.absolute().parent.name)
    return key, Found(place, _mark(dataset, path.name), path.name)


def _of_folder(folder: Path, without: str) -> Iterator[tuple[Key, Found]]:
    dataset = Dataset(folder)
    root = str(dataset.root)
    sources = sorted(_files(dataset, without))
    records = [source for source in sources if _name(source) == RECORD]
    for source in records or _meshes(sources):
        inside = source.rpartition("!")[2]
        stem = posixpath.splitext(inside)[0]
        label = printable(inside)
        path = tuple(stem.split("/"))
        trailing = int(bool(records) or path[-1] == STEM)
        place = AbstractionFile(root, source) if records else MeshFiles(root, (source,))
        key = Key(path, label, trailing, dataset.root.name)
        yield key, Found(place, _mark(dataset, source), label)
    if not records and not any(_is_mesh(source) for source in sources):
        raise UsageError(
            f"there are no results in {folder}: neither {RECORD} nor a mesh "
            f"({', '.join(MESH_SUFFIXES)}), at any depth"
        )


def _files(dataset: Dataset, without: str) -> Iterator[str]:
    """Sources of records and meshes, at any depth; hidden and linked folders aren't entered."""
    pending = [dataset.top]
    while pending:
        place = pending.pop()
        if not dataset.is_archive and os.path.realpath(Path(str(dataset.root), place)) == without:
            continue
        for entry in dataset.list(place):
            if is_hidden(entry.name) or printable(entry.name) != entry.name:
                continue
            if entry.is_folder and not entry.is_link:
                pending.append(f"{place}{entry.name}/")
            elif not entry.is_folder and (entry.name == RECORD or _is_mesh(entry.name)):
                yield place + entry.name


def _meshes(sources: Sequence[str]) -> Iterator[str]:
    """One file of those that are the same in several formats; none that follows from another."""
    whole = {posixpath.dirname(source) for source in sources if _stem(source) == STEM}
    taken: dict[str, str] = {}
    for source in filter(_is_mesh, sources):
        folder = posixpath.dirname(source)
        derived = _name(source).startswith(f"{STEM}.") and _stem(source) != STEM
        beside = folder if derived else posixpath.dirname(folder)
        convex = posixpath.basename(folder).startswith(f"{STEM}.")
        if (derived or convex) and beside in whole:
            continue
        stem = posixpath.splitext(source)[0]
        if stem not in taken or _preference(source) < _preference(taken[stem]):
            taken[stem] = source
    yield from taken.values()


def _name(source: str) -> str:
    return posixpath.basename(source.rpartition("!")[2])


def _stem(source: str) -> str:
    return posixpath.splitext(_name(source))[0]


def _is_mesh(source: str) -> bool:
    return posixpath.splitext(source)[1].lower() in MESH_SUFFIXES


def _preference(source: str) -> int:
    return MESH_SUFFIXES.index(posixpath.splitext(source)[1].lower())


def _mark(dataset: Dataset, source: str) -> str:
    """Size and time of a file, and of all that lies beside a .gltf, which may be made of it."""
    names = [source]
    if source.lower().endswith(".gltf"):
        cut = max(source.rfind("/"), source.rfind("!")) + 1
        inside = source[:cut]
        names += sorted(inside + e.name for e in dataset.list(inside) if not e.is_folder)
    marks = []
    for name in names:
        try:
            marks.append([name, *dataset.stat(name)])
        except SourceError as error:
            marks.append([name, str(error)])
    return digest([str(dataset.root), marks])
