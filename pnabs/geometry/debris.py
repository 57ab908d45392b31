"""Debris: small pieces that a crop leaves beside the main ones (section 3.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pnabs.geometry.crop import CropResult
from pnabs.geometry.inside import winding_number
from pnabs.geometry.types import Bool, Float64, Int64


@dataclass(frozen=True, slots=True)
class Pieces:
    """The connected pieces of a closed mesh: outer shells, each with its sealed voids.

    Attributes
    ----------
    label : (F,) int64
        The piece each face belongs to.
    area, volume : (K,) float64
    """

    label: Int64
    area: Float64
    volume: Float64

    def __len__(self) -> int:
        return len(self.area)


def find_pieces(result: CropResult) -> Pieces:
    """Split a closed mesh into connected solids.

    A void sealed within a piece is a shell of negative volume without an edge in common
    with the piece's outer shell; it belongs to the smallest shell around it.

    Parameters
    ----------
    result : CropResult

    Returns
    -------
    Pieces
    """
    faces = result.faces
    if not len(faces):
        return Pieces(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0))
    count = len(result.vertices)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    graph = coo_array((np.ones(len(edges), dtype=np.int8), edges.T), shape=(count, count))
    _, of_vertex = connected_components(graph, directed=False)
    _, shell = np.unique(of_vertex[faces[:, 0]], return_inverse=True)

    triangles = result.vertices[faces]
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.bincount(shell, np.linalg.norm(cross, axis=1) / 2)
    volume = np.bincount(shell, np.einsum("fi,fi->f", triangles[:, 0], cross) / 6)

    owner = np.arange(len(area))
    outer = np.flatnonzero(volume > 0)
    for void in np.flatnonzero(volume < 0):
        point = triangles[shell == void][0].mean(axis=0)[None]
        around = [k for k in outer if winding_number(triangles[shell == k], point)[0] > 0.5]
        if around:
            owner[void] = min(around, key=lambda k: volume[k])
    names, piece = np.unique(owner, return_inverse=True)
    return Pieces(
        label=piece[shell].astype(np.int64),
        area=np.bincount(piece, area, minlength=len(names)).astype(np.float64),
        volume=np.bincount(piece, volume, minlength=len(names)).astype(np.float64),
    )


def is_debris(pieces: Pieces, threshold: float) -> Bool:
    """Which pieces have less than `threshold` of the area of all, (K,) bool; never the largest."""
    small = pieces.area < threshold * pieces.area.sum()
    small[np.argmax(pieces.area)] = False
    return np.asarray(small)


def drop_debris(
    result: CropResult, threshold: float
) -> tuple[CropResult, list[dict[str, float]], int]:
    """Leave out the pieces with less than `threshold` of the total surface area.

    The largest piece always stays.

    Parameters
    ----------
    result : CropResult
    threshold : float
        Share of the area of all pieces.

    Returns
    -------
    (CropResult, dropped, pieces_kept)
        `dropped` holds area, share (of the total area) and volume of each piece left out, in
        normalised units, from the largest to the smallest.
    """
    pieces = find_pieces(result)
    if not len(pieces):
        return result, [], 0
    share = pieces.area / pieces.area.sum()
    small = is_debris(pieces, threshold)
    if not small.any():
        return result, [], len(pieces)
    order = np.flatnonzero(small)
    order = order[np.argsort(-pieces.area[order], kind="stable")]
    dropped = [
        {
            "area": float(pieces.area[k]),
            "share": float(share[k]),
            "volume": float(pieces.volume[k]),
        }
        for k in order
    ]
    faces = ~small[pieces.label]
    used, renumbered = np.unique(result.faces[faces], return_inverse=True)
    kept = CropResult(
        result.vertices[used], renumbered.reshape(-1, 3).astype(np.int64), result.source[faces]
    )
    return kept, dropped, int((~small).sum())
