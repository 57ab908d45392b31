"""What the report is made from: plain data, read from a run by the caller.

Nothing here knows of run folders or clusters, so a report can be made, and
tested, from arrays alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa

from pnabs.geometry.types import Float64, Int64, Mesh

from .pictures import View
from .tables import Tables


@dataclass(frozen=True, slots=True, eq=False)
class GalleryItem:
    """One model to be pictured; all meshes share the normalised frame.

    Attributes
    ----------
    category, model_id : str
    original, positives, negatives, result : Mesh
        An empty mesh gives an empty picture.
    row : mapping
        The model's row of the metrics table, as a dict; missing keys and None show as a dash.
    result_source : (F,) int64, optional
        Index of the positive each face of `result` comes from; colours it like that positive.
        Faces with a negative index are pale; left out, the whole mesh has one colour.
    positives_part : (F,) int64, optional
        Index of the positive each face of `positives` belongs to, in the numbering of
        `result_source`; connected pieces in order when left out.
    check : mapping, optional
        Findings of `pnabs.geometry.check` on the written mesh, as abstraction.json holds them, so
        that the caption can name what failed.
    """

    category: str
    model_id: str
    original: Mesh
    positives: Mesh
    negatives: Mesh
    result: Mesh
    row: Mapping[str, object]
    result_source: Int64 | None = None
    positives_part: Int64 | None = None
    check: Mapping[str, bool | int] | None = None


@dataclass(frozen=True, slots=True)
class Quarantined:
    """A model that failed in a stage: kind is invalid, error, crash, timeout or memory."""

    stage: str
    category: str
    model_id: str
    kind: str
    reason: str


@dataclass(frozen=True, slots=True)
class StageTiming:
    """What a stage cost.

    Attributes
    ----------
    stage : str
    seconds : float
        Wall time over all sessions, the start of workers included.
    models, quarantined : int
    peak_memory : int or None
        Largest resident memory of a worker, bytes.
    """

    stage: str
    seconds: float
    models: int
    quarantined: int
    peak_memory: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ReportData:
    """Everything the page shows.

    Attributes
    ----------
    title : str
    tables : Tables
        From `build_tables`, so that page and tables.json hold the same numbers.
    rows : mapping of variant to pyarrow Table
        One row a model (see `pnabs.report.measures.COLUMNS`).
    names : mapping of category to alias
    split : str
        Models the tables cover: a split's name, or `all`.
    seed : int
    without_negatives : sequence of str
        Variants that are fitted without negatives, to which others may be compared.
    curves : mapping of (variant, phase) to records
        Each record is one epoch: `epoch`, and the losses by name; `total` is drawn bold.
    gallery : sequence of GalleryItem
        Shown in the order given, under their categories.
    quarantine, timings : sequences
    settings_yaml, fingerprint, command : str
    versions : mapping of library to version
    view : View
        The pictures' camera.
    """

    title: str
    tables: Tables
    rows: Mapping[str, pa.Table]
    names: Mapping[str, str]
    split: str
    seed: int
    without_negatives: Sequence[str] = ()
    curves: Mapping[tuple[str, str], Sequence[Mapping[str, float]]] = field(default_factory=dict)
    gallery: Sequence[GalleryItem] = ()
    quarantine: Sequence[Quarantined] = ()
    timings: Sequence[StageTiming] = ()
    settings_yaml: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    fingerprint: str = ""
    command: str = ""
    view: View = field(default_factory=View)


def number(row: Mapping[str, object], key: str) -> float | None:
    """A figure of a model's row; None where there is none, or it isn't finite."""
    value = row.get(key)
    known = isinstance(value, (int, float, np.generic)) and np.isfinite(value)
    return float(value) if known else None  # type: ignore[arg-type]


def empty_mesh() -> Mesh:
    """A mesh of nothing, for what a model doesn't have."""
    vertices: Float64 = np.zeros((0, 3), dtype=np.float64)
    return Mesh(vertices, np.zeros((0, 3), dtype=np.int64))
