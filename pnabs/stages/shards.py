"""The catalogue by shard: what a driver needs of it, without a step for each model."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from pnabs.dataset import catalogue as catalogues
from pnabs.store.atomic import write_atomic
from pnabs.store.sealed import SealError, seal_derived, unseal_derived

INPUTS = ("model_id", "source", "size", "reason")
"""Columns that ingest's results depend on."""

MODELS = ("model_id", "split")
"""Columns that later stages' results depend on."""

VERSION = 1


class Shards:
    """Shards in the catalogue's order; a shard is told by its number in that order.

    Columns are read from the catalogue when they are first asked for, and what is asked of
    every shard lies in an index beside it: a driver never holds a million models.

    Attributes
    ----------
    names
        Of the shards.
    models
        How many each has.
    counts
        Category -> how many shards, numbered from 0, it has.
    """

    def __init__(
        self,
        table: Callable[[], pa.Table],
        column: Callable[[str], pa.ChunkedArray],
        index: dict[str, Any] | None = None,
    ) -> None:
        self._table, self._column = table, column
        if index is None:
            runs = pc.run_end_encode(_one_chunk(column("shard")))
            ends = np.array(runs.run_ends.to_pylist(), np.int64)
            self.names: list[str] = runs.values.to_pylist()
            self.models: list[int] = np.diff(ends, prepend=0).tolist()
        else:
            self.names, self.models = index["names"], index["models"]
        self._ends = np.cumsum(self.models, dtype=np.int64)
        self._starts = self._ends - np.array(self.models, np.int64)
        self.counts = dict(Counter(name.rpartition("-")[0] for name in self.names))
        self._digests: dict[tuple[str, ...], list[str]] = {}
        if index is not None:
            self._digests = {INPUTS: index["inputs"], MODELS: index["model_splits"]}
        self._chosen: dict[Sequence[str], tuple[NDArray[np.int32], list[int]]] = {}

    @classmethod
    def of_table(cls, catalogue: pa.Table) -> Shards:
        """Of a catalogue in memory, sorted by shard and row."""
        return cls(lambda: catalogue, catalogue.column)

    @classmethod
    def of_file(cls, path: Path, index: Path, sha256: str) -> Shards:
        """Of a catalogue's file; its index is passed over when it is of another catalogue.

        Parameters
        ----------
        sha256
            Digest of the file.
        """

        def column(name: str) -> pa.ChunkedArray:
            return pq.ParquetFile(path).read(columns=[name])[name]

        return cls(lambda: catalogues.read(path), column, _load_index(index, sha256))

    @property
    def catalogue(self) -> pa.Table:
        """The whole catalogue."""
        return self._table()

    def save_index(self, path: Path, sha256: str) -> None:
        """Write what is asked of every shard; `sha256` is that of the catalogue's file."""
        value = {
            "format": "pnabs/catalogue-index",
            "version": VERSION,
            "catalogue": sha256,
            "names": self.names,
            "models": self.models,
            "inputs": self.digests(INPUTS),
            "model_splits": self.digests(MODELS),
        }
        write_atomic(path, seal_derived(value))

    def digests(self, columns: tuple[str, ...]) -> list[str]:
        """SHA-256 of each shard's values in these columns."""
        if columns not in self._digests:
            parts = [self._bytes(self._column(name)) for name in columns]
            self._digests[columns] = [
                hashlib.sha256(b"".join(values)).hexdigest() for values in zip(*parts, strict=True)
            ]
        return self._digests[columns]

    def chosen(
        self, number: int, splits: Sequence[str], without: Collection[str] = ()
    ) -> NDArray[np.int32]:
        """Rows (positions in the shard) of some splits without some models, ascending."""
        if splits not in self._chosen:
            self._chosen[splits] = self._of_splits(splits)
        every, bounds = self._chosen[splits]
        rows = every[bounds[number] : bounds[number + 1]]
        if without:
            start, end = int(self._starts[number]), int(self._ends[number])
            ids = self._ids()[start:end].to_pylist()
            rows = rows[[ids[row] not in without for row in rows]]
        return rows

    def _of_splits(self, splits: Sequence[str]) -> tuple[NDArray[np.int32], list[int]]:
        """Rows of some splits in all shards, one after the other, and where each begins."""
        # By hand: whatever takes or gives Python or numpy values in pyarrow loads pandas.
        coded = _one_chunk(self._column("split")).dictionary_encode()
        values = coded.dictionary.to_pylist()
        codes = np.frombuffer(coded.indices.buffers()[1] or b"", np.int32)[: len(coded)]
        wanted = [code for code, value in enumerate(values) if value in splits]
        places = np.flatnonzero(np.isin(codes, wanted))
        bounds = np.searchsorted(places, [0, *self._ends]).tolist()
        rows = places - np.repeat(self._starts, np.diff(bounds))
        return rows.astype(np.int32), bounds

    def _ids(self) -> pa.ChunkedArray:
        if not hasattr(self, "_model_ids"):
            self._model_ids = self._column("model_id")
        return self._model_ids

    def _bytes(self, column: pa.ChunkedArray) -> Iterator[bytes]:
        """Each shard's values of a column as bytes, no two lists of values alike."""
        spans = list(zip(self._starts.tolist(), self._ends.tolist(), strict=True))
        if not pa.types.is_string(column.type):
            values = column.to_numpy().astype("<i8")
            for start, end in spans:
                yield values[start:end].tobytes()
            return
        array = _one_chunk(column.cast(pa.large_string()))
        _, offsets, data = array.buffers()
        ends = np.frombuffer(offsets, "<i8")[array.offset : array.offset + len(array) + 1]
        text = memoryview(data) if data is not None else memoryview(b"")
        for start, end in spans:
            places = ends[start : end + 1]
            yield np.diff(places).tobytes() + text[places[0] : places[-1]]


def _load_index(path: Path, sha256: str) -> dict[str, Any] | None:
    try:
        value = unseal_derived(path.read_bytes())
    except (OSError, SealError):
        return None
    return value if (value["version"], value["catalogue"]) == (VERSION, sha256) else None


def _one_chunk(column: pa.ChunkedArray) -> pa.Array:
    chunks = column.chunks
    if len(chunks) == 1:
        return chunks[0]
    return pa.concat_arrays(chunks) if chunks else pa.array([], column.type)
