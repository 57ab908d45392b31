"""Training data in memory, packed, and the batches drawn from it."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor

from pnabs import settings
from pnabs.geometry.types import GRID_SIDE
from pnabs.model import cuboids

RESOLUTION = 32
"""Cells along a side of the training grid."""


@dataclass(frozen=True, slots=True)
class Batch:
    """What one training step sees; all float32 unless said, normalised frame.

    Attributes
    ----------
    occupancy : (B, 1, 32, 32, 32)
        The network's input: the solid, or the pre-processed V_delta.
    sdf : (B, 1, 32, 32, 32)
        Its signed distances.
    points : (B, P, 3)
        Its samples for L_fit2, half surface and half interior.
    cells : (B, K, 3)
        Cell centres for the occupancy loss, half of them near the surface.
    inside : (B, K)
        Whether each of those is occupied, 0 or 1.
    mirror : (B,) int64
        Normal of its mirror plane, -1 for none.
    shape_interior : (B, Q, 3) or None
        Interior of the original solid, for L_sep.
    """

    occupancy: Tensor
    sdf: Tensor
    points: Tensor
    cells: Tensor
    inside: Tensor
    mirror: Tensor
    shape_interior: Tensor | None = None

    def to(self, device: torch.device | str) -> Batch:
        """The same batch on another device."""
        values: dict[str, Any] = {field.name: getattr(self, field.name) for field in fields(self)}
        moved: dict[str, Any] = {k: v if v is None else v.to(device) for k, v in values.items()}
        return replace(self, **moved)


@dataclass(frozen=True, slots=True)
class TrainingSet:
    """n shapes, packed to about 100 kB each; row i of every array is shape i.

    Attributes
    ----------
    occupancy : (n, 4096) uint8
        Bits of the 32^3 grid as of `numpy.packbits`, x slowest.
    sdf : (n, 32, 32, 32) float16
    surface : (n, P, 3) float16
    interior : (n, Q, 3) float16
    mirror : (n,) int8
        Normal of the mirror plane: 0, 1, 2, or -1 for none.
    shape_interior : (n, R, 3) float16 or None
        Interior of the original solids; the negative module needs it.
    """

    occupancy: NDArray[np.uint8]
    sdf: NDArray[np.float16]
    surface: NDArray[np.float16]
    interior: NDArray[np.float16]
    mirror: NDArray[np.int8]
    shape_interior: NDArray[np.float16] | None = None

    def __post_init__(self) -> None:
        count = len(self.occupancy)
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None and len(value) != count:
                raise ValueError(f"{field.name} has {len(value)} rows, occupancy {count}")

    def __len__(self) -> int:
        return len(self.occupancy)

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        arrays = (getattr(self, field.name) for field in fields(self))
        return sum(array.nbytes for array in arrays if array is not None)

    def mean_occupancy(self) -> NDArray[np.float64]:
        """Mean of the shapes' occupancies, (32, 32, 32)."""
        total = np.zeros(RESOLUTION**3)
        for start in range(0, len(self), 1024):
            total += np.unpackbits(self.occupancy[start : start + 1024], axis=1).sum(axis=0)
        return (total / max(len(self), 1)).reshape(RESOLUTION, RESOLUTION, RESOLUTION)

    def occupancies(self) -> NDArray[np.bool_]:
        """The shapes' grids, (n, 32, 32, 32)."""
        bits = np.unpackbits(self.occupancy, axis=1).astype(bool)
        return bits.reshape(-1, RESOLUTION, RESOLUTION, RESOLUTION)

    def batch(
        self,
        indices: NDArray[np.int64],
        training: settings.Training,
        generator: torch.Generator,
    ) -> Batch:
        """The shapes `indices` (B,) with freshly drawn samples.

        `training` gives the numbers of samples and whether shapes are mirrored at random across
        their own plane, turned and stretched.  The draws depend on the generator alone.
        """
        count = len(indices)
        occupancy = np.unpackbits(self.occupancy[indices], axis=1)
        half = training.shape_samples // 2
        surface = _draw(self.surface, indices, training.shape_samples - half, generator)
        interior = _draw(self.interior, indices, half, generator)
        near = _draw(self.surface, indices, training.occupancy_samples // 2, generator)
        cells, inside = _cells(occupancy, near, training.occupancy_samples, generator)
        shape_interior = None
        if self.shape_interior is not None:
            shape_interior = _draw(self.shape_interior, indices, training.shape_samples, generator)
        grid = (count, 1, RESOLUTION, RESOLUTION, RESOLUTION)
        batch = Batch(
            occupancy=torch.from_numpy(occupancy.astype(np.float32)).view(grid),
            sdf=torch.from_numpy(self.sdf[indices].astype(np.float32)).view(grid),
            points=torch.cat([surface, interior], dim=1),
            cells=cells,
            inside=inside,
            mirror=torch.from_numpy(self.mirror[indices].astype(np.int64)),
            shape_interior=shape_interior,
        )
        if training.mirror_augment:
            flip = torch.rand(count, generator=generator) < 0.5
            batch = mirrored(batch, torch.where(flip, batch.mirror, -1))
        if training.turn or training.stretch:
            draw = torch.rand((count, 4), generator=generator) * 2 - 1
            draw *= (torch.rand((count, 1), generator=generator) < 0.5).float()
            batch = turned(batch, training.turn * draw[:, 0], 1 + training.stretch * draw[:, 1:])
        return batch


def mirrored(batch: Batch, axis: Tensor) -> Batch:
    """The batch with each shape mirrored across the plane with normal `axis` (B,), -1 for none."""
    occupancy, sdf = batch.occupancy.clone(), batch.sdf.clone()
    for normal in range(3):
        rows = axis == normal
        occupancy[rows] = batch.occupancy[rows].flip(2 + normal)
        sdf[rows] = batch.sdf[rows].flip(2 + normal)
    interior = batch.shape_interior
    return Batch(
        occupancy=occupancy,
        sdf=sdf,
        points=cuboids.mirror_points(batch.points, axis),
        cells=cuboids.mirror_points(batch.cells, axis),
        inside=batch.inside,
        mirror=batch.mirror,
        shape_interior=None if interior is None else cuboids.mirror_points(interior, axis),
    )


def turned(batch: Batch, degrees: Tensor, stretch: Tensor) -> Batch:
    """The batch with each shape stretched along the axes, then turned about the up axis, +Y.

    Stretched shapes are scaled so that their farthest coordinate stays as far; what a turn takes
    out of the grid is lost.  Signed distances stay those of before, which is exact for turns.

    Parameters
    ----------
    degrees : (B,)
    stretch : (B, 3)
        Factors along x, y and z.
    """
    rows = torch.nonzero((degrees != 0) | (stretch != 1).any(dim=1)).squeeze(1)
    if not len(rows):
        return batch
    angle = torch.deg2rad(degrees[rows])
    cos, sin, zero, one = angle.cos(), angle.sin(), torch.zeros_like(angle), torch.ones_like(angle)
    turn = torch.stack([cos, zero, sin, zero, one, zero, -sin, zero, cos], -1).view(-1, 3, 3)
    farthest = batch.points[rows].abs().amax(dim=1)
    longest = farthest.amax(dim=1, keepdim=True)
    factors = stretch[rows]
    factors = factors * longest / (farthest * factors).amax(dim=1, keepdim=True)
    forth = turn * factors.unsqueeze(1)
    # grid_sample takes, for each place of the result, that of the source, last axis first.
    back = torch.linalg.inv(forth).flip(1, 2)
    axis = (torch.arange(RESOLUTION) + 0.5) * (2 / RESOLUTION) - 1
    x, y, z = (back[:, :, k, None] * axis for k in range(3))
    # A sum of planes, a coordinate after the other: a fortieth of affine_grid's time.
    grid = (z[:, :, :, None, None] + y[:, :, None, :, None] + x[:, :, None, None]).movedim(1, -1)
    fields = torch.cat([batch.occupancy[rows], batch.sdf[rows]], dim=1)
    fields = F.grid_sample(fields, grid, padding_mode="border", align_corners=False)
    occupancy, sdf, inside = batch.occupancy.clone(), batch.sdf.clone(), batch.inside.clone()
    occupancy[rows], sdf[rows] = (fields[:, :1] >= 0.5).float(), fields[:, 1:]
    cells = ((batch.cells[rows] / GRID_SIDE + 0.5) * RESOLUTION).long()
    flat = (cells[..., 0] * RESOLUTION + cells[..., 1]) * RESOLUTION + cells[..., 2]
    inside[rows] = occupancy[rows].flatten(1).gather(1, flat)

    def moved(points: Tensor) -> Tensor:
        out = points.clone()
        out[rows] = points[rows] @ forth.transpose(1, 2)
        return out

    interior = batch.shape_interior
    return Batch(
        occupancy=occupancy,
        sdf=sdf,
        points=moved(batch.points),
        cells=batch.cells,
        inside=inside,
        # A turned shape's mirror plane isn't along the axes.
        mirror=torch.where(degrees == 0, batch.mirror, -1),
        shape_interior=None if interior is None else moved(interior),
    )


def _draw(
    points: NDArray[np.float16], rows: NDArray[np.int64], count: int, generator: torch.Generator
) -> Tensor:
    """`count` of each row's points, with replacement, (B, count, 3) float32."""
    columns = torch.randint(points.shape[1], (len(rows), count), generator=generator).numpy()
    return torch.from_numpy(points[rows[:, None], columns].astype(np.float32))


def _cells(
    occupancy: NDArray[np.uint8], near: Tensor, count: int, generator: torch.Generator
) -> tuple[Tensor, Tensor]:
    """Cell centres (B, count, 3), uniform ones and neighbours of surface points, and their bits."""
    rows, size = len(occupancy), GRID_SIDE / RESOLUTION
    around = ((near + GRID_SIDE / 2) / size).floor().long()
    around += torch.randint(-1, 2, around.shape, generator=generator)
    shape = (rows, count - near.shape[1], 3)
    uniform = torch.randint(RESOLUTION, shape, generator=generator)
    cells = torch.cat([around.clamp_(0, RESOLUTION - 1), uniform], dim=1)
    flat = (cells[..., 0] * RESOLUTION + cells[..., 1]) * RESOLUTION + cells[..., 2]
    bits = torch.from_numpy(occupancy).gather(1, flat)
    return (cells + 0.5) * size - GRID_SIDE / 2, bits.float()
