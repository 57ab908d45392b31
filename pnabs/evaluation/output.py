"""What an evaluation says: a row a model and set of results, tables, and what is strange."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from pnabs import report
from pnabs.dataset.synsets import name_of
from pnabs.evaluation.frames import notice
from pnabs.evaluation.matching import told
from pnabs.evaluation.plan import Plan
from pnabs.evaluation.results import Results
from pnabs.evaluation.rows import COUNTS, FALLEN, METRICS
from pnabs.evaluation.shapes import ShapeEntry
from pnabs.report.text import plain
from pnabs.store.atomic import write_atomic

TEXTS = ("name", "category", "model_id", "split", "status", "reason", "not_exact", "not_closed")
COLUMNS = (*TEXTS, *METRICS)
"""Columns of models.csv."""

UNNAMED = "meshes"
"""What the tables call the models that have no category."""


@dataclass(frozen=True)
class Evaluation:
    """Results, measured.

    Attributes
    ----------
    models : pyarrow.Table
        A row for each shape and set of results, as models.csv has it: `name` of the set,
        `category`, `model_id`, `split`, `status` (`ok`, `missing`, `invalid`, `error`, `crash`,
        `timeout`, `memory`), `reason`, and what was measured, null where it isn't defined.
    tables : pnabs.report.Tables
    notices : tuple of str
        What is strange: results without a shape, missing ones, other frames.
    quarantine : tuple of dict
        What couldn't be measured: name (None for a shape), category, model_id, kind, reason,
        attempts, traceback.
    attempted : int
        Shapes and results that there were to measure.
    max_failed : float
        Per cent of them of which that may fail.
    """

    models: pa.Table
    tables: report.Tables
    notices: tuple[str, ...]
    quarantine: tuple[dict[str, Any], ...]
    attempted: int
    max_failed: float

    @property
    def text(self) -> str:
        """The tables for people to read."""
        return report.render_text(self.tables)

    @property
    def failed(self) -> float:
        """Per cent of what there was to measure that couldn't be."""
        return 100 * len(self.quarantine) / self.attempted if self.attempted else 0.0

    @property
    def exit_code(self) -> int:
        """0, or 3 when more couldn't be measured than may."""
        return 3 if self.failed > self.max_failed else 0


def summarise(
    shapes: Sequence[ShapeEntry],
    results: Sequence[Results],
    plan: Plan,
    row_of: Mapping[str, Mapping[str, Any]],
    *,
    frame: str,
    only: str | None,
    max_parts: int | None,
    seed: int,
    max_failed: float,
) -> Evaluation:
    """Rows as an evaluation.

    Parameters
    ----------
    row_of
        Fingerprint of each item -> its row.
    frame
        In which meshes and boxes were taken to be.
    only
        The split that shapes were taken of.
    max_parts
        Results of more count as failures.
    seed
        Of the tables' bootstraps.
    max_failed
        Per cent of shapes and results that may fail to be measured.
    """
    fallen = []
    measured = []
    for number, (shape, item) in enumerate(zip(shapes, plan.shapes, strict=True)):
        row = row_of[item.fingerprint]
        if row["status"] == "ok":
            measured.append(number)
        else:
            fallen.append(_fallen(None, shape, row))
    rows: dict[str, list[dict[str, Any]]] = {}
    said = _unmeasured(shapes, fallen)
    for one, items in zip(results, plan.results, strict=True):
        mine = rows[one.name] = []
        for number in measured:
            shape = shapes[number]
            row = _row(one.name, shape, row_of[plan.shapes[number].fingerprint])
            if number in items:
                found = row_of[items[number].fingerprint]
                if found["status"] in FALLEN:
                    fallen.append(_fallen(one.name, shape, found))
                row |= {**found, "not_exact": row["not_exact"]}
                _cap(row, max_parts)
            mine.append(row)
        said += _notices(one, mine, frame)
    tables = report.build_tables(
        {name: _table(mine) for name, mine in rows.items()},
        np.random.default_rng([seed, 1]),
        names=_names(shapes),
        split=only or "all",
    )
    every = [
        row for number in range(len(measured)) for row in (one[number] for one in rows.values())
    ]
    if 100 * len(fallen) > max_failed * plan.items:
        said.append(
            f"{len(fallen)} of {plan.items} shapes and results couldn't be measured, more than "
            f"{max_failed:g} %; see quarantine.jsonl"
        )
    return Evaluation(_table(every), tables, tuple(said), tuple(fallen), plan.items, max_failed)


def _row(name: str, shape: ShapeEntry, alone: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "name": name,
        "category": shape.category,
        "model_id": shape.model_id,
        "split": shape.split,
        "status": "missing",
        "reason": "",
        "not_exact": alone["not_exact"],
    }


def _cap(row: dict[str, Any], max_parts: int | None) -> None:
    """Make a result of too many parts a failure."""
    parts = row.get("parts")
    if row["status"] == "ok" and max_parts is not None and parts is not None and parts > max_parts:
        row.update(dict.fromkeys(METRICS))
        row.update(
            status="invalid", reason=f"too many parts: {parts}, of at most {max_parts}", parts=parts
        )


def _fallen(name: str | None, shape: ShapeEntry, row: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "name": name,
        "category": shape.category,
        "model_id": shape.model_id,
        "kind": row["status"],
        "reason": row["reason"],
        "attempts": row["attempts"],
        "traceback": row["traceback"],
    }


def _table(rows: Sequence[Mapping[str, Any]]) -> pa.Table:
    columns: dict[str, pa.Array] = {}
    for name in COLUMNS:
        values = [row.get(name) for row in rows]
        columns[name] = pa.array(values, pa.string() if name in TEXTS else pa.float64())
    return pa.table(columns)


def _names(shapes: Sequence[ShapeEntry]) -> dict[str, str]:
    categories = sorted({shape.category for shape in shapes})
    return {category: name_of(category) or UNNAMED for category in categories}


def _unmeasured(shapes: Sequence[ShapeEntry], fallen: Sequence[Mapping[str, Any]]) -> list[str]:
    if not fallen:
        return []
    first = fallen[0]
    label = f"{first['category']}/{first['model_id']}".removeprefix("/")
    return [
        f"{len(fallen)} of {len(shapes)} shapes can't be measured against and are left out, "
        f"such as {plain(label)}: {first['kind']}: {plain(first['reason'])}"
    ]


def _notices(results: Results, rows: Sequence[Mapping[str, Any]], frame: str) -> list[str]:
    """What is to be said of a set of results."""
    said = []
    subject, total = f"results of {results.name!r}", len(rows)
    if results.without:
        said.append(
            f"{subject}: {len(results.without)} belong to no shape: {told(results.without)}"
        )
    missing = [_label(row) for row in rows if row["status"] == "missing"]
    if missing:
        said.append(
            f"{subject}: {len(missing)} of {total} shapes have none and count as 0: {told(missing)}"
        )
    fallen = [row for row in rows if row["status"] in FALLEN]
    if fallen:
        first = fallen[0]
        said.append(
            f"{subject}: {len(fallen)} of {total} failed and count as 0, such as "
            f"{plain(_label(first))}: {first['status']}: {plain(first['reason'])}"
        )
    ok = [row for row in rows if row["status"] == "ok"]
    loose = [_label(row) for row in ok if row["not_closed"] and row["not_exact"] == ""]
    if loose:
        said.append(
            f"{subject}: {len(loose)} of {total} are not closed though their shapes are, and have "
            f"no exact volumes: {told(loose)}"
        )
    strange = notice(results.name, ok, frame)
    return [*said, strange] if strange else said


def _label(row: Mapping[str, Any]) -> str:
    return f"{row['category']}/{row['model_id']}".removeprefix("/")


def write(evaluation: Evaluation, folder: Path) -> None:
    """Write the files of an evaluation; without failures there is no quarantine.jsonl."""
    tables = evaluation.tables
    files = {
        "models.csv": _csv(evaluation.models),
        "tables.csv": tables.to_csv(),
        "tables.json": tables.to_json(),
        "tables.tex": tables.to_latex(),
    }
    lines = [json.dumps(entry, ensure_ascii=False) + "\n" for entry in evaluation.quarantine]
    if lines:
        files["quarantine.jsonl"] = "".join(lines)
    else:
        (folder / "quarantine.jsonl").unlink(missing_ok=True)
    for name, text in files.items():
        write_atomic(folder / name, text.encode("utf-8", "backslashreplace"))


def _csv(models: pa.Table) -> str:
    sink = io.StringIO()
    writer = csv.writer(sink, lineterminator="\n")
    writer.writerow(models.column_names)
    for row in models.to_pylist():
        writer.writerow(
            "" if value is None else int(value) if name in COUNTS else value
            for name, value in row.items()
        )
    return sink.getvalue()
