"""What the page's template is given: strings, flags and pictures, ready to be laid out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from .charts import VALIDATION, Strip, loss_chart, strip_chart, validation_chart
from .data import Quarantined, ReportData, StageTiming
from .export import WIDE
from .measures import Subset, read_models
from .tables import COMPARISON, Interval, Row, Table, Tables
from .text import DASH, MINUS, cell, heading, interval, plain

SECTIONS = (
    ("Exact volumes", ("volume_iou", "covered", "excess")),
    (
        "Grid and coverage",
        ("iou_128_not_closed", "coverage_not_closed", "iou_128", "coverage", "open_space"),
    ),
    ("Distances", ("out_99", "out_max", "miss_99", "miss_max")),
    ("For the paper's tables", ("iou_32", "iou_64", "cd_l1", "cd_l2", "cd_surface")),
)
"""Tables of measures by section; others come last."""
UNFOLDED = ("volume_iou", "iou_128_not_closed", "coverage_not_closed", "out_99", "miss_99")
"""Tables that are open when the page is."""
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

    Tables other than the main ones are folded away (not `unfolded`).
    """

    title: str
    unfolded: bool
    head: tuple[tuple[str, str], ...]
    lines: tuple[tuple[str, str, tuple[GridCell, ...]], ...]
    notes: tuple[str, ...]


HEADLINES = (
    ("volume_iou", "exact volume IoU", "{covered} of {models} models are closed"),
    ("iou_128_not_closed", "IoU at 128³", "{covered} of {models} models are not closed"),
    ("coverage_not_closed", "coverage", "{covered} of {models} models are not closed"),
    ("out_99", "result outside the shape", "99th percentile, share of the longest side"),
    ("miss_99", "shape missed by the result", "99th percentile, share of the longest side"),
)
"""Measures at the top of the page: table, label, and which models or what."""


def headline(data: ReportData) -> list[Figure]:
    """The figures at the top, of the first variant: exact where models are closed, then others."""
    variant = data.tables.variants[0]
    several = len(data.tables.variants) > 1
    table = data.tables[f"counts/{variant}" if several else "counts"]
    counts = {row.label: row for row in table.rows}
    models, ok = _number(counts["models"]), _number(counts["with a result"])
    failed = [
        f"{_number(row)} {label.removeprefix('failed: ')}"
        for label, row in counts.items()
        if label.startswith("failed: ") and row.summary
    ]
    figures = [
        Figure("models with a result", f"{ok} of {models}", ", ".join(failed) or "none failed")
    ]
    for name, label, note in HEADLINES:
        measured = data.tables.get(name)
        row = None if measured is None else measured.row("cropped", variant)
        if measured is None or row is None:
            continue
        covered = sum(column.models for column in measured.columns)
        parts = [note.format(covered=covered, models=models), *_sureness(row)]
        figures.append(Figure(label, f"{_shown(row.overall, row)} %", "; ".join(parts)))
    kinds = [counts[label] for label in ("positives", "negatives") if label in counts]
    if kinds:
        boxes = " + ".join(_shown(row.summary, row) for row in kinds)
        names = " and ".join(row.label for row in kinds)
        figures.append(Figure("boxes a model", boxes, names))
    if "failed checks" in counts:
        left = counts.get("left the bounding box")
        note = "" if left is None else f"{_number(left)} left the bounding box"
        figures.append(Figure("failed checks", str(_number(counts["failed checks"])), note))
    return figures


def _sureness(row: Row) -> list[str]:
    """The interval of a mean over all models, and the average over categories beside it."""
    parts = []
    if row.overall_interval:
        parts.append(f"95 % interval {_span(row.overall_interval, row)}")
    if row.summary is not None:
        parts.append(f"average over categories {_shown(row.summary, row)} %")
    return parts


def _number(row: Row) -> int:
    """A number of models."""
    return int(row.summary or 0)


def grids(tables: Tables, prefix: str) -> list[Grid]:
    """The tables whose names start with a prefix, laid out."""
    return [_grid(table) for table in tables.tables if table.name.startswith(prefix)]


def sections(tables: Tables) -> list[tuple[str, list[Grid]]]:
    """The tables of measures by section, laid out."""
    placed = {name: title for title, names in SECTIONS for name in names}
    found: dict[str, list[Grid]] = {title: [] for title in (*dict(SECTIONS), "Others")}
    for table in tables.tables:
        if not table.name.startswith((COMPARISON, "counts")):
            found[placed.get(table.name, "Others")].append(_grid(table))
    return [(title, own) for title, own in found.items() if own]


def _shown(value: float | None, row: Row) -> str:
    """A cell's figure in print: a dash where there is none, and a true minus sign."""
    return cell(value, row, DASH).replace("-", MINUS)


def _span(span: Interval | None, row: Row) -> str:
    return interval(span, row).replace("-", MINUS)


def _grid(table: Table) -> Grid:
    best = table.best()
    counts = table.better is None
    columns = [
        (
            (plain(column.label), "" if counts else str(column.models)),
            "plain",
            _cells([row.values[j] for row in table.rows], table.rows, [line[j] for line in best]),
        )
        for j, column in enumerate(table.columns)
    ]
    for j, total in enumerate(table.totals, len(table.columns)):
        marks = [line[j] for line in best]
        columns.append(((total.label, ""), "summary", _cells(total.values, table.rows, marks)))
        if any(total.intervals):
            spans = map(_span, total.intervals, table.rows)
            cells = [GridCell(span, "interval") for span in spans]
            columns.append((("95 % interval", ""), "interval", cells))
    unfolded = counts or table.name.removeprefix(COMPARISON) in UNFOLDED
    lines: list[tuple[str, str, tuple[GridCell, ...]]]
    if len(table.columns) <= WIDE:
        lines = [
            (plain(row.label), row.role, tuple(cells[i] for _, _, cells in columns))
            for i, row in enumerate(table.rows)
        ]
        head = tuple(title for title, _, _ in columns)
    else:
        lines = [
            (label + (f" ({note})" if note else ""), style, tuple(cells))
            for (label, note), style, cells in columns
        ]
        head = tuple((plain(row.label), "") for row in table.rows)
    return Grid(heading(table), unfolded, head, tuple(lines), tuple(map(plain, table.notes)))


def _cells(
    values: Sequence[float | None], rows: Sequence[Row], best: Sequence[bool]
) -> list[GridCell]:
    return [
        GridCell(_shown(value, row), "best" if top else "none" if not value else "")
        for value, row, top in zip(values, rows, best, strict=True)
    ]


STRIPS: tuple[tuple[str, str, str, Subset, str], ...] = (
    ("volume_iou", "volume_iou", "Closed models", "closed", "exact volume IoU, %"),
    ("iou_128_not_closed", "iou_128", "Models that are not closed", "not closed", "IoU at 128³, %"),
)
"""Charts of single models: table, column, title, models, and what the axis shows."""


def model_charts(data: ReportData) -> list[Markup]:
    """Strip charts of the first variant: exact volumes of closed models, the grid for others."""
    models = read_models(data.rows[data.tables.variants[0]], data.split)
    category = np.array(models.category, dtype=object)
    charts = []
    for name, column, title, subset, axis in STRIPS:
        table = data.tables.get(name)
        if table is None:
            continue
        values = 100 * models.figures(column, subset)
        known = np.isfinite(values)
        strips = [Strip(c.label, values[known & (category == c.category)]) for c in table.columns]
        charts.append(strip_chart(title, axis, strips))
    return charts


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
