"""Boxes of many models in one table: csv or npz."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import csv

from pnabs.evaluation.items import BoxList
from pnabs.stages.errors import UsageError

NUMBERS = ("sx", "sy", "sz", "qw", "qx", "qy", "qz", "tx", "ty", "tz")
"""Columns of a csv with a box's numbers, in the order of an npz's `boxes`."""

REQUIRED = ("model_id", *NUMBERS)
OPTIONAL = ("category", "sign")

ARRAYS = ("model_id", "boxes", "category", "sign")
"""Arrays of an npz, the last two optional."""

MOST_BYTES = 4 * 2**30
"""What an npz may unpack to."""

UNIT_SLACK = 1e-3
"""A quaternion's norm differs from 1 by at most this."""


def read_boxes(path: Path) -> dict[tuple[str, str], BoxList]:
    """The boxes in a csv or npz: (category, model id) -> its boxes, in the file's order.

    A model with a number that isn't finite, a negative side, a quaternion that isn't unit or a
    sign that isn't 1 or -1 has a `reason`; the others stand.

    Raises
    ------
    UsageError
        When the file can't be read or lacks something, or has what it shouldn't.
    """
    read = _read_npz if path.suffix.lower() == ".npz" else _read_csv
    category, model_id, sign, boxes = read(path)
    if not len(boxes):
        raise UsageError(f"{path} has no boxes")
    unit = "row" if path.suffix.lower() == ".npz" else "line"
    # A csv's first line holds its columns' names, and people count from 1.
    first = 0 if unit == "row" else 2
    faults = _faults(sign, boxes)
    found = {}
    for (group, name), rows in _grouped(category, model_id):
        wrong = [row for row in rows if row in faults]
        reason = f"{path.name}, {unit} {first + wrong[0]}: {faults[wrong[0]]}" if wrong else ""
        mine, signs = boxes[rows], sign[rows]
        if not name:
            raise UsageError(f"{path}, {unit} {first + rows[0]}: model_id is empty")
        found[group, name] = BoxList(
            () if reason else _tuples(mine[signs > 0]),
            () if reason else _tuples(mine[signs < 0]),
            reason,
        )
    return found


def _tuples(boxes: NDArray[np.float64]) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in boxes.tolist())


def _grouped(
    category: list[str], model_id: list[str]
) -> Iterator[tuple[tuple[str, str], list[int]]]:
    rows: dict[tuple[str, str], list[int]] = {}
    for row, name in enumerate(zip(category, model_id, strict=True)):
        rows.setdefault(name, []).append(row)
    yield from rows.items()


def _faults(sign: NDArray[np.float64], boxes: NDArray[np.float64]) -> dict[int, str]:
    """Row -> what is wrong with it, for those with which something is."""
    faults: dict[int, str] = {}
    with np.errstate(over="ignore", invalid="ignore"):
        norm = np.linalg.norm(boxes[:, 3:7], axis=1)
    checks = (
        (~np.isin(sign, (1, -1)), "sign is neither 1 nor -1"),
        (~(np.abs(norm - 1) <= UNIT_SLACK), "qw, qx, qy, qz are no unit quaternion"),
        ((boxes[:, :3] < 0).any(axis=1), "a side is negative"),
    )
    for wrong, text in checks:
        faults |= dict.fromkeys(np.flatnonzero(wrong).tolist(), text)
    for row, column in np.argwhere(~np.isfinite(boxes)).tolist():
        faults[row] = f"{NUMBERS[column]} is not a finite number"
    return faults


Table = tuple[list[str], list[str], NDArray[np.float64], NDArray[np.float64]]
"""Category, model id, sign (n,) and numbers (n, 10) of each box."""


def _read_csv(path: Path) -> Table:
    types = {name: pa.float64() for name in (*NUMBERS, "sign")}
    types |= {name: pa.string() for name in ("model_id", "category")}
    try:
        table = csv.read_csv(
            path,
            convert_options=csv.ConvertOptions(column_types=types, strings_can_be_null=False),
        )
    except (OSError, pa.ArrowException) as error:
        raise UsageError(f"{path} is no readable csv of boxes: {error}") from None
    _check_names(path, "columns", table.column_names, REQUIRED, OPTIONAL)
    count = len(table)
    given = set(table.column_names)
    numbers = [table[name].to_numpy() for name in NUMBERS]
    return (
        table["category"].to_pylist() if "category" in given else [""] * count,
        table["model_id"].to_pylist(),
        np.asarray(table["sign"].to_numpy()) if "sign" in given else np.ones(count),
        np.column_stack(numbers).astype(np.float64).reshape(-1, len(NUMBERS)),
    )


def _read_npz(path: Path) -> Table:
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(info.file_size for info in archive.infolist()) > MOST_BYTES:
                raise UsageError(f"{path} unpacks to more than {MOST_BYTES:,} bytes")
        with np.load(path, allow_pickle=False) as stored:
            _check_names(path, "arrays", stored.files, ARRAYS[:2], ARRAYS[2:])
            arrays = {name: stored[name] for name in stored.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise UsageError(f"{path} is no readable npz of boxes: {error}") from None
    boxes = arrays["boxes"]
    if boxes.ndim != 2 or boxes.shape[1] != len(NUMBERS) or boxes.dtype.kind not in "fiu":
        raise UsageError(
            f"{path}: boxes must be numbers of shape (n, {len(NUMBERS)}), not {boxes.dtype} of "
            f"shape {boxes.shape}"
        )
    count = len(boxes)
    for name, kinds, words in (
        ("model_id", "U", "strings"),
        ("category", "U", "strings"),
        ("sign", "fiu", "numbers"),
    ):
        array = arrays.get(name)
        if array is not None and (array.shape != (count,) or array.dtype.kind not in kinds):
            raise UsageError(
                f"{path}: {name} must be {words} of shape ({count},), one a box, not "
                f"{array.dtype} of shape {array.shape}"
            )
    category = arrays.get("category")
    sign = arrays.get("sign")
    return (
        [""] * count if category is None else category.tolist(),
        arrays["model_id"].tolist(),
        np.ones(count) if sign is None else sign.astype(np.float64),
        boxes.astype(np.float64),
    )


def _check_names(
    path: Path,
    what: str,
    names: list[str],
    required: tuple[str, ...],
    optional: tuple[str, ...],
) -> None:
    known = (*required, *optional)
    missing = [name for name in required if name not in names]
    strange = [name for name in names if name not in known]
    twice = sorted({name for name in names if names.count(name) > 1})
    faults = [
        f"{text}: {', '.join(repr(name) for name in found)}"
        for text, found in (("missing", missing), ("unknown", strange), ("repeated", twice))
        if found
    ]
    if faults:
        raise UsageError(
            f"{path}: wrong {what}: {'; '.join(faults)}. There must be {', '.join(required)}; "
            f"there may be {', '.join(optional)}"
        )
