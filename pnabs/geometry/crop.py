"""Cropping: the union of the positives minus the union of the negatives, as one closed mesh.

METHOD, "Abstraction" step 3; section 3.4 of the paper.  manifold3d gives an exact, closed
boolean of meshes; it is asked once, for the whole expression.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from manifold3d import Error, Manifold
from numpy.typing import NDArray

from pnabs.geometry import cuboid, quaternion
from pnabs.geometry.manifolds import difference, face_origins, to_arrays, unit_cube
from pnabs.geometry.types import Bool, Cuboids, Float32, Float64, Int64


@dataclass(frozen=True, slots=True)
class CropResult:
    """A closed mesh, outward faces, whose faces know the positive they belong to.

    Attributes
    ----------
    vertices : (V, 3) float64
    faces : (F, 3) int64
    source : (F,) int64
        Index of a positive: the one whose side a face lies on, or for a face that a
        negative cut, the one it was cut into (the deepest around the face's centre).
    """

    vertices: Float64
    faces: Int64
    source: Int64

    @property
    def is_empty(self) -> bool:
        """Whether nothing is left."""
        return len(self.faces) == 0

    @classmethod
    def nothing(cls) -> CropResult:
        """The empty result."""
        none = np.zeros((0, 3), dtype=np.int64)
        return cls(np.zeros((0, 3)), none, none[:, 0])


@dataclass(frozen=True, slots=True)
class Boxes:
    """Cuboids as they are cropped.

    Attributes
    ----------
    scale : (N, 3) float64
        Full side lengths.
    rotation : (N, 4) float64
        Unit quaternions, w first.
    translation : (N, 3) float64
    index : (N,) int64
        Of each in the set that they were chosen from.
    """

    scale: Float64
    rotation: Float64
    translation: Float64
    index: Int64

    def __getitem__(self, row: int) -> Boxes:
        """One of them, as a set."""
        one = slice(row, row + 1)
        return Boxes(self.scale[one], self.rotation[one], self.translation[one], self.index[one])

    @property
    def axes(self) -> Float64:
        """Rotation matrices, (N, 3, 3): columns are the boxes' own axes."""
        return quaternion.to_matrix(self.rotation)

    def solids(self) -> list[Manifold]:
        """Each as a manifold with an id of its own."""
        unit = unit_cube()
        matrices = self.axes * self.scale[:, None, :]
        placed = np.concatenate([matrices, self.translation[:, :, None]], axis=2)
        return [unit.transform(matrix).as_original() for matrix in placed]


def croppable(cuboids: Cuboids, min_side: float) -> Bool:
    """Which cuboids take part in a crop, (N,) bool: finite, no side shorter than `min_side`.

    Thinner ones stay in a boolean as slivers of zero area.
    """
    finite = np.all(np.isfinite(cuboids.as_vector()), axis=1)
    return np.asarray(finite & np.all(np.abs(cuboids.scale) >= min_side, axis=1))


def placed(
    positives: Cuboids,
    negatives: Cuboids,
    *,
    min_side: float,
    jitter: float = 0.0,
    rng: np.random.Generator | None = None,
) -> tuple[Boxes, Boxes]:
    """Positives and negatives as they are cropped.

    Parameters
    ----------
    positives, negatives : Cuboids
        Those not finite or with a side shorter than `min_side` are left out.
    min_side : float
        In normalised units.
    jitter : float
        Each cuboid is turned by about that many radians, shifted and grown by about that
        length, at random: sides that coincide no longer do.
    rng : numpy.random.Generator, optional
        Needed with jitter alone.

    Raises
    ------
    ValueError
        Jitter without `rng`.
    """
    if jitter and rng is None:
        raise ValueError("a crop with jitter needs a random generator: pass rng")
    added = _boxes(positives, min_side, jitter, rng)
    return added, _boxes(negatives, min_side, jitter, rng)


def crop(
    positives: Cuboids,
    negatives: Cuboids,
    *,
    min_side: float,
    jitter: float = 0.0,
    rng: np.random.Generator | None = None,
) -> CropResult:
    """The exact boolean C+ - C- (section 3.4).

    Parameters
    ----------
    positives, negatives, min_side, jitter, rng
        As `placed`.

    Returns
    -------
    CropResult
        Empty if there is no positive left, or if the negatives leave nothing of them.

    Raises
    ------
    ValueError
        Jitter without `rng`.
    """
    added, removed = placed(positives, negatives, min_side=min_side, jitter=jitter, rng=rng)
    if not len(added.index):
        return CropResult.nothing()
    solids = added.solids()
    result = difference(solids, removed.solids())
    if result.status() != Error.NoError or result.is_empty():
        return CropResult.nothing()

    vertices, faces = to_arrays(result)
    ids = face_origins(result)
    source = np.full(len(faces), -1, dtype=np.int64)
    for solid, index in zip(solids, added.index, strict=True):
        source[ids == solid.original_id()] = index
    cut_faces = source < 0
    source[cut_faces] = _deepest(vertices[faces[cut_faces]].mean(axis=1), positives, added.index)
    return CropResult(vertices, faces, source)


def to_float32_mesh(result: CropResult) -> tuple[Float32, NDArray[np.int32]]:
    """What is written: vertices (V, 3) float32 and faces (F, 3) int32."""
    return result.vertices.astype(np.float32), result.faces.astype(np.int32)


def _boxes(
    cuboids: Cuboids, min_side: float, jitter: float, rng: np.random.Generator | None
) -> Boxes:
    index = np.flatnonzero(croppable(cuboids, min_side))
    chosen = cuboids[index]
    scale = np.abs(chosen.scale.astype(np.float64))
    rotation = quaternion.normalise(chosen.rotation)
    translation = chosen.translation.astype(np.float64)
    if jitter and rng is not None:
        moves = jitter * rng.uniform(-1, 1, size=(len(index), 3, 3))
        scale = np.maximum(scale + moves[:, 0], min_side)
        rotation = quaternion.multiply(quaternion.from_rotation_vector(moves[:, 1]), rotation)
        translation = translation + moves[:, 2]
    return Boxes(scale, rotation, translation, index)


def _deepest(points: Float64, positives: Cuboids, index: Int64) -> Int64:
    """Index of the positive that each point lies deepest in, (P,)."""
    if not len(points):
        return np.zeros(0, dtype=np.int64)
    deepest = np.argmin(cuboid.depth(points, positives[index]), axis=0)
    return np.asarray(index[deepest])
