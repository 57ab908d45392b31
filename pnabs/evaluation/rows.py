"""What is kept of each item: rows in parquet files, one file a batch, and a record of each file.

A batch counts once its record is there.  Rows are found by their fingerprint, so they serve
whatever is evaluated later beside them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from pnabs.evaluation.frames import TURNS
from pnabs.store.atomic import file_digest, sweep, write_atomic
from pnabs.store.ledger import DamagedRecordError, Ledger, Record

STAGE = "evaluate"

FALLEN = ("invalid", "error", "crash", "timeout", "memory")
"""Statuses of what couldn't be measured."""

FLOATS = (
    *("volume_iou", "covered", "excess"),
    *("out_99", "out_max", "miss_99", "miss_max"),
    *("out_99_units", "out_max_units", "miss_99_units", "miss_max_units"),
    *("coverage", "beyond"),
    *("iou_32", "iou_64", "iou_128", "iou_mesh_64"),
    *("cd_l1", "cd_l2", "cd_surface", "open_space"),
)
COUNTS = (
    *("parts", "positives", "negatives", "bodies"),
    *("shape_pieces", "result_pieces", "faces"),
)
METRICS = (*FLOATS, *COUNTS)
"""What is measured of a result, in the order of models.csv."""

SCHEMA = pa.schema(
    [
        pa.field("fingerprint", pa.string(), nullable=False),
        pa.field("status", pa.string(), nullable=False),
        pa.field("reason", pa.string(), nullable=False),
        pa.field("attempts", pa.int32(), nullable=False),
        pa.field("traceback", pa.string(), nullable=False),
        # of a shape: why it isn't closed
        pa.field("not_exact", pa.string()),
        # of a result
        pa.field("not_closed", pa.string()),
        *(pa.field(name, pa.float64()) for name in FLOATS),
        *(pa.field(name, pa.int32()) for name in COUNTS),
        pa.field("frame_size", pa.float64()),
        pa.field("frame_shift", pa.float64()),
        pa.field("frame_other", pa.float64()),
        pa.field("frame_turns", pa.list_(pa.float64(), len(TURNS))),
    ]
)


class Rows:
    """The rows below a folder.

    Parameters
    ----------
    folder
        Holds `rows`, `ledger` and `index`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.ledger = Ledger(folder)
        self._fresh: set[str] = set()

    def path(self, batch: str) -> Path:
        """The file of a batch."""
        return self.folder / "rows" / f"{batch}.parquet"

    def write(self, batch: str, rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
        """Write a batch's rows; returns path -> size and digest, for its record."""
        table = pa.Table.from_pylist([dict(row) for row in rows], schema=SCHEMA)
        sink = pa.BufferOutputStream()
        pq.write_table(table, sink, compression="zstd")
        path = self.path(batch)
        if path.parent.is_dir():
            sweep(path.parent, f".{path.name}")
        write_atomic(path, sink.getvalue().to_pybytes())
        return {path.relative_to(self.folder).as_posix(): file_digest(path)}

    def commit(self, record: Record) -> None:
        """Make a batch count."""
        self.ledger.commit(record)
        self._fresh.add(record.shard)

    def is_fresh(self, batch: str) -> bool:
        """Whether this object has committed a batch."""
        return batch in self._fresh

    def read(self) -> tuple[pa.Table, list[str]]:
        """All rows that are committed and as they were written, and the batch of each.

        Records whose rows are damaged or lost are withdrawn: the rows are made again.
        """
        tables, batches = [SCHEMA.empty_table()], list[str]()
        for batch in sorted(self.ledger.index(STAGE)):
            table = self._read(batch)
            if table is None:
                self.ledger.withdraw(STAGE, batch)
                continue
            tables.append(table)
            batches += [batch] * len(table)
        return pa.concat_tables(tables).combine_chunks(), batches

    def _read(self, batch: str) -> pa.Table | None:
        try:
            record = self.ledger.read(STAGE, batch)
            if record is None or self.ledger.damaged_outputs(record):
                return None
            table = pq.read_table(self.path(batch))
        except (DamagedRecordError, OSError, pa.ArrowException):
            return None
        return table if table.schema.equals(SCHEMA) else None

    def keep(self, wanted: Iterable[str]) -> None:
        """Remove all batches but these, and rows that no record vouches for."""
        kept = set(wanted)
        for batch in set(self.ledger.index(STAGE)) - kept:
            self.ledger.withdraw(STAGE, batch)
        for path in (self.folder / "rows").glob("*.parquet"):
            if path.stem not in kept:
                path.unlink(missing_ok=True)
        self.ledger.save_index(STAGE)
