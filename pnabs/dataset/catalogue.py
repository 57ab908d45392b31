"""The catalogue: one row a model, in the order in which everything after it counts.

A model without a readable mesh keeps its row, with the reason in `reason` and
its size and time 0; its source names where the mesh should be, so that reading
it fails with the same reason.
"""

from __future__ import annotations

import hashlib
from array import array
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from pnabs import settings
from pnabs.dataset.errors import DatasetError, SourceError
from pnabs.dataset.layouts import LAYOUTS, Layout, enter, find_categories, no_models
from pnabs.dataset.names import check_category, printable, safe_model_id, unsafe_model_id
from pnabs.dataset.source import Dataset
from pnabs.dataset.splits import Split, hash_split, read_split
from pnabs.dataset.synsets import resolve_category, synset_of

SCHEMA = pa.schema(
    [
        pa.field(name, kind, nullable=False)
        for name, kind in {
            "category": pa.string(),
            "model_id": pa.string(),
            "split": pa.string(),  # train, val, test; none: in the dataset, but not in the csv
            "source": pa.string(),
            "shard": pa.string(),
            "row": pa.int32(),  # position in the shard
            "size": pa.int64(),
            "mtime_ns": pa.int64(),
            "reason": pa.string(),  # why the mesh can't be read; empty when it looks readable
        }.items()
    ]
)
"""Columns of the catalogue; none is ever null."""


GROUP_ROWS = 4096
"""Rows of a row group: so many are decoded to get at one shard's."""


def scan(job: settings.Dataset, base: Path) -> pa.Table:
    """List a dataset.

    Nothing but names, sizes and times is read.  The result depends on the dataset and the
    settings alone, not on the order in which a disk lists.

    Parameters
    ----------
    job : settings.Dataset
    base : Path
        Folder that relative paths in `job` count from.

    Returns
    -------
    pyarrow.Table
        `SCHEMA`, sorted by category and model_id; shards of `job.shard_size` in that order.

    Raises
    ------
    DatasetError
        If the root, a category or the split isn't there or can't be used, or no model has a
        readable mesh.
    """
    dataset = Dataset(job.root if isinstance(job.root, str) else base / job.root)
    layout = LAYOUTS[job.layout]
    split_of = _Splits(job, base)
    try:
        places = find_categories(dataset, layout.top(dataset))
        wanted = _wanted(job, places)
        if not wanted:
            raise no_models(dataset, job.layout)
        tables = [
            _scan_category(dataset, layout, name, places[name], split_of, job) for name in wanted
        ]
        for name, table in zip(wanted, tables, strict=True):
            if job.categories and not len(table):
                raise no_models(dataset, job.layout, f"none in category {name}")
        catalogue = pa.concat_tables(tables).combine_chunks()
        if not pc.any(pc.equal(catalogue["reason"], "")).as_py():
            first = catalogue["reason"][0].as_py() if len(catalogue) else ""
            raise no_models(dataset, job.layout, first)
    except SourceError as error:
        raise DatasetError(f"{dataset.root} can't be listed: {error}") from error
    split_of.check(catalogue)
    return catalogue


def extend(old: pa.Table, new: pa.Table, shard_size: int) -> pa.Table:
    """Take a later scan into a catalogue without renumbering anything.

    Parameters
    ----------
    old : pyarrow.Table
        The run's catalogue.
    new : pyarrow.Table
        A scan of the same dataset.
    shard_size : int
        Models a shard, for the new shards.

    Returns
    -------
    pyarrow.Table
        All models of `old` in their shards and rows, with split, source, size, time and reason
        of `new` where it has them (models gone from the dataset keep their row); then, in each
        category, the models that only `new` has, in new shards.  Sorted by category, shard, row.
    """
    old, new = old.combine_chunks(), new.combine_chunks()
    old_key, new_key = _keys(old), _keys(new)
    at = pc.index_in(old_key, value_set=new_key)
    row = pc.if_else(pc.is_null(at), pc.add(_count(len(old)), len(new)), at)
    kept = pa.concat_tables([new, old]).take(row)
    for name in ("shard", "row"):
        kept = kept.set_column(SCHEMA.get_field_index(name), SCHEMA.field(name), old[name])

    added = new.filter(pc.invert(pc.is_in(new_key, value_set=old_key)))
    used = pa.table({"category": old["category"], "number": _shard_numbers(old)})
    last = used.group_by("category").aggregate([("number", "max")])
    first = {row["category"]: row["number_max"] + 1 for row in last.to_pylist()}
    parts = [kept]
    for category in pc.unique(added["category"]).to_pylist():
        part = added.filter(pc.equal(added["category"], category))
        parts.append(_number(part, category, shard_size, first.get(category, 0)))
    table = pa.concat_tables(parts)
    order = pa.table(
        {"category": table["category"], "shard": _shard_numbers(table), "row": table["row"]}
    )
    keys = [(name, "ascending") for name in order.column_names]
    return table.take(pc.sort_indices(order, sort_keys=keys)).combine_chunks()


def to_bytes(table: pa.Table) -> bytes:
    """A catalogue as the content of its file; the same table gives the same bytes."""
    sink = pa.BufferOutputStream()
    # Small groups: a worker reads the rows of one shard.
    pq.write_table(table.combine_chunks(), sink, compression="zstd", row_group_size=GROUP_ROWS)
    data: bytes = sink.getvalue().to_pybytes()
    return data


def read(path: Path) -> pa.Table:
    """Read a catalogue.

    Raises
    ------
    DatasetError
        If it isn't one.
    """
    try:
        table = pq.ParquetFile(path).read()
        if table.column_names != SCHEMA.names:
            raise DatasetError(f"{path} isn't a catalogue: its columns are {table.column_names}")
        return table.cast(SCHEMA)
    except (OSError, pa.ArrowException) as error:
        raise DatasetError(f"{path} isn't a readable catalogue: {error}") from error


def fingerprint(table: pa.Table) -> str:
    """SHA-256 of a catalogue's content, whatever its chunks or the file it was read from."""
    digest = hashlib.sha256()
    for name in SCHEMA.names:
        column = table[name].cast(SCHEMA.field(name).type)
        if pa.types.is_string(column.type):
            digest.update(pc.binary_length(column).to_numpy().astype("<i4").tobytes())
            for chunk in column.chunks:
                _, offsets, data = chunk.buffers()
                ends = np.frombuffer(offsets, np.int32)[chunk.offset :]
                if len(chunk) and data is not None:
                    digest.update(memoryview(data)[ends[0] : ends[len(chunk)]])
        else:
            digest.update(column.to_numpy().astype("<i8").tobytes())
    return digest.hexdigest()


class _Splits:
    """Split of each model as the job has it."""

    def __init__(self, job: settings.Dataset, base: Path) -> None:
        self._job = job
        self._listed = None if job.split == "hash" else read_split(base / job.split)

    def __call__(self, category: str, model_id: str) -> Split:
        if self._listed is None:
            return hash_split(model_id, self._job.test_share, self._job.val_share)
        split = self._listed.get((category, model_id))
        if split is None:
            split = self._listed.get((synset_of(category) or category, model_id), "none")
        return split

    def check(self, catalogue: pa.Table) -> None:
        """Refuse a csv that knows none of the models: it belongs to another dataset."""
        if pc.all(pc.equal(catalogue["split"], "none")).as_py():
            first = f"{catalogue['category'][0]}/{catalogue['model_id'][0]}"
            raise DatasetError(
                f"dataset.split: {self._job.split} has none of the {len(catalogue)} models "
                f"(the first is {first})"
            )


def _wanted(job: settings.Dataset, places: dict[str, str]) -> list[str]:
    names = places if job.categories is None else job.categories
    wanted = sorted({resolve_category(name, places) for name in names})
    for name in wanted:
        check_category(name)
    return wanted


def _scan_category(
    dataset: Dataset,
    layout: Layout,
    category: str,
    place: str,
    split_of: _Splits,
    job: settings.Dataset,
) -> pa.Table:
    place = enter(dataset, place, category)
    dataset.preload(place)
    models = layout.models(dataset, place)
    found = _unique(sorted(_named(model.model_id, model.source) for model in models))[: job.limit]
    sizes, times, reasons = array("q"), array("q"), []
    for _, source, reason in found:
        size = time = 0
        if not reason:
            try:
                size, time = dataset.stat(source)
            except SourceError as error:
                reason = str(error)
        sizes.append(size)
        times.append(time)
        reasons.append(reason)
    ids = [model_id for model_id, _, _ in found]
    count = len(found)
    table = pa.table(
        {
            "category": pa.repeat(category, count),
            "model_id": pa.array(ids, pa.string()),
            "split": pa.array([split_of(category, model_id) for model_id in ids], pa.string()),
            "source": pa.array([printable(source) for _, source, _ in found], pa.string()),
            "shard": pa.repeat("", count),
            "row": pa.repeat(pa.scalar(0, pa.int32()), count),
            "size": np.frombuffer(sizes, np.int64),
            "mtime_ns": np.frombuffer(times, np.int64),
            "reason": pa.array(reasons, pa.string()),
        },
        schema=SCHEMA,
    )
    return _number(table, category, job.shard_size, 0)


def _named(model_id: str, source: str) -> tuple[str, str, str]:
    why = unsafe_model_id(model_id)
    if why:
        return safe_model_id(model_id), source, f"{printable(source)}: {why}"
    return model_id, source, ""


def _unique(found: list[tuple[str, str, str]]) -> list[tuple[str, str, str]]:
    """Sorted rows with repeated ids told apart; only stand-ins of unsafe ids ever repeat."""
    taken = {row[0] for row in found}
    if len(taken) == len(found):
        return found
    seen = set()
    for i, (model_id, source, reason) in enumerate(found):
        while model_id in seen or (model_id != found[i][0] and model_id in taken):
            model_id += "~"
        seen.add(model_id)
        found[i] = (model_id, source, reason)
    return sorted(found)


def _number(table: pa.Table, category: str, shard_size: int, first: int) -> pa.Table:
    """Put a category's rows into shards of their own, `first` and up."""
    shard, row = np.divmod(np.arange(len(table)), shard_size)
    names = pa.array([f"{category}-{first + n:05d}" for n in range(len(table) // shard_size + 1)])
    columns = {"shard": names.take(pa.array(shard)), "row": pa.array(row, pa.int32())}
    for name, column in columns.items():
        table = table.set_column(SCHEMA.get_field_index(name), SCHEMA.field(name), column)
    return table


def _shard_numbers(table: pa.Table) -> pa.ChunkedArray:
    return pc.cast(pc.replace_substring_regex(table["shard"], "^.*-", ""), pa.int64())


def _keys(table: pa.Table) -> pa.ChunkedArray:
    # No category has a slash.
    return pc.binary_join_element_wise(table["category"], table["model_id"], "/")


def _count(length: int) -> pa.Array:
    return pa.array(np.arange(length), pa.int64())
