"""The library's front door: a mesh to its abstraction, in this process, without Ray."""

from __future__ import annotations

import contextlib
import functools
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

# Imported first by another thread than the main one, it ends the process in a crash.
import pymeshlab  # noqa: F401

import pnabs
from pnabs.dataset.source import Dataset
from pnabs.formats import Abstraction, from_json
from pnabs.geometry.load import InvalidMeshError, parse_mesh, validate
from pnabs.geometry.types import Mesh
from pnabs.pipeline import Abstractor
from pnabs.renamed import warned
from pnabs.settings import Settings

if TYPE_CHECKING:
    import trimesh


def abstract(
    mesh: str | Path | Mesh | trimesh.Trimesh | trimesh.Scene,
    *,
    weights: str | Path = "shipped",
    seed: int = 0,
    settings: Mapping[str, Any] | None = None,
) -> Abstraction:
    """The abstraction of one mesh.

    Parameters
    ----------
    mesh
        A file (OBJ, OFF, PLY, STL, GLB, glTF), or a mesh or scene in memory.  It needs to be
        neither closed nor clean.
    weights
        Folder with `positive.safetensors` and `negative.safetensors`; those that come with pnabs
        when left out.
    seed
        Of all random numbers.
    settings
        Replaces settings of `ingest`, `difference`, `abstract` and `runtime`, as
        ``{"abstract": {"negatives": False}}``.

    Returns
    -------
    Abstraction
        Its mesh is in the input's coordinates.

    Raises
    ------
    FileNotFoundError
        When there is no such mesh, or no such weights.
    pnabs.geometry.load.InvalidMeshError
        When the file holds no usable mesh.
    pydantic.ValidationError
        When a setting is unknown or wrong.
    pnabs.renamed.BothNamesError
        When a setting is given by its old name and by its new one.
    pnabs.model.checkpoint.CheckpointError
        When the weights can't be read.
    """
    tree = {"dataset": {"root": ".", "layout": "folder"}, "out": "."}
    job = Settings.model_validate({**warned(settings), **tree, "weights": weights, "seed": seed})
    name = Path(mesh).stem if isinstance(mesh, str | Path) else "mesh"
    found = _mesh(mesh, job)
    validate(found, job.ingest.limits)
    provenance = {"pnabs": pnabs.__version__, "seed": seed}
    with _threads_kept():
        made = _abstractor(job.model_dump_json(), _state(job))
        return made(found, category="", model_id=name, provenance=provenance)


def load(path: str | Path) -> Abstraction:
    """The abstraction in an `abstraction.json`.

    Raises
    ------
    FileNotFoundError
        When there is no such file.
    pnabs.formats.FormatError
        When it is something else; says where and why.
    """
    return from_json(Path(path).read_bytes())


def _mesh(given: Any, job: Settings) -> Mesh:
    if isinstance(given, Mesh):
        return given
    if isinstance(given, str | Path):
        return _read(Path(given), job)
    # A scene's parts are put where its graph places them.
    whole = given.to_mesh() if hasattr(given, "to_mesh") else given
    vertices = np.ascontiguousarray(whole.vertices, dtype=np.float64)
    return Mesh(vertices, np.ascontiguousarray(whole.faces, dtype=np.int64))


def _read(path: Path, job: Settings) -> Mesh:
    if not path.is_file():
        raise FileNotFoundError(f"there is no mesh {path}")
    limits = job.ingest.limits
    if path.stat().st_size > limits.max_bytes:
        raise InvalidMeshError(f"{path} has more than limits.max_bytes = {limits.max_bytes:,}")
    # What a .gltf names is read from its own folder alone.
    sibling = Dataset(path.resolve().parent).sibling_reader(path.name, limits.max_bytes)
    return parse_mesh(path.read_bytes(), path.suffix, limits, sibling)


def _state(job: Settings) -> tuple[tuple[str, int], ...]:
    """The files of the weights as they are now, by which changed ones are noticed."""
    folder = job.weights_folder or Path()
    paths = sorted(folder.absolute().glob("*.safetensors"))
    return tuple((str(path), path.stat().st_mtime_ns) for path in paths)


@functools.lru_cache(maxsize=2)
def _abstractor(job: str, state: tuple[tuple[str, int], ...]) -> Abstractor:
    return Abstractor(Settings.model_validate(json.loads(job)))


@contextlib.contextmanager
def _threads_kept() -> Iterator[None]:
    """Leave the number of PyTorch's threads, which is the whole process's, as it is."""
    import torch

    threads = torch.get_num_threads()
    try:
        yield
    finally:
        torch.set_num_threads(threads)
