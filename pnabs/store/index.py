"""One compacted index a stage: what a driver asks of the ledger's records, in one file.

Derived: where it is missing, damaged or behind, the records are read.  It holds
file times, by which it is compared with the records, so it lies apart from them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pnabs.store.atomic import write_atomic
from pnabs.store.sealed import SealError, seal_derived, unseal_derived

VERSION = 1


@dataclass(frozen=True, slots=True)
class Entry:
    """What the index has of one record.

    Attributes
    ----------
    mtime_ns, size
        Of the record's file.
    fingerprint
        The record's.
    digest
        Of what later stages take as their input.
    models
        How many have a verdict.
    fallen
        (model id, kind) of those that fell out.
    empty
        Ids of those that came through with nothing to show.
    """

    mtime_ns: int
    size: int
    fingerprint: str
    digest: str
    models: int
    fallen: tuple[tuple[str, str], ...] = ()
    empty: tuple[str, ...] = ()


def save_index(path: Path, entries: Mapping[str, Entry]) -> None:
    """Write an index, shard -> entry."""
    rows = {
        shard: [e.mtime_ns, e.size, e.fingerprint, e.digest, e.models, e.fallen, e.empty]
        for shard, e in entries.items()
    }
    value = {"format": "pnabs/index", "version": VERSION, "entries": rows}
    write_atomic(path, seal_derived(value))


def load_index(path: Path) -> dict[str, Entry]:
    """Read an index; empty when it is missing, damaged or of another version."""
    try:
        value = unseal_derived(path.read_bytes())
    except (OSError, SealError):
        return {}
    if value["version"] != VERSION:
        return {}
    return {
        shard: Entry(*rest, tuple((name, kind) for name, kind in fallen), tuple(empty))  # type: ignore[call-arg]
        for shard, (*rest, fallen, empty) in value["entries"].items()
    }
