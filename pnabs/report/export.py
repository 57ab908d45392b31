"""Tables for other programs: csv in long form, and LaTeX."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

from .text import cell, heading, interval, plain

if TYPE_CHECKING:
    from .tables import Row, Table, Tables

FIELDS = (
    *("table", "unit", "row", "variant", "role", "scope", "category", "label", "models"),
    *("value", "low", "high"),
)
"""Columns of the csv.

`scope` is `category`, `average` (over categories) or `all` (over all models); `category` and
`label` are empty but for the first.  `low` and `high` are the 95 % interval of the last two.
"""

WIDE = 12
"""With more categories a LaTeX table lists them downwards instead of across."""

_LATEX = {
    **{c: f"\\{c}" for c in "&%$#_{}"},
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    # Behind the end of a line these two would be its options.
    "[": "{[}",
    "*": "{*}",
    # Straight quotes and grave accents would print as curly ones.
    '"': r"\textquotedbl{}",
    "`": r"\textasciigrave{}",
    "²": r"\textsuperscript{2}",
    "³": r"\textsuperscript{3}",
}


def to_csv(tables: Tables) -> str:
    """All figures, one a line below a header of `FIELDS`.

    Figures are written in full, one that isn't there as an empty cell.  Unprintable characters of
    names are spelled out as escapes.
    """
    sink = io.StringIO()
    writer = csv.writer(sink, lineterminator="\n")
    writer.writerow(FIELDS)
    for table in tables.tables:
        for row in table.rows:
            head = [plain(text) for text in (table.name, table.unit, row.label, row.variant)]
            for line in _figures(table, row):
                writer.writerow([*head, row.role, *line])
    return sink.getvalue()


def _figures(table: Table, row: Row) -> list[list[object]]:
    """Scope, category, label, models, value, low and high of each figure of a row."""
    lines: list[list[object]] = [
        ["category", plain(column.category), plain(column.label), models, value, "", ""]
        for column, models, value in zip(table.columns, row.models, row.values, strict=True)
    ]
    if row.role != "count":
        averaged = sum(
            number for number, in_it in zip(row.models, row.averaged, strict=True) if in_it
        )
        lines.append(["average", "", "", averaged, row.summary, *(row.interval or ("", ""))])
    overall = row.overall_interval or ("", "")
    lines.append(["all", "", "", sum(row.models), row.overall, *overall])
    return [["" if item is None else item for item in line] for line in lines]


def to_latex(tables: Tables) -> str:
    """All tables as LaTeX: a `tabular` each, for the package booktabs.

    Title and notes stand above each as comments; best figures are bold.  A table with many
    categories lists them downwards.
    """
    parts = ["% Tables of pnabs; they need \\usepackage{booktabs} and \\usepackage[T1]{fontenc}."]
    parts += [_tabular(table) for table in tables.tables]
    return "\n\n".join(parts) + "\n"


def latex(text: str) -> str:
    """A text that LaTeX prints as it is."""
    return "".join(_LATEX.get(c, c) for c in plain(text))


def _tabular(table: Table) -> str:
    columns = _columns(table)
    if table.better is not None:
        sizes = ["models", *(str(column.models) for column in table.columns)]
        for j, column in enumerate(columns):
            column.insert(1, sizes[j] if j < len(sizes) else "")
    if len(table.columns) > WIDE:
        return "\n".join([*_comments(table), *_lines(columns, {0, len(table.columns)})])
    rows = list(zip(*columns, strict=True))
    return "\n".join([*_comments(table), *_lines(rows, {0} if table.better is None else {0, 1})])


def _columns(table: Table) -> list[list[str]]:
    """Labels, categories, and totals with their intervals: each a heading and a cell a row."""
    best = table.best()
    columns = [["", *(latex(row.label) for row in table.rows)]]
    figures = [
        *(
            (column.label, [row.values[j] for row in table.rows], ())
            for j, column in enumerate(table.columns)
        ),
        *((total.label, list(total.values), total.intervals) for total in table.totals),
    ]
    for j, (label, values, spans) in enumerate(figures):
        cells = [
            _figure(value, row, bold=best[i][j])
            for i, (value, row) in enumerate(zip(values, table.rows, strict=True))
        ]
        columns.append([latex(label), *cells])
        if any(spans):
            columns.append([r"95\,\% interval", *map(_signed, map(interval, spans, table.rows))])
    return columns


def _lines(rows: Sequence[Sequence[str]], rules: set[int]) -> list[str]:
    """The tabular: its rows, with a rule after those numbered in `rules`."""
    lines = [rf"\begin{{tabular}}{{l{'r' * (len(rows[0]) - 1)}}}", r"\toprule"]
    for i, row in enumerate(rows):
        lines.append(" & ".join(row) + r" \\")
        lines += [r"\midrule"] if i in rules else []
    return [*lines, r"\bottomrule", r"\end{tabular}"]


def _comments(table: Table) -> list[str]:
    """Name, title and notes; `plain` leaves no line break in them that would end the comment."""
    return [f"% {plain(text)}" for text in (table.name, heading(table), *table.notes)]


def _figure(value: float | None, row: Row, *, bold: bool) -> str:
    text = _signed(cell(value, row, "--"))
    return rf"\textbf{{{text}}}" if bold else text


def _signed(text: str) -> str:
    """Figures with minus signs in place of hyphens."""
    return text if text == "--" else text.replace("-", "$-$")
