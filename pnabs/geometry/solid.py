"""Oriented meshes to solids on a grid, thin parts included."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pnabs.geometry.columns import ONE_SIDED, inside_votes, trace
from pnabs.geometry.kernel import kernel
from pnabs.geometry.orient import OrientedMesh
from pnabs.geometry.shell import surface_cells
from pnabs.geometry.types import Bool

MIN_VOTES = 3
"""Half-rays, of six, that must say inside."""


@dataclass(frozen=True, slots=True)
class Voxels:
    """A solid on a grid, its thin parts apart.

    Attributes
    ----------
    core : (G, G, G) bool
        Cell centres inside the surface.
    thin : (G, G, G) bool
        Cells that the surface passes where no core cell is among the 26 neighbours:
        sheets, and parts so thin that they hold no cell centre.
    """

    core: Bool
    thin: Bool

    @property
    def occupancy(self) -> Bool:
        """Core and thin parts together, (G, G, G) bool."""
        return self.core | self.thin


def voxelise(prepared: OrientedMesh, resolution: int) -> Bool:
    """The solid at cell centres, (G, G, G) bool; never empty.  See `voxelise_parts`."""
    return voxelise_parts(prepared, resolution).occupancy


def voxelise_parts(prepared: OrientedMesh, resolution: int) -> Voxels:
    """The solid at cell centres, from signed crossings of six half-rays, plus thin parts.

    With `prepared.open` "shell", cells that the outside reaches without passing a cell of the
    surface are not solid, whatever the rays say.

    Parameters
    ----------
    prepared : OrientedMesh
    resolution : int
        Cells along a side of the grid, G.
    """
    signs = np.ones(len(prepared.mesh.faces), dtype=np.int8)
    core = are_inside(inside_votes(trace(prepared.mesh, resolution), signs))
    surface = surface_cells(prepared.mesh, resolution)
    if prepared.open == "shell":
        core &= ~_outside(surface)
    return Voxels(core, _alone(surface, core))


def are_inside(votes: NDArray[np.int8]) -> Bool:
    """Whether enough half-rays say inside, and not just one along each axis.

    Those three are what a point behind a lone slanted sheet gets, however far away it is.
    """
    # a power of two, so the bits below it are the half-rays that say inside
    inside = (votes & (ONE_SIDED - 1)) >= MIN_VOTES
    inside &= votes != 3 * (1 + ONE_SIDED)
    return np.asarray(inside)


@kernel
def _alone(surface: Bool, core: Bool) -> Bool:
    """Cells of the surface with no core cell among themselves and their 26 neighbours."""
    cells = surface.shape[0]
    alone = np.zeros_like(surface)
    for i in range(cells):
        for j in range(cells):
            for k in range(cells):
                if surface[i, j, k] and not _joins(core, i, j, k):
                    alone[i, j, k] = True
    return alone


@kernel
def _joins(core: Bool, i: int, j: int, k: int) -> bool:
    cells = core.shape[0]
    for a in range(max(i - 1, 0), min(i + 2, cells)):
        for b in range(max(j - 1, 0), min(j + 2, cells)):
            for c in range(max(k - 1, 0), min(k + 2, cells)):
                if core[a, b, c]:
                    return True
    return False


def _outside(surface: Bool) -> Bool:
    """Cells joined to the rim of the grid through faces of cells without surface."""
    labels, _ = ndimage.label(~surface)
    # the grid is wider than the normalised shape, so its rim is one outside component
    return np.asarray(labels == labels[0, 0, 0])
