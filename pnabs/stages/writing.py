"""The files of one abstraction in its folder."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Mapping
from pathlib import Path

from pnabs.formats import FORMATS, STEM, level_stem
from pnabs.store.atomic import sweep, sync_folder, write_atomic


def write_files(folder: Path, files: Mapping[str, bytes]) -> list[Path]:
    """Write a model's files, in their order, in the place of those of another time.

    What was there goes first, so that whatever vouches for it by being there never stands beside
    files of another making.

    Parameters
    ----------
    folder
        The model's.  Other models' folders may lie in it: no name of theirs begins like a file's
        (`pnabs.dataset.names.unsafe_model_id`).
    files
        Name -> content; none removes the folder, if nothing else is in it.
    """
    if folder.is_dir():
        for known in FORMATS.values():
            (folder / f"{STEM}{known.suffix}").unlink(missing_ok=True)
        for path in folder.glob(f"{level_stem(STEM, 0)[:-1]}[0-9]*"):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        sync_folder(folder)
        clear_partials(folder)
    paths = [folder / name for name in files]
    for path, data in zip(paths, files.values(), strict=True):
        write_atomic(path, data)
    if not files:
        with contextlib.suppress(OSError):
            folder.rmdir()
    return paths


def clear_partials(folder: Path) -> None:
    """Remove what a killed writer left, and files that lay beside one that isn't there."""
    sweep(folder, f".{STEM}.*")
    for known in FORMATS.values():
        own = f"{STEM}{known.suffix}"
        if known.beside and not (folder / own).exists():
            shutil.rmtree(folder / f"{STEM}{known.beside}", ignore_errors=True)
