"""Files that are there whole or not at all, and digests of what they hold."""

from __future__ import annotations

import hashlib
import json
import os
import secrets
from pathlib import Path
from typing import Any


def write_atomic(path: Path, data: bytes) -> None:
    """Write a file so that a crash leaves the old content or the new, synced to disk.

    Raises
    ------
    OSError
        When the folder can't be made or the file can't be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.{secrets.token_hex(4)}.partial")
    try:
        with partial.open("wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def sweep(folder: Path, name: str = "") -> None:
    """Remove what writers that were killed left half-written in a folder (not below it).

    Parameters
    ----------
    name
        Only of the file of this name; others in the folder may have writers that live.
    """
    for path in folder.glob(f"{name}.*.partial" if name else "*.partial"):
        path.unlink(missing_ok=True)


def is_as_written(path: Path, expected: dict[str, Any]) -> bool:
    """Whether a file can be read and has the size and SHA-256 of `file_digest`."""
    try:
        return file_digest(path) == expected
    except OSError:
        return False


def sync_folder(folder: Path) -> None:
    """Make renames inside a folder durable."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def canonical_json(value: Any) -> bytes:
    """JSON with one spelling for one value: sorted keys, no spaces, no NaN.

    Raises
    ------
    ValueError
        For NaN or infinite numbers.
    """
    return json.dumps(
        value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False
    ).encode()


def pretty_json(value: Any) -> bytes:
    """JSON for people to read: sorted keys, indented, one line end at the end."""
    text = json.dumps(value, sort_keys=True, indent=1, ensure_ascii=False, allow_nan=False)
    return text.encode() + b"\n"


def digest(value: Any) -> str:
    """SHA-256 of bytes, or of a value's canonical JSON, in hex."""
    data = value if isinstance(value, bytes) else canonical_json(value)
    return hashlib.sha256(data).hexdigest()


def file_digest(path: Path) -> dict[str, Any]:
    """Size and SHA-256 of a file: ``{"bytes": int, "sha256": hex}``."""
    with path.open("rb") as stream:
        sha = hashlib.file_digest(stream, "sha256").hexdigest()
    return {"bytes": path.stat().st_size, "sha256": sha}
