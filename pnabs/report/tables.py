"""Tables as data: rows of methods or counts by columns of categories, and their written forms."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from typing import Literal

from . import export

MIN_MODELS = 5
"""Categories of which a row covers fewer models stay out of its average (METHOD, metrics)."""

COMPARISON = "variants/"
"""How the names of tables begin in which methods stand side by side, over the same models."""

Role = Literal["cropped", "positives", "difference", "mesh", "networks", "floor", "count"]


Interval = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Column:
    """A category of a table, and how many models the table has of it, failures included."""

    category: str
    label: str
    models: int


@dataclass(frozen=True, slots=True)
class Row:
    """One method or one quantity.

    Attributes
    ----------
    label : str
    variant : str
    role : str
        What the row is: `cropped` (the result), `positives` (its positives, not cropped), `mesh`
        (measured on the written mesh), `networks` (before the fit), `floor` (two samplings of one
        surface), `difference` (of two methods, paired by model), `count`.
    values : tuple of float or None, one a column
    models : tuple of int, one a column
        How many models each value covers.
    summary : float or None
        The average over categories, or for counts the figure over all models.
    interval : (low, high) or None
        95 % bootstrap interval of `summary`.
    overall : float or None
        The mean over all models.
    overall_interval : (low, high) or None
        95 % bootstrap interval of `overall`.
    digits : int
        Decimals worth showing.
    """

    label: str
    variant: str
    role: Role
    values: tuple[float | None, ...]
    models: tuple[int, ...]
    summary: float | None
    interval: Interval | None = None
    overall: float | None = None
    overall_interval: Interval | None = None
    digits: int = 2

    @property
    def averaged(self) -> tuple[bool, ...]:
        """Which columns an average over categories takes in."""
        return tuple(number >= MIN_MODELS for number in self.models)


@dataclass(frozen=True, slots=True)
class Total:
    """A column that closes a table: a figure and its interval for each row."""

    label: str
    values: tuple[float | None, ...]
    intervals: tuple[Interval | None, ...]


@dataclass(frozen=True, slots=True)
class Table:
    """A table of rows by categories.

    Attributes
    ----------
    name : str
        Stable key, for example `iou_64` or `counts`.
    title, unit : str
    better : {'higher', 'lower'} or None
    columns : tuple of Column
    summary_label : str
    rows : tuple of Row
    notes : tuple of str
        What a reader must know to use the numbers.
    """

    name: str
    title: str
    unit: str
    better: Literal["higher", "lower"] | None
    columns: tuple[Column, ...]
    summary_label: str
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = ()

    def row(self, role: Role, variant: str | None = None) -> Row | None:
        """The first row of a role, of one variant or of any."""
        for row in self.rows:
            if row.role == role and variant in (None, row.variant):
                return row
        return None

    @property
    def totals(self) -> tuple[Total, ...]:
        """What closes the table: the average, where there is one, and the mean over all models."""
        rows = self.rows
        summary = Total(
            self.summary_label,
            tuple(row.summary for row in rows),
            tuple(row.interval for row in rows),
        )
        if self.better is None:
            return (summary,)
        overall = Total(
            "all models",
            tuple(row.overall for row in rows),
            tuple(row.overall_interval for row in rows),
        )
        averaged = any(value is not None for value in summary.values)
        return (summary, overall) if averaged else (overall,)

    def best(self) -> tuple[tuple[bool, ...], ...]:
        """Which cells hold the best figure of their column, by rows; the last are the totals'.

        Only methods that stand side by side compete, as only there all figures cover the same
        models.  A figure that no other one falls short of isn't best.
        """
        cells = [
            *zip(*(row.values for row in self.rows), strict=True),
            *(total.values for total in self.totals),
        ]
        flags = [[False] * len(cells) for _ in self.rows]
        pick = {"higher": max, "lower": min}.get(self.better or "")
        if pick is not None and self.name.startswith(COMPARISON):
            for j, column in enumerate(cells):
                known = {
                    i: round(value, row.digits)
                    for i, (row, value) in enumerate(zip(self.rows, column, strict=True))
                    if row.role == "cropped" and value is not None
                }
                if len(set(known.values())) > 1:
                    top = pick(known.values())
                    for i, value in known.items():
                        flags[i][j] = value == top
        return tuple(tuple(line) for line in flags)


@dataclass(frozen=True, slots=True)
class Tables:
    """All tables of a run, and what they cover."""

    split: str
    variants: tuple[str, ...]
    resamples: int
    tables: tuple[Table, ...]

    def __getitem__(self, name: str) -> Table:
        table = self.get(name)
        if table is None:
            there = ", ".join(t.name for t in self.tables)
            raise KeyError(f"no table {name!r}; there are {there}")
        return table

    def get(self, name: str) -> Table | None:
        """A table by its name, or None where no model has a figure for it."""
        return next((table for table in self.tables if table.name == name), None)

    def to_json(self) -> str:
        """The content of tables.json: the same tables always give the same bytes."""
        document = {"format": "pnabs/tables", "version": 2, **asdict(self)}
        return json.dumps(document, indent=1, allow_nan=False) + "\n"

    def to_csv(self) -> str:
        """The content of tables.csv: a line a figure (`pnabs.report.export.to_csv`)."""
        return export.to_csv(self)

    def to_latex(self) -> str:
        """The content of tables.tex: a tabular a table (`pnabs.report.export.to_latex`)."""
        return export.to_latex(self)


def tidy(value: float) -> float | None:
    """A figure as tables hold it: None for nan, else rounded well beyond what is shown.

    So last-bit noise doesn't reach tables.json.
    """
    return round(float(value), 6) + 0.0 if math.isfinite(value) else None
