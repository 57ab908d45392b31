"""What a worker must see before it works: its driver's run folder, and the dataset."""

from __future__ import annotations

import os
from pathlib import Path

from pnabs.batch import Unavailable
from pnabs.dataset.errors import DatasetError
from pnabs.dataset.source import Dataset
from pnabs.store.lock import NotHeldError, check_held


def check_run(run: Path, token: str) -> None:
    """Whether this process sees the run folder, held by the driver it works for.

    Raises
    ------
    pnabs.batch.Unavailable
    """
    try:
        check_held(run, token)
    except NotHeldError as error:
        raise Unavailable(str(error)) from None


def check_dataset(root: Path | str) -> None:
    """Whether the dataset is there; the empty folder of a disk that isn't mounted is not.

    Raises
    ------
    pnabs.batch.Unavailable
    """
    try:
        dataset = Dataset(root)
        if isinstance(dataset.root, Path) and not dataset.is_archive:
            with os.scandir(dataset.root) as entries:
                if next(entries, None) is None:
                    raise Unavailable(f"the dataset {root} is an empty folder: is it mounted?")
    except (DatasetError, OSError) as error:
        raise Unavailable(f"the dataset {root} is out of reach: {error}") from None
