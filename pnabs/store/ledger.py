"""The ledger: one commit record a shard and stage, written last.

A shard is done when its record exists and carries the fingerprint that the
current settings and inputs give.  Records hold no times, hosts or order of work,
so that two runs compare as bytes.
"""

from __future__ import annotations

import json
import os
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pnabs.store.atomic import digest, is_as_written, write_atomic
from pnabs.store.index import Entry, load_index, save_index
from pnabs.store.sealed import SealError, seal, unseal

Kind = Literal["ok", "invalid", "error", "crash", "timeout", "memory"]
KINDS: tuple[Kind, ...] = ("ok", "invalid", "error", "crash", "timeout", "memory")
VERSION = 2


SAVE_SECONDS = 10.0
"""Time between two writings of an index: what a dead driver's successor reads singly."""


class LedgerError(Exception):
    """A record that can't be read; names the file."""


class DamagedRecordError(LedgerError):
    """A record whose bytes aren't what was written."""


@dataclass(frozen=True, slots=True)
class ModelVerdict:
    """What became of one model in one stage.

    `note` holds what the stage wants kept of a finished model (small, JSON);
    `reason`, `attempts` and `traceback` tell of one that fell out.
    """

    model_id: str
    kind: Kind
    reason: str = ""
    attempts: int = 1
    traceback: str = ""
    note: dict[str, Any] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """The verdict's part of a record; only what isn't at its default."""
        out: dict[str, Any] = {"model_id": self.model_id, "verdict": self.kind}
        if self.kind != "ok":
            out.update(reason=self.reason, attempts=self.attempts, traceback=self.traceback)
        if self.note:
            out["note"] = self.note
        return out

    @classmethod
    def from_json(cls, value: dict[str, Any]) -> ModelVerdict:
        """The inverse of `to_json`."""
        return cls(
            value["model_id"],
            value["verdict"],
            value.get("reason", ""),
            value.get("attempts", 1),
            value.get("traceback", ""),
            value.get("note", {}),
        )


@dataclass(frozen=True, slots=True)
class Record:
    """The commit record of a shard.

    Attributes
    ----------
    fingerprint
        Digest of all that the result depends on (settings, stage version, inputs).
    models
        A final verdict for every model of the shard, in the catalogue's order.
    outputs
        Path below the run folder -> ``{"bytes", "sha256"}`` of each file written.
    """

    stage: str
    shard: str
    fingerprint: str
    models: tuple[ModelVerdict, ...]
    outputs: dict[str, dict[str, Any]]

    def to_json(self) -> dict[str, Any]:
        """The record as it is written."""
        return {
            "format": "pnabs/ledger",
            "version": VERSION,
            "stage": self.stage,
            "shard": self.shard,
            "fingerprint": self.fingerprint,
            "models": [model.to_json() for model in self.models],
            "outputs": self.outputs,
        }

    @property
    def digest(self) -> str:
        """Digest of what later stages take as their input: who came through, and their data.

        Reasons and tracebacks are not in it: they may differ from one attempt to the next.
        """
        models = [[m.model_id, m.kind == "ok", m.note] for m in self.models]
        return digest([self.fingerprint, models, self.outputs])

    @property
    def finished(self) -> tuple[ModelVerdict, ...]:
        """The models that came through."""
        return tuple(model for model in self.models if model.kind == "ok")

    @property
    def quarantined(self) -> tuple[ModelVerdict, ...]:
        """The models that fell out."""
        return tuple(model for model in self.models if model.kind != "ok")


class Ledger:
    """The records below RUN/ledger, and what is derived from them: indexes, quarantine lists."""

    def __init__(self, run: Path) -> None:
        self.run = run
        self._indexes: dict[str, dict[str, Entry]] = {}
        self._unsaved: Counter[str] = Counter()
        self._generations: Counter[str] = Counter()
        self._saved: dict[str, float] = {}

    def path(self, stage: str, shard: str) -> Path:
        """Where a shard's record lies."""
        return self.run / "ledger" / stage / f"{shard}.json"

    def index_path(self, stage: str) -> Path:
        """Where a stage's index lies."""
        return self.run / "index" / f"{stage}.json"

    def read(self, stage: str, shard: str) -> Record | None:
        """A shard's record, or None when it isn't committed.

        Raises
        ------
        DamagedRecordError
            When the file isn't what was written.
        LedgerError
            When it is of another version.
        """
        path = self.path(stage, shard)
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            return None
        try:
            value = unseal(data)
        except SealError as error:
            _check_unsealed(path, data)
            raise DamagedRecordError(
                f"{path} is damaged ({error}); its shard is to be done again"
            ) from error
        _check_version(path, value)
        return Record(
            value["stage"],
            value["shard"],
            value["fingerprint"],
            tuple(ModelVerdict.from_json(model) for model in value["models"]),
            value["outputs"],
        )

    def index(self, stage: str) -> Mapping[str, Entry]:
        """Every committed shard of a stage, from its index and the records it doesn't know.

        A record that is damaged counts as not there: its shard is done again.

        Raises
        ------
        LedgerError
            When a record is of another version.
        """
        if stage in self._indexes:
            return self._indexes[stage]
        known = load_index(self.index_path(stage))
        entries: dict[str, Entry] = {}
        try:
            listing = sorted(os.scandir(self.run / "ledger" / stage), key=lambda item: item.name)
        except FileNotFoundError:
            listing = []
        for item in listing:
            shard, suffix = os.path.splitext(item.name)
            if suffix != ".json":
                continue
            try:
                status = item.stat()
            except FileNotFoundError:
                continue  # withdrawn just now, by the driver that this one looks at
            entry = known.get(shard)
            now = status.st_mtime_ns, status.st_size
            if entry is None or (entry.mtime_ns, entry.size) != now:
                entry = self._entry(stage, shard, status)
                self._unsaved[stage] += 1
            if entry is not None:
                entries[shard] = entry
        self._unsaved[stage] += len(known.keys() - entries.keys())
        self._indexes[stage] = entries
        self._saved.setdefault(stage, time.monotonic())
        return entries

    def _entry(self, stage: str, shard: str, status: os.stat_result) -> Entry | None:
        try:
            record = self.read(stage, shard)
        except DamagedRecordError:
            return None
        return None if record is None else _summary(record, status)

    def generation(self, stage: str) -> int:
        """Changes whenever a record of the stage was written or withdrawn by this object."""
        return self._generations[stage]

    def save_index(self, stage: str) -> None:
        """Write the stage's index when it has changed; only the driver does."""
        self._saved[stage] = time.monotonic()
        if self._unsaved.pop(stage, 0):
            save_index(self.index_path(stage), self.index(stage))

    def commit(self, record: Record) -> None:
        """Write a shard's record: from here on the shard is done."""
        path = self.path(record.stage, record.shard)
        self.index(record.stage)
        write_atomic(path, seal(record.to_json()))
        self._indexes[record.stage][record.shard] = _summary(record, path.stat())
        self._unsaved[record.stage] += 1
        self._generations[record.stage] += 1
        if time.monotonic() - self._saved.get(record.stage, 0.0) >= SAVE_SECONDS:
            self.save_index(record.stage)

    def withdraw(self, stage: str, shard: str) -> None:
        """Take a record back: the next run does the shard again."""
        self.path(stage, shard).unlink(missing_ok=True)
        if self._indexes.get(stage, {}).pop(shard, None) is not None:
            self._unsaved[stage] += 1
            self._generations[stage] += 1

    def shards(self, stage: str) -> list[str]:
        """Shards of a stage that have a record, sound or not, sorted."""
        return sorted(path.stem for path in (self.run / "ledger" / stage).glob("*.json"))

    def lost(self, stage: str) -> list[str]:
        """Shards that the stage's index knows and that have no record any more."""
        return sorted(load_index(self.index_path(stage)).keys() - set(self.shards(stage)))

    def stages(self) -> list[str]:
        """Stages that have or had records, sorted."""
        records, indexes = self.run.glob("ledger/*/"), self.run.glob("index/*.json")
        return sorted({path.name for path in records} | {path.stem for path in indexes})

    def quarantine_path(self, stage: str) -> Path:
        """Where a stage's quarantine list lies."""
        return self.run / "quarantine" / f"{stage}.jsonl"

    def quarantine(self, stage: str) -> bytes:
        """The stage's quarantine list, from the records; one line a model."""
        return "".join(self._fallen(stage)).encode()

    def write_quarantine(self, stage: str) -> None:
        """Rewrite the stage's quarantine list where it isn't what the records say."""
        path, content = self.quarantine_path(stage), self.quarantine(stage)
        if not path.exists() or path.read_bytes() != content:
            write_atomic(path, content)

    def _fallen(self, stage: str) -> Iterator[str]:
        for shard, entry in sorted(self.index(stage).items()):
            try:
                record = self.read(stage, shard) if entry.fallen else None
            except DamagedRecordError:
                # Damaged since the index was made: the next run does its shard again.
                self.withdraw(stage, shard)
                continue
            category = shard.rpartition("-")[0]
            for model in record.quarantined if record else ():
                line = {
                    "model_id": model.model_id,
                    "category": category,
                    "kind": model.kind,
                    "reason": model.reason,
                    "attempts": model.attempts,
                    "traceback": model.traceback,
                }
                yield json.dumps(line, ensure_ascii=False) + "\n"

    def damaged_outputs(self, record: Record) -> list[str]:
        """Files of a record that are missing or whose bytes changed."""
        return [
            name
            for name, expected in record.outputs.items()
            if not is_as_written(self.run / name, expected)
        ]


def _summary(record: Record, status: os.stat_result) -> Entry:
    return Entry(
        status.st_mtime_ns,
        status.st_size,
        record.fingerprint,
        record.digest,
        len(record.models),
        tuple((model.model_id, model.kind) for model in record.quarantined),
        tuple(model.model_id for model in record.finished if model.note.get("empty")),
    )


def _check_version(path: Path, value: Any) -> None:
    if value["version"] != VERSION:
        raise LedgerError(
            f"{path} has record version {value['version']}, this pnabs reads {VERSION}: go on "
            "with the pnabs that made the run, or give another folder with --out"
        )


def _check_unsealed(path: Path, data: bytes) -> None:
    """Tell a sound record of a version that had no checksum from a damaged one."""
    try:
        value = json.loads(data)
        sound = value["format"] == "pnabs/ledger" and "sha256" not in value
    except (ValueError, KeyError, TypeError):
        return
    if sound:
        _check_version(path, value)
