"""The catalogue by shard: what a driver needs of it, without a step for each model."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray


class Shards:
    """Shards in the catalogue's order; a shard is told by its number in that order.

    Parameters
    ----------
    catalogue
        Sorted by shard and row.

    Attributes
    ----------
    names
        Of the shards.
    models
        (n,) how many models each has.
    counts
        Category -> how many shards, numbered from 0, it has.
    """

    def __init__(self, catalogue: pa.Table) -> None:
        self.catalogue = catalogue.combine_chunks()
        runs = pc.run_end_encode(_one_chunk(self.catalogue["shard"]))
        self.names: list[str] = runs.values.to_pylist()
        self._ends: NDArray[np.int64] = runs.run_ends.to_numpy().astype(np.int64)
        self._starts = np.concatenate([[0], self._ends[:-1]]) if len(self._ends) else self._ends
        self.models = self._ends - self._starts
        self.counts = dict(Counter(name.rpartition("-")[0] for name in self.names))
        self._digests: dict[Sequence[str], list[str]] = {}
        self._masks: dict[Sequence[str] | None, NDArray[np.bool_]] = {}

    def __iter__(self) -> Iterator[tuple[str, list[dict[str, Any]]]]:
        """Each shard with its rows, decoded one shard at a time."""
        for number, name in enumerate(self.names):
            yield name, self.rows(number)

    def rows(self, number: int) -> list[dict[str, Any]]:
        """The rows of one shard."""
        start, count = int(self._starts[number]), int(self.models[number])
        rows: list[dict[str, Any]] = self.catalogue.slice(start, count).to_pylist()
        return rows

    def digests(self, *columns: str) -> list[str]:
        """SHA-256 of each shard's values in these columns."""
        if columns not in self._digests:
            parts = [self._bytes(self.catalogue[name]) for name in columns]
            self._digests[columns] = [
                hashlib.sha256(b"".join(values)).hexdigest() for values in zip(*parts, strict=True)
            ]
        return self._digests[columns]

    def chosen(
        self, number: int, splits: Sequence[str] | None = None, without: Collection[str] = ()
    ) -> NDArray[np.int32]:
        """Rows (positions in the shard) of some splits, or all, without some models, ascending."""
        if splits not in self._masks:
            self._masks[splits] = self._mask(splits)
        span = slice(self._starts[number], self._ends[number])
        mask = self._masks[splits][span]
        if without:
            ids = self.catalogue["model_id"][span.start : span.stop].to_pylist()
            mask = mask & np.array([name not in without for name in ids])
        rows: NDArray[np.int32] = np.flatnonzero(mask).astype(np.int32)
        return rows

    def _mask(self, splits: Sequence[str] | None) -> NDArray[np.bool_]:
        if splits is None:
            return np.ones(len(self.catalogue), bool)
        found = pc.is_in(self.catalogue["split"], value_set=pa.array(splits))
        mask: NDArray[np.bool_] = found.to_numpy().astype(bool)
        return mask

    def _bytes(self, column: pa.ChunkedArray) -> Iterator[bytes]:
        """Each shard's values of a column as bytes, no two lists of values alike."""
        if not pa.types.is_string(column.type):
            values = column.to_numpy().astype("<i8")
            for start, end in zip(self._starts, self._ends, strict=True):
                yield values[start:end].tobytes()
            return
        array = _one_chunk(column.cast(pa.large_string()))
        _, offsets, data = array.buffers()
        ends = np.frombuffer(offsets, "<i8")[array.offset : array.offset + len(array) + 1]
        text = memoryview(data) if data is not None else memoryview(b"")
        for start, end in zip(self._starts, self._ends, strict=True):
            places = ends[start : end + 1]
            yield np.diff(places).tobytes() + text[places[0] : places[-1]]


def _one_chunk(column: pa.ChunkedArray) -> pa.Array:
    chunks = column.chunks
    if len(chunks) == 1:
        return chunks[0]
    return pa.concat_arrays(chunks) if chunks else pa.array([], column.type)
