"""Fixed-length arrays a category in sharded, checksummed Zarr v3.

One group a category; model k of shard s lies in row s * shard_size + k.  One Zarr
shard belongs to one ledger shard and so has one writer, every chunk carries a
CRC-32C, and what was written is read back before it counts.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pnabs.store.atomic import file_digest, sweep, sync_folder, write_atomic
from pnabs.store.errors import DamagedDataError

if TYPE_CHECKING:
    # Loaded when first used: status, say, reads no array.
    import zarr

INNER_CHUNK = 8
"""Models a chunk: one model can be looked at cheaply, a shard is read in a few chunks."""


@dataclass(frozen=True, slots=True)
class ArraySpec:
    """Shape a model and type of one array."""

    name: str
    shape: tuple[int, ...]
    dtype: str


class CategoryArrays:
    """Named arrays a category below one Zarr store.

    Parameters
    ----------
    store
        Folder of the store, such as RUN/fields.zarr.
    run
        The run folder; digests are reported relative to it.
    specs
        The arrays each category has.
    shard_size
        Models a shard.
    """

    def __init__(self, store: Path, run: Path, specs: Sequence[ArraySpec], shard_size: int) -> None:
        self.store = store
        self.run = run
        self.specs = tuple(specs)
        self.shard_size = shard_size

    def ensure(self, category: str, shards: int) -> list[Path]:
        """Make a category's arrays, or let them grow to hold so many shards.

        Returns
        -------
        The descriptions (zarr.json) that weren't there or differed from what they should be.
        They follow from the settings, so nothing is lost with them, and shards that lie there
        stay.  Where settings gave an array another shape, its shards are to be written anew.
        """
        written = []
        for name, data in self._descriptions(category, shards).items():
            path = self.store / name
            sweep(path.parent, f".{path.name}")
            try:
                before = path.read_bytes()
            except OSError:
                before = b""
            if before == data:
                continue
            write_atomic(path, data)
            written.append(path)
        return written

    def _descriptions(self, category: str, shards: int) -> dict[str, bytes]:
        """Every zarr.json of a category and of the store, as Zarr writes them: path -> bytes."""
        import zarr.storage
        from zarr.codecs import BloscCodec, Crc32cCodec

        memory: dict[str, Any] = {}
        store = zarr.storage.MemoryStore(memory)
        zarr.create_group(store, zarr_format=3)
        group = zarr.create_group(store, path=category, zarr_format=3)
        # A shard must hold whole chunks.
        inner = INNER_CHUNK if self.shard_size % INNER_CHUNK == 0 else self.shard_size
        for spec in self.specs:
            width = np.dtype(spec.dtype).itemsize
            group.create_array(
                spec.name,
                shape=(shards * self.shard_size, *spec.shape),
                dtype=spec.dtype,
                chunks=(inner, *spec.shape),
                shards=(self.shard_size, *spec.shape),
                compressors=[
                    BloscCodec(
                        typesize=width,
                        cname="zstd",
                        clevel=3,
                        shuffle="bitshuffle" if width == 1 else "shuffle",
                    ),
                    Crc32cCodec(),
                ],
                fill_value=0,
            )
        return {name: value.to_bytes() for name, value in memory.items()}

    def write_shard(
        self, category: str, shard: int, arrays: Mapping[str, NDArray[Any]]
    ) -> dict[str, dict[str, Any]]:
        """Write one shard's rows of every array, read them back, and digest the files.

        Parameters
        ----------
        arrays
            Name -> (n, ...) with n at most the shard's size; the other rows stay zero.

        Returns
        -------
        Path below the run folder -> size and SHA-256 of each shard file.

        Raises
        ------
        DamagedDataError
            When what is read back differs from what was written.
        """
        outputs = {}
        start = shard * self.shard_size
        with _single_threaded():
            for spec in self.specs:
                value = np.zeros((self.shard_size, *spec.shape), spec.dtype)
                rows = arrays[spec.name]
                value[: len(rows)] = rows
                array = self._array(category, spec.name)
                array[start : start + self.shard_size] = value
                path = self.shard_path(category, spec.name, shard)
                sweep(path.parent, path.name)
                back = np.asarray(array[start : start + self.shard_size])
                if back.tobytes() != value.tobytes():
                    raise DamagedDataError(f"{path}: read back differs from what was written")
                _sync(path)
                outputs[path.relative_to(self.run).as_posix()] = file_digest(path)
        return outputs

    def read_shard(self, category: str, shard: int, name: str, count: int) -> NDArray[Any]:
        """The first `count` rows of one shard of one array, (count, ...).

        Raises
        ------
        DamagedDataError
            When the shard's file is missing, empty or fails a checksum.
        """
        path = self.shard_path(category, name, shard)
        # Zarr reads a missing or empty shard as zeros without an error.
        if not path.is_file() or path.stat().st_size == 0:
            raise DamagedDataError(f"{path} is missing or empty; run `pnabs verify {self.run}`")
        start = shard * self.shard_size
        try:
            with _single_threaded():
                return np.asarray(self._array(category, name)[start : start + count])
        except (ValueError, RuntimeError, OSError) as error:
            raise DamagedDataError(
                f"{path} is damaged ({error}); run `pnabs verify {self.run}`"
            ) from error

    def shard_path(self, category: str, name: str, shard: int) -> Path:
        """The file that holds one shard of one array."""
        dimensions = len(next(spec.shape for spec in self.specs if spec.name == name))
        return self.store / category / name / "c" / "/".join([str(shard), *["0"] * dimensions])

    def _array(self, category: str, name: str) -> zarr.Array[Any]:
        import zarr

        array = zarr.open_array(self.store, path=f"{category}/{name}", mode="r+")
        return array


def _single_threaded() -> Any:
    import zarr

    # Parallelism comes from processes; threads of each would only get in their way.
    # Chunks of zeros are written too, so that a missing file always means damage.
    return zarr.config.set(
        {
            "threading.max_workers": 1,
            "async.concurrency": 4,
            "array.write_empty_chunks": True,
        }
    )


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
    sync_folder(path.parent)
