"""A prefix of a bucket, or one zip file in it.

An object's key below the prefix is its path, `/` between folders; a key is
literal, so that nothing can lead out of the prefix, and one that isn't a plain
path (`..`, empty components) is listed but never read.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import PurePosixPath

from pnabs.dataset import s3_client
from pnabs.dataset.archive import Archive, folder_tree, open_archive
from pnabs.dataset.errors import DatasetError, SourceError
from pnabs.dataset.names import path_parts
from pnabs.dataset.storage import Entry, File, check_size, findings
from pnabs.settings import split_s3_url


@dataclass(frozen=True, slots=True)
class S3Root:
    """A bucket and a prefix (without the closing `/`; empty for the whole bucket)."""

    bucket: str
    prefix: str

    def __str__(self) -> str:
        return f"s3://{self.bucket}/{self.prefix}".rstrip("/")

    @property
    def name(self) -> str:
        """Last component."""
        return PurePosixPath(self.prefix or self.bucket).name

    @property
    def stem(self) -> str:
        """Last component without its suffix."""
        return PurePosixPath(self.name).stem


class S3Storage:
    """Objects below a prefix, or one zip file; implements `pnabs.dataset.storage.Storage`.

    Raises
    ------
    DatasetError
        If s3fs isn't installed, the bucket can't be reached or read, or nothing is there.
    """

    def __init__(self, url: str) -> None:
        try:
            self.root = S3Root(*split_s3_url(url))
        except ValueError as error:
            raise DatasetError(f"dataset.root: {error}") from error
        self.is_archive = _is_archive(self.root, os.getpid())
        self._archives: dict[str, s3_client.Object] = {}
        self._loaded = _Loaded(None, {}, {})

    def status(self, path: str) -> File:
        """Size and time of an object."""
        path_parts(path)
        if self._loaded.has(path):
            if path not in self._loaded.files:
                raise SourceError(f"{path}: no such file")
            return self._loaded.files[path]
        found = self._find(path)
        return File(found.size, found.mtime_ns)

    def read(self, path: str, max_bytes: int) -> bytes:
        """Content of an object."""
        if not path_parts(path):
            raise SourceError(f"{self.root}: not a regular file")
        with findings(path):
            return s3_client.get(
                self.root.bucket,
                self._key(path),
                lambda size: check_size(path, size, max_bytes),
            )

    def list(self, path: str) -> list[Entry]:
        """Entries of a folder: what the next components of keys are."""
        names = self._loaded.folders.get(path) if self._loaded.has(f"{path}/") else self._ask(path)
        if names is None:
            raise SourceError(f"{path}: no such folder")
        return [Entry(name, is_folder, False) for name, is_folder in names.items()]

    def archive(self, path: str) -> Archive:
        """A zip file, opened; it stays open in a cache of the process.

        Whether it has changed is looked up once an instance; a change that goes unseen makes
        reading fail, for every request names the state that it is about.
        """
        path_parts(path)
        found = self._archives.get(path) or self._find(path)
        self._archives[path] = found
        file = s3_client.RemoteFile(self.root.bucket, found.key, found.size, found.etag)
        return open_archive(file, (found.mtime_ns,), os.getpid())

    def preload(self, path: str) -> None:
        """List everything below a folder, thousand objects a request."""
        below = f"{path}/" if path else ""
        prefix, start = self._key(below), len(self._key(""))
        files = {}
        with findings(path):
            for page in s3_client.pages(self.root.bucket, prefix):
                for item in page.objects:
                    files[item.key[start:]] = File(item.size, item.mtime_ns)
        self._loaded = _Loaded(below, files, folder_tree(files))

    def _key(self, path: str) -> str:
        if self.is_archive:
            return self.root.prefix
        return f"{self.root.prefix}/{path}" if self.root.prefix else path

    def _ask(self, path: str) -> dict[str, bool] | None:
        """Names in a folder and whether they are folders; None if nothing begins so."""
        prefix = self._key(f"{path}/" if path else "")
        names: dict[str, bool] = {}
        with findings(path):
            for page in s3_client.pages(self.root.bucket, prefix, "/"):
                names.update((item.key[len(prefix) :], False) for item in page.objects)
                names.update((common[len(prefix) : -1], True) for common in page.prefixes)
        # The folder's own marker is no entry of it.
        found = {name: is_folder for name, is_folder in names.items() if name or is_folder}
        return found if names else None

    def _find(self, path: str) -> s3_client.Object:
        """An object, by listing: unlike HeadObject that tells why it is refused."""
        key = self._key(path)
        with findings(path):
            page = next(s3_client.pages(self.root.bucket, key, limit=1))
        # A folder's marker is an object whose key ends in a slash, so never asked for.
        if not page.objects or page.objects[0].key != key:
            raise SourceError(f"{path}: no such file")
        return page.objects[0]


@dataclass(frozen=True, slots=True)
class _Loaded:
    """What is known to lie below a place."""

    below: str | None
    files: dict[str, File]
    folders: dict[str, dict[str, bool]]

    def has(self, path: str) -> bool:
        return self.below is not None and path.startswith(self.below)


@lru_cache(maxsize=8)
def _is_archive(root: S3Root, pid: int) -> bool:
    """Whether the root is a zip file; looked up once a process.

    Raises
    ------
    DatasetError
        If there is neither such an object nor any below.
    """
    try:
        if root.prefix.lower().endswith(".zip"):
            page = next(s3_client.pages(root.bucket, root.prefix, limit=1))
            if page.objects and page.objects[0].key == root.prefix:
                return True
        below = f"{root.prefix}/" if root.prefix else ""
        if next(s3_client.pages(root.bucket, below, limit=1)).objects:
            return False
    except OSError as error:
        raise DatasetError(f"dataset.root: can't read {root}: {error.strerror}") from error
    raise DatasetError(f"dataset.root: nothing is at {root}: no zip file, and no objects below it")
