"""Tables as aligned text for a terminal or a log."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.cells import cell_len

if TYPE_CHECKING:
    from .tables import Interval, Row, Table, Tables

_GAP = "  "

DASH = "\N{EN DASH}"
"""What stands on the page where there is no figure."""
MINUS = "\N{MINUS SIGN}"


def plain(name: str) -> str:
    """A name that is safe to show: control, format and other unprintable characters are escaped.

    Names come from a dataset's folders; an escape sequence among them must not reach a terminal.
    """
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in name
    )


def cell(value: float | None, row: Row, missing: str = "-") -> str:
    """A figure with its row's decimals; differences carry their sign."""
    if value is None:
        return missing
    text = f"{value:+.{row.digits}f}" if row.role == "difference" else f"{value:.{row.digits}f}"
    return text if text.strip("+-0.") else text.lstrip("+-")


def interval(span: Interval | None, row: Row) -> str:
    """An interval with its row's decimals, or nothing."""
    if span is None:
        return ""
    low, high = (cell(value, row) for value in span)
    return f"{low} to {high}"


def heading(table: Table) -> str:
    """Title, unit and direction of a table in one line."""
    unit = f", {table.unit}" if table.unit else ""
    return table.title + unit + (f" ({table.better} is better)" if table.better else "")


def render_text(tables: Tables, width: int = 100) -> str:
    """All tables as text, at most `width` cells wide where names allow.

    Columns are categories under their aliases; a table that doesn't fit goes on in further
    blocks, each with the row labels.  The totals close the last block, the first with its
    interval.

    Parameters
    ----------
    tables : Tables
    width : int
        Cells of the terminal.
    """
    covered = "all" if tables.split == "all" else f"the {tables.split}"
    parts = [f"Figures cover {covered} models.", *(_render(t, width) for t in tables.tables)]
    return "\n\n".join(parts) + "\n"


def _render(table: Table, width: int) -> str:
    columns: list[list[str]] = [
        [plain(column.label), *(cell(row.values[j], row) for row in table.rows)]
        for j, column in enumerate(table.columns)
    ]
    for i, total in enumerate(table.totals):
        columns.append([total.label, *map(cell, total.values, table.rows)])
        if not i and any(total.intervals):
            columns.append(["95 % interval", *map(interval, total.intervals, table.rows)])
    labels = ["", *(plain(row.label) for row in table.rows)]
    if table.better is not None:
        labels.insert(1, "models")
        sizes = [str(column.models) for column in table.columns]
        for j, column_cells in enumerate(columns):
            column_cells.insert(1, sizes[j] if j < len(sizes) else "")

    lines = textwrap.wrap(heading(table), max(20, width))
    for i, block in enumerate(_blocks(labels, columns, width)):
        lines += ([""] if i else []) + block
    for note in table.notes:
        lines += textwrap.wrap(
            plain(note), max(20, width - 2), initial_indent="  ", subsequent_indent="  "
        )
    return "\n".join(lines)


def _blocks(labels: Sequence[str], columns: Sequence[Sequence[str]], width: int) -> list[list[str]]:
    label_width = max(map(cell_len, labels))
    blocks: list[list[Sequence[str]]] = [[]]
    used = label_width
    for column in columns:
        needed = len(_GAP) + max(map(cell_len, column))
        if blocks[-1] and used + needed > width:
            blocks.append([])
            used = label_width
        blocks[-1].append(column)
        used += needed
    return [
        [
            (
                _pad(label, label_width, left=True)
                + "".join(_GAP + _pad(c[i], max(map(cell_len, c))) for c in block)
            ).rstrip()
            for i, label in enumerate(labels)
        ]
        for block in blocks
    ]


def _pad(text: str, width: int, *, left: bool = False) -> str:
    fill = " " * (width - cell_len(text))
    return text + fill if left else fill + text
