"""What a dataset needs of the place where its files lie: a folder, or a bucket's prefix."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple, Protocol

from pnabs.dataset.archive import Archive
from pnabs.dataset.errors import SourceError

_FINDINGS = {
    errno.ENOENT: "no such file",
    errno.ENOTDIR: "no such file",
    errno.EISDIR: "is a folder",
    errno.EACCES: "no permission to read it",
    errno.EPERM: "no permission to read it",
    errno.ELOOP: "is a link that leads nowhere",
    errno.ENAMETOOLONG: "its name is too long",
}


class Entry(NamedTuple):
    """One name in a place."""

    name: str
    is_folder: bool
    """For a link, whether it leads to a folder."""
    is_link: bool


class File(NamedTuple):
    """A regular file, without its content."""

    size: int
    """Bytes."""
    mtime_ns: int
    """Time of the last change, in ns since 1970."""


class Root(Protocol):
    """A storage's root, for messages and for the names that layouts look at."""

    @property
    def name(self) -> str:
        """Last component."""

    @property
    def stem(self) -> str:
        """Last component without its suffix."""


class Storage(Protocol):
    """Files below a root, or the root itself where it is a zip file (path "").

    Paths are relative and posix; every method refuses, with `SourceError`, one that isn't plain
    or leads out of the root, and raises `OSError` where disk or network fail.
    """

    @property
    def root(self) -> Root:
        """Where the files lie."""

    @property
    def is_archive(self) -> bool:
        """Whether the root is a zip file."""

    def status(self, path: str) -> File:
        """Size and time of a regular file."""

    def read(self, path: str, max_bytes: int) -> bytes:
        """Content of a regular file; its size is checked before anything is read."""

    def list(self, path: str) -> list[Entry]:
        """Entries of a folder, in no particular order."""

    def archive(self, path: str) -> Archive:
        """A zip file, opened."""

    def preload(self, path: str) -> None:
        """Make ready for listing and looking at everything below a folder."""


def check_size(path: str, size: int, max_bytes: int) -> None:
    """Refuse what is too large.

    Raises
    ------
    SourceError
    """
    if size > max_bytes:
        raise SourceError(
            f"{path}: {size:,} bytes, over the limit of {max_bytes:,} (ingest.limits.max_bytes)"
        )


@contextmanager
def findings(path: str) -> Iterator[None]:
    """Turn errors that are a verdict on the path into one; others may pass and stay."""
    try:
        yield
    except OSError as error:
        reason = _FINDINGS.get(error.errno or 0)
        if reason is None:
            raise
        raise SourceError(f"{path}: {reason}") from error
