"""Cells in doubt lie along the sides of what is thick, and nowhere else."""

from __future__ import annotations

import numpy as np

from pnabs.geometry import cuboid
from pnabs.geometry.fit.fit import CELL
from pnabs.geometry.fit.sure import sure_cells
from pnabs.geometry.types import GRID_SIDE, Cuboids, grid_points
from tests.geometry.fit.shapes import occupied, surface, upright


def test_doubt_is_within_half_a_cell_of_slanted_sides() -> None:
    box = Cuboids.from_vector(np.array([[0.5, 0.3, 0.4, 0.9, 0.2, 0.3, 0.1, 0, 0, 0]]))
    shape, samples = occupied(box), surface(box, count=40_000).astype(np.float64)
    sure = sure_cells(shape, (samples[:, :3] + GRID_SIDE / 2) / CELL - 0.5, samples[:, 3:])
    depth = np.abs(cuboid.depth(grid_points(64), box)[0].reshape(shape.shape)) / CELL
    assert np.mean(sure[depth > 0.51]) > 0.999  # about edges a sample's plane goes on
    assert np.mean(~sure[depth < 0.4]) > 0.95


def test_all_cells_of_thin_parts_are_sure() -> None:
    sheet = upright(((40, 1, 30), (0, 0.5, 0)))
    shape, samples = occupied(sheet), surface(sheet, count=20_000).astype(np.float64)
    assert shape.sum() == 40 * 30
    sure = sure_cells(shape, (samples[:, :3] + GRID_SIDE / 2) / CELL - 0.5, samples[:, 3:])
    assert sure.all()
