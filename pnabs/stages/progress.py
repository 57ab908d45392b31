"""Progress on stderr: bars in a terminal, one plain line now and then elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

PLAIN_SECONDS = 30.0
"""Time between plain lines."""


class Tracker(Protocol):
    """How one stage's progress is told."""

    def update(self, done: int, note: str = "") -> None:
        """Units done since the stage began, and a few words."""


class Reporter:
    """Tells of stages on stderr.

    Parameters
    ----------
    quiet
        Only messages, no progress.
    """

    def __init__(self, *, quiet: bool = False) -> None:
        self._console = Console(stderr=True, highlight=False)
        self._quiet = quiet

    def say(self, message: str) -> None:
        """One message, on a line of its own."""
        self._console.print(message, markup=False, soft_wrap=True)

    @contextmanager
    def track(self, stage: str, total: int, unit: str) -> Iterator[Tracker]:
        """Follow a stage of so many units while the body runs."""
        if self._quiet:
            yield _Silent()
        elif self._console.is_terminal:
            columns = (
                TextColumn("{task.description:<20}"),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn(unit),
                TimeElapsedColumn(),
                TimeRemainingColumn(),
                TextColumn("{task.fields[note]}"),
            )
            with Progress(*columns, console=self._console) as progress:
                task = progress.add_task(stage, total=total, note="")
                yield _Bar(progress, task)
        else:
            tracker = _Lines(stage, total, unit)
            yield tracker
            tracker.finish()


class _Silent:
    def update(self, done: int, note: str = "") -> None:
        pass


class _Bar:
    def __init__(self, progress: Progress, task: object) -> None:
        self._progress = progress
        self._task = task

    def update(self, done: int, note: str = "") -> None:
        self._progress.update(self._task, completed=done, note=note)  # type: ignore[arg-type]


class _Lines:
    def __init__(self, stage: str, total: int, unit: str) -> None:
        self._stage, self._total, self._unit = stage, total, unit
        self._started = self._last = time.monotonic()
        self._before: int | None = None
        self._done, self._note = 0, ""
        self._say()

    def update(self, done: int, note: str = "") -> None:
        if self._before is None:
            self._before = done
        self._done, self._note = done, note
        now = time.monotonic()
        if now - self._last >= PLAIN_SECONDS:
            self._last = now
            self._say()

    def finish(self) -> None:
        self._say()

    def _say(self) -> None:
        seconds = time.monotonic() - self._started
        parts = [f"stage={self._stage} done={self._done}/{self._total} {self._unit}"]
        new = self._done - (self._before or 0)
        if new and seconds > 0:
            rate = new / seconds
            parts.append(f"rate={rate:.2f}/s eta={(self._total - self._done) / rate:.0f}s")
        if self._note:
            parts.append(self._note)
        sys.stderr.write(" ".join(parts) + "\n")
        sys.stderr.flush()
