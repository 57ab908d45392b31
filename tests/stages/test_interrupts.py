"""Signals: remembered where work is asked in turn, at once where nothing asks."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

from pnabs.stages.errors import InterruptedRunError
from pnabs.stages.interrupts import Interrupts


@pytest.fixture
def interrupts() -> Iterator[Interrupts]:
    """Installed while the test runs."""
    value = Interrupts()
    before = signal.getsignal(signal.SIGTERM)
    with value.installed():
        yield value
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_remembered(interrupts: Interrupts, number: int) -> None:
    assert interrupts() is None
    os.kill(os.getpid(), number)
    assert interrupts() == number


def test_a_signal_ends_what_never_asks(interrupts: Interrupts) -> None:
    listing = interrupts.at_once("listing the dataset")
    with pytest.raises(InterruptedRunError, match="stopped while listing") as stopped, listing:
        os.kill(os.getpid(), signal.SIGTERM)
    assert stopped.value.exit_code == 143


def test_one_that_came_before_ends_it_too(interrupts: Interrupts) -> None:
    os.kill(os.getpid(), signal.SIGINT)
    report = interrupts.at_once("the report was being made")
    says = "stopped while the report was being made"
    with pytest.raises(InterruptedRunError, match=says), report:
        pytest.fail("the body ran")


TWICE = """
import os, signal
from pnabs.stages.interrupts import Interrupts
with Interrupts().installed():
    os.kill(os.getpid(), signal.SIGINT)
    print("once", flush=True)
    os.kill(os.getpid(), signal.SIGTERM)
    print("twice", flush=True)
"""


def test_twice_ends_now() -> None:
    done = subprocess.run(
        [sys.executable, "-c", TWICE], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (143, "once\n")
