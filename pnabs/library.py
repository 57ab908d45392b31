"""The library's front door: a mesh to its abstraction, in this process, without Ray."""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pnabs.dataset.source import Dataset
from pnabs.formats import Abstraction, from_json
from pnabs.geometry.load import parse_mesh, validate
from pnabs.geometry.types import Mesh
from pnabs.pipeline import Abstractor
from pnabs.settings import Settings

if TYPE_CHECKING:
    import trimesh


def abstract(
    mesh: str | Path | Mesh | trimesh.Trimesh,
    *,
    weights: str | Path = "shipped",
    seed: int = 0,
    settings: Mapping[str, Any] | None = None,
) -> Abstraction:
    """The abstraction of one mesh.

    Parameters
    ----------
    mesh
        A file (OBJ, OFF, PLY, STL, GLB, glTF), or a mesh in memory.  It needs to be neither closed
        nor clean.
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
        When there is no such file.
    pnabs.geometry.load.InvalidMeshError
        When the file holds no usable mesh.
    pydantic.ValidationError
        When a setting is unknown or wrong.
    pnabs.model.checkpoint.CheckpointError
        When the weights can't be read.
    """
    tree = {"dataset": {"root": ".", "layout": "folder"}, "out": "."}
    job = Settings.model_validate({**(settings or {}), **tree, "weights": weights, "seed": seed})
    name = "mesh"
    if isinstance(mesh, str | Path):
        name = Path(mesh).stem
        mesh = _read(Path(mesh), job)
    elif not isinstance(mesh, Mesh):
        vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float64)
        mesh = Mesh(vertices, np.ascontiguousarray(mesh.faces, dtype=np.int64))
    validate(mesh, job.ingest.limits)
    return _abstractor(job.model_dump_json())(mesh, category="", model_id=name, provenance={})


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


def _read(path: Path, job: Settings) -> Mesh:
    if not path.is_file():
        raise FileNotFoundError(f"there is no mesh {path}")
    limits = job.ingest.limits
    # What a .gltf names is read from its own folder alone.
    dataset = Dataset(path.absolute().parent)
    data = dataset.read(path.name, limits.max_bytes)
    return parse_mesh(
        data, path.suffix, limits, dataset.sibling_reader(path.name, limits.max_bytes)
    )


@functools.lru_cache(maxsize=2)
def _abstractor(job: str) -> Abstractor:
    return Abstractor(Settings.model_validate(json.loads(job)))
