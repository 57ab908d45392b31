"""Reading a dataset in place, and nothing beside it.

A *source* is a string: a posix path relative to the dataset's root
(`03001627/1a2b/model.obj`), or one into an archive below the root
(`03001627.zip!03001627/1a2b/model.obj`), or, when the root is itself a zip
file, just `!member`.  A *place* is such a string for a folder: empty, or ending
in `/` or `!`, so that a place and a name make a source.

The root is a folder, a zip file, or either in a bucket (`s3://bucket/prefix`).
Nothing outside it is read: links are followed only where they stay inside,
`..` and absolute paths are refused, and only regular files are opened.
"""

from __future__ import annotations

import os
import posixpath
import re
from collections.abc import Callable
from urllib.parse import unquote

from pnabs.dataset.archive import Archive
from pnabs.dataset.errors import SourceError
from pnabs.dataset.local import LocalStorage
from pnabs.dataset.s3 import S3Storage
from pnabs.dataset.storage import Entry, Root, Storage, check_size

__all__ = ["Dataset", "Entry"]

_IN_ARCHIVE = re.compile(r"(?P<archive>|.*?\.zip)!(?P<member>.*)", re.IGNORECASE | re.DOTALL)


class Dataset:
    """A folder of meshes or one zip file, on a disk or in a bucket, read in place.

    Instances are cheap and can be pickled; archives stay open in a cache of the
    process.  What an instance has seen of a bucket's archives it doesn't look at again.

    Parameters
    ----------
    root : path or str
        Folder, zip file, or `s3://bucket/prefix`.

    Raises
    ------
    DatasetError
        If there is no such folder, zip file, bucket or prefix, or it can't be reached.
    """

    def __init__(self, root: str | os.PathLike[str]) -> None:
        remote = isinstance(root, str) and root.startswith("s3://")
        self._storage: Storage = S3Storage(str(root)) if remote else LocalStorage(root)

    @property
    def root(self) -> Root:
        """The root, made absolute."""
        return self._storage.root

    @property
    def is_archive(self) -> bool:
        """Whether the root is a zip file."""
        return self._storage.is_archive

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
            return self._storage.read(source, max_bytes)
        info = archive.member(member, source)
        check_size(source, info.file_size, max_bytes)
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
            size, mtime_ns = self._storage.status(source)
            return size, mtime_ns
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
            folder = archive.folders.get(member.removesuffix("/"))
            if folder is None:
                raise SourceError(f"{place}: no such folder in the archive")
            return [Entry(name, is_folder, False) for name, is_folder in folder.items()]
        return self._storage.list(place.removesuffix("/"))

    def preload(self, place: str) -> None:
        """Say that everything below a place is going to be listed and looked at.

        A bucket is then asked for it in bulk, and what it says stays with this instance until
        another place is preloaded.

        Raises
        ------
        SourceError
            If there is no such place inside the root.
        """
        archive, _ = self._split(place)
        if archive is None:
            self._storage.preload(place.removesuffix("/"))

    def _split(self, source: str) -> tuple[Archive | None, str]:
        match = _IN_ARCHIVE.fullmatch(source)
        if match is None:
            if self.is_archive:
                raise SourceError(f"{source}: not a member of {self.root.name}")
            return None, source
        if (match["archive"] == "") != self.is_archive:
            raise SourceError(f"{source}: not a source of the dataset at {self.root}")
        return self._storage.archive(match["archive"]), match["member"]
