"""Soup to oriented mesh: which side of every face looks out of the solid, and what is missing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pnabs.geometry.columns import Columns, trace
from pnabs.geometry.disorder import disorder, settle
from pnabs.geometry.holes import Caps, close_rims, enclosed_faces
from pnabs.geometry.patches import join
from pnabs.geometry.types import Bool, Float64, Int64, Mesh, Signs
from pnabs.geometry.visibility import patch_votes
from pnabs.geometry.weld import weld

Open = Literal["fill", "shell"]

CLEAR_VOTE = 1.5
"""An open patch is turned by what is seen of it only if one side is seen so many times as often."""

JUDGE_RESOLUTION = 32
"""Grid along whose columns orientations are compared."""

TOLERANCE = 0.02
"""The file's own orientation stands if its disorder is at most this share of the length of line
inside the patches more than that of the orientation found."""


@dataclass(frozen=True, slots=True)
class OrientedMesh:
    """A welded mesh whose faces look out of the solid; made once, used at every resolution.

    Attributes
    ----------
    mesh : Mesh
        In the normalised frame; the faces that close holes come last.
    patch : (F,) int64
        Consistently oriented manifold patch of each face, from 0.
    open : "fill" or "shell"
        Whether what an open tube or shade surrounds is solid.
    """

    mesh: Mesh
    patch: Int64
    open: Open = "fill"

    @property
    def normals(self) -> Float64:
        """Unit face normals, (F, 3) float64."""
        a, b, c = np.moveaxis(self.mesh.triangles, 1, 0)
        normals = np.cross(b - a, c - a)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.asarray(normals / np.where(length > 0, length, 1.0))

    def open_faces(self) -> Bool:
        """Faces whose patch has a free edge, one that no other face shares, (F,) bool."""
        faces = self.mesh.faces
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        key = edges[:, 0] * np.int64(len(self.mesh.vertices)) + edges[:, 1]
        _, index, count = np.unique(key, return_inverse=True, return_counts=True)
        free = (count[index] == 1).reshape(-1, 3).any(axis=1)
        open_patch = np.zeros(int(self.patch.max()) + 1, dtype=bool)
        open_patch[self.patch[free]] = True
        return np.asarray(open_patch[self.patch])


def prepare(mesh: Mesh, open: Open = "fill") -> OrientedMesh:
    """Weld a soup, orient its faces, and close its holes.

    Patches that are closed, or whose holes all have their own inside behind them, look outward
    if their volume is positive; others are turned so that what is seen of them from outside is
    their front.  Then patches that leave the columns of the grid less than outside are turned
    over.  The file's own orientation stands where it is hardly worse: then somebody modelled
    it with care, cavities included.

    Parameters
    ----------
    mesh : Mesh
        In the normalised frame, at least one face of non-zero area.
    open : "fill" or "shell"
        Whether what an open tube or shade surrounds is solid, its ends closed.

    Raises
    ------
    pnabs.geometry.load.InvalidMeshError
        If too many large faces lie over each other (`pnabs.geometry.columns.MAX_HITS`).
    """
    welded = weld(mesh)
    patches = join(welded.faces)
    patch = patches.patch
    oriented = Mesh(welded.vertices, patches.faces)
    caps = close_rims(welded.vertices, patches)
    volume = _patch_volumes(*_with_caps(oriented, patch, caps, np.ones(len(caps.faces), bool)))

    flip = volume < 0
    kept = enclosed_faces(oriented, patch, volume, flip, caps)
    unclosed = np.zeros(len(flip), dtype=bool)
    unclosed[caps.patch[~kept]] = True
    if unclosed.any():
        sure = kept & ~unclosed[caps.patch]
        seen = _backs_seen(*_with_caps(oriented, patch, caps, sure), flip)
        flip = np.where(unclosed, seen, flip)
        kept = enclosed_faces(oriented, patch, volume, flip, caps)

    joined, owner = _with_caps(oriented, patch, caps, kept)
    columns = trace(joined, JUDGE_RESOLUTION)
    flip, signs = _settled(columns, owner, flip, patches.given)

    kept = enclosed_faces(oriented, patch, volume, flip, caps, among_all=True) & (open == "fill")
    joined, owner = _with_caps(oriented, patch, caps, kept)
    signs = np.concatenate([signs, _signs(flip, caps.patch[kept])])
    faces = np.where(signs[:, None] < 0, joined.faces[:, ::-1], joined.faces)
    return OrientedMesh(Mesh(joined.vertices, np.ascontiguousarray(faces)), owner, open)


def _settled(columns: Columns, patch: Int64, flip: Bool, given: Signs) -> tuple[Bool, Signs]:
    """Which patches are turned over, and the signs of all faces but the caps' that come last.

    From the orientation found, or from the file's own if that is hardly worse; there, patches
    that aren't turned over keep even faces that contradict their neighbours.
    """
    flip, extent = settle(columns, patch, flip)
    as_given = np.bincount(patch[: len(given)], given) < 0
    signs = _signs(as_given, patch)
    signs[: len(given)] = given
    found = disorder(columns, _signs(flip, patch))
    if disorder(columns, signs) > found + TOLERANCE * extent:
        return flip, _signs(flip, patch)[: len(given)]
    flip, _ = settle(columns, patch, as_given)
    same = (flip == as_given)[patch]
    return flip, np.where(same, signs, _signs(flip, patch))[: len(given)]


def _signs(flip: Bool, patch: Int64) -> Signs:
    return np.where(flip, -1, 1).astype(np.int8)[patch]


def _with_caps(mesh: Mesh, patch: Int64, caps: Caps, kept: Bool) -> tuple[Mesh, Int64]:
    """A mesh followed by some faces of caps, and the patch of each face."""
    return (
        Mesh(caps.vertices, np.concatenate([mesh.faces, caps.faces[kept]])),
        np.concatenate([patch, caps.patch[kept]]),
    )


def _backs_seen(mesh: Mesh, patch: Int64, otherwise: Bool) -> Bool:
    """Patches of which mostly backs are seen, and where that is unclear those given."""
    front, back = patch_votes(mesh, patch).T
    unclear = np.maximum(front, back) <= CLEAR_VOTE * np.minimum(front, back)
    return np.asarray(np.where(unclear, otherwise, back > front))


def _patch_volumes(mesh: Mesh, patch: Int64) -> Float64:
    """Signed volume of each patch about the mean of its corners, (patches,) float64."""
    corners = mesh.triangles
    sizes = np.bincount(patch)
    means = corners.mean(axis=1)
    centroid = np.stack([np.bincount(patch, weights=means[:, k]) for k in range(3)], axis=1)
    corners = corners - (centroid / sizes[:, None])[patch][:, None]
    a, b, c = np.moveaxis(corners, 1, 0)
    return np.bincount(patch, weights=(a * np.cross(b, c)).sum(axis=1)) / 6
