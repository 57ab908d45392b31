"""Names that are safe as folders of a run and, for categories, as Zarr groups."""

from __future__ import annotations

import re

from pnabs.dataset.errors import DatasetError, SourceError

_LONGEST_CATEGORY = 100
_LONGEST_COMPONENT = 200
# Control characters, the backslash, and lone surrogates (names that aren't UTF-8).
_UNSAFE = re.compile("[\x00-\x1f\x7f-\x9f\\\\\ud800-\udfff]")
# What the system takes for no name, or another.
_NO_NAME = re.compile("[\0\\\\\ud800-\udc7f\udd00-\udfff]")
_RESERVED_CATEGORIES = {"zarr.json"}


def is_hidden(name: str) -> bool:
    """Whether a file or folder is no part of the collection: `.git`, `._chair.obj`, `__MACOSX`."""
    return name == "__MACOSX" or (name.startswith(".") and name not in (".", ".."))


def check_category(name: str) -> None:
    """Refuse a category that can't name a folder and a Zarr group everywhere.

    Letters and digits of any script, and inside also blank, `.`, `_`, `-` and `+`.

    Raises
    ------
    DatasetError
        With what to rename.
    """
    allowed = all(c.isalnum() or c in " ._-+" for c in name)
    ends = name[:1].isalnum() and (name[-1:].isalnum() or name[-1:] in "_-+")
    short = len(name.encode("utf-8", "replace")) <= _LONGEST_CATEGORY
    if not (allowed and ends and short) or name.casefold() in _RESERVED_CATEGORIES:
        raise DatasetError(
            f"category {printable(name)!r} can't be used as a folder's name: rename it to at most "
            f"{_LONGEST_CATEGORY} bytes of letters, digits, blanks and . _ - +, beginning with a "
            "letter or digit, or leave it out (dataset.categories)"
        )


def printable(text: str) -> str:
    """The text with everything that UTF-8 can't hold written as an escape."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def path_parts(path: str) -> list[str]:
    """Components of a relative path; empty for the root.

    Raises
    ------
    SourceError
        If it is absolute or has `..` or anything else that could mean another file elsewhere.
    """
    parts = path.split("/") if path else []
    plain = all(part not in ("", ".", "..") and not _NO_NAME.search(part) for part in parts)
    if not plain:
        raise SourceError(f"{path!r}: not a plain path below the dataset's root")
    return parts


def unsafe_model_id(model_id: str) -> str:
    """Why a model's id can't be a path below `abstractions/<category>/`; empty when it can."""
    for part in model_id.split("/"):
        if part in ("", ".", ".."):
            return "its path isn't plain"
        if _UNSAFE.search(part):
            return "its name has control characters, a backslash or isn't UTF-8; rename it"
        if len(part.encode()) > _LONGEST_COMPONENT:
            return f"its name has more than {_LONGEST_COMPONENT} bytes; rename it"
        if part.startswith("abstraction."):
            return "its name is taken by the results' files; rename it"
    return ""


def safe_model_id(model_id: str) -> str:
    """A stand-in for an unsafe id, fit to be listed and to be a path."""
    parts = (_UNSAFE.sub("_", part) for part in model_id.split("/"))
    return "/".join(
        "_" if part in ("", ".", "..") else part.replace("abstraction.", "abstraction_")[:50]
        for part in parts
    )
