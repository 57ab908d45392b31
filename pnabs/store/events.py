"""What happened when: durations, memory, hosts.  Nothing else holds times."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any


class EventLog:
    """Appends events to RUN/events/<writer>/<n>.jsonl; one writer a file.

    Parameters
    ----------
    writer
        Who writes: `driver`, `ingest`, `train-positive-initial`, ...
    """

    def __init__(self, run: Path, writer: str) -> None:
        folder = run / "events" / writer
        folder.mkdir(parents=True, exist_ok=True)
        number = len(list(folder.glob("*.jsonl")))
        while True:
            try:
                self.path = folder / f"{number:05d}.jsonl"
                self._descriptor = os.open(
                    self.path, os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_APPEND, 0o644
                )
                break
            except FileExistsError:
                number += 1
        self._common = {"host": socket.gethostname(), "pid": os.getpid()}

    def __call__(self, event: str, **values: Any) -> None:
        """Append one event; lost where the disk is full."""
        line = {"time": round(time.time(), 3), "event": event, **self._common, **values}
        data = json.dumps(line, ensure_ascii=False).encode() + b"\n"
        with contextlib.suppress(OSError):
            if os.write(self._descriptor, data) < len(data):
                # Only its beginning: what follows must not join it.
                os.write(self._descriptor, b"\n")

    def close(self) -> None:
        """Close the file."""
        os.close(self._descriptor)


def read_events(run: Path, writer: str = "*") -> Iterator[dict[str, Any]]:
    """Events of a writer, or of all, file by file; torn and damaged lines are passed over."""
    for path in sorted((run / "events").glob(f"{writer}/*.jsonl")):
        yield from _parse(path.read_bytes())


def _sound(lines: list[bytes]) -> Iterator[Any]:
    for line in lines:
        with contextlib.suppress(ValueError):
            yield json.loads(line)


def _parse(data: bytes) -> Iterator[dict[str, Any]]:
    lines = [line for line in data.split(b"\n") if line]
    try:
        # At once is several times faster than line by line.
        values = json.loads(b"[" + b",".join(lines) + b"]")
    except ValueError:
        values = list(_sound(lines))
    for value in values:
        if isinstance(value, dict) and {"event", "time", "pid", "host"} <= value.keys():
            yield value


class EventTail:
    """The events that writers of a name (a pattern) add from now on, each once."""

    def __init__(self, run: Path, writer: str) -> None:
        self._events, self._pattern = run / "events", f"{writer}/*.jsonl"
        self._read = {path: path.stat().st_size for path in self._events.glob(self._pattern)}

    def __call__(self) -> Iterator[dict[str, Any]]:
        """What is new since the last call."""
        for path in sorted(self._events.glob(self._pattern)):
            start = self._read.get(path, 0)
            if path.stat().st_size <= start:
                continue
            with path.open("rb") as stream:
                stream.seek(start)
                # A line that is being written is read when it is whole.
                data = stream.read().rpartition(b"\n")[0]
            self._read[path] = start + len(data) + bool(data)
            yield from _parse(data)
