"""Soup to oriented mesh: which side of every face looks out of the solid."""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
from numpy.typing import NDArray

from pnabs.geometry.crossing import crossing_counts
from pnabs.geometry.holes import Caps, close_rims, enclosed_rims
from pnabs.geometry.types import Bool, Float32, Float64, Int64, Mesh
from pnabs.geometry.visibility import patch_votes
from pnabs.geometry.weld import weld

CLEAR_VOTE = 1.5
"""A patch is turned by what is seen of it only if one side is seen so many times as often."""

JUDGE_RESOLUTION = 32
"""Grid on which the two candidate orientations are compared."""

MAX_RESIDUE = 0.2
"""The file's own orientation stands only if its winding numbers are this close to integers."""


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
    turned, patch = igl.bfs_orient(welded.faces)
    patch = np.asarray(patch, dtype=np.int64).ravel()
    oriented = Mesh(welded.vertices, np.ascontiguousarray(turned))
    given = _same_winding(oriented.faces, welded.faces)
    caps = close_rims(oriented, patch)
    inward = _patch_volumes(
        Mesh(caps.vertices, np.concatenate([oriented.faces, caps.faces])),
        np.concatenate([patch, caps.patch]),
    ) < 0
    enclosed = enclosed_rims(oriented, patch, np.where(inward, -1.0, 1.0), caps)
    kept = enclosed[caps.rim] if close else np.zeros(len(caps.faces), dtype=bool)
    whole = np.ones(len(inward), dtype=bool)
    whole[caps.patch[~kept]] = False
    flip = inward
    if not whole.all():
        joined, owner = _with_caps(oriented, patch, caps, kept)
        flip = np.where(whole, inward, _patches_to_flip(joined, owner, inward))
        kept &= (flip == inward)[caps.patch]
    joined, patch = _with_caps(oriented, patch, caps, kept)
    seen = np.where(flip[patch][:, None], joined.faces[:, ::-1], joined.faces)
    signs = np.ones((2, len(seen)), dtype=np.int8)
    signs[1, : len(given)] = given
    majority = np.bincount(patch[: len(given)], weights=given, minlength=len(flip)) < 0
    signs[1, len(given) :] = np.where(majority, -1, 1)[patch[len(given) :]]
    signs[1] *= np.where(flip, -1, 1).astype(np.int8)[patch]
    faces = seen
    if (signs[1] < 0).any():
        _, winding = crossing_counts(Mesh(joined.vertices, seen), signs, JUDGE_RESOLUTION)
        as_seen, as_given = _residue(winding[0]), _residue(winding[1])
        if as_given <= min(MAX_RESIDUE, as_seen):
            faces = np.where(signs[1][:, None] < 0, seen[:, ::-1], seen)
    return OrientedMesh(Mesh(joined.vertices, np.ascontiguousarray(faces)), patch)


def _with_caps(mesh: Mesh, patch: Int64, caps: Caps, kept: Bool) -> tuple[Mesh, Int64]:
    return (
        Mesh(caps.vertices, np.concatenate([mesh.faces, caps.faces[kept]])),
        np.concatenate([patch, caps.patch[kept]]),
    )


def _patches_to_flip(mesh: Mesh, patch: Int64, inward: Bool) -> Bool:
    """Patches seen mostly from their back, or, where that is unclear, of negative volume."""
    front, back = patch_votes(mesh, patch).T
    unclear = np.maximum(front, back) <= CLEAR_VOTE * np.minimum(front, back)
    return np.asarray(np.where(unclear, inward, back > front))


def _patch_volumes(mesh: Mesh, patch: Int64) -> Float64:
    """Signed volume of each patch about the mean of its corners, (patches,) float64."""
    corners = mesh.triangles
    sizes = np.bincount(patch)
    means = corners.mean(axis=1)
    centroid = np.stack([np.bincount(patch, weights=means[:, k]) for k in range(3)], axis=1)
    corners = corners - (centroid / sizes[:, None])[patch][:, None]
    a, b, c = np.moveaxis(corners, 1, 0)
    return np.bincount(patch, weights=(a * np.cross(b, c)).sum(axis=1)) / 6


def _same_winding(faces: Int64, others: Int64) -> NDArray[np.int8]:
    """+1 where two lists have a face's corners in the same cyclic order, else -1, (F,) int8."""
    start = np.argmax(others == faces[:, :1], axis=1)
    following = others[np.arange(len(others)), (start + 1) % 3]
    return np.where(following == faces[:, 1], 1, -1).astype(np.int8)


def _residue(winding: Float32) -> float:
    """How far winding numbers are from whole ones, from 0 up; inf where nothing is enclosed."""
    enclosed = winding[np.abs(winding) > 0.2]
    if len(enclosed) == 0:
        return float("inf")
    return float(np.abs(enclosed - np.maximum(np.rint(enclosed), 0)).mean())
