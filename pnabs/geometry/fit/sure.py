"""Cells that the grid gives to the shape, or not, without chance.

A cell's centre may be inside by a hundredth of a cell.  Along a slanted side such cells make
a pattern of steps, and boxes that trace it agree better with the grid but not with the shape.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from pnabs.geometry.types import Bool, Float64

_DOUBT = 0.5
"""A cell whose centre is nearer to the surface is in doubt, in cells."""
_ASIDE = 0.75
"""A sample tells of the surface so far about it, in cells."""
_NEIGHBOURS = np.array(
    [[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]
)


def sure_cells(occupancy: Bool, points: Float64, normals: Float64) -> Bool:
    """Cells not within half a cell of a side of the shape; all cells of its thin parts.

    Parameters
    ----------
    occupancy : (G, G, G) bool
    points, normals : (P, 3) float64
        Samples of its surface, in cells.

    Returns
    -------
    (G, G, G) bool
    """
    inner = ndimage.binary_erosion(occupancy)
    thick = ndimage.binary_dilation(inner, np.ones((3, 3, 3), dtype=bool)) & occupancy
    sides = thick | (ndimage.binary_dilation(thick) & ~occupancy)

    cells = np.rint(points)[:, None] + _NEIGHBOURS
    offset = cells - points[:, None]
    height = np.abs(np.einsum("pni,pi->pn", offset, normals))
    aside = np.square(offset).sum(axis=2) - np.square(height)
    close = (height < _DOUBT) & (aside < _ASIDE**2)
    doubtful = np.zeros_like(occupancy)
    within = np.clip(cells[close].astype(np.int64), 0, len(occupancy) - 1)
    doubtful[tuple(within.T)] = True
    return np.asarray(~(doubtful & sides))
