"""Zip files as they come from elsewhere: any of their claims may be false."""

from __future__ import annotations

import errno
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterable
from functools import cached_property, lru_cache
from typing import BinaryIO, Protocol

from pnabs.dataset.errors import SourceError
from pnabs.dataset.names import path_parts

_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_BROKEN = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    NotImplementedError,
    RuntimeError,
    ValueError,
)
_ENCRYPTED = 0x1
_LONGEST_MEMBER = 4096
_DEEPEST_MEMBER = 64
_CHUNK = 2**20


class Archive:
    """An open archive."""

    def __init__(self, file: str | BinaryIO, mtime_ns: int) -> None:
        self.zip = zipfile.ZipFile(file)
        self.mtime_ns = mtime_ns

    @cached_property
    def folders(self) -> dict[str, dict[str, bool]]:
        """The members as a tree."""
        members = self.zip.namelist()
        if any(member.count("/") > _DEEPEST_MEMBER for member in members):
            raise SourceError(
                f"{self.zip.filename}: a member lies more than {_DEEPEST_MEMBER} folders deep"
            )
        if any(len(member) > _LONGEST_MEMBER for member in members):
            raise SourceError(
                f"{self.zip.filename}: a member's path has over {_LONGEST_MEMBER} characters"
            )
        return folder_tree(members)

    def member(self, name: str, source: str) -> zipfile.ZipInfo:
        """A member that is safe to read, as far as the archive's directory tells."""
        if not path_parts(name):
            raise SourceError(f"{source}: names no member")
        try:
            info = self.zip.getinfo(name)
        except KeyError:
            raise SourceError(f"{source}: no such file") from None
        kind = stat.S_IFMT(info.external_attr >> 16)
        if info.is_dir() or kind not in (0, stat.S_IFREG):
            raise SourceError(f"{source}: not a regular file")
        if info.flag_bits & _ENCRYPTED:
            raise SourceError(f"{source}: is encrypted")
        # Other methods can't be unpacked within a bound on memory.
        if info.compress_type not in _METHODS:
            raise SourceError(
                f"{source}: compressed by method {info.compress_type}; repack it with deflate"
            )
        return info

    def read(self, info: zipfile.ZipInfo, source: str) -> bytes:
        """Content of a member, never unpacking more than a chunk beyond its declared size."""
        parts = []
        left = info.file_size
        try:
            with self.zip.open(info) as file:
                while left and (part := file.read(min(left, _CHUNK))):
                    parts.append(part)
                    left -= len(part)
        except _BROKEN as error:
            raise SourceError(f"{source}: damaged in its archive ({error})") from error
        except OSError as error:
            if error.errno != errno.EINVAL:
                raise
            # no disk's fault: the archive's directory sent the reader before its beginning
            raise SourceError(f"{source}: damaged in its archive ({error})") from error
        if left:
            raise SourceError(f"{source}: {left:,} bytes shorter than its archive declares")
        return b"".join(parts)


def folder_tree(paths: Iterable[str]) -> dict[str, dict[str, bool]]:
    """Paths as a tree: folder -> name -> whether a folder.

    Names are taken as they stand, `..` included, so that a hostile one is seen where it pretends
    to lie; it is refused when it is asked for.  Absolute paths lie nowhere in it.  What is both
    a file and a folder is taken for a folder.

    Parameters
    ----------
    paths : iterable of str
        Posix; those of folders end in a slash.
    """
    folders: dict[str, dict[str, bool]] = {"": {}}
    for path in paths:
        name, is_folder = path.rstrip("/"), path.endswith("/")
        if not name or name.startswith("/"):
            continue
        if is_folder:
            folders.setdefault(name, {})
        while name:
            parent, _, last = name.rpartition("/")
            known = parent in folders
            names = folders.setdefault(parent, {})
            names[last] = is_folder or names.get(last, False)
            if known:
                break
            name, is_folder = parent, True
    return folders


class Openable(Protocol):
    """A file that isn't on a disk; equal to another only if that is the same."""

    def open(self) -> BinaryIO:
        """Open for reading, anywhere in it."""

    def __hash__(self) -> int: ...


@lru_cache(maxsize=8)
def open_archive(file: str | Openable, identity: tuple[int, ...], pid: int) -> Archive:
    """Open an archive, or take it from the cache of this process.

    Parameters
    ----------
    file : str or Openable
        Path, or a file elsewhere.
    identity : tuple of int
        What changes when the file does; its modification time in ns comes last.
    pid : int
        Of this process: a forked child shares its parent's file offset and must open anew.

    Raises
    ------
    SourceError
        If it is no zip file.
    """
    try:
        return Archive(file if isinstance(file, str) else file.open(), identity[-1])
    except _BROKEN as error:
        raise SourceError(f"{file}: not a readable zip file ({error})") from error
