"""How models lie below a dataset's root.

A layout tells where the categories begin and lists a category's models; folders
and archives look alike to it.  A category is a folder, or a zip file of the
category's name (`02691156.zip` holding `02691156/<id>/...`); where both are
there the folder is taken.  Hidden names (`.git`, `__MACOSX`) are no models.

A new layout is a class with `top` and `models` and a line in `LAYOUTS` (and its
name in `pnabs.settings.Layout`).
"""

from __future__ import annotations

import posixpath
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple, Protocol

from pnabs.dataset.errors import DatasetError, SourceError
from pnabs.dataset.names import is_hidden
from pnabs.dataset.source import Dataset, Entry

MESH_SUFFIXES = (".obj", ".off", ".ply", ".stl", ".glb", ".gltf")
"""Suffixes that the plain folder layout takes for meshes, the preferred first."""

_PROBES = 100


class Model(NamedTuple):
    """A model as a layout finds it, before anything of it is read."""

    model_id: str
    source: str


class Layout(Protocol):
    """How models lie below a root."""

    def top(self, dataset: Dataset) -> str:
        """Place whose entries are the categories."""

    def models(self, dataset: Dataset, place: str) -> Iterator[Model]:
        """Models of a category's place, in no particular order, whether or not readable.

        Raises
        ------
        SourceError
            If the place can't be listed.
        """


@dataclass(frozen=True)
class ShapeNet:
    """`<synset>/<id>/<mesh>`, as ShapeNetCore is handed out, with or without a top folder."""

    mesh: str
    """The mesh, relative to the model's folder."""

    def top(self, dataset: Dataset) -> str:
        place = dataset.top
        while not any_mesh(self, dataset, place):
            inner = [e.name for e in _visible(dataset, place) if e.is_folder and not e.is_link]
            if len(inner) != 1:
                return dataset.top
            place = f"{place}{inner[0]}/"
        return place

    def models(self, dataset: Dataset, place: str) -> Iterator[Model]:
        for entry in _visible(dataset, place):
            if entry.is_folder:
                yield Model(entry.name, f"{place}{entry.name}/{self.mesh}")


class Folder:
    """`<category>/**/*.{obj,off,ply,stl,glb,gltf}`, any depth.

    A model's id is its path below the category without the suffix.  Of files that differ only
    in the suffix, the first in the order of `MESH_SUFFIXES` has that id, the others keep their
    suffix in theirs.  Linked folders are not entered; they are listed as a model that can't be
    read.  Files beside the categories belong to none.  In a zip file, a single top folder of
    the archive's own name is no category.
    """

    def top(self, dataset: Dataset) -> str:
        place = dataset.top
        if dataset.is_archive:
            names = [entry.name for entry in _visible(dataset, place)]
            if names == [dataset.root.stem]:
                return f"{place}{names[0]}/"
        return place

    def models(self, dataset: Dataset, place: str) -> Iterator[Model]:
        stems: dict[str, list[str]] = defaultdict(list)
        for path in self.paths(dataset, place):
            stem, suffix = posixpath.splitext(path)
            stems[stem if suffix.lower() in MESH_SUFFIXES else path].append(path)
        taken = set(stems)
        for stem, paths in sorted(stems.items()):
            paths.sort(key=_preference)
            for number, path in enumerate(paths):
                model_id = stem if number == 0 else path
                while number and model_id in taken:
                    model_id += "~"
                taken.add(model_id)
                yield Model(model_id, place + path)

    def paths(self, dataset: Dataset, place: str) -> Iterator[str]:
        """Paths of meshes below a place, and of folders that can't be entered."""
        pending = [""]
        while pending:
            below = pending.pop()
            try:
                entries = _visible(dataset, place + below)
            except SourceError:
                if not below:
                    raise
                yield below.rstrip("/")
                continue
            for entry in entries:
                if entry.is_folder and not entry.is_link:
                    pending.append(f"{below}{entry.name}/")
                elif entry.is_folder or _is_mesh(entry.name):
                    yield below + entry.name


LAYOUTS: dict[str, Layout] = {
    "shapenet-v1": ShapeNet("model.obj"),
    "shapenet-v2": ShapeNet("models/model_normalized.obj"),
    "folder": Folder(),
}


def find_categories(dataset: Dataset, top: str) -> dict[str, str]:
    """Categories in a place: name -> place of the category (of an archive, its outside)."""
    folders, archives = {}, {}
    for entry in _visible(dataset, top):
        stem, suffix = posixpath.splitext(entry.name)
        if entry.name in ("", ".", ".."):
            continue
        if entry.is_folder:
            folders[entry.name] = f"{top}{entry.name}/"
        elif suffix.lower() == ".zip" and not dataset.is_archive and not is_hidden(stem):
            archives[stem] = f"{top}{entry.name}!"
    return archives | folders


def enter(dataset: Dataset, place: str, category: str) -> str:
    """Place where a category's models lie: inside its archive, and the top folders there.

    Raises
    ------
    SourceError
        If the archive can't be opened.
    """
    inside = place
    while place.endswith("!"):
        inner = [entry.name for entry in _visible(dataset, inside) if entry.is_folder]
        if category in inner:
            return f"{inside}{category}/"
        if len(inner) != 1:
            return place
        inside = f"{inside}{inner[0]}/"
    return place


def any_mesh(layout: Layout, dataset: Dataset, top: str) -> bool:
    """Whether the layout fits: a category in this place has a mesh among its first models."""
    for category, place in find_categories(dataset, top).items():
        try:
            for model in islice(layout.models(dataset, enter(dataset, place, category)), _PROBES):
                if _has_mesh(dataset, model.source):
                    return True
        except SourceError:
            continue
    return False


def no_models(dataset: Dataset, layout_name: str, why: str = "") -> DatasetError:
    """The error for a root where a layout finds nothing, with the layout that would."""
    layout = LAYOUTS[layout_name]
    looked_for = (
        f"<synset>/<id>/{layout.mesh}"
        if isinstance(layout, ShapeNet)
        else "<category>/**/*{" + ",".join(MESH_SUFFIXES) + "}"
    )
    found = sorted(entry.name for entry in _visible(dataset, dataset.top))
    listing = ", ".join(found[:8]) + (f" and {len(found) - 8} more" if len(found) > 8 else "")
    hint = next(
        (
            f"; this looks like {name}: use layout: {name}"
            for name, other in LAYOUTS.items()
            if name != layout_name and any_mesh(other, dataset, other.top(dataset))
        ),
        "",
    )
    return DatasetError(
        f"no models in {dataset.root}: layout {layout_name} looks for {looked_for}, "
        f"and there is {listing or 'nothing'}{hint or (why and f' ({why})')}"
    )


def _visible(dataset: Dataset, place: str) -> list[Entry]:
    return [entry for entry in dataset.list(place) if not is_hidden(entry.name)]


def _is_mesh(name: str) -> bool:
    return posixpath.splitext(name)[1].lower() in MESH_SUFFIXES


def _has_mesh(dataset: Dataset, source: str) -> bool:
    try:
        dataset.stat(source)
    except SourceError:
        return False
    return True


def _preference(path: str) -> tuple[int, str]:
    suffix = posixpath.splitext(path)[1].lower()
    return (MESH_SUFFIXES.index(suffix) if suffix in MESH_SUFFIXES else -1, path)
