"""What the page's template is given: strings, flags and pictures, ready to be laid out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from .charts import VALIDATION, Strip, gain_chart, loss_chart, strip_chart, validation_chart
from .data import Quarantined, ReportData, StageTiming
from .measures import read_models
from .tables import Row, Table, Tables
from .text import DASH, MINUS, cell, heading, interval, plain

WIDE = 12
"""With more categories a table lists them downwards instead of across."""
QUARANTINE_ROWS = 500
"""Models the failure table lists; a large run's full list is in its quarantine folder."""


@dataclass(frozen=True, slots=True)
class Figure:
    """One headline: what, how much, and what to compare it with."""

    label: str
    value: str
    note: str


@dataclass(frozen=True, slots=True)
class GridCell:
    """One cell: its text, and the style class that marks it."""

    text: str
    style: str = ""


@dataclass(frozen=True, slots=True)
class Grid:
    """A table laid out: header cells (text, small print) and lines of a label, a style and cells.

    Tables with a line a category are folded away unless they are the main ones (`unfolded`).
    """

    title: str
    unfolded: bool
    head: tuple[tuple[str, str], ...]
    lines: tuple[tuple[str, str, tuple[GridCell, ...]], ...]
    notes: tuple[str, ...]


def headline(data: ReportData) -> list[Figure]:
    """The figures at the top, of the first variant."""
    variant = data.tables.variants[0]
    counts = data.tables["counts" if len(data.tables.variants) == 1 else f"counts/{variant}"]
    by_label = {row.label: row for row in counts.rows}
    models, ok = (int(by_label[label].summary or 0) for label in ("models", "with a result"))
    failed = [
        f"{row.summary:.0f} {row.label.removeprefix('failed: ')}"
        for row in counts.rows
        if row.label.startswith("failed: ") and row.summary
    ]
    figures = [
        Figure("models with a result", f"{ok} of {models}", ", ".join(failed) or "none failed")
    ]
    for name, label, unit in (
        ("iou_64", "IoU at 64³", " %"),
        ("cd_surface", "distance between surfaces, x 1000", ""),
        ("open_space", "of the open space left open", " %"),
    ):
        table = data.tables[name]
        ours, plain_row = table.row("cropped", variant), table.row("positives", variant)
        if ours is None or plain_row is None:
            continue
        figures.append(
            Figure(
                label,
                _summary(ours) + unit,
                f"positives only: {_summary(plain_row)}{unit}, {_scope(ours)}",
            )
        )
        difference = table.row("difference", variant)
        if name == "iou_64" and difference is not None:
            span = (
                f"95 % interval {_span(difference)}" if difference.interval else _scope(difference)
            )
            figures.append(Figure("points of IoU from negatives", _summary(difference), span))
    kept, predicted = by_label["negatives kept"], by_label["negatives predicted"]
    figures.append(
        Figure(
            "negatives kept a model",
            _shown(kept.summary, kept),
            f"of {_shown(predicted.summary, predicted)} predicted",
        )
    )
    return figures


def _summary(row: Row) -> str:
    return _shown(row.summary if row.summary is not None else row.overall, row)


def _scope(row: Row) -> str:
    return "average over categories" if row.summary is not None else "mean over all models"


def grids(tables: Tables, prefix: Sequence[str]) -> list[Grid]:
    """The tables whose names start with one of the prefixes, laid out."""
    return [_grid(table) for table in tables.tables if table.name.startswith(tuple(prefix))]


def _shown(value: float | None, row: Row) -> str:
    """A cell's figure in print: a dash where there is none, and a true minus sign."""
    return cell(value, row, DASH).replace("-", MINUS)


def _span(row: Row) -> str:
    return interval(row).replace("-", MINUS)


def _grid(table: Table) -> Grid:
    best = table.best()
    intervals = any(row.interval for row in table.rows)
    cells = [
        [
            GridCell(_shown(value, row), "best" if best[i][j] else "none" if not value else "")
            for j, value in enumerate((*row.values, row.summary))
        ]
        + ([GridCell(_span(row), "interval")] if intervals else [])
        for i, row in enumerate(table.rows)
    ]
    models = [""] if table.name.startswith("counts") else []
    columns = [(plain(c.label), "" if models else str(c.models)) for c in table.columns]
    unfolded = len(table.columns) <= WIDE or table.name in ("iou_64", "counts", "variants/iou_32")
    columns += [(table.summary_label, "")] + ([("95 % interval", "")] if intervals else [])
    if len(table.columns) <= WIDE:
        lines = [(plain(row.label), row.role, tuple(cells[i])) for i, row in enumerate(table.rows)]
        return Grid(heading(table), unfolded, tuple(columns), tuple(lines), table.notes)
    styles = ["plain"] * len(table.columns) + ["summary"] + ["difference"] * intervals
    turned = [
        (label + (f" ({note})" if note else ""), styles[j], tuple(line[j] for line in cells))
        for j, (label, note) in enumerate(columns)
    ]
    head = tuple((plain(row.label), "") for row in table.rows)
    return Grid(heading(table), unfolded, head, tuple(turned), table.notes)


def iou_charts(data: ReportData) -> list[Markup]:
    """Strip and gain charts of IoU at 64^3, of the first variant; no result stands at 0."""
    variant = data.tables.variants[0]
    models = read_models(data.rows[variant], data.split)
    category = np.array(models.category, dtype=object)
    cropped, positives = (
        np.where(models.ok, np.nan_to_num(models.numbers[name]), 0.0) * 100
        for name in ("iou_64", "iou_64_positives")
    )
    strips = [
        Strip(
            column.label,
            cropped[category == column.category],
            positives[category == column.category],
        )
        for column in data.tables["iou_64"].columns
    ]
    return [
        strip_chart(strips, "IoU at 64³, %"),
        gain_chart(cropped[models.ok], positives[models.ok], "IoU at 64³, %"),
    ]


def loss_charts(data: ReportData) -> list[Markup]:
    """A chart a training phase, and one a variant of the validation models' IoU, where any is."""
    names = dict.fromkeys(
        key for records in data.curves.values() for record in records for key in record
    )
    terms = [name for name in names if name not in ("epoch", "total", VALIDATION)]
    variants: dict[str, dict[str, Sequence[Mapping[str, float]]]] = {}
    for (variant, phase), records in data.curves.items():
        variants.setdefault(variant, {})[phase] = records
    charts: list[Markup] = []
    for variant, phases in variants.items():
        shown = variant if len(variants) > 1 else ""
        prefix = f"{shown}: " if shown else ""
        charts += [loss_chart(prefix + name, records, terms) for name, records in phases.items()]
        validation = validation_chart(phases, shown)
        charts += [validation] if validation is not None else []
    return charts


def failures(data: ReportData) -> tuple[list[tuple[str, str]], list[Quarantined]]:
    """Counts by stage and kind, and the first models with their reasons, safe to show."""
    counts = Counter((item.stage, item.kind) for item in data.quarantine)
    chips = [
        (f"{plain(stage)}: {plain(kind)}", str(count)) for (stage, kind), count in counts.items()
    ]
    rows = [
        Quarantined(
            plain(item.stage),
            plain(data.names.get(item.category, item.category)),
            plain(item.model_id),
            plain(item.kind),
            plain(item.reason),
        )
        for item in data.quarantine[:QUARANTINE_ROWS]
    ]
    return chips, rows


def timings(rows: Sequence[StageTiming]) -> list[tuple[str, str, str, str, str, str, str]]:
    """Stage, time, models, seconds a model, quarantined, peak memory, and the bar in per cent."""
    longest = max((row.seconds for row in rows), default=0.0)
    return [
        (
            plain(row.stage),
            duration(row.seconds),
            str(row.models),
            _rate(row.seconds / row.models) if row.models else DASH,
            str(row.quarantined),
            DASH if row.peak_memory is None else f"{row.peak_memory / 2**20:,.0f} MiB",
            f"{100 * row.seconds / longest:.1f}" if longest > 0 else "0",
        )
        for row in rows
    ]


def _rate(seconds: float) -> str:
    return f"{seconds:.{3 if seconds < 1 else 1 if seconds < 100 else 0}f} s"


def duration(seconds: float) -> str:
    """A span of time in the two units that matter: `2 h 05 min`, `3 min 20 s`, `7.5 s`."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest:02d} s"
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min"
