"""Tables as data: rows of methods or counts by columns of categories, and their JSON."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Literal

Role = Literal["cropped", "positives", "difference", "mesh", "networks", "floor", "count"]


@dataclass(frozen=True, slots=True)
class Column:
    """A category of a table, and how many models of it the table covers."""

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
        What the row is: `cropped` (positives and negatives), `positives`, their `difference`,
        `mesh` (measured on the written mesh), `floor` (two samplings of one surface), `count`.
    values : tuple of float or None, one a column
    summary : float or None
        The average over categories, or for counts the figure over all models.
    interval : (low, high) or None
        95 % bootstrap interval of `summary`.
    digits : int
        Decimals worth showing.
    """

    label: str
    variant: str
    role: Role
    values: tuple[float | None, ...]
    summary: float | None
    interval: tuple[float, float] | None = None
    overall: float | None = None
    digits: int = 2


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

    def best(self) -> tuple[tuple[bool, ...], ...]:
        """Which cells hold the best figure of their column, by rows; the last one is the summary.

        Only methods compete: differences, floors and counts are never best, and neither is a
        figure that no other one falls short of.
        """
        rivals = [i for i, row in enumerate(self.rows) if row.role in ("cropped", "positives")]
        cells = [
            [round(v, r.digits) if v is not None else None for v in (*r.values, r.summary)]
            for r in self.rows
        ]
        flags = [[False] * (len(self.columns) + 1) for _ in self.rows]
        pick = {"higher": max, "lower": min}.get(self.better or "")
        if pick is not None:
            for j in range(len(self.columns) + 1):
                known = [(i, value) for i in rivals if (value := cells[i][j]) is not None]
                if len({value for _, value in known}) > 1:
                    top = pick(value for _, value in known)
                    for i, value in known:
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
        for table in self.tables:
            if table.name == name:
                return table
        raise KeyError(f"no table {name!r}; there are {', '.join(t.name for t in self.tables)}")

    def to_json(self) -> str:
        """The content of tables.json: the same tables always give the same bytes."""
        document = {"format": "pnabs/tables", "version": 1, **asdict(self)}
        return json.dumps(document, indent=1, allow_nan=False) + "\n"
