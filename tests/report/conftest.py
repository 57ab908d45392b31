"""Small metrics tables and box meshes with known figures."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from pnabs.geometry.types import Mesh
from pnabs.report import GalleryItem, Quarantined, ReportData, StageTiming, build_tables, empty_mesh
from pnabs.report.measures import COLUMNS

TEXTS = ("category", "model_id", "split", "status", "not_exact")
DEFAULTS: dict[str, Any] = {
    "volume_iou": 0.7, "covered": 0.9, "excess": 0.25, "iou_128": 0.65, "coverage": 0.85,
    "out_99": 0.02, "out_max": 0.04, "miss_99": 0.03, "miss_max": 0.06, "beyond": 0.0,
    "iou_32": 0.6, "iou_64": 0.5, "iou_mesh_64": 0.45,
    "iou_32_positives": 0.5, "iou_64_positives": 0.4,
    "iou_32_networks": 0.6, "iou_64_networks": 0.5,
    "cd_l1": 20.0, "cd_l2": 1.5, "cd_surface": 12.0,
    "cd_l1_positives": 24.0, "cd_l2_positives": 1.8, "cd_surface_positives": 15.0,
    "cd_l1_floor": 8.0, "cd_l2_floor": 0.1, "open_space": 0.7, "open_space_positives": 0.3,
    "parts": None, "positives": 8, "negatives": 3, "axis_aligned": None, "mirrored_pairs": None,
    "self_mirrored": None, "negatives_predicted": 6, "negatives_kept": 3, "shrunk": 2, "grown": 1,
    "discarded_deep": 1, "discarded_overlap": 0, "discarded_gap": 1, "discarded_idle": 0,
    "suppressed": 1, "shape_pieces": 2, "result_pieces": 3, "bodies": 4, "pieces_dropped": 0,
    "faces": 100, "check_ok": True, "fitted_again": 0, "jitter_attempt": 0,
}  # fmt: skip

SCHEMA = pa.schema(
    [
        (
            name,
            pa.string()
            if name in TEXTS
            else pa.bool_()
            if name == "check_ok"
            else pa.int64()
            if isinstance(DEFAULTS[name], int | None)
            else pa.float64(),
        )
        for name in COLUMNS
    ]
)


def model(category: str, model_id: str = "m", status: str = "ok", **changes: Any) -> dict[str, Any]:
    """A row of metrics of a closed model; one that failed has none."""
    figures = DEFAULTS if status == "ok" else dict.fromkeys(DEFAULTS)
    row = {"category": category, "model_id": model_id, "split": "test", "status": status}
    reason = changes.get("not_exact", "")
    if reason != "":
        figures = figures | dict.fromkeys(("volume_iou", "covered", "excess"))
    return row | {"not_exact": ""} | figures | changes


def metrics(rows: list[dict[str, Any]]) -> pa.Table:
    """Rows as a metrics table."""
    return pa.Table.from_pylist(rows, schema=SCHEMA)


def boxes(*bounds: tuple[tuple[float, ...], tuple[float, ...]]) -> Mesh:
    """Axis-aligned boxes from their low and high corners, 12 faces each."""
    faces = [
        (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
        (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
    ]  # fmt: skip
    grid = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)], dtype=np.float64)
    corners = [np.array(low) + grid * (np.array(high) - low) for low, high in bounds]
    return Mesh(
        np.concatenate(corners),
        np.concatenate([np.array(faces) + 8 * i for i in range(len(bounds))]).astype(np.int64),
    )


@pytest.fixture
def row() -> Callable[..., dict[str, Any]]:
    return model


@pytest.fixture
def table() -> Callable[[list[dict[str, Any]]], pa.Table]:
    return metrics


@pytest.fixture
def box_mesh() -> Callable[..., Mesh]:
    return boxes


@pytest.fixture
def report() -> Callable[..., ReportData]:
    """A small report; names, reasons and the rest can be replaced."""

    def make(category: str = "03001627", model_id: str = "m0", **changes: Any) -> ReportData:
        rows = [model(category, model_id), *(model(category, f"m{i}") for i in range(1, 6))]
        rows += [model(category, f"o{i}", not_exact="open") for i in range(5)]
        rows.append(model("bus", "b", status="crash", not_exact=None))
        tables = {"main": metrics(rows)}
        names = changes.pop("names", {category: "chair"})
        shape = boxes(((-0.3, -0.5, -0.3), (0.3, 0.5, 0.3)))
        item = GalleryItem(
            category,
            model_id,
            shape,
            shape,
            boxes(((-0.2, -0.5, -0.35), (0.2, 0.1, 0.35))),
            shape,
            rows[0],
            np.zeros(12, dtype=np.int64),
        )
        bare = GalleryItem("bus", "b", shape, *[empty_mesh()] * 3, {"iou_128": None})
        fields: dict[str, Any] = {
            "title": "Chairs",
            "tables": build_tables(tables, np.random.default_rng(0), names=names),
            "rows": tables,
            "names": names,
            "split": "test",
            "seed": 0,
            "curves": {("main", "positive-initial"): [{"epoch": 1, "fit1": 0.1, "total": 0.2}]},
            "gallery": [item, bare],
            "quarantine": [Quarantined("ingest", "bus", "b", "crash", "signal 11")],
            "timings": [StageTiming("ingest", 7265.0, 7, 1, 512 * 2**20)],
            "settings_yaml": "seed: 0\n",
            "versions": {"numpy": "2.4.0"},
            "fingerprint": "sha256:1234",
            "command": "pnabs run job.yaml",
        }
        return ReportData(**(fields | changes))

    return make
