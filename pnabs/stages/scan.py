"""scan: the dataset's models, listed once and only ever added to."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from pnabs.dataset import catalogue
from pnabs.dataset.errors import DatasetError, SourceError
from pnabs.dataset.source import Dataset
from pnabs.settings import Settings
from pnabs.stages.errors import RefusedError
from pnabs.stages.progress import Reporter
from pnabs.store.run import RunFolder


def scan(
    job: Settings, run: RunFolder, reporter: Reporter, *, accept: bool, write: bool = True
) -> pa.Table:
    """The run's catalogue: made on the first run, compared with the dataset on later ones.

    Parameters
    ----------
    accept
        Take changed and added models into the catalogue.
    write
        Leave the folder as it is when False (`--dry-run`).

    Raises
    ------
    RefusedError
        When models were added or changed and `accept` is False; says which.
    pnabs.dataset.errors.DatasetError
        When the dataset can't be listed and there is no catalogue to go on with.
    """
    old = catalogue.read(run.catalogue) if run.catalogue.exists() else None
    try:
        found = catalogue.scan(job.dataset, Path.cwd())
    except DatasetError:
        root = job.dataset.root
        if old is None or not isinstance(root, Path) or root.exists():
            raise
        reporter.say(f"the dataset {root} is not there; going on with what is catalogued")
        return old
    if old is None:
        if write:
            catalogue.write(found, run.catalogue)
        return found
    missing = sorted(set(_keys(old)) - set(_keys(found)))
    if missing:
        reporter.say(
            f"{len(missing)} models of this run are not in the dataset as the job names it now "
            f"(gone, or left out by dataset.categories or dataset.limit), such as {missing[0]}; "
            "they stay in the run"
        )
    merged = catalogue.extend(old, found, job.dataset.shard_size)
    edited = _edited(job, run, old, merged)
    differences = _differences(old, merged, edited)
    if differences and not accept:
        raise RefusedError(
            "the dataset has changed since this run began:\n"
            + "\n".join(f"  {line}" for line in differences)
            + "\n--accept-changes takes it as it is now: added models get shards of their own, "
            "changed models' shards are redone, and training with them."
        )
    if write and not merged.equals(old):
        for shard in {row["shard"] for row in edited}:
            # Content is no part of the catalogue: without its record the shard is done again.
            run.ledger.withdraw("ingest", shard)
        catalogue.write(merged, run.catalogue)
    return merged


def _edited(job: Settings, run: RunFolder, old: pa.Table, new: pa.Table) -> list[dict[str, Any]]:
    """Ingested models whose file has another time and the same size, but other bytes."""
    before = dict(zip(_keys(old), old.to_pylist(), strict=True))
    dataset = Dataset(job.dataset.root)
    edited = []
    for key, row in zip(_keys(new), new.to_pylist(), strict=True):
        then = before.get(key)
        same = then is not None and then["size"] == row["size"] and not row["reason"]
        if not same or then is None or then["mtime_ns"] == row["mtime_ns"]:
            continue
        record = run.ledger.read("ingest", row["shard"])
        notes = {m.model_id: m.note for m in record.models} if record else {}
        known = notes.get(row["model_id"], {}).get("source_sha256")
        if known is None:
            continue
        try:
            data = dataset.read(row["source"], job.ingest.limits.max_bytes)
        except SourceError:
            data = b""
        if hashlib.sha256(data).hexdigest() != known:
            edited.append(row)
    return edited


def _differences(old: pa.Table, new: pa.Table, edited: list[dict[str, Any]]) -> list[str]:
    lines = []
    if edited:
        first = f"{edited[0]['category']}/{edited[0]['model_id']}"
        lines.append(f"content changed: {len(edited)} models ({first}, ...)")
    before = dict(zip(_keys(old), range(len(old)), strict=True))
    rows = [before.get(key, -1) for key in _keys(new)]
    known = pa.array([row >= 0 for row in rows], pa.bool_())
    added = new.filter(pc.invert(known))
    if len(added):
        counts = pc.value_counts(added["category"]).to_pylist()
        parts = ", ".join(f"{item['counts']} in {item['values']}" for item in counts)
        lines.append(f"added: {len(added)} models ({parts})")
    now = new.filter(known)
    then = old.take(pa.array([row for row in rows if row >= 0], pa.int64()))
    for column in ("source", "size", "split", "reason"):
        changed = then.filter(pc.not_equal(then[column], now[column]))
        if len(changed):
            names = _keys(changed.slice(0, 3))
            more = ", ..." if len(changed) > 3 else ""
            lines.append(f"{column} changed: {len(changed)} models ({', '.join(names)}{more})")
    return lines


def _keys(table: pa.Table) -> list[str]:
    keys: list[str] = pc.binary_join_element_wise(
        table["category"], table["model_id"], "/"
    ).to_pylist()
    return keys
