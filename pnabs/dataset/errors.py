"""What can be wrong with a dataset as a whole, and with one model's source."""

from __future__ import annotations


class DatasetError(ValueError):
    """The dataset can't be used as described: wrong root, layout, categories or split."""


class SourceError(ValueError):
    """One source can't be read: missing, not a file, outside the root, too large or damaged.

    It is a verdict on that model and final; a disk or network that fails shows
    as the `OSError` it is, for that may pass.
    """
