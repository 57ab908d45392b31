"""What a reader must know of a table: which models it covers, and what became of the others."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from .measures import FAILURES, REASONS, Measure, Models
from .tables import MIN_MODELS, Column, Row


def measure_notes(measure: Measure, models: Mapping[str, Models]) -> list[str]:
    """What the measure is, and which of the models it covers."""
    notes = [measure.note] if measure.note else []
    if measure.models == "all":
        return notes
    verdicts: dict[tuple[str, str], str | None] = {}
    for table in models.values():
        verdicts |= zip(table.names, table.not_exact, strict=True)
    count = Counter(verdicts.values())
    others = [f"{count[reason]} {reason}" for reason in REASONS if count[reason]]
    others += [f"{count[None]} not known, as the shape can't be read"] if count[None] else []
    note = f"Closed: {count['']} of {len(verdicts)} models"
    return [*notes, note + (f"; not closed: {', '.join(others)}." if others else ".")]


def average_notes(columns: Sequence[Column], rows: Sequence[Row]) -> list[str]:
    """Which categories an average covers, and which are too small for it."""
    results = [row for row in rows if row.role == "cropped"]
    most = [max(row.models[j] for row in results) for j in range(len(columns))]
    labels = [column.label for column in columns]
    covered = tuple(number >= MIN_MODELS for number in most)
    if not any(covered):
        return [f"No average: no category has {MIN_MODELS} models with a figure."]
    noun = "category" if sum(covered) == 1 else "categories"
    note = f"Average over {sum(covered)} {noun} with at least {MIN_MODELS} models"
    small = [f"{labels[j]} ({most[j]})" for j, enough in enumerate(covered) if not enough]
    notes = [note + (f"; too small, and left out: {', '.join(small)}." if small else ".")]
    for row in rows:
        if row.averaged != covered:
            own = [label for label, inside in zip(labels, row.averaged, strict=True) if inside]
            notes.append(f"{row.label}: average over {', '.join(own) or 'none of them'}.")
    return notes


def failure_notes(measure: Measure, models: Mapping[str, Models]) -> list[str]:
    """How many of each variant's models aren't in its means, and why."""
    notes = []
    for variant, table in models.items():
        absent = _absent(measure, table)
        if absent:
            prefix = f"{variant}: not" if len(models) > 1 else "Not"
            total = int(table.members(measure.models).sum())
            notes.append(f"{prefix} in the means, of {total} models: {absent}.")
    return notes or ["No model failed."]


def _absent(measure: Measure, models: Models) -> str:
    """Of a measure's models, those that failed, by kind, and those whose result has no figure."""
    members = models.members(measure.models)
    status = Counter(kind for kind, member in zip(models.status, members, strict=True) if member)
    failed = [f"{status[kind]} {kind}" for kind in FAILURES if status[kind]]
    number = sum(status.values()) - status["ok"]
    parts = [f"{number} failed ({', '.join(failed)})"] if number else []
    bare = status["ok"] - int(np.isfinite(models.result(measure)).sum())
    if bare:
        reason = "not closed" if measure.models == "closed" else "without this figure"
        parts.append(f"{bare} with a result {reason}")
    return ", ".join(parts)


def pairing_notes(measure: Measure, models: Mapping[str, Models], rows: Sequence[Row]) -> list[str]:
    """Over which models variants are compared, and what failures are worth."""
    first = next(iter(models))
    side = "above" if measure.better == "higher" else "below"
    notes = [
        f"Differences are paired by model; {measure.better} is better, so {first} is ahead where "
        f"its difference is {side} 0."
    ]
    if measure.missing_is_zero:
        absent = {variant: _absent(measure, table) for variant, table in models.items()}
        told = "; ".join(f"{variant}: {text}" for variant, text in absent.items() if text)
        return [*notes, f"Counted as 0: {told}." if told else "No model failed."]
    results, *_ = rows
    pairs = [f"{row.label} {sum(row.models)}" for row in rows if row.role == "difference"]
    return [
        *notes,
        f"Rows cover the {sum(results.models)} models where each has a figure; differences those "
        f"where both have one: {', '.join(pairs)}.",
    ]
