"""scan: the dataset's models, listed once and only ever added to."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
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
from pnabs.store.run import RunFolder, RunFolderError


@dataclass(frozen=True, slots=True)
class Scan:
    """What a scan found.

    Attributes
    ----------
    catalogue
        The run's catalogue, extended by what is new.
    edited
        Shards whose models' files have other bytes in the same number: content is no part of
        the catalogue, so their records are to be withdrawn.
    """

    catalogue: pa.Table
    edited: frozenset[str] = frozenset()


def scan(
    job: Settings,
    run: RunFolder,
    identity: dict[str, Any] | None,
    reporter: Reporter,
    *,
    accept: bool,
) -> Scan:
    """The run's catalogue: made on the first run, compared with the dataset on later ones.

    Writes nothing.

    Parameters
    ----------
    identity
        run.json; None for a new run, or where it is lost.
    accept
        Take changed and added models into the catalogue, or make a damaged one again.

    Raises
    ------
    RefusedError
        When models were added or changed and `accept` is False; says which.
    pnabs.store.run.RunFolderError
        When the catalogue is damaged or lost.
    pnabs.dataset.errors.DatasetError
        When the dataset can't be listed and there is no catalogue to go on with.
    """
    # One by which nothing lies yet binds nobody.
    old = _stored(run, identity, anew=accept) if run.ledger.stages() else None
    try:
        found = catalogue.scan(job.dataset, Path.cwd())
    except DatasetError:
        root = job.dataset.root
        if old is None or not isinstance(root, Path) or root.exists():
            raise
        reporter.say(f"the dataset {root} is not there; going on with what is catalogued")
        return Scan(old)
    if old is None:
        lost = identity is not None and bool(run.ledger.stages())
        if lost and catalogue.fingerprint(found) != (identity or {})["dataset_fingerprint"]:
            raise RefusedError(
                f"{run.catalogue} is damaged or lost, and the dataset as it is now gives another: "
                "put back a copy of it, or begin a new run folder"
            )
        return Scan(found)
    if pc.max(old["row"]).as_py() >= job.dataset.shard_size:
        # With run.json lost, nothing else would tell.
        raise RefusedError(
            f"{run.catalogue} has shards of more models than dataset.shard_size="
            f"{job.dataset.shard_size}; set it back"
        )
    if found.equals(old):
        return Scan(old)
    gone = pc.invert(pc.is_in(_keys(old), value_set=_keys(found)))
    missing = old.filter(gone)
    if len(missing):
        reporter.say(
            f"{len(missing)} models of this run are not in the dataset as the job names it now "
            "(gone, or left out by dataset.categories or dataset.limit), such as "
            f"{_keys(missing)[0]}; they stay in the run"
        )
    merged = catalogue.extend(old, found, job.dataset.shard_size)
    before = pc.index_in(_keys(merged), value_set=_keys(old))
    kept = merged.filter(pc.is_valid(before))
    then = old.take(before.drop_null())
    edited = _edited(job, run, then, kept)
    differences = _differences(then, kept, merged.filter(pc.is_null(before)), edited)
    if differences and not accept:
        raise RefusedError(
            "the dataset has changed since this run began:\n"
            + "\n".join(f"  {line}" for line in differences)
            + "\n--accept-changes takes it as it is now: added models get shards of their own, "
            "changed models' shards are redone, and training with them "
            "(not with --keep-weights)."
        )
    return Scan(merged, frozenset(row["shard"] for row in edited))


def _stored(run: RunFolder, identity: dict[str, Any] | None, *, anew: bool) -> pa.Table | None:
    """The catalogue that lies in the run folder, checked; None when there is none.

    Parameters
    ----------
    anew
        Take a damaged or lost one for one that is to be made again.

    Raises
    ------
    pnabs.store.run.RunFolderError
        When it is damaged or lost.
    pnabs.dataset.errors.DatasetError
        When it isn't a catalogue.
    """
    if identity is None:
        return catalogue.read(run.catalogue) if run.catalogue.exists() else None
    try:
        run.check_catalogue(identity)
    except RunFolderError:
        if anew:
            return None
        raise
    return catalogue.read(run.catalogue)


def _edited(job: Settings, run: RunFolder, then: pa.Table, now: pa.Table) -> list[dict[str, Any]]:
    """Ingested models whose file has another time and the same size, but other bytes."""
    touched = pc.and_(
        pc.and_(pc.equal(then["size"], now["size"]), pc.equal(now["reason"], "")),
        pc.not_equal(then["mtime_ns"], now["mtime_ns"]),
    )
    dataset = Dataset(job.dataset.root)
    edited = []
    digests: dict[str, dict[str, Any]] = {}
    for row in now.filter(touched).to_pylist():
        if row["shard"] not in digests:
            digests = {row["shard"]: _source_digests(run, row["shard"])}
        known = digests[row["shard"]].get(row["model_id"])
        if known is None:
            continue
        try:
            data = dataset.read(row["source"], job.ingest.limits.max_bytes)
        except SourceError:
            data = b""
        if hashlib.sha256(data).hexdigest() != known:
            edited.append(row)
    return edited


def _source_digests(run: RunFolder, shard: str) -> dict[str, Any]:
    record = run.ledger.read("ingest", shard)
    return {m.model_id: m.note.get("source_sha256") for m in record.models} if record else {}


def _differences(
    then: pa.Table, now: pa.Table, added: pa.Table, edited: list[dict[str, Any]]
) -> list[str]:
    lines = []
    if edited:
        first = f"{edited[0]['category']}/{edited[0]['model_id']}"
        lines.append(f"content changed: {len(edited)} models ({first}, ...)")
    if len(added):
        counts = pc.value_counts(added["category"]).to_pylist()
        parts = ", ".join(f"{item['counts']} in {item['values']}" for item in counts)
        lines.append(f"added: {len(added)} models ({parts})")
    for column in ("source", "size", "split", "reason"):
        changed = then.filter(pc.not_equal(then[column], now[column]))
        if len(changed):
            names = _keys(changed.slice(0, 3)).to_pylist()
            more = ", ..." if len(changed) > 3 else ""
            lines.append(f"{column} changed: {len(changed)} models ({', '.join(names)}{more})")
    return lines


def _keys(table: pa.Table) -> pa.ChunkedArray:
    return pc.binary_join_element_wise(table["category"], table["model_id"], "/")
