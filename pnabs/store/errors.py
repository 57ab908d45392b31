"""What is wrong with stored data."""

from __future__ import annotations


class DamagedDataError(Exception):
    """Stored data is missing or fails its checksum; names the file and what to do."""
