"""How compiled loops are declared: lazily, cached on disk, without the interpreter's lock."""

from __future__ import annotations

import fcntl
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TypeVar, cast

from numba import njit

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile a loop over arrays at its first call, not at import.

    The machine code is cached beside the module, or in NUMBA_CACHE_DIR, or else in the user's
    cache folder.  Division follows numpy (inf and nan, no exception) and floating point is
    not reordered, so results are the same wherever the same code is generated.
    """
    compiled = njit(nogil=True, error_model="numpy")(function)
    # without a place to write, as in a read-only installation without a home, there is no cache
    with suppress(RuntimeError):
        compiled.enable_caching()
    return cast(Function, compiled)


@contextmanager
def compiling() -> Iterator[None]:
    """Have one process of this machine compile while the others wait, and then find it done."""
    with open(__file__, "rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
