"""Scoring from Python: whole sets as the command does, or one result in memory."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pnabs import settings as schema
from pnabs.dataset.source import Dataset
from pnabs.evaluation.names import named
from pnabs.evaluation.output import Evaluation
from pnabs.evaluation.reading import (
    Frame,
    Reading,
    from_abstraction,
    from_boxes,
    from_meshes,
    to_shape,
)
from pnabs.evaluation.run import Request, run
from pnabs.evaluation.shapes import Choice
from pnabs.evaluation.task import measured
from pnabs.formats import Abstraction, from_json
from pnabs.geometry.fields import compute_fields
from pnabs.geometry.load import InvalidMeshError, parse_mesh, validate
from pnabs.geometry.reference import Reference
from pnabs.geometry.types import Cuboids, Float64, Mesh
from pnabs.pipeline import model_rng
from pnabs.renamed import warned
from pnabs.stages.progress import Reporter
from pnabs.stages.trees import at, dotted

if TYPE_CHECKING:
    import trimesh

    AnyMesh = str | Path | Mesh | trimesh.Trimesh | trimesh.Scene


def evaluate(
    shapes: str | Path,
    results: str | Path | Sequence[str | Path] | Mapping[str, str | Path],
    *,
    name: str | Sequence[str] = (),
    out: str | Path | None = None,
    layout: schema.Layout | None = None,
    split: str | Path | None = None,
    only: str | None = None,
    categories: Iterable[str] = (),
    frame: Frame = "input",
    max_parts: int | None = None,
    seed: int | None = None,
    settings: Mapping[str, Any] | None = None,
    jobs: int | None = None,
    address: str | None = None,
    retry: bool = False,
    quiet: bool = True,
) -> Evaluation:
    """Score anybody's results against shapes, as `pnabs evaluate` does.

    Parameters
    ----------
    shapes
        A run folder, a dataset (folder, zip file, `s3://` URL), a folder of meshes, or a mesh.
    results
        A folder or zip file of results, a run folder or one of its variants, a mesh, an
        `abstraction.json`, or a csv or npz of boxes.  Several stand side by side.
    name
        Of each of the results; their paths' last components when left out.
    out
        Folder of rows and tables, where the same call goes on after any stop; nothing stays when
        left out.
    layout
        Of a dataset; found out when left out.
    split, only
        Take the models of one split alone; `split` is `hash` or a csv in the form of all.csv.
    categories
        Take these alone.
    frame
        In which meshes and boxes are given: `input`, the shapes' own coordinates, or `normalised`.
    max_parts
        Results of more parts count as failures.
    seed
        Of all random numbers; a run's own, else 0.
    settings
        Replaces settings of `ingest`, `runtime` and `abstract.metric_samples`.
    jobs
        Results at a time; one a CPU when left out.
    address
        Work on the Ray cluster there; `local` starts Ray here.
    retry
        Do again what couldn't be measured before.
    quiet
        Tell no progress.

    Returns
    -------
    Evaluation

    Raises
    ------
    pnabs.stages.errors.RunError
        When something given can't be used; its subclasses tell why.
    pnabs.stages.job.JobError
        When a setting is unknown or wrong.
    pnabs.dataset.errors.DatasetError
        When the shapes can't be listed.
    """
    if isinstance(results, Mapping):
        given = tuple((str(key), Path(path)) for key, path in results.items())
    else:
        paths = [results] if isinstance(results, str | Path) else list(results)
        names = [name] if isinstance(name, str) else list(name)
        given = named([Path(path) for path in paths], names)
    remote = isinstance(shapes, str) and "://" in shapes
    tree = dict(settings or {})
    overrides = tuple(
        # JSON is YAML, which overrides are read as.
        f"{key}={json.dumps(at(tree, key.split('.')))}"
        for key in sorted(dotted(tree))
    )
    with tempfile.TemporaryDirectory(prefix="pnabs-evaluation-") as scratch:
        request = Request(
            shapes=shapes if remote else Path(shapes),
            results=given,
            out=Path(scratch if out is None else out),
            choice=Choice(layout, split, only, tuple(categories)),
            frame=frame,
            max_parts=max_parts,
            seed=seed,
            overrides=overrides,
            jobs=jobs or len(os.sched_getaffinity(0)),
            address=address,
            retry=retry,
        )
        return run(request, Reporter(quiet=quiet))


def score(
    shape: AnyMesh,
    result: AnyMesh | Abstraction | Cuboids | Sequence[AnyMesh] | tuple[Cuboids, Cuboids],
    *,
    frame: Frame = "input",
    seed: int = 0,
    settings: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Score one result of one shape, in this process.

    Parameters
    ----------
    shape
        A mesh file, or a mesh in memory; it needs to be neither closed nor clean.
    result
        An `Abstraction` or `abstraction.json`, a mesh, a list of meshes whose union is meant, or
        `Cuboids`: positives, or a pair of positives and negatives.
    frame
        In which meshes and cuboids are given: `input`, the shape's own coordinates, or
        `normalised`.
    seed
        Of all random numbers.
    settings
        Replaces settings of `ingest` and `abstract.metric_samples`.

    Returns
    -------
    dict
        Name of each measure -> its value, as in models.csv; those that aren't defined are left
        out.  `not_exact` tells why the shape isn't closed, `not_closed` why the result isn't;
        empty where they are.

    Raises
    ------
    FileNotFoundError
        When there is no such file.
    pnabs.geometry.load.InvalidMeshError
        When a file or mesh can't be used.
    pnabs.formats.FormatError
        When an abstraction.json is something else.
    pydantic.ValidationError
        When a setting is unknown or wrong.
    pnabs.renamed.BothNamesError
        When a setting is given by its old name and by its new one.
    """
    tree = {"dataset": {"root": ".", "layout": "folder"}, "out": ".", "seed": seed}
    job = schema.Settings.model_validate({**warned(settings), **tree})
    limits = job.ingest.limits
    rng = model_rng(job.seed, "ingest")
    fields = compute_fields(_mesh(shape, limits), job.ingest, "folder", rng)
    reference = Reference.of(fields)
    reading = _reading(result, frame, reference.transform, limits)
    found = measured(reading, reference, job.abstract.metric_samples, job.seed)
    return {key: value for key, value in found.items() if value is not None}


def _reading(given: Any, frame: Frame, transform: Float64, limits: schema.Limits) -> Reading:
    if isinstance(given, str | Path) and Path(given).suffix.lower() == ".json":
        given = from_json(Path(given).read_bytes())
    if isinstance(given, Abstraction):
        return from_abstraction(given, transform)
    matrix = to_shape(frame, transform)
    several = isinstance(given, Sequence) and not isinstance(given, str)
    found = list(given) if several else [given]
    if all(isinstance(one, Cuboids) for one in found) and 1 <= len(found) <= 2:
        positives, negatives = (*found, Cuboids.empty())[:2]
        return from_boxes(positives.as_vector(), negatives.as_vector(), matrix)
    return from_meshes([_mesh(one, limits) for one in found], matrix)


def _mesh(given: Any, limits: schema.Limits) -> Mesh:
    if isinstance(given, str | Path):
        return _read(Path(given), limits)
    if isinstance(given, Mesh):
        mesh = given
    else:
        # A scene's parts are put where its graph places them.
        whole = given.to_mesh() if hasattr(given, "to_mesh") else given
        vertices = np.ascontiguousarray(whole.vertices, dtype=np.float64)
        mesh = Mesh(vertices, np.ascontiguousarray(whole.faces, dtype=np.int64))
    validate(mesh, limits)
    return mesh


def _read(path: Path, limits: schema.Limits) -> Mesh:
    if not path.is_file():
        raise FileNotFoundError(f"there is no mesh {path}")
    if path.stat().st_size > limits.max_bytes:
        raise InvalidMeshError(f"{path} has more than limits.max_bytes = {limits.max_bytes:,}")
    # What a .gltf names is read from its own folder alone.
    sibling = Dataset(path.resolve().parent).sibling_reader(path.name, limits.max_bytes)
    return parse_mesh(path.read_bytes(), path.suffix, limits, sibling)
