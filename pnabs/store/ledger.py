"""The ledger: one commit record a shard and stage, written last.

A shard is done when its record exists and carries the fingerprint that the
current settings and inputs give.  Records hold no times, hosts or order of work,
so that two runs compare as bytes.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pnabs.store.atomic import digest, file_digest, pretty_json, write_atomic

Kind = Literal["ok", "invalid", "error", "crash", "timeout", "memory"]
KINDS: tuple[Kind, ...] = ("ok", "invalid", "error", "crash", "timeout", "memory")
VERSION = 1


class LedgerError(Exception):
    """A record that can't be read; names the file."""


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
        """Digest of the record's content: what later stages take as their input."""
        return digest(self.to_json())

    @property
    def finished(self) -> tuple[ModelVerdict, ...]:
        """The models that came through."""
        return tuple(model for model in self.models if model.kind == "ok")

    @property
    def quarantined(self) -> tuple[ModelVerdict, ...]:
        """The models that fell out."""
        return tuple(model for model in self.models if model.kind != "ok")


class Ledger:
    """The records below RUN/ledger and the quarantine lists derived from them."""

    def __init__(self, run: Path) -> None:
        self.run = run

    def path(self, stage: str, shard: str) -> Path:
        """Where a shard's record lies."""
        return self.run / "ledger" / stage / f"{shard}.json"

    def read(self, stage: str, shard: str) -> Record | None:
        """A shard's record, or None when it isn't committed.

        Raises
        ------
        LedgerError
            When the file is there but isn't a record of this version.
        """
        path = self.path(stage, shard)
        try:
            value = json.loads(path.read_bytes())
        except FileNotFoundError:
            return None
        except ValueError as error:
            raise LedgerError(
                f"{path} is not a ledger record ({error}); delete it and run again: "
                "its shard will be redone"
            ) from error
        if not isinstance(value, dict) or value.get("format") != "pnabs/ledger":
            raise LedgerError(f"{path} is not a ledger record; delete it and run again")
        if value.get("version") != VERSION:
            raise LedgerError(
                f"{path} has record version {value.get('version')}, this pnabs reads {VERSION}"
            )
        try:
            return Record(
                value["stage"],
                value["shard"],
                value["fingerprint"],
                tuple(ModelVerdict.from_json(model) for model in value["models"]),
                value["outputs"],
            )
        except (KeyError, TypeError) as error:
            raise LedgerError(f"{path} lacks {error}; delete it and run again") from error

    def commit(self, record: Record) -> None:
        """Write a shard's record: from here on the shard is done."""
        write_atomic(self.path(record.stage, record.shard), pretty_json(record.to_json()))

    def withdraw(self, stage: str, shard: str) -> None:
        """Take a record back: the next run does the shard again."""
        self.path(stage, shard).unlink(missing_ok=True)

    def shards(self, stage: str) -> list[str]:
        """Shards of a stage that have a record, sorted."""
        return sorted(path.stem for path in (self.run / "ledger" / stage).glob("*.json"))

    def stages(self) -> list[str]:
        """Stages that have records, sorted."""
        folder = self.run / "ledger"
        return sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []

    def write_quarantine(self, stage: str) -> Path:
        """Rewrite RUN/quarantine/<stage>.jsonl from the records; one line a model."""
        lines = []
        for shard in self.shards(stage):
            record = self.read(stage, shard)
            if record is None:
                continue
            category = shard.rpartition("-")[0]
            for model in record.quarantined:
                entry = {
                    "model_id": model.model_id,
                    "category": category,
                    "kind": model.kind,
                    "reason": model.reason,
                    "attempts": model.attempts,
                    "traceback": model.traceback,
                }
                lines.append(json.dumps(entry, ensure_ascii=False) + "\n")
        path = self.run / "quarantine" / f"{stage}.jsonl"
        write_atomic(path, "".join(lines).encode())
        return path

    def damaged_outputs(self, record: Record) -> list[str]:
        """Files of a record that are missing or whose bytes changed."""
        return [
            name
            for name, expected in record.outputs.items()
            if not (self.run / name).is_file() or file_digest(self.run / name) != expected
        ]
