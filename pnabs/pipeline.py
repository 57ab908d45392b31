"""One shape to one abstraction: no Ray, no run folder.  Stages and the library call it."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, field, replace
from dataclasses import fields as dataclass_fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pnabs import settings
from pnabs.formats import Abstraction
from pnabs.geometry.difference import difference_volume
from pnabs.geometry.fields import Fields, compute_fields
from pnabs.geometry.fit.build import Terms
from pnabs.geometry.fit.fit import Fitted, fit
from pnabs.geometry.measure import measure
from pnabs.geometry.metrics import iou, predicted_occupancy
from pnabs.geometry.postprocess import postprocess
from pnabs.geometry.reference import Boundary, Reference
from pnabs.geometry.solidify import SolidResult, solidify
from pnabs.geometry.types import Bool, Cuboids, Float32, Float64, Mesh

if TYPE_CHECKING:
    import torch

    from pnabs.model.network import CuboidNetwork


@dataclass(frozen=True, slots=True)
class Shape:
    """A shape as ingest keeps it, as far as abstraction needs it; normalised frame.

    Attributes
    ----------
    occupancy : (32, 32, 32) bool
    occupancy_64 : (64, 64, 64) bool
    occupancy_128 : (128, 128, 128) bool
    occupancy_192 : (192, 192, 192) bool
    sdf : (32, 32, 32) float32
    surface : (P, 6) float32
    transform : (4, 4) float64
        Normalised frame -> the input's coordinates.
    mirror : int
        Axis across which it is its own mirror image, or -1.
    extent : (3,) float64
        Sides of the bounding box, whose centre is the origin.
    boundary : Boundary
        What exact volumes and distances are measured against.
    """

    occupancy: Bool
    occupancy_64: Bool
    occupancy_128: Bool
    occupancy_192: Bool
    sdf: Float32
    surface: Float32
    transform: Float64
    mirror: int
    extent: Float64
    boundary: Boundary

    @classmethod
    def of(cls, fields: Fields) -> Shape:
        """What ingest computes of a mesh, as far as it is needed."""
        return cls(**{one.name: getattr(fields, one.name) for one in dataclass_fields(cls)})


@dataclass(frozen=True, slots=True)
class Prediction:
    """What the networks say of one shape.

    Attributes
    ----------
    positives, negatives : Cuboids
        As predicted, before post-process.
    difference : (32, 32, 32) bool
        V_delta that the negatives were predicted from; empty means no negatives.
    """

    positives: Cuboids
    negatives: Cuboids
    difference: Bool


class Predictor:
    """The trained networks of both modules.

    Parameters
    ----------
    positive, negative
        Weights; without negative ones, or with `abstract.negatives` off, nothing is cropped.
    device
        `auto`, `cpu` or `cuda`.

    Raises
    ------
    pnabs.model.checkpoint.CheckpointError
        When a file holds no such weights.
    """

    def __init__(
        self, positive: Path, negative: Path | None, job: settings.Settings, threads: int = 1
    ) -> None:
        import torch

        from pnabs.model.checkpoint import load_network

        torch.set_num_threads(threads)
        wanted = job.runtime.device
        cuda = wanted == "cuda" or (wanted == "auto" and torch.cuda.is_available())
        self._device: torch.device = torch.device("cuda" if cuda else "cpu")
        self._job = job
        self._positive: CuboidNetwork = load_network(positive, self._device)
        self._negative = load_network(negative, self._device) if negative else None

    def positives(self, occupancy: Bool) -> list[Cuboids]:
        """C+ of each shape, from occupancies (B, 32, 32, 32)."""
        from pnabs.model.predict import predict

        return predict(self._positive, occupancy, self._job.abstract.iterations, self._device)

    def __call__(self, occupancy: Bool, sdf: Float32) -> list[Prediction]:
        """C+, V_delta and C- of each shape, from (B, 32, 32, 32) occupancies and fields."""
        from pnabs.model.predict import predict

        positives = self.positives(occupancy)
        options = self._job.difference
        volumes = [
            difference_volume(boxes, solid, field, options)
            for boxes, solid, field in zip(positives, occupancy, sdf, strict=True)
        ]
        negatives = [Cuboids.empty()] * len(positives)
        if self._negative is not None and self._job.abstract.negatives:
            rows = [row for row, volume in enumerate(volumes) if volume.any()]
            if rows:
                chosen = np.stack([volumes[row] for row in rows])
                iterations = self._job.abstract.iterations
                found = predict(self._negative, chosen, iterations, self._device)
                for row, boxes in zip(rows, found, strict=True):
                    negatives[row] = boxes
        return [Prediction(*parts) for parts in zip(positives, negatives, volumes, strict=True)]


def thickened(positives: Cuboids, min_side: float) -> Cuboids:
    """Positives whose sides are raised to at least `min_side` (ours).

    A seat or a wing may be predicted with no thickness at all; a crop would lose it.  Specks,
    shorter than that in every direction, are left out.
    """
    kept = positives[positives.scale.max(axis=1) >= min_side]
    scale = np.maximum(kept.scale, np.float32(min_side))
    return Cuboids(scale, kept.rotation, kept.translation)


def finish(
    prediction: Prediction,
    shape: Shape,
    options: settings.Abstract,
    *,
    category: str,
    model_id: str,
    seed: int,
    provenance: dict[str, Any],
) -> Abstraction:
    """From predicted cuboids to the checked, measured abstraction (METHOD, abstraction).

    Post-processes the negatives, fits all cuboids to the shape, crops, drops debris, checks
    and measures.

    Parameters
    ----------
    seed
        The job's: random numbers come from it alone.
    """
    rng = model_rng(seed, "abstract")
    seeds = model_rng(seed, "metrics").integers(2**32, size=2).tolist()
    negatives, report = postprocess(
        prediction.negatives,
        shape.surface,
        shape.occupancy_64,
        prediction.difference,
        options,
    )
    positives = thickened(prediction.positives, options.min_side)
    counts: dict[str, float | int] = {
        "negatives_predicted": report.predicted,
        "negatives_kept": report.kept,
        "shrunk": report.shrunk,
        "grown": report.grown,
        "discarded_deep": report.discarded_deep,
        "discarded_overlap": report.discarded_overlap,
        "discarded_gap": report.discarded_gap,
        "discarded_idle": report.discarded_idle,
        "suppressed": report.suppressed,
    }
    for resolution, cells in ((32, shape.occupancy), (64, shape.occupancy_64)):
        predicted = predicted_occupancy(positives, negatives, resolution, options.min_side)
        counts[f"iou_{resolution}_networks"] = iou(predicted, cells)
    levels, found = _levels(positives, negatives, shape, options, rng)
    counts |= found
    reference = Reference.of(shape)

    def made(level: _Level, more: dict[str, float | int]) -> Abstraction:
        return Abstraction.from_solid(
            level.solid,
            category=category,
            model_id=model_id,
            positives=level.positives,
            negatives=level.negatives,
            transform=shape.transform,
            metrics=_measured(level, reference, options, seeds) | more,
            provenance=provenance,
        )

    finest = made(levels[0], counts)
    coarser = {one.size: replace(made(one, {}), origins=one.origins) for one in levels[1:]}
    return replace(finest, levels=coarser) if coarser else finest


@dataclass(frozen=True, slots=True)
class _Level:
    """Boxes and the solid made of them; the finest has size 0."""

    positives: Cuboids
    negatives: Cuboids
    solid: SolidResult
    size: int = 0
    origins: list[list[int]] = field(default_factory=list)


def _levels(
    positives: Cuboids,
    negatives: Cuboids,
    shape: Shape,
    options: settings.Abstract,
    rng: np.random.Generator,
) -> tuple[list[_Level], dict[str, float | int]]:
    """The finest level and the coarser ones, and what the fit counted.

    A fit whose result leaves the input's bounding box is made again, held to the box.
    """
    for strict in (False, True) if options.fit else ():
        fitted = _fitted(positives, negatives, shape, options, rng, strict=strict)
        if not len(fitted.positives):
            break
        levels = [_solid(fitted.positives, fitted.negatives, shape, options, rng)]
        levels += [
            _solid(one.positives, one.negatives, shape, options, rng, size, one.origins)
            for size, one in fitted.coarser.items()
        ]
        if strict or all(one.solid.check.within_bounds for one in levels):
            return levels, {
                "mirrored_pairs": fitted.pairs,
                "self_mirrored": fitted.centred,
                "axis_aligned": fitted.aligned,
                "fitted_again": int(strict),
            }
    return [_solid(positives, negatives, shape, options, rng)], {}


def _solid(
    positives: Cuboids,
    negatives: Cuboids,
    shape: Shape,
    options: settings.Abstract,
    rng: np.random.Generator,
    size: int = 0,
    origins: list[list[int]] | None = None,
) -> _Level:
    solid = solidify(positives, negatives, options, rng, shape.extent)
    return _Level(positives, negatives, solid, size, origins or [])


def _fitted(
    positives: Cuboids,
    negatives: Cuboids,
    shape: Shape,
    options: settings.Abstract,
    rng: np.random.Generator,
    *,
    strict: bool,
) -> Fitted:
    return fit(
        shape.occupancy_64,
        shape.occupancy_192,
        shape.surface,
        shape.mirror,
        Terms(
            options.boxes,
            options.min_gain,
            options.cover,
            negatives=None if options.negatives else 0,
        ),
        rng,
        extent=shape.extent,
        min_side=options.min_side,
        strict=strict,
        start=None if options.start == "scattered" else (positives, negatives),
        scattered=options.start != "networks",
        sizes=options.levels,
    )


def _measured(
    level: _Level, reference: Reference, options: settings.Abstract, seeds: tuple[int, int]
) -> dict[str, float | int]:
    """The metrics of an abstraction, and how many cuboids it has."""
    found = measure(level.positives, level.negatives, level.solid, reference, options, seeds)
    # An empty result has no distances: absent rather than not a number.
    metrics = {name: value for name, value in found.items() if math.isfinite(value)}
    return metrics | {
        "positives": len(level.positives),
        "negatives": len(level.negatives),
        "pieces_dropped": len(level.solid.mesh.dropped),
        "jitter_attempt": level.solid.recipe.jitter_attempt,
    }


class Abstractor:
    """Meshes to abstractions with trained networks, one at a time.

    A mesh gets what a run of the same settings and weights gives it.

    Parameters
    ----------
    job : Settings
        With weights.

    Raises
    ------
    pnabs.model.checkpoint.CheckpointError
        When the weights can't be read.
    """

    def __init__(self, job: settings.Settings) -> None:
        folder = job.weights_folder
        if folder is None:
            raise ValueError("there are no weights: give settings with `weights`")
        negative = folder / "negative.safetensors" if job.abstract.negatives else None
        self._job = job
        self._predictor = Predictor(
            folder / "positive.safetensors", negative, job, job.runtime.threads
        )

    def __call__(
        self, mesh: Mesh, *, category: str, model_id: str, provenance: dict[str, Any]
    ) -> Abstraction:
        """The abstraction of one mesh, which is in the input's coordinates.

        Raises
        ------
        pnabs.geometry.load.InvalidMeshError
            When no solid can be made of it.
        """
        job = self._job
        rng = model_rng(job.seed, "ingest")
        fields = compute_fields(mesh, job.ingest, job.dataset.layout, rng)
        shape = Shape.of(fields)
        (prediction,) = self._predictor(shape.occupancy[None], shape.sdf[None])
        return finish(
            prediction,
            shape,
            job.abstract,
            category=category,
            model_id=model_id,
            seed=job.seed,
            provenance=provenance,
        )


def model_rng(seed: int, stage: str) -> np.random.Generator:
    """Random numbers for one model in one stage: the same for every model of the job.

    They come from the job's seed and the stage alone.  So a mesh has one result, whatever its
    name, its category and its company.
    """
    name = f"{seed}/{stage}".encode()
    return np.random.default_rng(int.from_bytes(hashlib.sha256(name).digest()[:16], "big"))
