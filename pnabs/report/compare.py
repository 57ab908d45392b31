"""The figures of a run, or of anybody's results: a table a measure, and counts.

Rows are methods that were measured, and nothing else.  Means are of what succeeded, and how many
models failed stands below each table.  Averages weigh categories equally, as the paper's do, and
cover categories with at least `MIN_MODELS` models; beside them stands the mean over all models.
Intervals are bootstrapped by drawing models anew, for averages within each category.

With several variants, further tables hold their results side by side, as the paper's tables 3 and
4 hold its ablations: over the same models, with a failure at IoU 0, and with what the first has
ahead of each, paired by model.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pyarrow as pa

from pnabs.geometry.types import Float64

from .averages import figures
from .counts import count_table
from .measures import MEASURES, Measure, Models, Subset, read_models
from .notes import average_notes, failure_notes, measure_notes, pairing_notes
from .tables import COMPARISON, Column, Role, Row, Table, Tables

Name = tuple[str, str]
"""Category and id of a model."""

_LABELS: dict[Role, str] = {
    "positives": "its positives, not cropped",
    "mesh": "as the written mesh",
    "networks": "as the networks predict",
    "floor": "sampling floor",
}
"""Rows below the result's own, in this order."""


def build_tables(
    rows: Mapping[str, pa.Table],
    rng: np.random.Generator,
    *,
    names: Mapping[str, str] | None = None,
    split: str = "test",
    resamples: int = 2_000,
) -> Tables:
    """The tables of a run, or of several results for the same shapes.

    Parameters
    ----------
    rows : mapping of variant to pyarrow.Table
        One row a model, with the columns `REQUIRED` and any of `COLUMNS`; what isn't there is left
        out of the tables.  Shares and lengths are fractions, Chamfer distances x 1000.
    rng : numpy.random.Generator
        For the bootstrap; drawn from in the order of variants and categories.
    names : mapping of category to alias, optional
    split : str
        Models to cover: a split's name, or `all`.
    resamples : int
        Bootstrap resamples.

    Returns
    -------
    Tables
        One for each of `MEASURES` that a model has a figure for; with several variants also
        `variants/<measure>` each; and one `counts` (or `counts/<variant>`) a variant.

    Raises
    ------
    ValueError
        If there is no variant, or a table lacks required columns.
    """
    if not rows:
        raise ValueError("a report needs the metrics of at least one variant")
    models = _agreed({variant: read_models(table, split) for variant, table in rows.items()})
    labels = _categories(models.values(), names or {})
    subsets = {measure.models for measure in MEASURES}
    columns = {subset: _columns(subset, models.values(), labels) for subset in subsets}
    several = len(models) > 1
    single: dict[str, list[Row]] = {}
    for variant, table in models.items():
        drafts = _single_drafts(variant, table, several=several)
        for name, own in _rows(drafts, table.category, columns, resamples, rng).items():
            single.setdefault(name, []).extend(own)
    paired: dict[str, list[Row]] = {}
    if several:
        order = list(dict.fromkeys(name for table in models.values() for name in table.names))
        categories = [category for category, _ in order]
        paired = _rows(_paired_drafts(models, order), categories, columns, resamples, rng)
    tables = [
        make(measure, models, columns[measure.models], found[measure.name])
        for make, found in ((_single_table, single), (_paired_table, paired))
        for measure in MEASURES
        if measure.name in found
    ]
    for variant, table in models.items():
        # All categories, so that one that a variant doesn't have stands there with 0 models.
        sizes = Counter(table.category)
        whole = tuple(Column(name, label, sizes[name]) for name, label in labels.items())
        tables.append(count_table(variant, table, whole, single=not several))
    return Tables(split, tuple(rows), resamples, tuple(tables))


def _agreed(models: Mapping[str, Models]) -> dict[str, Models]:
    """The same verdict on a shape for all variants: one that lacks it takes it from another."""
    known: dict[Name, str] = {}
    for table in models.values():
        for name, reason in zip(table.names, table.not_exact, strict=True):
            if reason is not None:
                known.setdefault(name, reason)
    return {
        variant: replace(
            table,
            not_exact=tuple(
                known.get(name) if reason is None else reason
                for name, reason in zip(table.names, table.not_exact, strict=True)
            ),
        )
        for variant, table in models.items()
    }


def _categories(models: Iterable[Models], names: Mapping[str, str]) -> dict[str, str]:
    """Category to label, in the order of the caller's names (the paper's, say), others by name."""
    rank = {category: i for i, category in enumerate(names)}
    found = {category for table in models for category in table.category}
    order = sorted(found, key=lambda category: (rank.get(category, len(rank)), category))
    return {category: names.get(category, category) for category in order}


def _columns(
    subset: Subset, models: Iterable[Models], labels: Mapping[str, str]
) -> tuple[Column, ...]:
    """The categories that have models of a subset, with the number of these."""
    most: dict[str, int] = {}
    for table in models:
        inside = table.members(subset)
        count = Counter(c for c, member in zip(table.category, inside, strict=True) if member)
        for category, number in count.items():
            most[category] = max(most.get(category, 0), number)
    return tuple(Column(c, label, most[c]) for c, label in labels.items() if c in most)


@dataclass(frozen=True, slots=True, eq=False)
class _Draft:
    """A row before its figures are known: the value of each model, nan where it has none, (n,)."""

    measure: Measure
    label: str
    variant: str
    role: Role
    values: Float64


def _rows(
    drafts: Sequence[_Draft],
    category: Sequence[str],
    columns: Mapping[Subset, Sequence[Column]],
    resamples: int,
    rng: np.random.Generator,
) -> dict[str, list[Row]]:
    """Measure to its rows, of drafts over the same models; bootstrapped together, as they may."""
    rows: dict[str, list[Row]] = {}
    if not drafts:
        return rows
    values = np.stack([draft.values for draft in drafts], axis=1)
    found = figures(values, np.array(category), resamples, rng)
    for draft, figure in zip(drafts, found, strict=True):
        own = columns[draft.measure.models]
        row = figure.row(draft.label, draft.variant, draft.role, own)
        rows.setdefault(draft.measure.name, []).append(row)
    return rows


def _single_drafts(variant: str, models: Models, *, several: bool) -> list[_Draft]:
    """Of each measure the results of one variant, if there are any, and what goes with them."""
    prefix = f"{variant}: " if several else ""
    drafts = []
    for measure in MEASURES:
        result = models.result(measure)
        if not np.isfinite(result).any():
            continue
        name = variant if several else "result"
        drafts.append(_Draft(measure, name, variant, "cropped", result))
        sources = dict(measure.columns)
        for role in (role for role in _LABELS if role in sources):
            values = models.figures(sources[role], measure.models) * measure.factor
            # Without negatives the positives are the result, and without a fit the prediction is.
            repeated = role in ("positives", "networks") and np.array_equal(
                values, result, equal_nan=True
            )
            if np.isfinite(values).any() and not repeated:
                drafts.append(_Draft(measure, prefix + _LABELS[role], variant, role, values))
    return drafts


def _single_table(
    measure: Measure, models: Mapping[str, Models], columns: tuple[Column, ...], rows: list[Row]
) -> Table:
    """Each variant's result over what succeeded, and below it what goes with it."""
    notes = [*measure_notes(measure, models), *average_notes(columns, rows)]
    notes += failure_notes(measure, models)
    results = {row.variant: row for row in rows if row.role == "cropped"}
    notes += [
        f"{row.label}: over {sum(row.models)} of {sum(results[row.variant].models)} models."
        for row in rows
        if row.models != results[row.variant].models
    ]
    roles = {row.role for row in rows}
    if "positives" in roles:
        notes.append(
            "Positives are made to be cropped: what they lose without the crop is more than "
            "what negatives gain."
        )
    if "floor" in roles:
        notes.append("Sampling floor: the same distance between two samplings of one surface.")
    return _table(measure, measure.name, measure.title, columns, rows, notes)


def _table(
    measure: Measure,
    name: str,
    title: str,
    columns: tuple[Column, ...],
    rows: Sequence[Row],
    notes: Sequence[str],
) -> Table:
    return Table(
        name, title, measure.unit, measure.better, columns, "average", tuple(rows), tuple(notes)
    )


def _paired_drafts(models: Mapping[str, Models], names: Sequence[Name]) -> list[_Draft]:
    """Of each measure that several variants have, their results over the same models and pairs."""
    place = {name: i for i, name in enumerate(names)}
    places = {
        variant: np.array([place[name] for name in table.names], dtype=np.int64)
        for variant, table in models.items()
    }
    drafts = []
    for measure in MEASURES:
        found: dict[str, Float64] = {}
        for variant, table in models.items():
            values = np.full(len(names), np.nan)
            values[places[variant]] = _with_failures(measure, table)
            if np.isfinite(values).any():
                found[variant] = values
        measured = any(np.isfinite(models[variant].result(measure)).any() for variant in found)
        if len(found) < 2 or not measured:
            continue
        common = np.isfinite(np.stack(list(found.values()))).all(axis=0)
        drafts += [
            _Draft(measure, variant, variant, "cropped", np.where(common, values, np.nan))
            for variant, values in found.items()
        ]
        first, *others = found
        drafts += [
            _Draft(
                measure, f"{first} minus {other}", other, "difference", found[first] - found[other]
            )
            for other in others
        ]
    return drafts


def _with_failures(measure: Measure, models: Models) -> Float64:
    """The figure of each model, and 0 for those without where a failure is worth that, (n,).

    All nan where there are results but none has this figure: they weren't measured so.
    """
    values = models.result(measure)
    members = models.members(measure.models)
    if measure.missing_is_zero and (np.isfinite(values).any() or not (members & models.ok).any()):
        return np.where(members, np.nan_to_num(values), np.nan)
    return values


def _paired_table(
    measure: Measure, models: Mapping[str, Models], columns: tuple[Column, ...], rows: list[Row]
) -> Table:
    """The results of several variants, and the first minus each other."""
    shown = {row.variant: models[row.variant] for row in rows if row.role == "cropped"}
    notes = [
        *measure_notes(measure, models),
        *average_notes(columns, rows),
        *pairing_notes(measure, shown, rows),
    ]
    title = f"{measure.title}, side by side"
    return _table(measure, COMPARISON + measure.name, title, columns, rows, notes)
