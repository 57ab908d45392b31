"""What the report reads from a table of metrics: columns, measures, and rows as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from pnabs.geometry.types import Bool, Float64

from .tables import Role

FAILURES = ("invalid", "error", "crash", "timeout", "memory")
"""Kinds of verdict that take a model out."""


@dataclass(frozen=True, slots=True)
class Measure:
    """A metric: its texts, and the column that holds it for each role.

    The first two roles are `cropped` and `positives`, whose difference the tables show.
    """

    name: str
    title: str
    unit: str
    better: Literal["higher", "lower"]
    columns: tuple[tuple[Role, str], ...]
    factor: float = 1.0
    missing_is_zero: bool = False


MEASURES = (
    Measure(
        "iou_32",
        "IoU at 32³",
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
        "IoU at 64³",
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
        "Distance between surfaces",
        "x 1000",
        "lower",
        (("cropped", "cd_surface"), ("positives", "cd_surface_positives")),
    ),
    Measure(
        "open_space",
        "Open space left open",
        "%",
        "higher",
        (("cropped", "open_space"), ("positives", "open_space_positives")),
        100.0,
    ),
)

MEANS = (
    ("positives", "positives", 1),
    ("negatives", "negatives", 1),
    ("boxes along the axes", "axis_aligned", 1),
    ("mirrored pairs of boxes", "mirrored_pairs", 1),
    ("boxes that mirror themselves", "self_mirrored", 1),
    ("negatives predicted", "negatives_predicted", 1),
    ("negatives shrunk", "shrunk", 2),
    ("negatives grown", "grown", 2),
    ("discarded: too deep", "discarded_deep", 2),
    ("discarded: overlap", "discarded_overlap", 2),
    ("discarded: gap", "discarded_gap", 2),
    ("discarded: idle", "discarded_idle", 2),
    ("suppressed", "suppressed", 2),
    ("negatives kept", "negatives_kept", 2),
    ("pieces", "pieces", 2),
    ("pieces dropped", "pieces_dropped", 2),
    ("faces", "faces", 0),
)
"""Counts that are shown as means: label, column, decimals."""

COLUMNS = (
    "category",
    "model_id",
    "split",
    "status",
    *dict.fromkeys(column for measure in MEASURES for _, column in measure.columns),
    *(column for _, column, _ in MEANS),
    "check_ok",
    "jitter_attempt",
)
"""Columns a metrics table must have; metrics are null where `status` isn't ok."""


@dataclass(frozen=True, slots=True)
class Models:
    """A metrics table as arrays, one entry a model."""

    category: tuple[str, ...]
    model_id: tuple[str, ...]
    status: tuple[str, ...]
    numbers: dict[str, Float64]

    @property
    def ok(self) -> Bool:
        """Which models have a result, (n,) bool."""
        return np.array([status == "ok" for status in self.status], dtype=bool)


def read_models(table: pa.Table, split: str = "all") -> Models:
    """A metrics table as arrays, nulls as nan.

    Parameters
    ----------
    table : pyarrow.Table
        With the columns `COLUMNS`.
    split : str
        Keep the models of this split; `all` keeps every model.

    Raises
    ------
    ValueError
        If columns are missing.
    """
    missing = [name for name in COLUMNS if name not in table.column_names]
    if missing:
        raise ValueError(
            f"the metrics table lacks the columns {', '.join(missing)}; measure the models again"
        )
    if split != "all":
        table = table.filter(pc.equal(table["split"], split))
    texts = ("category", "model_id", "split", "status")
    numbers = {
        name: pc.cast(table[name], pa.float64()).to_numpy().astype(np.float64)
        for name in COLUMNS
        if name not in texts
    }
    category, model_id, status = (
        tuple(table[name].to_pylist()) for name in ("category", "model_id", "status")
    )
    return Models(category, model_id, status, numbers)
