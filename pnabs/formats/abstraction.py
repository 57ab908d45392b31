"""The result for one model: cuboids, and all that makes the mesh from them again."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from pnabs.geometry.check import CheckReport
from pnabs.geometry.solidify import CropRecipe, SolidMesh, SolidResult, make_checked, make_solid
from pnabs.geometry.types import Cuboids, Float64, Mesh


class FormatError(ValueError):
    """A file is not what its format asks for; the message says where and why."""


@dataclass(frozen=True, eq=False)
class Abstraction:
    """A shape as positive cuboids cropped by negative ones.

    Attributes
    ----------
    category, model_id : str
    positives, negatives : Cuboids
        In the normalised frame, as they are cropped.
    transform : (4, 4) float64
        Normalised frame -> the input's coordinates.
    crop : dict
        min_side, jitter, jitter_seed, jitter_attempt (`CropRecipe`).
    debris : dict
        threshold, and dropped: area, share and volume of each piece left out.
    metrics : dict
        What `pnabs.geometry.measure.measure` finds, and counts.
    check : dict
        The findings of `pnabs.geometry.check.check` on the mesh.
    provenance : dict
        What made it: versions, settings, seed.
    levels : dict of int to Abstraction
        Coarser levels of detail: number of boxes at most -> the level.
    origins : list of list of int
        Of a coarser level: for each of its cuboids, positives before negatives, the cuboids of
        the finest level that it stands for.
    """

    category: str
    model_id: str
    positives: Cuboids
    negatives: Cuboids
    transform: Float64
    crop: dict[str, float | int]
    debris: dict[str, Any]
    metrics: dict[str, float | int] = field(default_factory=dict)
    check: dict[str, bool | int] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
    levels: dict[int, Abstraction] = field(default_factory=dict)
    origins: list[list[int]] = field(default_factory=list)

    @classmethod
    def from_solid(
        cls,
        solid: SolidResult,
        *,
        category: str,
        model_id: str,
        positives: Cuboids,
        negatives: Cuboids,
        transform: Float64,
        metrics: dict[str, float | int],
        provenance: dict[str, Any],
    ) -> Abstraction:
        """The abstraction of cuboids that have been cropped; its mesh is not made again.

        Parameters
        ----------
        solid : SolidResult
            What `pnabs.geometry.solidify.solidify` made of the cuboids.
        category, model_id, positives, negatives, transform, metrics, provenance
            As the attributes.
        """
        report: CheckReport = solid.check
        abstraction = cls(
            category=category,
            model_id=model_id,
            positives=positives,
            negatives=negatives,
            transform=transform,
            crop={
                "min_side": solid.recipe.min_side,
                "jitter": solid.recipe.jitter,
                "jitter_seed": solid.recipe.jitter_seed,
                "jitter_attempt": solid.recipe.jitter_attempt,
            },
            debris={"threshold": solid.recipe.debris, "dropped": solid.mesh.dropped},
            metrics=metrics,
            check=report.as_dict(),
            provenance=provenance,
        )
        abstraction.__dict__["solid"] = solid.mesh
        return abstraction

    @property
    def recipe(self) -> CropRecipe:
        """How the mesh is made from the cuboids."""
        return CropRecipe(
            min_side=float(self.crop["min_side"]),
            jitter=float(self.crop["jitter"]),
            jitter_seed=int(self.crop["jitter_seed"]),
            jitter_attempt=int(self.crop["jitter_attempt"]),
            debris=float(self.debris["threshold"]),
        )

    @cached_property
    def solid(self) -> SolidMesh:
        """The cropped mesh in the normalised frame, made again from the cuboids."""
        return make_solid(self.positives, self.negatives, self.recipe)

    def edited(
        self, *, positives: Cuboids | None = None, negatives: Cuboids | None = None
    ) -> Abstraction:
        """The abstraction with other cuboids, cropped and checked anew, without coarser levels.

        Its metrics are counts alone: distances and overlaps need the shape.

        Parameters
        ----------
        positives, negatives : Cuboids, optional
            In the normalised frame; as they are where left out.

        Raises
        ------
        ValueError
            When a number is not finite, or a side negative.
        """
        positives = self.positives if positives is None else positives
        negatives = self.negatives if negatives is None else negatives
        for name, cuboids in (("positives", positives), ("negatives", negatives)):
            sound = np.isfinite(cuboids.as_vector()).all(axis=1) & (cuboids.scale >= 0).all(axis=1)
            if not sound.all():
                raise ValueError(
                    f"{name}: cuboid {int(np.argmin(sound))} has a side that is negative, or a "
                    "number that is not finite"
                )
        solid = make_checked(positives, negatives, replace(self.recipe, jitter_attempt=0))
        counts: dict[str, float | int] = {
            "positives": len(positives),
            "negatives": len(negatives),
            "faces": len(solid.mesh.faces),
            "bodies": solid.mesh.pieces,
            "pieces_dropped": len(solid.mesh.dropped),
            "jitter_attempt": solid.recipe.jitter_attempt,
        }
        return Abstraction.from_solid(
            solid,
            category=self.category,
            model_id=self.model_id,
            positives=positives,
            negatives=negatives,
            transform=self.transform,
            metrics=counts,
            provenance={**_without(self.provenance, "fingerprint"), "edited": True},
        )

    def mesh(self) -> Mesh:
        """The closed mesh in the input's coordinates: `solid`, placed by `transform`."""
        vertices = self.solid.vertices.astype(np.float64)
        placed = vertices @ self.transform[:3, :3].T + self.transform[:3, 3]
        return Mesh(placed, self.solid.faces.astype(np.int64))

    def save(self, path: str | Path) -> None:
        """Write it in the format that the file's suffix names, and its coarser levels beside it.

        Parameters
        ----------
        path : str or Path
            Ends in the suffix of one of `pnabs.formats.FORMATS`, such as `.json`, `.glb`,
            `.parts.glb`, `.urdf`.  What the format needs beside that file is written beside it.
            The level of 8 boxes of `chair.glb` is `chair.level8.glb`; `.json` holds all levels.

        Raises
        ------
        ValueError
            No format has this suffix.
        """
        # The writers take this class, so the registry can't be known before it.
        from pnabs.formats.registry import FORMATS, format_of, written

        path = Path(path)
        name, stem = format_of(path)
        files = written(self, [name], stem)
        own = files.popitem()[1]
        if FORMATS[name].beside:
            shutil.rmtree(path.with_name(stem + FORMATS[name].beside), ignore_errors=True)
        for beside, data in files.items():
            place = path.parent / beside
            place.parent.mkdir(exist_ok=True)
            place.write_bytes(data)
        path.write_bytes(own)


def _without(values: dict[str, Any], name: str) -> dict[str, Any]:
    return {key: value for key, value in values.items() if key != name}
