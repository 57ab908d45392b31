"""Where meshes come from: layouts, catalogue, splits, reading in place."""

from __future__ import annotations

from pnabs.dataset.catalogue import extend, fingerprint, read, scan, to_bytes
from pnabs.dataset.errors import DatasetError, SourceError
from pnabs.dataset.source import Dataset
from pnabs.dataset.synsets import name_of, resolve_category, synset_of

__all__ = [
    "Dataset",
    "DatasetError",
    "SourceError",
    "extend",
    "fingerprint",
    "name_of",
    "read",
    "resolve_category",
    "scan",
    "synset_of",
    "to_bytes",
]
