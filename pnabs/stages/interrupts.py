"""SIGINT and SIGTERM: once to stop in good order, twice to stop now."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from pnabs.stages.errors import InterruptedRunError

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupts:
    """Remembers the signal that asked the run to stop."""

    def __init__(self) -> None:
        self._received: int | None = None
        self._at_once: str | None = None

    def __call__(self) -> int | None:
        """The signal's number, or None."""
        return self._received

    @contextmanager
    def installed(self) -> Iterator[None]:
        """Take the signals while the body runs."""
        before = {number: signal.getsignal(number) for number in SIGNALS}
        self.install()
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def install(self) -> None:
        """Take the signals (again: starting Ray takes SIGTERM for itself)."""
        for number in SIGNALS:
            signal.signal(number, self._handle)

    @contextmanager
    def at_once(self, what: str) -> Iterator[None]:
        """While the body runs, which never asks and loses nothing, a signal ends it.

        Raises
        ------
        InterruptedRunError
        """
        self._at_once = what
        try:
            if self._received is not None:
                raise self._stopped(self._received)
            yield
        finally:
            self._at_once = None

    def _stopped(self, number: int) -> InterruptedRunError:
        return InterruptedRunError(f"stopped while {self._at_once}", 128 + number)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self._received is not None:
            # Twice means now; Ray's local processes end with this one.
            os._exit(128 + number)
        self._received = number
        if self._at_once is not None:
            raise self._stopped(number)
