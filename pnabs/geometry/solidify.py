"""From cuboids to the checked mesh: crop, leave out debris, check, and if need be again.

METHOD, "Abstraction" steps 3 to 5; section 3.4 of the paper.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pnabs import settings
from pnabs.geometry.check import CheckReport, check
from pnabs.geometry.crop import crop, to_float32_mesh
from pnabs.geometry.debris import drop_debris
from pnabs.geometry.types import Cuboids, Float32, Float64

MAX_JITTER_ATTEMPTS = 3
"""Crops made again after a failed check; two sufficed in all of 700 hard cases."""


@dataclass(frozen=True, slots=True)
class CropRecipe:
    """All that a crop depends on beside its cuboids; with it the mesh is made again exactly.

    Attributes
    ----------
    min_side : float
        Cuboids with a shorter side are left out.
    jitter : float
        Size of the random change of each cuboid where `jitter_attempt` is not 0.
    jitter_seed, jitter_attempt : int
        Seed of the random change; attempt 0 changes nothing.
    debris : float
        Pieces below this share of the area are dropped.
    """

    min_side: float
    jitter: float
    jitter_seed: int
    jitter_attempt: int
    debris: float

    def options(self) -> dict[str, Any]:
        """Keyword arguments of `pnabs.geometry.crop.crop` and `placed`, with fresh randomness."""
        if not self.jitter_attempt:
            return {"min_side": self.min_side}
        rng = np.random.default_rng([self.jitter_seed, self.jitter_attempt])
        return {"min_side": self.min_side, "jitter": self.jitter, "rng": rng}


@dataclass(frozen=True, slots=True)
class SolidMesh:
    """A cropped mesh as it is written, in the normalised frame.

    Attributes
    ----------
    vertices : (V, 3) float32
    faces : (F, 3) int32
        Outward.
    source : (F,) int32
        Index of the positive that each face belongs to.
    dropped : list of {area, share, volume}
        The debris left out.
    pieces : int
        Connected solids kept.
    """

    vertices: Float32
    faces: NDArray[np.int32]
    source: NDArray[np.int32]
    dropped: list[dict[str, float]]
    pieces: int

    @property
    def is_empty(self) -> bool:
        """Whether the negatives took everything, or there was nothing."""
        return len(self.faces) == 0

    @property
    def triangles(self) -> Float64:
        """Corner positions, (F, 3, 3) float64."""
        return self.vertices.astype(np.float64)[self.faces]


@dataclass(frozen=True, slots=True)
class SolidResult:
    """A cropped mesh with its verdict and with what makes it again."""

    mesh: SolidMesh
    check: CheckReport
    recipe: CropRecipe

    @property
    def is_empty(self) -> bool:
        """Whether nothing is left; such a result is not ok."""
        return self.mesh.is_empty


def make_solid(positives: Cuboids, negatives: Cuboids, recipe: CropRecipe) -> SolidMesh:
    """Crop and drop debris by a recipe; the same cuboids and recipe give the same mesh.

    Parameters
    ----------
    positives, negatives : Cuboids
    recipe : CropRecipe

    Returns
    -------
    SolidMesh
    """
    cropped = crop(positives, negatives, **recipe.options())
    kept, dropped, pieces = drop_debris(cropped, recipe.debris)
    vertices, faces = to_float32_mesh(kept)
    return SolidMesh(vertices, faces, kept.source.astype(np.int32), dropped, pieces)


def solidify(
    positives: Cuboids,
    negatives: Cuboids,
    options: settings.Abstract,
    rng: np.random.Generator,
    extent: Float64 | None = None,
) -> SolidResult:
    """The checked mesh of an abstraction.

    A result that fails its check is made again, at most three times, with each cuboid
    changed at random by `options.jitter`: sides that touch or coincide are what fails, and
    a change far below a voxel parts them.  Never raises for degenerate cuboids.

    Parameters
    ----------
    positives, negatives : Cuboids
    options : settings.Abstract
    rng : numpy.random.Generator
        Gives the seed of the changes; one number is drawn, whether it is needed or not.
    extent : (3,) float64, optional
        Sides of the input's bounding box, which the check holds the result against.

    Returns
    -------
    SolidResult
        The first that passes, or the last.  Empty, and not ok, if nothing is left.
    """
    seed = int(rng.integers(2**32))
    recipe = CropRecipe(options.min_side, options.jitter, seed, 0, options.debris)
    return make_checked(positives, negatives, recipe, extent)


def make_checked(
    positives: Cuboids, negatives: Cuboids, recipe: CropRecipe, extent: Float64 | None = None
) -> SolidResult:
    """`solidify` by a recipe; its `jitter_attempt` is the first."""
    while True:
        mesh = make_solid(positives, negatives, recipe)
        report = check(mesh.vertices, mesh.faces, extent)
        # No random change brings a box back that lies where it shouldn't.
        if report.is_sound or mesh.is_empty or recipe.jitter_attempt == MAX_JITTER_ATTEMPTS:
            return SolidResult(mesh, report, recipe)
        recipe = replace(recipe, jitter_attempt=recipe.jitter_attempt + 1)
