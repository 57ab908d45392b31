from __future__ import annotations

import subprocess
import sys

import pytest

from pnabs.model.memory import keep_freed_memory

# Blocks of 48 MB are above every threshold that glibc finds by itself.
FAULTS = """
import resource, sys
import numpy as np
if {keep}:
    from pnabs.model.memory import keep_freed_memory
    assert keep_freed_memory()
np.ones(6_000_000)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(10):
    np.ones(6_000_000)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def faults(keep: bool) -> int:
    code = FAULTS.format(keep=keep)
    return int(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout)


@pytest.mark.skipif(not keep_freed_memory(), reason="the C library has no mallopt")
def test_freed_blocks_are_not_faulted_in_again() -> None:
    # numpy asks for huge pages: a fault may be of 2 MB.
    assert faults(True) < 20 < faults(False)


def test_other_systems_are_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "darwin")
    assert not keep_freed_memory()
