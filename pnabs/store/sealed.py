"""JSON files that carry their own checksum, over every byte.

In those that people may read the last member is `sha256`, of all bytes before it, so
that any JSON reader loads them, and no changed, lost or added byte goes unnoticed.
"""

from __future__ import annotations

import hashlib
import json
from typing import Any

from pnabs.store.atomic import canonical_json, pretty_json

_HEAD, _TAIL = b',\n "sha256": "', b'"\n}\n'
_CLOSE = b"\n}\n"
_LENGTH = len(_HEAD) + 64 + len(_TAIL)


class SealError(ValueError):
    """The bytes aren't what was written."""


def seal(value: dict[str, Any]) -> bytes:
    """A non-empty object as JSON with its checksum; one spelling for one value."""
    body = pretty_json(value).removesuffix(_CLOSE)
    return body + _HEAD + hashlib.sha256(body).hexdigest().encode() + _TAIL


def unseal(data: bytes) -> dict[str, Any]:
    """The inverse of `seal`.

    Raises
    ------
    SealError
        When a byte differs from what was written.
    """
    body, end = data[:-_LENGTH], data[-_LENGTH:]
    if end != _HEAD + hashlib.sha256(body).hexdigest().encode() + _TAIL:
        raise SealError("its checksum doesn't hold")
    value: dict[str, Any] = json.loads(body + _CLOSE)
    return value


def seal_derived(value: dict[str, Any]) -> bytes:
    """An object as compact JSON below a line with its checksum: quick to read, for programs."""
    body = canonical_json(value)
    return hashlib.sha256(body).hexdigest().encode() + b"\n" + body


def unseal_derived(data: bytes) -> dict[str, Any]:
    """The inverse of `seal_derived`.

    Raises
    ------
    SealError
        When a byte differs from what was written.
    """
    checksum, _, body = data.partition(b"\n")
    if hashlib.sha256(body).hexdigest().encode() != checksum:
        raise SealError("its checksum doesn't hold")
    value: dict[str, Any] = json.loads(body)
    return value
