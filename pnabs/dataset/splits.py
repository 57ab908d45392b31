"""Which models train, which test: the paper's split by hash, or a list of one's own."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Literal

import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import csv

from pnabs.dataset.errors import DatasetError

Split = Literal["train", "val", "test", "none"]

_COLUMNS = ("synsetId", "modelId", "split")
_SPLITS = ("train", "val", "test")


def hash_split(model_id: str, test_share: float, val_share: float) -> Split:
    """Split of a model by a hash of its id (4.1: two thirds train, one third tests).

    It depends on nothing else, so it stays when models are added, and a model that a collection
    lists under several categories (every ShapeNet `cellphone` is a `telephone`, too) is on the
    same side in all of them.

    Parameters
    ----------
    model_id : str
    test_share, val_share : float
        Expected shares of all models; they add up to at most 1, the rest trains.

    Raises
    ------
    DatasetError
        If the shares add up to more than 1.
    """
    if test_share + val_share > 1:
        raise DatasetError(
            f"dataset.test_share ({test_share:g}) and dataset.val_share ({val_share:g}) "
            "add up to more than 1"
        )
    digest = hashlib.sha256(model_id.encode()).digest()
    place = int.from_bytes(digest[:8], "big") / 2**64
    if place < test_share:
        return "test"
    return "val" if place < test_share + val_share else "train"


def read_split(path: Path) -> dict[tuple[str, str], Split]:
    """Read a csv in the form of ShapeNet's `all.csv`.

    Parameters
    ----------
    path : Path
        Columns `synsetId` (a category), `modelId` and `split` (train, val or test); others
        (`id`, `subSynsetId`) are ignored.

    Returns
    -------
    dict of (category, model_id) -> split

    Raises
    ------
    DatasetError
        If the file can't be read, lacks a column, has another split, or puts one model in two.
    """
    try:
        table = csv.read_csv(
            path,
            convert_options=csv.ConvertOptions(
                column_types={name: pa.string() for name in _COLUMNS},
                include_columns=list(_COLUMNS),
                strings_can_be_null=False,
            ),
        )
    except (OSError, pa.ArrowException) as error:
        raise DatasetError(
            f"dataset.split: {path} isn't a readable csv with the columns "
            f"{', '.join(_COLUMNS)}: {error}"
        ) from error

    strange = table.filter(pc.invert(pc.is_in(table["split"], pa.array(_SPLITS))))
    if len(strange):
        row = strange.slice(0, 1).to_pylist()[0]
        raise DatasetError(
            f"dataset.split: {path} puts {row['synsetId']}/{row['modelId']} into {row['split']!r}, "
            f"which is none of {', '.join(_SPLITS)} ({len(strange)} such rows)"
        )
    splits: dict[tuple[str, str], Split] = {}
    columns = (table[name].to_pylist() for name in _COLUMNS)
    for category, model_id, split in zip(*columns, strict=True):
        if splits.setdefault((category, model_id), split) != split:
            raise DatasetError(
                f"dataset.split: {path} has {category}/{model_id} twice, "
                f"in {splits[category, model_id]} and in {split}"
            )
    return splits
