"""What the report reads from a table of metrics: columns, measures, and rows as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from pnabs.geometry.types import Bool, Float64

from .tables import Role

FAILURES = ("invalid", "error", "crash", "timeout", "memory", "missing")
"""Kinds of verdict that leave a model without a result."""

REASONS = {
    "open": "not closed",
    "refused": "refused by the exact boolean",
    "large": "too large for exact volumes",
    "empty": "without a volume",
}
"""Why a model doesn't count as closed: values of `not_exact`, and what they mean."""

Subset = Literal["all", "closed", "not closed"]
"""Models that a measure covers: those with an exact solid are *closed*."""


@dataclass(frozen=True, slots=True)
class Measure:
    """A metric: its texts, and the column that holds it for each role.

    Attributes
    ----------
    name : str
        Key of its table.
    title, unit : str
    better : {'higher', 'lower'}
    columns : tuple of (role, column)
        The first is `cropped`, the result itself.
    factor : float
        From the column's unit to the table's.
    missing_is_zero : bool
        Where methods are compared, a model without a result counts as 0; otherwise it is left out.
    models : {'all', 'closed', 'not closed'}
        Models that it covers.
    note : str
        What a reader must know of it.
    """

    name: str
    title: str
    unit: str
    better: Literal["higher", "lower"]
    columns: tuple[tuple[Role, str], ...]
    factor: float = 1.0
    missing_is_zero: bool = False
    models: Subset = "all"
    note: str = ""


def _share(name: str, title: str, column: str, models: Subset = "all", note: str = "") -> Measure:
    """A share in per cent, of which more is better and none is worth 0."""
    return Measure(name, title, "%", "higher", (("cropped", column),), 100.0, True, models, note)


def _length(name: str, title: str, note: str) -> Measure:
    """A distance in per cent of the longest side."""
    columns: tuple[tuple[Role, str], ...] = (("cropped", name),)
    return Measure(name, title, "% of the longest side", "lower", columns, 100.0, note=note)


_COVERAGE = "Coverage: outer surface within 1 % of the longest side of the result, or in it."
_OUT = "Measured from the result's surface to the shape; 0 where it is inside the shape."
_MISS = "Measured from the shape's outer surface to the result; 0 where it is inside the result."

MEASURES = (
    _share("volume_iou", "Exact volume IoU, closed models", "volume_iou", "closed"),
    _share("covered", "Covered share of the shape's volume, closed models", "covered", "closed"),
    Measure(
        "excess",
        "Volume outside the shape as a share of the shape's, closed models",
        "%",
        "lower",
        (("cropped", "excess"),),
        100.0,
        models="closed",
    ),
    _share(
        "iou_128_not_closed", "IoU at 128³, models that are not closed", "iou_128", "not closed"
    ),
    _share(
        "coverage_not_closed",
        "Coverage, models that are not closed",
        "coverage",
        "not closed",
        _COVERAGE,
    ),
    _share("iou_128", "IoU at 128³, all models", "iou_128"),
    _share("coverage", "Coverage, all models", "coverage", "all", _COVERAGE),
    _length("out_99", "Result outside the shape, 99th percentile", _OUT),
    _length("out_max", "Result outside the shape, maximum", _OUT),
    _length("miss_99", "Shape missed by the result, 99th percentile", _MISS),
    _length("miss_max", "Shape missed by the result, maximum", _MISS),
    Measure(
        "open_space",
        "Open space left open",
        "%",
        "higher",
        (("cropped", "open_space"), ("positives", "open_space_positives")),
        100.0,
    ),
    Measure(
        "iou_32",
        "IoU at 32³, for the paper's tables",
        "%",
        "higher",
        (
            ("cropped", "iou_32"),
            ("positives", "iou_32_positives"),
            ("networks", "iou_32_networks"),
        ),
        100.0,
        True,
    ),
    Measure(
        "iou_64",
        "IoU at 64³, for the paper's tables",
        "%",
        "higher",
        (
            ("cropped", "iou_64"),
            ("positives", "iou_64_positives"),
            ("mesh", "iou_mesh_64"),
            ("networks", "iou_64_networks"),
        ),
        100.0,
        True,
    ),
    Measure(
        "cd_l1",
        "Chamfer distance, L1",
        "x 1000",
        "lower",
        (("cropped", "cd_l1"), ("positives", "cd_l1_positives"), ("floor", "cd_l1_floor")),
    ),
    Measure(
        "cd_l2",
        "Chamfer distance, L2 (squared)",
        "x 1000",
        "lower",
        (("cropped", "cd_l2"), ("positives", "cd_l2_positives"), ("floor", "cd_l2_floor")),
    ),
    Measure(
        "cd_surface",
        "Mean distance between surfaces",
        "x 1000",
        "lower",
        (("cropped", "cd_surface"), ("positives", "cd_surface_positives")),
    ),
)
"""In the order of the tables: exact volumes, grids and coverage, distances, the paper's figures."""

MEANS = (
    ("parts", "parts", 1),
    ("positives", "positives", 1),
    ("negatives", "negatives", 1),
    ("boxes along the axes", "axis_aligned", 1),
    ("mirrored pairs of boxes", "mirrored_pairs", 1),
    ("boxes that mirror themselves", "self_mirrored", 1),
    ("connected pieces of the shape", "shape_pieces", 2),
    ("connected pieces of the result", "result_pieces", 2),
    ("bodies of the written mesh", "bodies", 2),
    ("pieces dropped", "pieces_dropped", 2),
    ("faces", "faces", 0),
    ("negatives predicted", "negatives_predicted", 1),
    ("negatives shrunk", "shrunk", 2),
    ("negatives grown", "grown", 2),
    ("discarded: too deep", "discarded_deep", 2),
    ("discarded: overlap", "discarded_overlap", 2),
    ("discarded: gap", "discarded_gap", 2),
    ("discarded: idle", "discarded_idle", 2),
    ("suppressed", "suppressed", 2),
    ("negatives kept", "negatives_kept", 2),
)
"""Counts that are shown as means: label, column, decimals."""

REQUIRED = ("category", "model_id", "split", "status")
"""Columns a metrics table must have, all of them text."""

COLUMNS = (
    *REQUIRED,
    "not_exact",
    *dict.fromkeys(column for measure in MEASURES for _, column in measure.columns),
    *(column for _, column, _ in MEANS),
    *("beyond", "check_ok", "fitted_again", "jitter_attempt"),
)
"""Columns that are read; `not_exact` is text, those after it are numbers or truth values.

Metrics are null where `status` isn't ok, and where a result or shape doesn't have them.
"""


@dataclass(frozen=True, slots=True)
class Models:
    """A metrics table as arrays, one entry a model.

    `not_exact` is empty for a closed model, a reason for another, and None where nothing is known
    of the shape, as it couldn't be read.
    """

    category: tuple[str, ...]
    model_id: tuple[str, ...]
    status: tuple[str, ...]
    not_exact: tuple[str | None, ...]
    numbers: dict[str, Float64]

    @property
    def names(self) -> list[tuple[str, str]]:
        """Category and id of each model."""
        return list(zip(self.category, self.model_id, strict=True))

    @property
    def ok(self) -> Bool:
        """Which models have a result, (n,) bool."""
        return np.array([status == "ok" for status in self.status], dtype=bool)

    def members(self, subset: Subset) -> Bool:
        """Which models belong to a subset, (n,) bool; shapes of which nothing is known only to all.

        Parameters
        ----------
        subset : {'all', 'closed', 'not closed'}
        """
        return np.array(
            [
                subset == "all" or (reason is not None and (reason == "") == (subset == "closed"))
                for reason in self.not_exact
            ],
            dtype=bool,
        )

    def figures(self, column: str, subset: Subset = "all") -> Float64:
        """A column for the models of a subset that have a result, nan for others, (n,) float64."""
        return np.where(self.ok & self.members(subset), self.numbers[column], np.nan)

    def result(self, measure: Measure) -> Float64:
        """A measure's figures of the results, in the table's unit, (n,) float64."""
        return self.figures(measure.columns[0][1], measure.models) * measure.factor


def read_models(table: pa.Table, split: str = "all") -> Models:
    """A metrics table as arrays, nulls and columns that it lacks as nan.

    Parameters
    ----------
    table : pyarrow.Table
        With the columns `REQUIRED`, and of `COLUMNS` those that were measured.
    split : str
        Keep the models of this split; `all` keeps every model.

    Raises
    ------
    ValueError
        If a required column is missing.
    """
    missing = [name for name in REQUIRED if name not in table.column_names]
    if missing:
        raise ValueError(f"the metrics table lacks the columns {', '.join(missing)}")
    if split != "all":
        table = table.filter(pc.equal(table["split"], split))
    category, model_id, status = (
        tuple(table[name].to_pylist()) for name in ("category", "model_id", "status")
    )
    not_exact: tuple[str | None, ...] = (None,) * len(table)
    if "not_exact" in table.column_names:
        not_exact = tuple(table["not_exact"].to_pylist())
    numbers = {
        name: pc.cast(table[name], pa.float64()).to_numpy().astype(np.float64)
        if name in table.column_names
        else np.full(len(table), np.nan)
        for name in COLUMNS
        if name not in (*REQUIRED, "not_exact")
    }
    return Models(category, model_id, status, not_exact, numbers)
