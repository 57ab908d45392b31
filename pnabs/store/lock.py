"""One driver a run folder.

The lock is the kernel's (`flock`), so a dead holder never keeps it.  Where a file
system doesn't carry `flock` from one machine to another, the file's content still
tells: a holder rewrites its time every few seconds, and who finds another machine's
entry first watches whether it lives.  The content's token fences workers: one that
outlived its driver finds another token, or none, and writes nothing any more.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import secrets
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_NO_LOCKS = (errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOLCK)

BEAT_SECONDS = 5.0
"""Time between a holder's signs of life."""


class LockedError(Exception):
    """The run folder is held by another driver."""


class NotHeldError(Exception):
    """A worker's driver doesn't hold the run folder any more."""


@contextmanager
def run_lock(run: Path) -> Iterator[str]:
    """Hold RUN/lock while the body runs.

    Yields
    ------
    The token by which workers know their driver (`check_held`).

    Raises
    ------
    LockedError
        When another driver holds it; names host, process and age.
    OSError
        When the folder can't be made or written.
    """
    run.mkdir(parents=True, exist_ok=True)
    path = run / "lock"
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            here = socket.gethostname()
        except BlockingIOError:
            raise LockedError(_held(path)) from None
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                raise
            here = ""
        _watch(path, here)
        now = time.time()
        token = secrets.token_hex(8)
        holder = {"host": socket.gethostname(), "pid": os.getpid(), "since": now, "token": token}
        _write(descriptor, {**holder, "beat": now})
        stop = threading.Event()
        beating = threading.Thread(target=_beat, args=(descriptor, holder, stop), daemon=True)
        beating.start()
        try:
            yield token
        finally:
            stop.set()
            beating.join()
            os.ftruncate(descriptor, 0)
    finally:
        os.close(descriptor)


def check_held(run: Path, token: str) -> None:
    """Whether the driver with this token still holds the run folder.

    Raises
    ------
    NotHeldError
        When another does, or nobody, or the folder isn't there.
    """
    try:
        holder = json.loads((run / "lock").read_bytes() or b"{}")
    except (OSError, ValueError) as error:
        raise NotHeldError(
            f"the run folder {run} is out of reach ({error}); "
            "`out` must lie on a disk that every worker sees"
        ) from None
    if holder.get("token") != token:
        who = f"process {holder['pid']} on {holder['host']}" if holder else "nobody"
        raise NotHeldError(f"{run} is held by {who} now, not by this worker's driver")


@dataclass(frozen=True, slots=True)
class Holder:
    """Who holds a run folder: host, process, and since when (seconds since 1970)."""

    host: str
    pid: int
    since: float


def holder(run: Path) -> Holder | None:
    """The driver that seems to be at work; takes nothing.

    Told from the lock's file alone: a driver counts as gone when it hasn't given a sign of life
    for half a minute, or its process isn't there any more on this machine.
    """
    try:
        found = json.loads((run / "lock").read_bytes() or b"{}")
        if not found or time.time() - found["beat"] > 6 * BEAT_SECONDS:
            return None
        here = found["host"] == socket.gethostname()
        if here and not Path(f"/proc/{found['pid']}").exists():
            return None
        return Holder(found["host"], int(found["pid"]), found["since"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _write(descriptor: int, holder: dict[str, Any]) -> None:
    # One width, in place: a reader never sees half of it, nor an end that was cut off.
    os.pwrite(descriptor, f"{json.dumps(holder):<254}\n".encode(), 0)


def _beat(descriptor: int, holder: dict[str, Any], stop: threading.Event) -> None:
    while not stop.wait(BEAT_SECONDS):
        try:
            if holder["token"] not in os.pread(descriptor, 1024, 0).decode(errors="replace"):
                return  # taken over while this process slept
            _write(descriptor, {**holder, "beat": time.time()})
        except OSError:
            # A full disk is told by those who write results.
            continue


def _watch(path: Path, trusted: str) -> None:
    """Where `flock` doesn't tell, see whether an entry's holder is alive.

    Parameters
    ----------
    trusted
        The machine whose holders `flock` has told of.
    """
    before = path.read_bytes()
    try:
        found = json.loads(before or b"{}")
        known = found.get("host", trusted) == trusted
    except (ValueError, AttributeError):
        known = True
    if known:
        return
    time.sleep(2.5 * BEAT_SECONDS)
    if path.read_bytes() not in (before, b""):
        raise LockedError(_held(path))


def _held(path: Path) -> str:
    try:
        holder = json.loads(path.read_text())
        seconds = time.time() - holder["since"]
        age = f"{seconds:.0f} seconds" if seconds < 100 else f"{seconds / 60:.0f} minutes"
        who = f"process {holder['pid']} on {holder['host']}, for {age}"
    except (OSError, ValueError, KeyError, TypeError):
        who = "another process"
    return (
        f"{path.parent} is being written by {who}. Wait for it, or stop it and run again: "
        "the lock goes with the process that holds it."
    )
