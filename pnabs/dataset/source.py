"""Reading a dataset in place, and nothing beside it.

A *source* is a string: a posix path relative to the dataset's root
(`03001627/1a2b/model.obj`), or one into an archive below the root
(`03001627.zip!03001627/1a2b/model.obj`), or, when the root is itself a zip
file, just `!member`.  A *place* is such a string for a folder: empty, or ending
in `/` or `!`, so that a place and a name make a source.

Nothing outside the root is read: links are followed only where they stay
inside, `..` and absolute paths are refused, and only regular files are opened.
"""

from __future__ import annotations

import errno
import os
import posixpath
import re
import stat
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote

from pnabs.dataset.archive import Archive, open_archive
from pnabs.dataset.errors import DatasetError, SourceError
from pnabs.dataset.names import path_parts

_IN_ARCHIVE = re.compile(r"(?P<archive>|.*?\.zip)!(?P<member>.*)", re.IGNORECASE | re.DOTALL)
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


class Dataset:
    """A folder of meshes or one zip file, read in place.

    Instances are cheap and can be pickled; archives stay open in a cache of the
    process.

    Parameters
    ----------
    root : path
        Folder, or zip file.

    Raises
    ------
    DatasetError
        If there is no such folder or zip file.
    """

    def __init__(self, root: str | os.PathLike[str]) -> None:
        try:
            self.root = Path(root).resolve(strict=True)
        except (OSError, RuntimeError) as error:
            raise DatasetError(f"dataset.root: there is no {os.fspath(root)}") from error
        self.is_archive = self.root.is_file()
        if self.is_archive and not zipfile.is_zipfile(self.root):
            raise DatasetError(f"dataset.root: {self.root} is neither a folder nor a zip file")
        if not self.is_archive and not self.root.is_dir():
            raise DatasetError(f"dataset.root: {self.root} is neither a folder nor a zip file")

    @property
    def top(self) -> str:
        """The outermost place."""
        return "!" if self.is_archive else ""

    def read(self, source: str, max_bytes: int) -> bytes:
        """Whole content of a source.

        Parameters
        ----------
        source : str
        max_bytes : int
            Largest (uncompressed) size; checked before anything is read, and again while reading.

        Raises
        ------
        SourceError
            If the source is missing, not a regular file, outside the root, too large, or
            damaged (its archive's checksum or declared size doesn't hold).
        OSError
            If the disk or network fails.
        """
        archive, member = self._split(source)
        if archive is None:
            return self._read_file(source, max_bytes)
        info = archive.member(member, source)
        _check_size(source, info.file_size, max_bytes)
        return archive.read(info, source)

    def stat(self, source: str) -> tuple[int, int]:
        """Size in bytes and modification time in ns; in an archive its own time.

        Raises
        ------
        SourceError
            As `read`, as far as it shows without reading.
        """
        archive, member = self._split(source)
        if archive is None:
            _, status = self._locate(source)
            _check_regular(source, status)
            return status.st_size, status.st_mtime_ns
        return archive.member(member, source).file_size, archive.mtime_ns

    def sibling_reader(self, source: str, max_bytes: int) -> Callable[[str], bytes]:
        """Reader of the files that a mesh names (.gltf buffers), relative to the mesh.

        Parameters
        ----------
        source : str
            The mesh.
        max_bytes : int
            Most bytes that all siblings together may have.

        Returns
        -------
        callable
            Takes a relative posix path, percent-encoded or not; raises `SourceError` where
            `read` would.
        """
        match = _IN_ARCHIVE.fullmatch(source)
        prefix, path = ("", source) if match is None else (f"{match['archive']}!", match["member"])
        folder, left = posixpath.dirname(path), max_bytes

        def read(name: str) -> bytes:
            nonlocal left
            if not name or name.startswith("/") or "\\" in name or re.match(r"\w+:", name):
                raise SourceError(f"{source} names {name!r}, which isn't a relative path")
            data = self.read(prefix + posixpath.normpath(posixpath.join(folder, name)), left)
            left -= len(data)
            return data

        def read_either(name: str) -> bytes:
            try:
                return read(name)
            except SourceError:
                if (decoded := unquote(name)) == name:
                    raise
                return read(decoded)

        return read_either

    def list(self, place: str) -> list[Entry]:
        """Entries of a place, in no particular order.

        Raises
        ------
        SourceError
            If there is no such place inside the root.
        """
        archive, member = self._split(place)
        if archive is not None:
            folder = archive.folders.get(member.rstrip("/"))
            if folder is None:
                raise SourceError(f"{place}: no such folder in the archive")
            return [Entry(name, is_folder, False) for name, is_folder in folder.items()]
        path, _ = self._locate(place.rstrip("/"))
        with _findings(place), os.scandir(path) as entries:
            return [_entry(entry) for entry in entries]

    def _split(self, source: str) -> tuple[Archive | None, str]:
        match = _IN_ARCHIVE.fullmatch(source)
        if match is None:
            if self.is_archive:
                raise SourceError(f"{source}: not a member of {self.root.name}")
            return None, source
        if (match["archive"] == "") != self.is_archive:
            raise SourceError(f"{source}: not a source of the dataset at {self.root}")
        path, status = self._locate(match["archive"])
        _check_regular(source, status)
        identity = (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns)
        return open_archive(path, identity, os.getpid()), match["member"]

    def _locate(self, path: str) -> tuple[str, os.stat_result]:
        """Real path and status of a path relative to the root, which it never leaves."""
        current = os.fspath(self.root)
        with _findings(path):
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

    def _read_file(self, source: str, max_bytes: int) -> bytes:
        path, status = self._locate(source)
        _check_regular(source, status)
        flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
        with _findings(source), open(os.open(path, flags), "rb") as file:
            # Looked at again: what was checked by name may have been replaced since.
            status = os.fstat(file.fileno())
            _check_regular(source, status)
            _check_size(source, status.st_size, max_bytes)
            return file.read(status.st_size)


def _check_regular(source: str, status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise SourceError(f"{source}: not a regular file")


def _check_size(source: str, size: int, max_bytes: int) -> None:
    if size > max_bytes:
        raise SourceError(
            f"{source}: {size:,} bytes, over the limit of {max_bytes:,} (ingest.limits.max_bytes)"
        )


@contextmanager
def _findings(path: str) -> Iterator[None]:
    """Turn errors that are a verdict on the path into one; others may pass and stay."""
    try:
        yield
    except OSError as error:
        reason = _FINDINGS.get(error.errno or 0)
        if reason is None:
            raise
        raise SourceError(f"{path}: {reason}") from error


def _entry(entry: os.DirEntry[str]) -> Entry:
    try:
        is_folder = entry.is_dir()
    except OSError:
        is_folder = False
    return Entry(entry.name, is_folder, entry.is_symlink())
