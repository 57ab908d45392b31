"""The table of counts: what became of a variant's models, and what their results are made of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pnabs.geometry.check import BEYOND
from pnabs.geometry.types import Bool, Float64

from .measures import FAILURES, MEANS, REASONS, Models
from .tables import Column, Row, Table, tidy

NOTE = (
    "Models, results, failures, closed and not closed, checks, and what was done again are numbers "
    "of models; all others are means over the models with a result. Connected pieces of shape and "
    "result are counted by one rule, at 64³ cells with 26 neighbours; bodies are the mesh's own."
)


def count_table(
    variant: str, models: Models, columns: tuple[Column, ...], *, single: bool
) -> Table:
    """Counts and means by category and over all models.

    Parameters
    ----------
    variant : str
    models : Models
    columns : tuple of Column
        Categories, with all of the variant's models.
    single : bool
        Whether there is no other variant, so that the table is named `counts` alone.

    Returns
    -------
    Table
        Without rows of what no model has a figure for.
    """
    category = np.array(models.category, dtype=object)
    every = np.ones(len(category), dtype=bool)
    groups = [*(category == column.category for column in columns), every]
    numbers = models.numbers

    def row(label: str, cells: Sequence[float | None], known: Bool, digits: int = 0) -> Row:
        covered = tuple(int((group & known).sum()) for group in groups[:-1])
        values, whole = tuple(cells[:-1]), cells[-1]
        return Row(label, variant, "count", values, covered, whole, None, whole, None, digits)

    def count(label: str, mask: Bool) -> Row:
        return row(label, [float((group & mask).sum()) for group in groups], every)

    def mean(label: str, values: Float64, known: Bool, digits: int) -> Row:
        cells = [
            tidy(float(values[group & known].mean())) if (group & known).any() else None
            for group in groups
        ]
        return row(label, cells, known, digits)

    status = np.array(models.status, dtype=object)
    rows = [count("models", every), count("with a result", models.ok)]
    # Only results that somebody hands in can be missing.
    kinds = [kind for kind in FAILURES if kind != "missing" or (status == kind).any()]
    rows += [count(f"failed: {kind}", status == kind) for kind in kinds]
    reason = np.array(models.not_exact, dtype=object)
    if any(known is not None for known in models.not_exact):
        rows.append(count("closed, with an exact volume", reason == ""))
        rows += [count(f"not closed: {name}", reason == name) for name in REASONS]
    for label, column, mask in (
        ("failed checks", "check_ok", numbers["check_ok"] == 0),
        ("left the bounding box", "beyond", numbers["beyond"] > BEYOND),
        ("fitted again", "fitted_again", numbers["fitted_again"] > 0),
        ("cropped again, jittered", "jitter_attempt", numbers["jitter_attempt"] > 0),
    ):
        if np.isfinite(numbers[column][models.ok]).any():
            rows.append(count(label, models.ok & mask))
    for label, column, digits in MEANS:
        known = models.ok & np.isfinite(numbers[column])
        if known.any():
            rows.append(mean(label, numbers[column], known, digits))
    name, title = ("counts", "Counts") if single else (f"counts/{variant}", f"Counts, {variant}")
    return Table(name, title, "", None, columns, "all", tuple(rows), (NOTE,))
