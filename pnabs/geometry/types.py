"""The shared vocabulary: meshes, solids and cuboids as arrays.

Frames: the *normalised frame* has the bounding-box centre of the input at the
origin and its longest side at 1; a 4 x 4 ``transform`` leads back to the
input's coordinates.  Grids are cubes of side `GRID_SIDE` about the origin, x is
the slowest index, and values sit at cell centres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

GRID_SIDE = 1.1
"""Side of the voxel grid in the normalised frame (METHOD, shapes)."""

THETA_D = GRID_SIDE / 32
"""The paper's theta_d: one voxel side of the 32^3 grid, at every resolution."""

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Bool = NDArray[np.bool_]
Signs = NDArray[np.int8]
"""1, or -1 for what is taken turned over."""


@dataclass(frozen=True, slots=True)
class Mesh:
    """A triangle mesh, not necessarily closed, oriented or welded.

    Attributes
    ----------
    vertices : (V, 3) float64
    faces : (F, 3) int64
    """

    vertices: Float64
    faces: Int64

    @property
    def triangles(self) -> Float64:
        """Corner positions, (F, 3, 3) float64."""
        return self.vertices[self.faces]


@dataclass(frozen=True, slots=True)
class Solid:
    """A shape as a solid in the normalised frame.

    Attributes
    ----------
    occupancy : (G, G, G) bool
        Whether a cell centre is inside, thin parts included.
    sdf : (G, G, G) float32
        Signed distance at the cell centres, negative inside, in normalised units.
    """

    occupancy: Bool
    sdf: Float32


@dataclass(frozen=True, slots=True)
class Cuboids:
    """N cuboids; a point u of [-1/2, 1/2]^3 goes to R(rotation) (scale * u) + translation.

    Attributes
    ----------
    scale : (N, 3) float32
        Full side lengths.
    rotation : (N, 4) float32
        Unit quaternions, w first.
    translation : (N, 3) float32
    """

    scale: Float32
    rotation: Float32
    translation: Float32

    def __len__(self) -> int:
        return len(self.scale)

    def __getitem__(self, which: slice | NDArray[np.bool_] | NDArray[np.integer]) -> Cuboids:
        """The cuboids chosen by a slice, a mask or an index array."""
        return Cuboids(self.scale[which], self.rotation[which], self.translation[which])

    def without(self, *indices: int) -> Cuboids:
        """All but some of them.

        Raises
        ------
        IndexError
            When one isn't there.
        """
        kept = np.ones(len(self), dtype=bool)
        kept[list(indices)] = False
        return self[kept]

    def moved(self, index: int, shift: ArrayLike) -> Cuboids:
        """One of them shifted by (3,) in the normalised frame.

        Raises
        ------
        IndexError
            When it isn't there.
        """
        translation = self.translation.copy()
        translation[index] += np.asarray(shift, dtype=np.float32)
        return Cuboids(self.scale, self.rotation, translation)

    def resized(self, index: int, sides: ArrayLike) -> Cuboids:
        """One of them with other full side lengths (3,), non-negative.

        Raises
        ------
        IndexError
            When it isn't there.
        """
        scale = self.scale.copy()
        scale[index] = np.asarray(sides, dtype=np.float32)
        return Cuboids(scale, self.rotation, self.translation)

    def joined(self, other: Cuboids) -> Cuboids:
        """These, and then others."""
        return Cuboids(
            np.concatenate([self.scale, other.scale]),
            np.concatenate([self.rotation, other.rotation]),
            np.concatenate([self.translation, other.translation]),
        )

    def as_vector(self) -> Float32:
        """Parameters side by side, (N, 10) float32: scale, rotation, translation."""
        return np.concatenate([self.scale, self.rotation, self.translation], axis=1)

    @classmethod
    def from_vector(cls, vector: NDArray[np.floating]) -> Cuboids:
        """The inverse of `as_vector`; quaternions are normalised, sides made non-negative."""
        vector = np.asarray(vector, dtype=np.float32).reshape(-1, 10)
        rotation = vector[:, 3:7]
        norm = np.linalg.norm(rotation, axis=1, keepdims=True)
        identity = np.array([[1, 0, 0, 0]], dtype=np.float32)
        safe = np.where(norm > 1e-8, rotation / np.maximum(norm, 1e-8), identity)
        return cls(np.abs(vector[:, :3]), safe.astype(np.float32), vector[:, 7:].copy())

    @classmethod
    def empty(cls) -> Cuboids:
        """No cuboids."""
        return cls.from_vector(np.zeros((0, 10), dtype=np.float32))


def cell_centres(resolution: int) -> Float64:
    """Coordinates of the cell centres along one axis, (G,) float64, normalised frame."""
    steps = np.arange(resolution, dtype=np.float64) + 0.5
    return steps * (GRID_SIDE / resolution) - GRID_SIDE / 2


def grid_points(resolution: int) -> Float64:
    """All cell centres, (G^3, 3) float64, x slowest, normalised frame."""
    axis = cell_centres(resolution)
    grid: Float64 = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    return grid.reshape(-1, 3)
