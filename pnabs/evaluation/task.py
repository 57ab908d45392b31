"""What a worker's child does: a shape to what results are measured against, a result to its row."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pnabs import batch, settings
from pnabs.dataset.errors import DatasetError
from pnabs.dataset.source import Dataset
from pnabs.evaluation.frames import compare
from pnabs.evaluation.items import (
    AbstractionFile,
    BoxList,
    FileShape,
    Item,
    MeshFiles,
    ResultPlace,
    StoredShape,
)
from pnabs.evaluation.reading import (
    Frame,
    Reading,
    from_abstraction,
    from_boxes,
    from_meshes,
    inverse,
    to_shape,
)
from pnabs.formats import FormatError, from_json
from pnabs.geometry.fields import compute_fields
from pnabs.geometry.reference import Reference
from pnabs.geometry.score import score
from pnabs.geometry.types import Float64
from pnabs.pipeline import Shape, model_rng
from pnabs.stages.reading import blamed, read_mesh


@dataclass(frozen=True, slots=True)
class Measuring:
    """All that a row depends on beside its shape and its result.

    Attributes
    ----------
    ingest
        How meshes become solids, and what may be read.
    layout
        Of the dataset.
    seed
        Of all random numbers.
    samples
        Points on a result's surface.
    frame
        In which meshes and boxes are given.
    """

    ingest: settings.Ingest
    layout: settings.Layout
    seed: int
    samples: int
    frame: Frame


@dataclass
class EvaluateTask:
    """Items, one at a time; the last shape stays for the results of it that follow."""

    measuring: Measuring
    _mark: str = ""
    _reference: Reference | None = field(default=None, repr=False)

    def __call__(self, payload: tuple[Item, Shape | None]) -> dict[str, Any]:
        """The row of an item, without its fingerprint.

        Raises
        ------
        pnabs.batch.InvalidInput
            When the shape or the result can't be used.
        pnabs.batch.Unavailable
            When a disk or the network fails.
        """
        item, stored = payload
        if item.shape_mark != self._mark:
            self._mark, self._reference = "", None
            self._reference = self._measured_against(item, stored)
            self._mark = item.shape_mark
        assert self._reference is not None
        if item.result is None:
            return {"not_exact": self._reference.boundary.not_exact}
        return self._measured(item.result, self._reference)

    def _measured_against(self, item: Item, stored: Shape | None) -> Reference:
        place = item.shape
        if place.reason:
            raise batch.InvalidInput(place.reason)
        if isinstance(place, StoredShape):
            if stored is None:
                raise ValueError(f"{item.label}: its stored shape was not handed over")
            return Reference.of(stored)
        return self._ingested(place)

    def _ingested(self, place: FileShape) -> Reference:
        measuring = self.measuring
        with blamed(place.root, place.source):
            read = read_mesh(place.root, place.source, measuring.ingest.limits, place.suffix)
            rng = model_rng(measuring.seed, "ingest")
            fields = compute_fields(read.mesh, measuring.ingest, measuring.layout, rng)
            return Reference.of(fields)

    def _measured(self, place: ResultPlace, reference: Reference) -> dict[str, Any]:
        reading = self._read(place, reference)
        row = measured(reading, reference, self.measuring.samples, self.measuring.seed)
        other = None
        if not isinstance(place, AbstractionFile):
            # From where it is taken to be to where the other frame would put it.
            there = reference.transform
            other = inverse(there) if self.measuring.frame == "normalised" else there
        return row | compare(reference, reading.result, float(row["iou_32"]), other)

    def _read(self, place: ResultPlace, reference: Reference) -> Reading:
        limits, transform = self.measuring.ingest.limits, reference.transform
        matrix = to_shape(self.measuring.frame, transform)
        if isinstance(place, BoxList):
            if place.reason:
                raise batch.InvalidInput(place.reason)
            return from_boxes(
                np.array(place.positives).reshape(-1, 10),
                np.array(place.negatives).reshape(-1, 10),
                matrix,
            )
        if isinstance(place, AbstractionFile):
            with blamed(place.root, place.source):
                data = _bytes(place.root, place.source, limits.max_bytes)
                try:
                    return from_abstraction(from_json(data), transform)
                except FormatError as error:
                    raise batch.InvalidInput(f"{place.source}: {error}") from None
        return self._read_meshes(place, matrix)

    def _read_meshes(self, place: MeshFiles, matrix: Float64) -> Reading:
        meshes = []
        for source in place.sources:
            with blamed(place.root, source):
                meshes.append(read_mesh(place.root, source, self.measuring.ingest.limits).mesh)
        with blamed(place.root, place.sources[0]):
            return from_meshes(meshes, matrix)


def measured(reading: Reading, reference: Reference, samples: int, seed: int) -> dict[str, Any]:
    """What is measured of a result; undefined figures are left out."""
    # As a run measures its own results, so that both say the same.
    own = int(model_rng(seed, "metrics").integers(2**32))
    found: dict[str, Any] = dict(score(reference, reading.result, samples=samples, seed=own))
    found = {
        name: value
        for name, value in found.items()
        if name != "closed" and (not isinstance(value, float) or math.isfinite(value))
    }
    if reading.not_closed not in ("", "empty"):
        # Rays through what isn't closed don't tell inside from outside.
        found.pop("iou_mesh_64", None)
    return found | {
        "parts": reading.parts,
        "positives": reading.positives,
        "negatives": reading.negatives,
        "bodies": reading.bodies,
        "not_exact": reference.boundary.not_exact,
        "not_closed": reading.not_closed,
    }


def _bytes(root: str, source: str, max_bytes: int) -> bytes:
    try:
        return Dataset(root).read(source, max_bytes)
    except (DatasetError, OSError) as error:
        raise batch.Unavailable(f"the results {root} can't be read: {error}") from None
