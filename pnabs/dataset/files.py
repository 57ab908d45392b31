"""Meshes given one by one or by folder, without any layout."""

from __future__ import annotations

import os
import posixpath
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pnabs.dataset.errors import DatasetError
from pnabs.dataset.layouts import MESH_SUFFIXES, Folder
from pnabs.dataset.names import printable, unsafe_model_id
from pnabs.dataset.source import Dataset


@dataclass(frozen=True, slots=True)
class Files:
    """Meshes below one root.

    Attributes
    ----------
    root
        The deepest folder that holds all that was given.
    sources
        Model id -> path below the root, sorted.  The id is that path without its suffix.
    """

    root: Path
    sources: dict[str, str]


def find_files(given: Sequence[Path], without: Path) -> Files:
    """The meshes that were named, and those in the folders that were named, at any depth.

    Parameters
    ----------
    given
        Mesh files and folders.
    without
        Where results go: what lies there is no input.

    Raises
    ------
    DatasetError
        When something isn't there or is no mesh, when there is no mesh at all, or when two would
        have one id.
    """
    paths = [Path(os.path.abspath(path)) for path in given]
    for path in paths:
        if not path.exists():
            raise DatasetError(f"there is no {path}")
        if path.is_file() and path.suffix.lower() not in MESH_SUFFIXES:
            known = ", ".join(MESH_SUFFIXES)
            raise DatasetError(f"{path} is no mesh that can be read: known are {known}")
    folders = [path if path.is_dir() else path.parent for path in paths]
    root = Path(os.path.commonpath(folders))
    dataset = Dataset(root)
    excluded = os.path.relpath(os.path.abspath(without), root).replace(os.sep, "/") + "/"
    found: set[str] = set()
    for path in paths:
        below = "" if path == root else path.relative_to(root).as_posix()
        if path.is_file():
            found.add(below)
        else:
            place = f"{below}/" if below else ""
            found.update(place + one for one in Folder().paths(dataset, place))
    sources: dict[str, str] = {}
    for source in sorted(found):
        if source.startswith(excluded):
            continue
        model_id, suffix = posixpath.splitext(source)
        if suffix.lower() not in MESH_SUFFIXES:
            continue  # a linked folder
        reason = unsafe_model_id(model_id)
        if reason:
            raise DatasetError(f"{root}/{printable(source)} can't be taken: {reason}")
        other = sources.setdefault(model_id, source)
        if other != source:
            raise DatasetError(
                f"{root}/{other} and {root}/{source} would both be {model_id} in the results: "
                "name just one of them, or rename one"
            )
    if not sources:
        raise DatasetError(f"there is no mesh in {', '.join(str(path) for path in given)}")
    return Files(root, sources)
