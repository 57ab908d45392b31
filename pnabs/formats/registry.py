"""Every format that an abstraction can be written in.

A new format is one module with a function from an `Abstraction` to bytes, and one line here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from pnabs.formats.abstraction import Abstraction
from pnabs.formats.glb import to_glb, to_parts
from pnabs.formats.json_format import to_json
from pnabs.formats.plain import to_obj, to_ply, to_stl

STEM = "abstraction"
"""What the files of an abstraction are named by."""


@dataclass(frozen=True, slots=True)
class Format:
    """A format by its name.

    Attributes
    ----------
    suffix
        Of its file.
    write
        From an abstraction, and the stem of the file's name, to file name -> content; the file
        with the suffix is the last, so that where it is there the others are.
    beside
        Suffix of a folder for the others.
    """

    suffix: str
    write: Callable[[Abstraction, str], dict[str, bytes]]
    beside: str = ""


def single(suffix: str, write: Callable[[Abstraction], bytes]) -> Format:
    """A format of one file."""
    return Format(suffix, lambda abstraction, stem: {stem + suffix: write(abstraction)})


# What these two need takes a second to load, and most do without.
def _urdf(abstraction: Abstraction, stem: str) -> dict[str, bytes]:
    from pnabs.formats.physics import to_urdf

    return to_urdf(abstraction, stem)


def _mjcf(abstraction: Abstraction) -> bytes:
    from pnabs.formats.physics import to_mjcf

    return to_mjcf(abstraction)


FORMATS = {
    "json": single(".json", to_json),
    "glb": single(".glb", to_glb),
    "parts": single(".parts.glb", to_parts),
    "obj": single(".obj", to_obj),
    "ply": single(".ply", to_ply),
    "stl": single(".stl", to_stl),
    "urdf": Format(".urdf", _urdf, beside=".convex"),
    "mjcf": single(".xml", _mjcf),
}
"""Name -> format."""


def level_stem(stem: str, size: int) -> str:
    """What the files of a coarser level are named by."""
    return f"{stem}.level{size}"


def written(abstraction: Abstraction, formats: Iterable[str], stem: str = STEM) -> dict[str, bytes]:
    """File name -> content of an abstraction in some formats, each level's before its own.

    Coarser levels are in `abstraction.json`, and have files of their own in other formats.

    Parameters
    ----------
    formats
        Names in `FORMATS`.
    """
    files: dict[str, bytes] = {}
    for name in formats:
        if name != "json":
            for size, level in abstraction.levels.items():
                files |= FORMATS[name].write(level, level_stem(stem, size))
        files |= FORMATS[name].write(abstraction, stem)
    return files


def format_of(path: Path) -> tuple[str, str]:
    """The format that a file's name ends in, and the stem before it.

    Raises
    ------
    ValueError
        When no format has this suffix.
    """
    # The longest first: `.parts.glb` ends in `.glb` too.
    for name, known in sorted(FORMATS.items(), key=lambda item: -len(item[1].suffix)):
        if path.name.lower().endswith(known.suffix) and len(path.name) > len(known.suffix):
            return name, path.name[: -len(known.suffix)]
    suffixes = ", ".join(known.suffix for known in FORMATS.values())
    raise ValueError(f"{path.name}: no format has this suffix; choose one of {suffixes}")
