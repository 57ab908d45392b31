"""Zip files as they come from elsewhere: any of their claims may be false."""

from __future__ import annotations

import stat
import struct
import zipfile
import zlib
from functools import cached_property, lru_cache

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
_CHUNK = 2**20


class Archive:
    """An open archive."""

    def __init__(self, path: str, mtime_ns: int) -> None:
        self.zip = zipfile.ZipFile(path)
        self.mtime_ns = mtime_ns

    @cached_property
    def folders(self) -> dict[str, dict[str, bool]]:
        """The members as a tree: folder -> name -> whether a folder.

        Names are taken as they stand, `..` included, so that a hostile member is seen where it
        pretends to lie; it is refused when it is asked for.  Absolute names lie nowhere in it.
        """
        folders: dict[str, dict[str, bool]] = {"": {}}
        for member in self.zip.namelist():
            if len(member) > _LONGEST_MEMBER:
                raise SourceError(
                    f"{self.zip.filename}: a member's path has over {_LONGEST_MEMBER} characters"
                )
            name, is_folder = member.rstrip("/"), member.endswith("/")
            if not name or name.startswith("/"):
                continue
            if is_folder:
                folders.setdefault(name, {})
            while name:
                parent, _, last = name.rpartition("/")
                known = parent in folders
                folders.setdefault(parent, {}).setdefault(last, is_folder)
                if known:
                    break
                name, is_folder = parent, True
        return folders

    def member(self, name: str, source: str) -> zipfile.ZipInfo:
        """A member that is safe to read, as far as the archive's directory tells."""
        path_parts(name)
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
        if left:
            raise SourceError(f"{source}: {left:,} bytes shorter than its archive declares")
        return b"".join(parts)


@lru_cache(maxsize=8)
def open_archive(path: str, identity: tuple[int, ...], pid: int) -> Archive:
    """Open an archive, or take it from the cache of this process.

    Parameters
    ----------
    path : str
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
        return Archive(path, identity[-1])
    except _BROKEN as error:
        raise SourceError(f"{path}: not a readable zip file ({error})") from error
