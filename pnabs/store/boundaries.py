"""Boundaries of a shard's shapes, which differ in size: one row a model, parquet."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from pnabs.geometry.reference import Boundary
from pnabs.store.atomic import file_digest, write_atomic
from pnabs.store.errors import DamagedDataError

SCHEMA = pa.schema(
    [
        pa.field("vertices", pa.binary()),  # little-endian float32, three a vertex
        pa.field("faces", pa.binary()),  # little-endian int32, three a face
        pa.field("sheet", pa.binary()),  # a bit a face
        pa.field("thickness", pa.float64()),
        pa.field("not_exact", pa.string()),
    ]
)


def write_boundaries(run: Path, path: Path, rows: Sequence[Boundary | None]) -> dict[str, Any]:
    """Write one shard's boundaries, a row group each; None gives an empty row.

    Returns
    -------
    Path below the run folder -> size and digest.
    """
    sink = pa.BufferOutputStream()
    with pq.ParquetWriter(sink, SCHEMA, compression="zstd", write_page_checksum=True) as writer:
        for row in rows:
            writer.write_table(pa.Table.from_pylist([_to_row(row)], schema=SCHEMA))
    write_atomic(path, sink.getvalue().to_pybytes())
    return {path.relative_to(run).as_posix(): file_digest(path)}


def read_boundaries(path: Path, rows: Sequence[int]) -> Iterator[Boundary]:
    """The boundaries of some of a shard's models, one at a time.

    Raises
    ------
    DamagedDataError
        When the file is missing or fails a checksum, or a row is empty.
    """
    try:
        file = pq.ParquetFile(path, page_checksum_verification=True)
        for row in rows:
            yield _of_row(file.read_row_group(row).to_pylist()[0])
    except (OSError, pa.ArrowException, TypeError, ValueError) as error:
        raise DamagedDataError(
            f"{path} is missing or damaged ({error}); `pnabs verify` the run, then run again"
        ) from error


def read_reasons(path: Path) -> list[str | None]:
    """Why each model of a shard has no exact solid: empty where it has one, None without a model.

    Raises
    ------
    DamagedDataError
        As `read_boundaries`.
    """
    try:
        table = pq.read_table(path, columns=["not_exact"], page_checksum_verification=True)
    except (OSError, pa.ArrowException) as error:
        raise DamagedDataError(
            f"{path} is missing or damaged ({error}); `pnabs verify` the run, then run again"
        ) from error
    reasons: list[str | None] = table["not_exact"].to_pylist()
    return reasons


def _to_row(boundary: Boundary | None) -> dict[str, Any]:
    if boundary is None:
        return dict.fromkeys(SCHEMA.names)
    return {
        "vertices": boundary.vertices.astype("<f4").tobytes(),
        "faces": boundary.faces.astype("<i4").tobytes(),
        "sheet": np.packbits(boundary.sheet).tobytes(),
        "thickness": boundary.thickness,
        "not_exact": boundary.not_exact,
    }


def _of_row(row: dict[str, Any]) -> Boundary:
    faces = np.frombuffer(row["faces"], "<i4").reshape(-1, 3).astype(np.int32)
    bits = np.unpackbits(np.frombuffer(row["sheet"], np.uint8), count=len(faces))
    vertices = np.frombuffer(row["vertices"], "<f4").reshape(-1, 3).astype(np.float32)
    return Boundary(vertices, faces, bits.astype(bool), row["thickness"], row["not_exact"])
