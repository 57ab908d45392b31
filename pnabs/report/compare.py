"""The figures of a run: the paper's tables 1 and 2 for this dataset, open space, and counts.

Rows are methods measured in the run, and nothing else: "positives and negatives", and
"positives only", which takes the role of the paper's POSPRIM with the same positives.
Averages weigh categories equally, as the paper's do, and cover categories with at
least `MIN_MODELS` models.  Intervals are bootstrapped by drawing models anew within
each category; both methods see the same draws, so the interval of their difference
is a paired one.  With several variants, further tables hold their results side by side, as the
paper's tables 3 and 4 hold its ablations, and what the first has ahead of each, paired by model.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from pnabs.geometry.types import Bool, Float64

from .measures import FAILURES, MEANS, MEASURES, Measure, Models, read_models
from .tables import Column, Role, Row, Table, Tables

MIN_MODELS = 5
"""Categories with fewer models stay out of averages (METHOD, metrics)."""

_LABELS: dict[Role, str] = {
    "cropped": "positives and negatives",
    "positives": "positives only",
    "difference": "difference",
    "mesh": "as the written mesh",
    "networks": "as the networks predict",
    "floor": "sampling floor",
}
_ORDER: tuple[Role, ...] = (*("cropped", "positives", "difference", "mesh", "networks", "floor"),)


def bootstrap_means(values: Float64, resamples: int, rng: np.random.Generator) -> Float64:
    """Means of resampled models.

    Parameters
    ----------
    values : (n, m) float64
        m quantities of n models; a model is drawn with all of its quantities.
    resamples : int
    rng : numpy.random.Generator

    Returns
    -------
    (resamples, m) float64
    """
    n = len(values)
    means = np.empty((resamples, values.shape[1]))
    step = max(1, 4_000_000 // max(1, n * values.shape[1]))
    for start in range(0, resamples, step):
        stop = min(start + step, resamples)
        means[start:stop] = values[rng.integers(n, size=(stop - start, n))].mean(axis=1)
    return means


def build_tables(
    rows: Mapping[str, pa.Table],
    rng: np.random.Generator,
    *,
    names: Mapping[str, str] | None = None,
    split: str = "test",
    resamples: int = 2_000,
) -> Tables:
    """The tables of a run.

    Parameters
    ----------
    rows : mapping of variant to pyarrow.Table
        One row a model (`COLUMNS`).  IoUs and open space are shares, distances are x 1000.
    rng : numpy.random.Generator
        For the bootstrap; drawn from in the order of variants, measures and categories.
    names : mapping of category to alias, optional
    split : str
        Models to cover: a split's name, or `all`.
    resamples : int
        Bootstrap resamples.

    Returns
    -------
    Tables
        `iou_32`, `iou_64`, `cd_l1`, `cd_l2`, `cd_surface`, `open_space`, with several variants
        `variants/<measure>` each, and one `counts` (or `counts/<variant>`) a variant.

    Raises
    ------
    ValueError
        If there is no variant, or a table lacks columns.
    """
    if not rows:
        raise ValueError("a report needs the metrics of at least one variant")
    models = {variant: read_models(table, split) for variant, table in rows.items()}
    prefix = {variant: f"{variant}: " if len(rows) > 1 else "" for variant in rows}
    sizes: dict[str, int] = {}
    for covered in models.values():
        for category, count in Counter(covered.category).items():
            sizes[category] = max(sizes.get(category, 0), count)
    # Categories in the order of the caller's names (the paper's order, say), others by name.
    rank = {category: i for i, category in enumerate(names or {})}
    order = sorted(sizes, key=lambda category: (rank.get(category, len(rank)), category))
    columns = tuple(Column(c, (names or {}).get(c, c), sizes[c]) for c in order)
    tables = [
        _measure_table(measure, models, prefix, columns, resamples, rng) for measure in MEASURES
    ]
    if len(models) > 1:
        tables += [_variant_table(measure, models, columns, resamples, rng) for measure in MEASURES]
    for variant, table in models.items():
        tables.append(_count_table(variant, table, columns, single=len(rows) == 1))
    return Tables(split, tuple(rows), resamples, tuple(tables))


def _measure_table(
    measure: Measure,
    models: Mapping[str, Models],
    prefix: Mapping[str, str],
    columns: tuple[Column, ...],
    resamples: int,
    rng: np.random.Generator,
) -> Table:
    rows: list[Row] = []
    absent: list[str] = []
    for variant, table in models.items():
        block, failed = _method_rows(
            measure, variant, table, prefix[variant], columns, resamples, rng
        )
        rows += block
        if failed:
            absent.append(f"{prefix[variant]}{failed}")
    notes = [_average_note(columns)]
    if absent:
        fate = "counted as IoU 0" if measure.missing_is_zero else "left out"
        notes.append(f"Models without a figure, {fate}: {', '.join(absent)}.")
    for row in (row for row in rows if row.role == "cropped"):
        large = [(c, v) for c, v in zip(columns, row.values, strict=True) if c.models >= MIN_MODELS]
        bare = [column.label for column, value in large if value is None]
        if bare:
            names = ", ".join(bare)
            notes.append(
                f"{prefix[row.variant]}no model has a figure, so no part in the average: {names}."
            )
    if any(role == "floor" for role, _ in measure.columns):
        notes.append("Sampling floor: the same distance between two samplings of one surface.")
    return Table(
        measure.name,
        measure.title,
        measure.unit,
        measure.better,
        columns,
        "average",
        tuple(rows),
        tuple(notes),
    )


def _method_rows(
    measure: Measure,
    variant: str,
    models: Models,
    prefix: str,
    columns: tuple[Column, ...],
    resamples: int,
    rng: np.random.Generator,
) -> tuple[list[Row], int]:
    """The rows of one variant, and how many of its models have no figure."""
    roles: list[Role] = [role for role, _ in measure.columns]
    values = (
        np.stack([models.numbers[name] for _, name in measure.columns], axis=1) * measure.factor
    )
    values[~models.ok] = np.nan
    missing = ~np.isfinite(values).all(axis=1)
    if measure.missing_is_zero:
        values = np.where(np.isfinite(values), values, 0.0)
    kept = np.isfinite(values).all(axis=1)
    roles.append("difference")
    values = np.column_stack([values, values[:, 0] - values[:, 1]])[kept]
    figures = _figures(values, np.array(models.category)[kept], columns, resamples, rng)
    rows = [
        Row(
            prefix + _LABELS[role],
            variant,
            role,
            *figures[i],
        )
        for role in _ORDER
        if role in roles
        for i in (roles.index(role),)
        # without a fit the prediction is the result
        if role != "networks" or not np.array_equal(values[:, i], values[:, 0], equal_nan=True)
    ]
    return rows, int(missing.sum())


Figures = tuple[tuple[float | None, ...], float | None, tuple[float, float] | None, float | None]
"""Of one row: a mean a category, their average and its interval, the mean over all models."""


def _figures(
    values: Float64,
    category: NDArray[np.str_],
    columns: tuple[Column, ...],
    resamples: int,
    rng: np.random.Generator,
) -> list[Figures]:
    """The figures of each row, of values (models, rows) without gaps."""
    count = values.shape[1]
    means = np.full((count, len(columns)), np.nan)
    draws: list[Float64] = []
    averaged: list[int] = []
    for j, column in enumerate(columns):
        chosen = values[category == column.category]
        if not len(chosen):
            continue
        means[:, j] = chosen.mean(axis=0)
        if column.models >= MIN_MODELS:
            averaged.append(j)
            draws.append(bootstrap_means(chosen, resamples, rng))
    summary: list[float | None] = [None] * count
    interval: list[tuple[float, float] | None] = [None] * count
    if averaged:
        low, high = np.percentile(np.mean(draws, axis=0), [2.5, 97.5], axis=0)
        for i, average in enumerate(means[:, averaged].mean(axis=1)):
            summary[i] = _tidy(average)
            interval[i] = (_exact(low[i]), _exact(high[i]))
    overall = values.mean(axis=0) if len(values) else np.full(count, np.nan)
    return [
        (tuple(_tidy(value) for value in means[i]), summary[i], interval[i], _tidy(overall[i]))
        for i in range(count)
    ]


def _variant_table(
    measure: Measure,
    models: Mapping[str, Models],
    columns: tuple[Column, ...],
    resamples: int,
    rng: np.random.Generator,
) -> Table:
    """The result of each variant, and the first minus each other, over models that both have."""
    found = {variant: _by_model(measure, table) for variant, table in models.items()}
    first, *others = models

    def row(label: str, variant: str, role: Role, values: Mapping[tuple[str, str], float]) -> Row:
        numbers = np.array(list(values.values()), dtype=np.float64).reshape(-1, 1)
        category = np.array([category for category, _ in values])
        figures = _figures(numbers, category, columns, resamples, rng)
        return Row(label, variant, role, *figures[0])

    rows = [row(variant, variant, "cropped", values) for variant, values in found.items()]
    for other in others:
        both = [model for model in found[first] if model in found[other]]
        gains = {model: found[first][model] - found[other][model] for model in both}
        rows.append(row(f"{first} minus {other}", other, "difference", gains))
    return Table(
        f"variants/{measure.name}",
        f"{measure.title}, by variant",
        measure.unit,
        measure.better,
        columns,
        "average",
        tuple(rows),
        (
            _average_note(columns),
            f"Differences are paired by model; {measure.better} is better, so {first} is ahead "
            f"where its difference is {'above' if measure.better == 'higher' else 'below'} 0.",
        ),
    )


def _by_model(measure: Measure, models: Models) -> dict[tuple[str, str], float]:
    """The result of each model that has one; where none is worth 0, of all."""
    values = models.numbers[measure.columns[0][1]] * measure.factor
    values = np.where(models.ok, values, np.nan)
    if measure.missing_is_zero:
        values = np.nan_to_num(values)
    names = zip(models.category, models.model_id, strict=True)
    return {
        name: value for name, value in zip(names, values.tolist(), strict=True) if value == value
    }


def _count_table(
    variant: str, models: Models, columns: tuple[Column, ...], *, single: bool
) -> Table:
    category = np.array(models.category, dtype=object)
    status = np.array(models.status, dtype=object)
    groups = [
        *(category == column.category for column in columns),
        np.ones(len(category), dtype=bool),
    ]
    numbers = models.numbers

    def row(label: str, cells: Sequence[float | None], digits: int = 0) -> Row:
        return Row(label, variant, "count", tuple(cells[:-1]), cells[-1], None, cells[-1], digits)

    def count(label: str, mask: Bool) -> Row:
        return row(label, [float((group & mask).sum()) for group in groups])

    def mean(label: str, values: Float64, digits: int) -> Row:
        known = models.ok & np.isfinite(values)
        return row(
            label,
            [
                _tidy(values[group & known].mean()) if (group & known).any() else None
                for group in groups
            ],
            digits,
        )

    rows = [count("models", np.ones(len(category), dtype=bool)), count("with a result", models.ok)]
    rows += [count(f"failed: {kind}", status == kind) for kind in FAILURES]
    rows += [mean(label, numbers[name], digits) for label, name, digits in MEANS]
    rows.append(count("failed checks", models.ok & (numbers["check_ok"] == 0)))
    rows.append(count("cropped again, jittered", models.ok & (numbers["jitter_attempt"] > 0)))
    notes = (
        "Models, with a result, failed, failed checks and cropped again are numbers of models; "
        "the rest are means over the models with a result.",
    )
    name, title = ("counts", "Counts") if single else (f"counts/{variant}", f"Counts, {variant}")
    return Table(name, title, "", None, columns, "all", tuple(rows), notes)


def _average_note(columns: Sequence[Column]) -> str:
    """Which categories an average covers, and which are too small for it."""
    small = [f"{c.label} ({c.models})" for c in columns if c.models < MIN_MODELS]
    covered = len(columns) - len(small)
    if not covered:
        return f"No average: no category has {MIN_MODELS} models."
    noun = "category" if covered == 1 else "categories"
    note = f"Average over {covered} {noun} with at least {MIN_MODELS} models"
    return note + (f"; too small, and left out: {', '.join(small)}." if small else ".")


def _exact(value: float) -> float:
    """Rounded well beyond what is shown, so that last-bit noise doesn't reach tables.json."""
    return round(float(value), 6) + 0.0


def _tidy(value: float) -> float | None:
    return _exact(value) if np.isfinite(value) else None
