"""What is there of the results of `pnabs abstract`, and what is missing."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pnabs import batch
from pnabs.dataset.errors import SourceError
from pnabs.dataset.files import File, Files
from pnabs.dataset.source import Dataset
from pnabs.formats import FORMATS, STEM, FormatError, from_json
from pnabs.settings import Settings
from pnabs.stages.identity import given_weights
from pnabs.stages.job import Job
from pnabs.stages.plan import fingerprint, recipe_digest
from pnabs.stages.progress import Reporter
from pnabs.store.atomic import write_atomic

RECORD = f"{STEM}.json"
"""The file that says that a mesh is done, written last; all other formats follow from it."""

QUARANTINE = "quarantine.jsonl"


@dataclass(frozen=True, slots=True)
class Item:
    """A mesh to be seen to.

    Attributes
    ----------
    known
        Its `abstraction.json`, where that is of this mesh and these settings.
    formats
        Those to be written; of a mesh that isn't known, all.
    """

    model_id: str
    file: File
    known: bytes | None
    formats: tuple[str, ...]


class Quarantine:
    """The list of meshes that fell out: a line each, written at once."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.entries: dict[str, dict[str, Any]] = {}
        for line in path.read_text().splitlines() if path.exists() else ():
            try:
                entry = json.loads(line)
                self.entries[entry["model_id"]] = entry
            except (ValueError, KeyError, TypeError):
                continue  # cut short by a kill

    def settle(self, outcome: batch.Outcome, mark: str) -> None:
        """Take a verdict; `mark` tells when it no longer holds."""
        if outcome.kind == "ok":
            self.entries.pop(outcome.model_id, None)
            return
        entry = {
            "model_id": outcome.model_id,
            "kind": outcome.kind,
            "reason": outcome.reason,
            "attempts": outcome.attempts,
            "traceback": outcome.traceback,
            "fingerprint": mark,
        }
        self.entries[outcome.model_id] = entry
        with self._path.open("a") as stream:
            stream.write(f"\n{json.dumps(entry)}\n")
            stream.flush()
            os.fsync(stream.fileno())

    def rewrite(self) -> None:
        """One line each, by id; no file when nothing fell out."""
        if self.entries:
            lines = (json.dumps(self.entries[name]) + "\n" for name in sorted(self.entries))
            write_atomic(self._path, "".join(lines).encode())
        else:
            self._path.unlink(missing_ok=True)


def recipe_of(job: Job) -> str:
    """What results depend on beside the mesh; not on formats, which follow from the record."""
    settings = job.settings
    plain = settings.model_copy(
        update={"abstract": settings.abstract.model_copy(update={"formats": ("json",)})}
    )
    return fingerprint(recipe_digest("abstract", plain), given_weights(job))


def missing(
    files: Files,
    settings: Settings,
    recipe: str,
    quarantine: Quarantine,
    reporter: Reporter,
    *,
    retry: bool,
) -> list[Item]:
    """The meshes with something to be done."""
    formats = settings.abstract.formats
    items, changed = [], []
    for model_id, file in files.files.items():
        folder = settings.out / model_id
        record, before = _read(folder / RECORD), quarantine.entries.get(model_id)
        item = Item(model_id, file, None, formats)
        known = None if record is None else _provenance(record)
        if known is None and (before is None or retry):
            items.append(item)
            continue
        mark = mark_of(settings, recipe, file, (known or {}).get("siblings", ()))
        if known is not None and known.get("fingerprint") == mark:
            quarantine.entries.pop(model_id, None)
            lacking = tuple(
                name for name in formats if not (folder / f"{STEM}{FORMATS[name].suffix}").exists()
            )
            if lacking:
                items.append(Item(model_id, file, record, lacking))
        # What a .gltf that fell out names may be there by now.
        elif before is None or retry or before.get("fingerprint") != mark or file.suffix == ".gltf":
            items.append(item)
            changed += [model_id] if known is not None else []
    if changed:
        reporter.say(
            f"{len(changed)} results, such as {changed[0]}, are of other settings or of a mesh "
            "that has changed: they are made again"
        )
    return items


def mark_of(settings: Settings, recipe: str, file: File, siblings: Iterable[str]) -> str:
    """What the result of a file depends on, as it is now."""
    most = settings.ingest.limits.max_bytes
    dataset = Dataset(file.root)
    digests = {}
    try:
        own = _sha256(dataset.read(file.source, most))
        read = dataset.sibling_reader(file.source, most)
        digests = {name: _sha256(read(name)) for name in siblings}
    except SourceError:
        own = ""
    return result_fingerprint(recipe, own, digests)


def result_fingerprint(recipe: str, sha256: str, siblings: Mapping[str, str]) -> str:
    """By what a record says of what it was made.

    Parameters
    ----------
    recipe
        `recipe_of` the job.
    sha256
        Of the mesh file's bytes.
    siblings
        Name -> SHA-256 of the other files that it is made of.
    """
    return fingerprint(recipe, {"mesh": sha256, "siblings": dict(siblings)})


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _provenance(record: bytes) -> dict[str, Any] | None:
    """What a record says of its making; None where it is damaged."""
    try:
        return from_json(record).provenance
    except FormatError:
        return None


def _read(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        return None
