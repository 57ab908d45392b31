"""How compiled loops are declared: lazily, cached on disk, without the interpreter's lock."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile a loop over arrays at its first call, not at import.

    The machine code is cached beside the module, or under NUMBA_CACHE_DIR.  Division
    follows numpy (inf and nan, no exception) and floating point is not reordered, so
    results are the same wherever the same code is generated.
    """
    return cast(Function, njit(cache=True, nogil=True, error_model="numpy")(function))
