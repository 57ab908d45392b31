"""Per-shard metrics: one row a model, parquet; a variant loads as one table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from pnabs.store.atomic import file_digest, write_atomic
from pnabs.store.errors import DamagedDataError

FLOATS = (
    *("volume_iou", "covered", "excess", "coverage", "iou_128", "beyond"),
    *("out_99", "out_max", "miss_99", "miss_max"),
    *("out_99_units", "out_max_units", "miss_99_units", "miss_max_units"),
    *("iou_32", "iou_64", "iou_mesh_64", "iou_32_positives", "iou_64_positives"),
    *("iou_32_networks", "iou_64_networks"),
    *("cd_l1", "cd_l2", "cd_surface"),
    *("cd_l1_positives", "cd_l2_positives", "cd_surface_positives"),
    *("cd_l1_floor", "cd_l2_floor", "open_space", "open_space_positives"),
)
COUNTS = (
    *("positives", "negatives", "mirrored_pairs", "self_mirrored", "axis_aligned"),
    *("negatives_predicted", "negatives_kept", "shrunk", "grown"),
    *("discarded_deep", "discarded_overlap", "discarded_gap", "discarded_idle", "suppressed"),
    *("shape_pieces", "result_pieces", "bodies", "pieces_dropped", "faces"),
    *("jitter_attempt", "fitted_again"),
)
NUMBERS = (*FLOATS, *COUNTS)
"""Columns that hold what was measured of a result."""

SCHEMA = pa.schema(
    [
        pa.field("category", pa.string(), nullable=False),
        pa.field("model_id", pa.string(), nullable=False),
        pa.field("split", pa.string(), nullable=False),
        pa.field("status", pa.string(), nullable=False),
        pa.field("not_exact", pa.string()),
        *(pa.field(name, pa.float64()) for name in FLOATS),
        *(pa.field(name, pa.int32()) for name in COUNTS),
        pa.field("check_ok", pa.bool_()),
        pa.field("positive_cuboids", pa.list_(pa.list_(pa.float32(), 10))),
        pa.field("negative_cuboids", pa.list_(pa.list_(pa.float32(), 10))),
    ]
)


def write_metrics(run: Path, path: Path, rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Write one shard's rows; absent values are null.  Returns path -> size and digest."""
    table = pa.Table.from_pylist(list(rows), schema=SCHEMA)
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd", write_page_checksum=True)
    write_atomic(path, sink.getvalue().to_pybytes())
    return {path.relative_to(run).as_posix(): file_digest(path)}


def read_metrics(paths: Sequence[Path]) -> pa.Table:
    """The rows of many shards as one table, in the order of the paths.

    Raises
    ------
    DamagedDataError
        When a file is missing or fails a checksum.
    """
    tables = [SCHEMA.empty_table()]
    for path in paths:
        try:
            tables.append(pq.read_table(path, schema=SCHEMA, page_checksum_verification=True))
        except (OSError, pa.ArrowException) as error:
            raise DamagedDataError(
                f"{path} is missing or damaged ({error}); `pnabs verify` the run, then run again"
            ) from error
    return pa.concat_tables(tables)
