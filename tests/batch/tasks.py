"""Work that misbehaves on command: tables say for each model, and each attempt, what happens."""

from __future__ import annotations

import ctypes
import os
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pnabs.batch.work import Committed, InvalidInput, Outcome, Unavailable

Table = dict[str, str]
"""Model -> what it does at its first, second, ... attempt, by comma; the last goes on."""


def count(folder: Path, name: str) -> int:
    """Note one more invocation on disk; returns how many came before."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / name).open("ab") as stream:
        stream.write(b".")
        return stream.tell() - 1


def invocations(folder: Path, names: Iterable[str]) -> dict[str, int]:
    """How often each model was begun."""
    return {
        name: (folder / name).stat().st_size if (folder / name).exists() else 0 for name in names
    }


def misbehave(script: str, attempt: int, folder: Path) -> None:
    """Do what the table says for this attempt."""
    actions = script.split(",")
    action = actions[min(attempt, len(actions) - 1)]
    if action == "slow":
        time.sleep(1)
    elif action == "raise":
        raise ValueError("a bad model")
    elif action == "invalid":
        raise InvalidInput("not a mesh")
    elif action == "unavailable":
        raise Unavailable("the disk is gone")
    elif action == "crash":
        ctypes.string_at(0)
    elif action == "abort":
        os.abort()
    elif action == "exit":
        os._exit(7)
    elif action == "hang":
        (folder / "pid").write_text(str(os.getpid()))
        # In native code, with the interpreter's lock held.
        ctypes.PyDLL(None).sleep(1000)
    elif action == "memory":
        np.zeros(2**34, dtype=np.uint8)[:] = 1
    else:
        assert action == "ok", action


FAULTS: Table = {
    "crash": "crash",
    "abort": "abort",
    "exit": "exit",
    "hang": "hang",
    "raise": "raise",
    "invalid": "invalid",
    "memory": "memory",
}
"""One model for each way to fall out."""

VERDICTS = {
    "crash": ("crash", "the process died of SIGSEGV", "misbehave"),
    "abort": ("crash", "the process died of SIGABRT", "misbehave"),
    "exit": ("crash", "the process ended with exit code 7", ""),
    "hang": ("timeout", "no result within", "misbehave"),
    "raise": ("error", "ValueError: a bad model", "a bad model"),
    "invalid": ("invalid", "not a mesh", ""),
    "memory": ("memory", "out of its memory limit", "misbehave"),
}
"""Kind, part of the reason, part of the traceback of each."""


@dataclass(frozen=True)
class Faulty:
    """A task around another, with a table in front; payloads come with their model's id."""

    table: Table
    folder: Path
    task: Callable[[Any], Any]

    def __call__(self, payload: tuple[str, Any]) -> Any:
        """Count, misbehave, and then do the work if that left us alive."""
        model_id, inner = payload
        attempt = count(self.folder, model_id)
        misbehave(self.table.get(model_id, "ok"), attempt, self.folder)
        return self.task(inner)


def finish(model_id: str) -> str:
    """The work of a scripted model."""
    return f"{model_id} done"


@dataclass
class ScriptedWork:
    """Shards of scripted models; commit writes one text file a shard.

    Files in its folder make more of it misbehave: `gone` puts all out of reach with its content
    as the reason, `blind` one worker; `stuck-<shard>` makes its worker hang.
    """

    folder: str
    shards: dict[str, Table]
    preload: tuple[str, ...] = ("numpy",)

    @property
    def task(self) -> Faulty:
        """A table before a trivial task."""
        table = {name: script for shard in self.shards.values() for name, script in shard.items()}
        return Faulty(table, Path(self.folder), finish)

    def check(self) -> None:
        """Nothing is out of reach, unless a file says so."""
        gone = Path(self.folder) / "gone"
        if gone.exists():
            raise Unavailable(gone.read_text())
        blind = Path(self.folder) / "blind"
        if blind.exists():
            who = blind.read_text() or str(os.getpid())
            blind.write_text(who)
            if who == str(os.getpid()):
                raise Unavailable("this worker doesn't see the run folder")

    def setup(self) -> None:
        """Nothing to load."""

    def payloads(self, shard: str) -> Iterable[tuple[str, Any]]:
        """Each model with its script."""
        if (Path(self.folder) / f"stuck-{shard}").exists():
            time.sleep(1000)
        for model_id in self.shards[shard]:
            yield model_id, (model_id, model_id)

    def commit(self, shard: str, outcomes: Sequence[Outcome]) -> Committed:
        """One line a finished model."""
        lines = [f"{outcome.value}\n" for outcome in outcomes if outcome.kind == "ok"]
        count(Path(self.folder) / "commits", shard)
        (Path(self.folder) / f"{shard}.txt").write_text("".join(lines))
        return Committed({}, {})
