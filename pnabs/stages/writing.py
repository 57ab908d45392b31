"""The files of one abstraction in its folder."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Mapping
from pathlib import Path

from pnabs.formats import STEM
from pnabs.store.atomic import sweep, write_atomic


def write_files(folder: Path, files: Mapping[str, bytes]) -> list[Path]:
    """Write a model's files, in their order; what lies there of another time goes.

    Parameters
    ----------
    folder
        The model's.  Other models' folders may lie in it: no name of theirs begins like a file's
        (`pnabs.dataset.names.unsafe_model_id`).
    files
        Name -> content; none removes the folder, if nothing else is in it.
    """
    sweep(folder)
    for path in folder.glob(f"{STEM}.*"):
        if path.is_dir():
            shutil.rmtree(path)
        elif path.name not in files:
            path.unlink()
    paths = [folder / name for name in files]
    for path, data in zip(paths, files.values(), strict=True):
        write_atomic(path, data)
    if not files:
        with contextlib.suppress(OSError):
            folder.rmdir()
    return paths
