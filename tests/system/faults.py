"""Faults in real stages: tables of misbehaving models, and drivers killed at a named point.

Run as ``python -m tests.system.faults POINT NUMBER COUNTS pnabs-arguments...`` it is the
command line with every begun model counted on disk and the driver killed by SIGKILL when it
comes to the point for the NUMBER-th time.  Points:

    before:<glob>, after:<glob>   a file whose path matches is given its name
    begun:<stage>                 a worker was given a shard
    epoch:<phase>                 the driver hears of an epoch
    event:<event>/<phase>         the driver has noted an event
    ray                           Ray is up
"""

from __future__ import annotations

import fnmatch
import functools
import os
import signal
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pnabs.batch import Outcome, ShardWork
from pnabs.batch.work import Committed
from tests.batch.tasks import Faulty, Table


@dataclass
class FaultyWork:
    """A stage's work with a table of faults before each model's task."""

    inner: ShardWork
    table: Table
    folder: Path

    @property
    def preload(self) -> tuple[str, ...]:
        """The stage's own."""
        return self.inner.preload

    @property
    def task(self) -> Faulty:
        """The table, then the stage's task."""
        return Faulty(self.table, self.folder, self.inner.task)

    def check(self) -> None:
        """The stage's own."""
        self.inner.check()

    def setup(self) -> None:
        """The stage's own."""
        self.inner.setup()

    def payloads(self, shard: str) -> Iterable[tuple[str, Any]]:
        """The stage's own, with the models' ids."""
        for model_id, payload in self.inner.payloads(shard):
            yield model_id, (model_id, payload)

    def commit(self, shard: str, outcomes: Sequence[Outcome]) -> Committed:
        """The stage's own."""
        return self.inner.commit(shard, outcomes)


STAGES = {"ingest": "IngestWork", "difference": "DifferenceWork", "abstract": "AbstractWork"}


def wrapped(counts: Path, table: Table | None = None) -> dict[str, Callable[..., FaultyWork]]:
    """Dotted name of each stage's work -> what makes it with faults; counts go to `counts`."""
    import importlib

    out: dict[str, Callable[..., FaultyWork]] = {}
    for stage, name in STAGES.items():
        original = getattr(importlib.import_module(f"pnabs.stages.{stage}"), name)

        def make(
            *arguments: Any, original: Any = original, folder: Path = counts / stage
        ) -> FaultyWork:
            return FaultyWork(original(*arguments), table or {}, folder)

        out[f"pnabs.stages.{stage}.{name}"] = make
    return out


def install(name: str, value: object) -> None:
    """Put a value in the place of a dotted name."""
    import importlib

    parts = name.split(".")
    for depth in range(len(parts) - 1, 0, -1):
        try:
            place: Any = importlib.import_module(".".join(parts[:depth]))
        except ModuleNotFoundError:
            continue
        for part in parts[depth:-1]:
            place = getattr(place, part)
        setattr(place, parts[-1], value)
        return
    raise ModuleNotFoundError(name)


class Killer:
    """Ends this process when a point is reached for the n-th time."""

    def __init__(self, point: str, number: int) -> None:
        self._kind, _, self._what = point.partition(":")
        self._left = number

    def _reached(self) -> None:
        self._left -= 1
        if self._left == 0:
            os.kill(os.getpid(), signal.SIGKILL)

    def install(self) -> None:
        """Watch for the point in this process."""
        if self._kind in ("before", "after"):
            replace = Path.replace

            @functools.wraps(replace)
            def replaced(path: Path, target: Any) -> Any:
                matches = fnmatch.fnmatch(str(target), self._what)
                if matches and self._kind == "before":
                    self._reached()
                result = replace(path, target)
                if matches and self._kind == "after":
                    self._reached()
                return result

            install("pathlib.Path.replace", replaced)
        elif self._kind == "begun":
            self._around("pnabs.stages.sharded._Progress.started", lambda self, *_: self.stage)
        elif self._kind == "epoch":
            from pnabs.stages.train import _Watch

            look = _Watch.look

            def looked(watch: Any) -> Any:
                epoch = look(watch)
                if epoch is not None and epoch["phase"] == self._what:
                    self._reached()
                return epoch

            install("pnabs.stages.train._Watch.look", looked)
        elif self._kind == "event":
            from pnabs.store.events import EventLog

            note = EventLog.__call__

            def noted(log: Any, event: str, **values: Any) -> None:
                note(log, event, **values)
                if f"{event}/{values.get('phase')}" == self._what:
                    self._reached()

            install("pnabs.store.events.EventLog.__call__", noted)
        elif self._kind == "ray":
            self._around("pnabs.batch.ray_executor.RayExecutor.__init__", lambda *_: "")
        else:
            assert self._kind == "never", self._kind

    def _around(self, name: str, what: Callable[..., str]) -> None:
        import importlib

        module, owner, method = name.rsplit(".", 2)
        original = getattr(getattr(importlib.import_module(module), owner), method)

        def around(*arguments: Any) -> Any:
            result = original(*arguments)
            if what(*arguments) == self._what:
                self._reached()
            return result

        install(name, around)


def main() -> None:
    """The command line, with faults."""
    point, number, counts, *arguments = sys.argv[1:]
    for name, value in wrapped(Path(counts)).items():
        install(name, value)
    Killer(point, int(number)).install()
    sys.argv = ["pnabs", *arguments]
    from pnabs.cli import main as pnabs

    pnabs()


if __name__ == "__main__":
    main()
