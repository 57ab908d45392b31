"""Soup to oriented mesh: which side of every face looks out of the solid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pnabs.geometry.columns import disorder, settle, trace
from pnabs.geometry.holes import Caps, close_rims, enclosed_faces
from pnabs.geometry.patches import join
from pnabs.geometry.types import Bool, Float64, Int64, Mesh
from pnabs.geometry.visibility import patch_votes
from pnabs.geometry.weld import weld

CLEAR_VOTE = 1.5
"""A patch is turned by what is seen of it only if one side is seen so many times as often."""

JUDGE_RESOLUTION = 32
"""Grid on which the two candidate orientations are compared."""

TOLERANCE = 0.02
"""The file's own orientation stands if its disorder is at most this share of the length of line
inside the patches more than that of the orientation found."""


@dataclass(frozen=True, slots=True)
class OrientedMesh:
    """A welded mesh whose faces look out of the solid; made once, used at every resolution.

    Attributes
    ----------
    mesh : Mesh
        In the normalised frame.
    patch : (F,) int64
        Consistently oriented manifold patch of each face, from 0.
    """

    mesh: Mesh
    patch: Int64

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


def prepare(mesh: Mesh, close: bool = True) -> OrientedMesh:
    """Weld a soup and orient its faces.

    Two candidates compete: patches turned so that what is seen of them from outside is their
    front, and the faces as the file has them.  The file's stand where their winding numbers
    on the grid are nearly whole and no worse than the candidate's: then somebody modelled
    them with care, cavities and open bottoms included.

    Parameters
    ----------
    mesh : Mesh
        In the normalised frame, at least one face of non-zero area.
    """
    welded = weld(mesh)
    patches = join(welded.faces)
    patch, given = patches.patch, patches.given
    oriented = Mesh(welded.vertices, patches.faces)
    caps = close_rims(welded.vertices, patches)
    sealed = Mesh(caps.vertices, np.concatenate([patches.faces, caps.faces]))
    owner = np.concatenate([patch, caps.patch])
    volume = _patch_volumes(sealed, owner)
    flip = volume < 0
    kept = enclosed_faces(oriented, patch, volume, flip, caps)
    unclosed = np.zeros(len(flip), dtype=bool)
    unclosed[caps.patch[~kept]] = True
    if unclosed.any():
        sure = kept & ~unclosed[caps.patch]
        flip = np.where(unclosed, _seen_backs(*_with_caps(oriented, patch, caps, sure), flip), flip)
        kept = enclosed_faces(oriented, patch, volume, flip, caps)
    joined, owner = _with_caps(oriented, patch, caps, kept)
    columns = trace(joined, JUDGE_RESOLUTION)
    flip, extent = settle(columns, owner, flip)
    seen = _signs(flip, owner)
    as_given = np.bincount(patch, given) < 0
    signs = _signs(as_given, owner)
    signs[: len(given)] = given
    if disorder(columns, signs) <= disorder(columns, seen) + TOLERANCE * extent:
        flip, _ = settle(columns, owner, as_given)
        seen = np.where((flip == as_given)[owner], signs, _signs(flip, owner))
    kept = enclosed_faces(oriented, patch, volume, flip, caps, among_all=True) & close
    joined, owner = _with_caps(oriented, patch, caps, kept)
    signs = np.concatenate([seen[: len(patch)], _signs(flip, caps.patch[kept])])
    faces = np.where(signs[:, None] < 0, joined.faces[:, ::-1], joined.faces)
    return OrientedMesh(Mesh(joined.vertices, np.ascontiguousarray(faces)), owner)


def _signs(flip: Bool, patch: Int64) -> NDArray[np.int8]:
    return np.where(flip, -1, 1).astype(np.int8)[patch]


def _with_caps(mesh: Mesh, patch: Int64, caps: Caps, kept: Bool) -> tuple[Mesh, Int64]:
    return (
        Mesh(caps.vertices, np.concatenate([mesh.faces, caps.faces[kept]])),
        np.concatenate([patch, caps.patch[kept]]),
    )


def _seen_backs(mesh: Mesh, patch: Int64, otherwise: Bool) -> Bool:
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
