"""A folder, or one zip file, on a disk.

Nothing outside the root is read: links are followed only where they stay
inside, and only regular files are opened.
"""

from __future__ import annotations

import os
import stat
import zipfile
from pathlib import Path

from pnabs.dataset.archive import Archive, open_archive
from pnabs.dataset.errors import DatasetError, SourceError
from pnabs.dataset.names import path_parts
from pnabs.dataset.storage import Entry, File, check_size, findings


class LocalStorage:
    """Files below a folder, or one zip file; implements `pnabs.dataset.storage.Storage`.

    Raises
    ------
    DatasetError
        If there is no such folder or zip file.
    """

    def __init__(self, root: str | os.PathLike[str]) -> None:
        try:
            self.root = Path(root).resolve(strict=True)
        except (OSError, RuntimeError, ValueError) as error:
            raise DatasetError(f"dataset.root: there is no {os.fspath(root)}") from error
        self.is_archive = self.root.is_file()
        usable = zipfile.is_zipfile(self.root) if self.is_archive else self.root.is_dir()
        if not usable:
            raise DatasetError(f"dataset.root: {self.root} is neither a folder nor a zip file")

    def status(self, path: str) -> File:
        """Size and time of a regular file."""
        _, status = self._locate_regular(path)
        return File(status.st_size, status.st_mtime_ns)

    def read(self, path: str, max_bytes: int) -> bytes:
        """Content of a regular file."""
        real, _ = self._locate_regular(path)
        flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
        with findings(path), open(os.open(real, flags), "rb") as file:
            # Looked at again: what was checked by name may have been replaced since.
            status = os.fstat(file.fileno())
            _check_regular(path, status)
            check_size(path, status.st_size, max_bytes)
            return file.read(status.st_size)

    def list(self, path: str) -> list[Entry]:
        """Entries of a folder."""
        real, _ = self._locate(path)
        with findings(path), os.scandir(real) as entries:
            return [_entry(entry) for entry in entries]

    def archive(self, path: str) -> Archive:
        """A zip file, opened; it stays open in a cache of the process until it changes."""
        real, status = self._locate_regular(path)
        identity = (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns)
        return open_archive(real, identity, os.getpid())

    def preload(self, path: str) -> None:
        """Nothing: a disk is quick to look at."""

    def _locate_regular(self, path: str) -> tuple[str, os.stat_result]:
        real, status = self._locate(path)
        _check_regular(path, status)
        return real, status

    def _locate(self, path: str) -> tuple[str, os.stat_result]:
        """Real path and status of a path relative to the root, which it never leaves."""
        current = os.fspath(self.root)
        with findings(path):
            status = os.lstat(current)
            for part in path_parts(path):
                current = os.path.join(current, part)
                status = os.lstat(current)
                if stat.S_ISLNK(status.st_mode):
                    return self._follow(path)
        return current, status

    def _follow(self, path: str) -> tuple[str, os.stat_result]:
        real = os.path.realpath(os.path.join(self.root, path), strict=True)
        if not Path(real).is_relative_to(self.root):
            raise SourceError(f"{path}: a link leads out of the dataset's root")
        return real, os.lstat(real)


def _check_regular(path: str, status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise SourceError(f"{path}: not a regular file")


def _entry(entry: os.DirEntry[str]) -> Entry:
    try:
        is_folder = entry.is_dir()
    except OSError:
        is_folder = False
    return Entry(entry.name, is_folder, entry.is_symlink())
