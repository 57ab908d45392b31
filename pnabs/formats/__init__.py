"""Writers and readers of abstractions.

A new format is one module with a function from an `Abstraction` to bytes, and one line in
`WRITERS`.
"""

from __future__ import annotations

from collections.abc import Callable

from pnabs.formats.abstraction import Abstraction, FormatError
from pnabs.formats.glb import to_glb
from pnabs.formats.json_format import from_json, to_json

WRITERS: dict[str, Callable[[Abstraction], bytes]] = {
    ".json": to_json,
    ".glb": to_glb,
}
"""File suffix -> writer."""

__all__ = ["WRITERS", "Abstraction", "FormatError", "from_json", "to_glb", "to_json"]
