"""A model's mesh from its dataset, with a bad model told from a dataset that is gone."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from pnabs import batch
from pnabs.dataset.errors import DatasetError, SourceError
from pnabs.dataset.source import Dataset
from pnabs.geometry.load import InvalidMeshError, parse_mesh
from pnabs.geometry.types import Mesh
from pnabs.settings import Limits
from pnabs.stages.reach import check_dataset


@contextlib.contextmanager
def blamed(root: Path | str, source: str) -> Iterator[None]:
    """Turn what is wrong with a model's file into an error that the runner knows.

    Raises
    ------
    pnabs.batch.InvalidInput
        When it is the model's fault.
    pnabs.batch.Unavailable
        When the whole dataset is gone.
    """
    try:
        yield
    except (SourceError, InvalidMeshError) as error:
        # A model's file is missing: the model's fault, or the whole dataset's?
        check_dataset(root)
        text = str(error)
        raise batch.InvalidInput(text if source in text else f"{source}: {text}") from None


@dataclass(frozen=True, slots=True)
class Read:
    """A mesh as it was read.

    Attributes
    ----------
    sha256
        Of the file's bytes.
    siblings
        Name -> SHA-256 of the other files that it is made of (.gltf buffers).
    """

    mesh: Mesh
    sha256: str
    siblings: dict[str, str]


def read_mesh(root: Path | str, source: str, limits: Limits, suffix: str | None = None) -> Read:
    """The mesh in a source.

    Parameters
    ----------
    suffix
        What the file is, where its name doesn't tell.

    Raises
    ------
    SourceError, InvalidMeshError
        When there is no readable mesh.
    pnabs.batch.Unavailable
        When the dataset is gone, or its disk or network fails.
    """
    reader = _Reader(root, source, limits.max_bytes)
    data = reader()
    suffix = suffix or PurePosixPath(source.rpartition("!")[2]).suffix
    try:
        mesh = parse_mesh(data, suffix, limits, reader.sibling)
    except InvalidMeshError:
        # What a sibling's disk does is no fault of the mesh.
        reader.raise_failure()
        raise
    return Read(mesh, hashlib.sha256(data).hexdigest(), reader.siblings)


class _Reader:
    """Reads a mesh and its siblings; tells a dataset that fails from a model that is bad."""

    def __init__(self, root: Path | str, source: str, max_bytes: int) -> None:
        self._root, self._source, self._max_bytes = root, source, max_bytes
        self._failure: Exception | None = None
        self.siblings: dict[str, str] = {}
        with self._watched():
            self._dataset = Dataset(root)
            self._sibling = self._dataset.sibling_reader(source, max_bytes)

    def __call__(self) -> bytes:
        with self._watched():
            return self._dataset.read(self._source, self._max_bytes)

    def sibling(self, name: str) -> bytes:
        with self._watched():
            data = self._sibling(name)
        self.siblings[name] = hashlib.sha256(data).hexdigest()
        return data

    def raise_failure(self) -> None:
        """Raise again what a caller in between may have taken for the mesh's fault."""
        if self._failure is not None:
            raise self._failure

    @contextlib.contextmanager
    def _watched(self) -> Iterator[None]:
        try:
            yield
        except (DatasetError, OSError) as error:
            text = f"the dataset {self._root} can't be read: {error}"
            self._failure = batch.Unavailable(text)
            raise self._failure from None
