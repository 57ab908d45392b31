"""Tasks that misbehave on command, and a shard's work around them."""

from __future__ import annotations

import ctypes
import os
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pnabs.batch.work import Committed, InvalidInput, Outcome, Unavailable


def misbehave(payload: tuple[str, str, str]) -> str:
    """Do what the table says for this attempt; count the invocation on disk."""
    model_id, script, folder = payload
    counter = Path(folder) / model_id
    attempt = counter.stat().st_size if counter.exists() else 0
    with counter.open("ab") as stream:
        stream.write(b".")
    actions = script.split(",")
    action = actions[min(attempt, len(actions) - 1)]
    if action == "crash":
        ctypes.string_at(0)
    elif action == "abort":
        os.abort()
    elif action == "exit":
        os._exit(7)
    elif action == "hang":
        (Path(folder) / "pid").write_text(str(os.getpid()))
        time.sleep(1000)
    elif action == "raise":
        raise ValueError("a bad model")
    elif action == "invalid":
        raise InvalidInput("not a mesh")
    elif action == "memory":
        np.zeros(2**34, dtype=np.uint8)[:] = 1
    return f"{model_id} done"


@dataclass
class ScriptedWork:
    """Shards of scripted models; commit writes one text file a shard."""

    folder: str
    shards: dict[str, dict[str, str]]
    preload: tuple[str, ...] = ("numpy",)
    task = staticmethod(misbehave)

    def check(self) -> None:
        """Nothing is out of reach, unless a file says so."""
        gone = Path(self.folder) / "gone"
        if gone.exists():
            raise Unavailable(gone.read_text())

    def setup(self) -> None:
        """Nothing to load."""

    def payloads(self, shard: str) -> Iterable[tuple[str, Any]]:
        """Each model with its script."""
        for model_id, script in self.shards[shard].items():
            yield model_id, (model_id, script, self.folder)

    def commit(self, shard: str, outcomes: Sequence[Outcome]) -> Committed:
        """One line a finished model."""
        lines = [f"{outcome.value}\n" for outcome in outcomes if outcome.kind == "ok"]
        (Path(self.folder) / f"{shard}.txt").write_text("".join(lines))
        return Committed({}, {})
