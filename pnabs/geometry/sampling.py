"""Points on a solid's surface, with normals, and in its interior."""

from __future__ import annotations

import numpy as np

from pnabs.geometry.orient import OrientedMesh
from pnabs.geometry.solid import voxelise_parts
from pnabs.geometry.types import GRID_SIDE, Bool, Float32, Float64, Int64

CORE_RESOLUTION = 64
"""Grid on which a sample's two sides are looked up."""

_ROUNDS = 4
_MAX_FACTOR = 16


def sample_surface(
    prepared: OrientedMesh, n: int, rng: np.random.Generator, core: Bool | None = None
) -> Float32:
    """Points on the solid's outer surface, uniform by area, with normals out of the solid.

    Walls buried in the solid, with solid on either side, get no points.  Where neither side
    is solid the part is thinner than a cell: a closed part keeps its own normals, a sheet
    gets normals to either side, by chance.  Points are in random order, so that any first
    few of them are a sample too.

    Parameters
    ----------
    prepared : OrientedMesh
    n : int
    rng : numpy.random.Generator
    core : (G, G, G) bool, optional
        Core cells of the solid (`pnabs.geometry.solid.Voxels`), if they are known already;
        made at `CORE_RESOLUTION` otherwise.

    Returns
    -------
    (n, 6) float32
        Positions and unit normals, normalised frame.
    """
    if core is None:
        core = voxelise_parts(prepared, CORE_RESOLUTION).core
    triangles, normals = prepared.mesh.triangles, prepared.normals
    wanted = n
    for _ in range(_ROUNDS):
        points, face = draw_on_triangles(triangles, wanted, rng)
        upper, lower = _sides(points, normals[face], core)
        kept = np.flatnonzero(~(upper & lower))
        if len(kept) >= n or wanted >= _MAX_FACTOR * n:
            break
        wanted = min(int(np.ceil(1.2 * wanted * n / max(len(kept), 1))), _MAX_FACTOR * n)
    if len(kept) < n:
        # hardly any surface is open to the outside on this grid: buried points must fill up
        buried = np.flatnonzero(upper & lower)
        kept = np.concatenate([kept, rng.permutation(buried)[: n - len(kept)]])
    chosen = rng.permutation(kept)[:n]
    points, face = points[chosen], face[chosen]
    upper, lower = upper[chosen], lower[chosen]
    sign = np.where(upper & ~lower, -1.0, 1.0)
    thin = ~upper & ~lower
    if thin.any():
        sheet = thin & prepared.open_faces()[face]
        sign[sheet] = rng.choice([-1.0, 1.0], size=np.count_nonzero(sheet))
    return np.concatenate([points, sign[:, None] * normals[face]], axis=1).astype(np.float32)


def draw_on_triangles(
    triangles: Float64, n: int, rng: np.random.Generator
) -> tuple[Float64, Int64]:
    """Points uniform by area, one in each of n strata of equal area in the faces' order.

    Parameters
    ----------
    triangles : (F, 3, 3) float64
        At least one of non-zero area.

    Returns
    -------
    points : (n, 3) float64
    face : (n,) int64
        The triangle of each point, ascending.
    """
    a, b, c = np.moveaxis(triangles, 1, 0)
    cumulated = np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1))
    target = (np.arange(n) + rng.random(n)) * (cumulated[-1] / n)
    # rounding may put the last target at the very end; faces without area are never hit
    last = int(np.searchsorted(cumulated, cumulated[-1], side="left"))
    face = np.minimum(np.searchsorted(cumulated, target, side="right"), last)
    root, share = np.sqrt(rng.random((n, 1))), rng.random((n, 1))
    points = (1 - root) * a[face] + root * (1 - share) * b[face] + root * share * c[face]
    return points, face


def sample_interior(occupancy: Bool, n: int, rng: np.random.Generator) -> Float32:
    """Points uniform in the occupied cells, (n, 3) float32, normalised frame.

    Cells are drawn in strata, so that they share the points as evenly as can be.

    Parameters
    ----------
    occupancy : (G, G, G) bool
        With at least one occupied cell.
    """
    cells = np.argwhere(occupancy)
    if len(cells) == 0:
        raise ValueError("no cell of the solid is occupied, so its interior has no points")
    stratum = (np.arange(n) + rng.random(n)) * (len(cells) / n)
    chosen = cells[np.minimum(stratum.astype(np.int64), len(cells) - 1)]
    points = (chosen + rng.random((n, 3))) * (GRID_SIDE / len(occupancy)) - GRID_SIDE / 2
    return rng.permutation(points).astype(np.float32)


def _sides(points: Float64, normals: Float64, core: Bool) -> tuple[Bool, Bool]:
    """Whether there is solid on the normal's side of each point, and on the other, (n,) bool.

    Looked up half a cell away, and a whole cell where that doesn't tell the sides apart.
    """
    cell = GRID_SIDE / len(core)
    upper = _lookup(points + 0.5 * cell * normals, core)
    lower = _lookup(points - 0.5 * cell * normals, core)
    same = np.flatnonzero(upper == lower)
    further = cell * normals[same]
    upper[same] = _lookup(points[same] + further, core)
    lower[same] = _lookup(points[same] - further, core)
    return upper, lower


def has_core_beside(triangles: Float64, normals: Float64, core: Bool) -> Bool:
    """Whether solid lies on either side of the middle of each triangle, (F,) bool.

    Parameters
    ----------
    triangles : (F, 3, 3) float64
    normals : (F, 3) float64
    core : (G, G, G) bool
    """
    upper, lower = _sides(triangles.mean(axis=1), normals, core)
    return np.asarray(upper | lower)


def _lookup(points: Float64, cells: Bool) -> Bool:
    """A grid's values at points, (P,) bool; beyond the grid those of the nearest cell."""
    cell = GRID_SIDE / len(cells)
    index = np.floor((points + GRID_SIDE / 2) / cell).astype(np.int64).clip(0, len(cells) - 1)
    return np.asarray(cells[index[:, 0], index[:, 1], index[:, 2]])


def near_to(points: Float64, cells: Bool) -> Bool:
    """Whether a point's own cell or one of its 26 neighbours is set, (P,) bool."""
    side = len(cells)
    index = np.floor((points + GRID_SIDE / 2) * (side / GRID_SIDE)).astype(np.int64)
    index = index.clip(1, side - 2)
    first = (index[:, 0] * side + index[:, 1]) * side + index[:, 2]
    offset = np.arange(-1, 2)
    around = ((offset[:, None, None] * side + offset[:, None]) * side + offset).reshape(-1)
    return np.asarray(cells.reshape(-1)[first[:, None] + around].any(axis=1))
