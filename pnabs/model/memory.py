"""What a training process does with memory that it has freed."""

from __future__ import annotations

import ctypes
import sys

M_TRIM_THRESHOLD, M_MMAP_MAX = -1, -4
"""Parameters of glibc's mallopt(3)."""


def keep_freed_memory() -> bool:
    """Let this process keep large blocks that it frees, for the next ones.

    A training step makes and frees the same few blocks of tens of megabytes.  glibc gives each
    back to the system, which hands out zeroed pages again one fault at a time: a third of a
    step's time.  Lasts as long as the process, whose memory then stays at its peak.

    Returns
    -------
    bool
        Whether the C library is one that can be told so; others are left as they are.
    """
    if not sys.platform.startswith("linux"):
        return False
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return False
    return bool(mallopt(M_MMAP_MAX, 0)) and bool(mallopt(M_TRIM_THRESHOLD, 2**31 - 1))
