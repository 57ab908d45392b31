"""Holes in a mesh: their rims, the faces that close them, and which of them are worth closing.

A box without its bottom, or a hull with a face torn out, bounds a solid all the same.  Each
rim is closed by a surface of little area that goes on as the faces beside it do, and the cap
stays where the mesh around it, seen from the cap's inner side, encloses that side: the same
majority of half-rays that makes a voxel solid.  So a lone sheet, a frame, or a seat folded
into a back stay open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pnabs.geometry.kernel import kernel
from pnabs.geometry.patches import Patches
from pnabs.geometry.polygon import LONGEST_EXACT, triangulate
from pnabs.geometry.types import GRID_SIDE, Bool, Float64, Int64, Mesh

CONTINUE = 1.0
"""Weight of a cap's going on as the faces beside it do, in mean lengths of the rim's edges: a
missing triangle of a box is most often one that lay in its neighbour's plane."""

MIN_VOTES = 3
"""Half-rays, of six, that must meet the mesh from its inside for a point to be enclosed."""

PROBES = 8
"""Faces of a cap, at most, from which is looked: its largest."""

PROBE_AREA = 2 * (GRID_SIDE / 128) ** 2
"""Doubled area of a cap that one such face is enough for."""

_STEP = 1e-5
"""How far inward of a cap's face the probe lies, in the normalised frame."""

_SLIVER = 1e-12
"""Doubled area of a face that closes nothing."""

_EMPTY = 1e-12
"""Volume of a patch that encloses nothing."""

_BINS = 64, 1024
"""Bins along a side for few probes, and for as many as there may be."""


@dataclass(frozen=True, slots=True)
class Caps:
    """Faces that close rims.

    Attributes
    ----------
    vertices : (V', 3) float64
        The mesh's vertices, followed by the centroids of long rims.
    faces : (C, 3) int64
        Oriented like the faces around.
    patch : (C,) int64
        Patch whose rim each face closes.
    rim : (C,) int64
        Rim that each face closes, from 0.
    free : (rims,) bool
        Whether an edge of the rim is free.  Where all have two faces or more beyond, patches
        meet there and nothing is missing.
    """

    vertices: Float64
    faces: Int64
    patch: Int64
    rim: Int64
    free: Bool


def close_rims(vertices: Float64, patches: Patches) -> Caps:
    """Faces over every rim of a mesh's patches.

    Parameters
    ----------
    vertices : (V, 3) float64
        Welded.
    patches : Patches
    """
    corners, starts = _rims(patches.mate)
    owner = patches.patch[corners // 3]
    loop = patches.faces.reshape(-1)[corners]
    lengths = np.diff(starts)
    long = np.flatnonzero(lengths > LONGEST_EXACT)
    # a rim of n edges is closed by n - 2 faces, or n about a centroid; one of 2 needs none
    counts = np.where(lengths > LONGEST_EXACT, lengths, np.maximum(lengths - 2, 0))
    centroids = np.full(len(lengths), -1, dtype=np.int64)
    centroids[long] = len(vertices) + np.arange(len(long))
    vertices = np.concatenate(
        [vertices] + [vertices[loop[starts[r] : starts[r + 1]]].mean(axis=0)[None] for r in long]
    )
    faces = np.empty((int(counts.sum()), 3), dtype=np.int64)
    normals = np.cross(*np.moveaxis(np.diff(vertices[patches.faces[corners // 3]], axis=1), 1, 0))
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    _close(vertices, loop, starts, normals, centroids, CONTINUE, faces)
    rim = np.repeat(np.arange(len(lengths)), counts)
    rim_of = np.repeat(np.arange(len(lengths)), lengths)
    free = np.bincount(rim_of, patches.free[corners], len(lengths)) > 0
    # a slit is closed already
    wide = np.flatnonzero(doubled_areas(vertices[faces]) > _SLIVER)
    return Caps(vertices, faces[wide], owner[starts[:-1]][rim[wide]], rim[wide], free)


def enclosed_faces(
    mesh: Mesh, patch: Int64, volume: Float64, flip: Bool, caps: Caps, among_all: bool = False
) -> Bool:
    """Faces of caps that have the inside of their own patch on their inner side, (C,) bool.

    The cap of a rim is judged as a whole.

    Parameters
    ----------
    mesh : Mesh
        The mesh without its caps.
    patch : (F,) int64
    volume : (patches,) float64
        Of the patches with all their caps; a patch without any encloses nothing.
    flip : (patches,) bool
        Patches whose faces look inward.
    caps : Caps
    among_all : bool
        Whether the mesh as a whole must have its inside there too.
    """
    kept = np.zeros(len(caps.faces), dtype=bool)
    worth = np.flatnonzero(caps.free[caps.rim] & (np.abs(volume) > _EMPTY)[caps.patch])
    if len(worth) == 0:
        return kept
    corners = caps.vertices[caps.faces[worth]]
    area = doubled_areas(corners)
    rim, owner = caps.rim[worth], caps.patch[worth]
    total = np.bincount(rim, weights=area)
    wanted = np.clip(np.ceil(total / PROBE_AREA), 1, PROBES)
    order = np.lexsort((-area, rim))
    rank = np.arange(len(order)) - np.searchsorted(rim[order], rim[order])
    order = order[rank < wanted[rim[order]]]
    rim, owner, area, corners = rim[order], owner[order], area[order], corners[order]
    inward = np.cross(corners[:, 2] - corners[:, 0], corners[:, 1] - corners[:, 0])
    inward *= (np.where(flip[owner], -1.0, 1.0) * _STEP / area)[:, None]
    points = corners.mean(axis=1) + inward
    counts = np.zeros((2, len(points), 6), dtype=np.int64)
    signs = np.where(flip, -1, 1)
    for axis in range(3):
        _cast(mesh, patch, signs, points, owner, axis, counts)
    votes = (counts > 0).sum(axis=2) >= MIN_VOTES
    enclosed = votes.all(axis=0) if among_all else votes[0]
    share = np.bincount(rim, weights=area * enclosed) / np.maximum(np.bincount(rim, area), _SLIVER)
    kept[worth] = share[caps.rim[worth]] > 0.5
    return kept


def doubled_areas(corners: Float64) -> Float64:
    """Twice the area of triangles (F, 3, 3), as (F,)."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(np.linalg.norm(normals, axis=1))


@kernel
def _rims(mate: Int64) -> tuple[Int64, Int64]:
    """Half-edges without a mate, chained into rims: half-edges, and where each rim starts.

    From the end of one, the faces around that vertex are turned through until the next.
    """
    count = 0
    for h in range(len(mate)):
        count += mate[h] < 0
    corners = np.empty(count, dtype=np.int64)
    starts = np.empty(count + 1, dtype=np.int64)
    done = np.zeros(len(mate), dtype=np.bool_)
    filled, rims = 0, 0
    for begin in range(len(mate)):
        if mate[begin] >= 0 or done[begin]:
            continue
        starts[rims] = filled
        rims += 1
        h = begin
        while not done[h]:
            done[h] = True
            corners[filled] = h
            filled += 1
            h = h - 2 if h % 3 == 2 else h + 1
            while mate[h] >= 0:
                h = mate[h]
                h = h - 2 if h % 3 == 2 else h + 1
    starts[rims] = filled
    return corners, starts[: rims + 1].copy()


@kernel
def _close(
    vertices: Float64,
    loop: Int64,
    starts: Int64,
    beside: Float64,
    centroids: Int64,
    weight: float,
    faces: Int64,
) -> None:
    """Triangles over each rim: of least cost, or a cone."""
    filled = 0
    for r in range(len(starts) - 1):
        rim = loop[starts[r] : starts[r + 1]]
        n = len(rim)
        if n < 3:
            continue
        if centroids[r] >= 0:
            for i in range(n):
                faces[filled, 0] = rim[(i + 1) % n]
                faces[filled, 1] = rim[i]
                faces[filled, 2] = centroids[r]
                filled += 1
            continue
        # against the rim's direction, as every face on the other side of an edge
        polygon = rim[::-1].copy()
        normals = np.empty((n, 3))
        length = 0.0
        for i in range(n):
            normals[i] = beside[starts[r] + (n - 2 - i) % n]
            a, b = vertices[rim[i]], vertices[rim[(i + 1) % n]]
            length += np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)
        mean = length / n
        triangulate(vertices, polygon, normals, weight * mean, faces[filled : filled + n - 2])
        filled += n - 2


def _cast(
    mesh: Mesh,
    patch: Int64,
    signs: Int64,
    points: Float64,
    owner: Int64,
    axis: int,
    counts: Int64,
) -> None:
    """Count signed crossings of the two half-rays along an axis: own patches', and all."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    bins = int(np.clip(np.sqrt(len(points)), *_BINS))
    cell = np.floor((points[:, [u, v]] / GRID_SIDE + 0.5) * bins).astype(np.int64)
    key = cell.clip(0, bins - 1) @ np.array([bins, 1])
    order = np.argsort(key, kind="stable")
    starts = np.searchsorted(key[order], np.arange(bins * bins + 1))
    _count(
        mesh.vertices, mesh.faces, patch, signs, points, owner, order, starts, bins, axis, counts
    )


@kernel
def _count(
    vertices: Float64,
    faces: Int64,
    patch: Int64,
    signs: Int64,
    points: Float64,
    owner: Int64,
    order: Int64,
    starts: Int64,
    bins: int,
    axis: int,
    counts: Int64,
) -> None:
    u, v = (axis + 1) % 3, (axis + 2) % 3
    for f in range(len(faces)):
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        low_u, high_u = min(a[u], b[u], c[u]), max(a[u], b[u], c[u])
        low_v, high_v = min(a[v], b[v], c[v]), max(a[v], b[v], c[v])
        i_low = min(max(int(np.floor((low_u / GRID_SIDE + 0.5) * bins)), 0), bins - 1)
        i_high = min(max(int(np.floor((high_u / GRID_SIDE + 0.5) * bins)), 0), bins - 1)
        j_low = min(max(int(np.floor((low_v / GRID_SIDE + 0.5) * bins)), 0), bins - 1)
        j_high = min(max(int(np.floor((high_v / GRID_SIDE + 0.5) * bins)), 0), bins - 1)
        for i in range(i_low, i_high + 1):
            for place in range(starts[i * bins + j_low], starts[i * bins + j_high + 1]):
                p = order[place]
                pu, pv = points[p, u], points[p, v]
                if pu < low_u or pu > high_u or pv < low_v or pv > high_v:
                    continue
                ea = (c[u] - b[u]) * (pv - b[v]) - (c[v] - b[v]) * (pu - b[u])
                eb = (a[u] - c[u]) * (pv - c[v]) - (a[v] - c[v]) * (pu - c[u])
                ec = (b[u] - a[u]) * (pv - a[v]) - (b[v] - a[v]) * (pu - a[u])
                total = ea + eb + ec
                if total == 0 or min(ea, eb, ec) < 0 < max(ea, eb, ec):
                    continue
                height = (ea * a[axis] + eb * b[axis] + ec * c[axis]) / total
                # from inside, a ray upward leaves through a front that looks up
                upward = signs[patch[f]] if total > 0 else -signs[patch[f]]
                if height > points[p, axis]:
                    counts[1, p, 2 * axis] += upward
                    if owner[p] == patch[f]:
                        counts[0, p, 2 * axis] += upward
                elif height < points[p, axis]:
                    counts[1, p, 2 * axis + 1] -= upward
                    if owner[p] == patch[f]:
                        counts[0, p, 2 * axis + 1] -= upward
