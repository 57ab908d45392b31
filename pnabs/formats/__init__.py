"""Writers and readers of abstractions."""

from __future__ import annotations

from pnabs.formats.abstraction import Abstraction, FormatError
from pnabs.formats.glb import to_glb
from pnabs.formats.json_format import from_json, to_json
from pnabs.formats.registry import FORMATS, STEM, Format, level_stem, single, written

__all__ = [
    "FORMATS",
    "STEM",
    "Abstraction",
    "Format",
    "FormatError",
    "from_json",
    "level_stem",
    "single",
    "to_glb",
    "to_json",
    "written",
]
