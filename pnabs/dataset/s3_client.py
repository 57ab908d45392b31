"""The two calls that reading a bucket takes: list its objects, get one of them.

They go through s3fs (`pip install pnabs[s3]`), set up as AWS' own tools are: credentials,
profile, region and `AWS_ENDPOINT_URL` from the environment or ~/.aws; without credentials
(public buckets) where fsspec's settings say so (`FSSPEC_S3_ANON=true`).  Whatever goes wrong is
an `OSError`, its number telling a verdict (no such object, no permission) from what may pass.
"""

from __future__ import annotations

import errno
import importlib
import io
import os
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple, TypeVar

from pnabs.dataset.errors import DatasetError

_CONFIG = {
    "connect_timeout": 5,
    "read_timeout": 15,
    "retries": {"mode": "standard", "total_max_attempts": 3},
}
_ERRNO = {
    "NoSuchKey": errno.ENOENT,
    "AccessDenied": errno.EACCES,
    "AllAccessDisabled": errno.EACCES,
    "InvalidObjectState": errno.EACCES,  # in cold storage, not restored
    "PreconditionFailed": errno.ESTALE,
}
_WINDOW = 2**18
_T = TypeVar("_T")


class Object(NamedTuple):
    """An object as a listing shows it."""

    key: str
    size: int
    mtime_ns: int
    etag: str


class Page(NamedTuple):
    """A part of a listing."""

    objects: list[Object]
    prefixes: list[str]
    """What keys have in common up to the delimiter, which ends each."""


def pages(bucket: str, prefix: str, delimiter: str = "", limit: int = 1000) -> Iterator[Page]:
    """List the objects whose keys begin with a prefix, in the order of their keys.

    Parameters
    ----------
    bucket, prefix : str
    delimiter : str
        Keys are cut after the first one beyond the prefix, and listed once.
    limit : int
        Most entries a page (a request).

    Raises
    ------
    OSError
    DatasetError
        If s3fs isn't installed.
    """
    options = {"Bucket": bucket, "Prefix": prefix, "Delimiter": delimiter, "MaxKeys": limit}
    while True:

        async def ask(client: Any) -> dict[str, Any]:
            answer: dict[str, Any] = await client.list_objects_v2(**options)
            return answer

        answer = _call(ask, f"s3://{bucket}/{prefix}")
        yield Page(
            [_object(item) for item in answer.get("Contents", ())],
            [item["Prefix"] for item in answer.get("CommonPrefixes", ())],
        )
        if not answer.get("IsTruncated"):
            return
        options["ContinuationToken"] = answer["NextContinuationToken"]


def get(bucket: str, key: str, check: Callable[[int], None], **conditions: str) -> bytes:
    """Content of an object.

    Parameters
    ----------
    bucket, key : str
    check : callable
        Called with the number of bytes that are to come, before any is taken.
    conditions : str
        `Range` and `IfMatch`, as GetObject has them.

    Raises
    ------
    OSError
    """

    async def ask(client: Any) -> bytes:
        answer = await client.get_object(Bucket=bucket, Key=key, **conditions)
        size = answer["ContentLength"]
        async with answer["Body"] as body:
            check(size)
            data: bytes = await body.read()
        if len(data) != size:
            raise OSError(errno.EIO, f"{len(data):,} bytes came of {size:,}")
        return data

    return _call(ask, f"s3://{bucket}/{key}")


@dataclass(frozen=True, slots=True)
class RemoteFile:
    """An object of one state (its ETag): should it change, reading it fails."""

    bucket: str
    key: str
    size: int
    etag: str

    def open(self) -> io.BufferedReader:
        """Open for reading by ranges; nothing is fetched that isn't read, but for a window."""
        return io.BufferedReader(_Ranges(self), _WINDOW)


class _Ranges(io.RawIOBase):
    """A read is a request for a range."""

    def __init__(self, file: RemoteFile) -> None:
        self._file = file
        self._position = 0
        self.name = f"s3://{file.bucket}/{file.key}"

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        start = {io.SEEK_SET: 0, io.SEEK_CUR: self._position, io.SEEK_END: self._file.size}[whence]
        if start + offset < 0:
            raise OSError(errno.EINVAL, "before the beginning of the file")
        self._position = start + offset
        return self._position

    def readinto(self, buffer: Any) -> int:
        view = memoryview(buffer).cast("B")
        start, stop = self._position, min(self._position + len(view), self._file.size)
        if stop <= start:
            return 0

        def check(size: int) -> None:
            if size != stop - start:
                raise OSError(errno.EIO, f"{self.name}: the storage doesn't serve ranges")

        span = f"bytes={start}-{stop - 1}"
        data = get(self._file.bucket, self._file.key, check, Range=span, IfMatch=self._file.etag)
        view[: len(data)] = data
        self._position = stop
        return len(data)


def _object(item: dict[str, Any]) -> Object:
    # Whole seconds are all that every S3-compatible storage gives.
    mtime_ns = int(item["LastModified"].timestamp()) * 10**9
    return Object(item["Key"], item["Size"], mtime_ns, item["ETag"])


def _call(ask: Callable[[Any], Awaitable[_T]], what: str) -> _T:
    """Run a coroutine with the process' client."""
    filesystem = _filesystem(os.getpid())

    async def run() -> _T:
        return await ask(await filesystem.set_session())

    with _as_os_errors(what):
        answer: _T = importlib.import_module("fsspec.asyn").sync(filesystem.loop, run)
        return answer


@lru_cache(maxsize=1)
def _filesystem(pid: int) -> Any:
    """s3fs' file system, one a process: a forked child can't use its parent's connections."""
    try:
        s3fs = importlib.import_module("s3fs")
    except ImportError as error:
        raise DatasetError(
            "dataset.root: reading from s3:// needs s3fs; install pnabs[s3]"
        ) from error
    return s3fs.S3FileSystem(config_kwargs=_CONFIG, skip_instance_cache=True)


@contextmanager
def _as_os_errors(what: str) -> Iterator[None]:
    exceptions = importlib.import_module("botocore.exceptions")
    aiohttp = importlib.import_module("aiohttp")
    try:
        yield
    except exceptions.ClientError as error:
        code = str(error.response.get("Error", {}).get("Code", ""))
        text = str(error.response.get("Error", {}).get("Message", "")) or str(error)
        raise OSError(_ERRNO.get(code, errno.EIO), f"{code}: {text}", what) from error
    except exceptions.NoCredentialsError as error:
        raise OSError(
            errno.EIO,
            "no credentials; set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY or AWS_PROFILE, "
            "or FSSPEC_S3_ANON=true for a public bucket",
            what,
        ) from error
    except (exceptions.BotoCoreError, aiohttp.ClientError, TimeoutError) as error:
        raise OSError(errno.EIO, str(error) or type(error).__name__, what) from error
