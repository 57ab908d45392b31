"""Meshes given one by one or by folder, without any layout."""

from __future__ import annotations

import os
import posixpath
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pnabs.dataset.errors import DatasetError
from pnabs.dataset.layouts import MESH_SUFFIXES, Folder
from pnabs.dataset.names import safe_model_id, unsafe_model_id
from pnabs.dataset.source import Dataset

RESULT = re.compile(r"(.*/)?abstraction\.(parts\.)?(glb|obj|ply|stl)|(.*/)?abstraction\.convex/.*")
"""What this program writes, and could take for a mesh."""


@dataclass(frozen=True, slots=True)
class File:
    """A mesh file.

    Attributes
    ----------
    root, source
        Folder that nothing outside of is read, and the file's path below it.
    suffix
        That of the name it was given by.
    reason
        Why it can't be taken; empty when it can.
    """

    root: Path
    source: str
    suffix: str
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Files:
    """Meshes below one root.

    Attributes
    ----------
    root
        The deepest folder that holds all that was given.
    files
        Model id -> file, sorted.  The id is its path below the root without the suffix.
    """

    root: Path
    files: dict[str, File]


def find_files(given: Sequence[Path], without: Path) -> Files:
    """The meshes that were named, and those in the folders that were named, at any depth.

    Links that were named are followed; those in folders only where they stay inside the root.

    Parameters
    ----------
    given
        Mesh files and folders.
    without
        Where results go: what lies there is no input, unless it is where meshes were named.

    Raises
    ------
    DatasetError
        When something isn't there or is no mesh, when there is no mesh at all, or when two would
        have one id.
    """
    paths = [Path(os.path.abspath(path)) for path in given]
    for path in paths:
        _check(path)
    folders = [path if path.is_dir() else path.parent for path in paths]
    root = Path(os.path.commonpath(folders))
    results = os.path.realpath(without)
    dataset = Dataset(root)
    found: dict[str, File] = {}
    for path in paths:
        below = "" if path == root else path.relative_to(root).as_posix()
        if path.is_file():
            found[below] = _named(root, path, below)
            continue
        place = f"{below}/" if below else ""
        for source in (place + one for one in Folder().paths(dataset, place)):
            if not _is_result(root, source, results):
                found.setdefault(source, _listed(root, source))
    files: dict[str, File] = {}
    for source, given_file in sorted(found.items()):
        model_id, file = _under_its_id(source, given_file)
        other = files.setdefault(model_id, file)
        if other is not file:
            raise DatasetError(
                f"{other.root / other.source} and {root / source} would both be {model_id} in the "
                "results: name just one of them, or rename one"
            )
    if not files:
        raise DatasetError(f"there is no mesh in {', '.join(str(path) for path in given)}")
    return Files(root, files)


def _check(path: Path) -> None:
    known = ", ".join(MESH_SUFFIXES)
    try:
        path.stat()
    except FileNotFoundError:
        raise DatasetError(f"there is no {path}") from None
    except OSError as error:
        raise DatasetError(f"{path} can't be read: {error.strerror}") from None
    if path.is_dir():
        return
    if not path.is_file():
        raise DatasetError(f"{path} is neither a mesh file nor a folder")
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise DatasetError(f"{path} is no mesh that can be read: known are {known}")


def _named(root: Path, path: Path, below: str) -> File:
    real = path.resolve()
    if real.is_relative_to(root.resolve()):
        return File(root, below, path.suffix, _unreadable(below))
    return File(real.parent, real.name, path.suffix, _unreadable(real.name))


def _listed(root: Path, source: str) -> File:
    suffix = posixpath.splitext(source)[1]
    if suffix.lower() not in MESH_SUFFIXES:
        return File(root, source, suffix, "a folder that is a link, or can't be listed")
    return File(root, source, suffix, _unreadable(source))


def _unreadable(source: str) -> str:
    in_archive = re.match(r"(.*\.zip)?!", source, re.IGNORECASE | re.DOTALL)
    return "its name reads like a zip file's inside ('!'); rename it" if in_archive else ""


def _under_its_id(source: str, file: File) -> tuple[str, File]:
    """The file's id, or a stand-in for one that can't be a folder below the results."""
    model_id, suffix = posixpath.splitext(source)
    model_id = model_id if suffix.lower() in MESH_SUFFIXES else source
    if model_id.partition("/")[0] == "quarantine.jsonl":
        return f"_{model_id}", replace(file, reason="its name is that of the quarantine list")
    reason = unsafe_model_id(model_id)
    return (safe_model_id(model_id), replace(file, reason=reason)) if reason else (model_id, file)


def _is_result(root: Path, source: str, results: str) -> bool:
    """Whether a file was written by this program, here or elsewhere."""
    if RESULT.fullmatch(source):
        folder = root / source
        while folder.name and not folder.name.startswith("abstraction."):
            folder = folder.parent
        if (folder.parent / "abstraction.json").exists():
            return True
    real = os.path.realpath(root / posixpath.dirname(source))
    return results != os.path.realpath(root) and (
        real == results or real.startswith(results + os.sep)
    )
