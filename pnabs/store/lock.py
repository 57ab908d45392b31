"""One driver a run folder.

The lock is the kernel's (`flock`), so a dead holder never keeps it; the file's
content only tells who holds it.
"""

from __future__ import annotations

import fcntl
import json
import os
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class LockedError(Exception):
    """The run folder is held by another driver."""


@contextmanager
def run_lock(run: Path) -> Iterator[None]:
    """Hold RUN/lock while the body runs.

    Raises
    ------
    LockedError
        When another driver holds it; names host, process and age.
    """
    run.mkdir(parents=True, exist_ok=True)
    path = run / "lock"
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise LockedError(_holder(path)) from None
        holder = {"host": socket.gethostname(), "pid": os.getpid(), "since": time.time()}
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, json.dumps(holder).encode(), 0)
        yield
        os.ftruncate(descriptor, 0)
    finally:
        os.close(descriptor)


def _holder(path: Path) -> str:
    try:
        holder = json.loads(path.read_text())
        minutes = (time.time() - holder["since"]) / 60
        who = f"process {holder['pid']} on {holder['host']}, for {minutes:.0f} minutes"
    except (OSError, ValueError, KeyError, TypeError):
        who = "another process"
    return (
        f"{path.parent} is being written by {who}. Wait for it, or stop it and run again: "
        "the lock goes with the process that holds it."
    )
