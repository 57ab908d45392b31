"""JSON files that carry their own checksum, over every byte.

The last member is `sha256`, of all bytes before it, so that people can read the
file, any JSON reader loads it, and no changed, lost or added byte goes unnoticed.
"""

from __future__ import annotations

import hashlib
import json
from typing import Any

from pnabs.store.atomic import pretty_json

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
