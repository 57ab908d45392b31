"""Faces joined over edges of two, into patches that are oriented alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import Bool, Int64, Signs

CUT = 0.5
"""Patches end at edges where the file's faces contradict each other, if there are fewer such
edges than this share of the faces that would have to be turned."""


@dataclass(frozen=True, slots=True)
class Patches:
    """The faces of a mesh, turned so that neighbours agree.

    Half-edge 3 f + e runs from corner e of face f to the next.

    Attributes
    ----------
    faces : (F, 3) int64
    patch : (F,) int64
        Patch of each face, from 0.
    given : (F,) int8
        -1 for faces that were turned over, else 1.
    mate : (3F,) int64
        The other half of each half-edge's edge, within the patch, or -1.
    free : (3F,) bool
        Half-edges whose edge has no other face.
    """

    faces: Int64
    patch: Int64
    given: Signs
    mate: Int64
    free: Bool

    @property
    def count(self) -> int:
        """How many patches there are."""
        return int(self.patch.max(initial=-1)) + 1


def join(faces: Int64) -> Patches:
    """Orient the faces alike, as far as they hang together.

    Patches end where an edge has one face or more than two.  Where touching parts were welded
    and one lost a face, an edge can join what doesn't belong together, and the file's own
    orientation tells: where it is consistent but for a few edges, patches end there as well.
    Where faces are turned at random, nearly every edge contradicts, and nothing is cut.

    Parameters
    ----------
    faces : (F, 3) int64
        Corners of a face differ.
    """
    mate, free = _mates(faces)
    origin = np.ascontiguousarray(faces).reshape(-1)
    # two faces agree if they run along their edge in opposite directions
    clash = (mate >= 0) & (origin == origin[mate])
    patch, given = _flood(mate, clash)
    count = int(patch.max(initial=-1)) + 1
    kept = np.bincount(patch[given > 0], minlength=count)
    fewer = np.minimum(kept, np.bincount(patch, minlength=count) - kept)
    if fewer.any():
        clashes = np.bincount(patch[np.flatnonzero(clash) // 3], minlength=count) / 2
        cut = clashes < CUT * fewer
        mate[clash & cut[patch].repeat(3)] = -1
        patch, given = _flood(mate, clash)
    turned = np.where(given[:, None] < 0, faces[:, ::-1], faces)
    # where a face is read backwards its half-edges come in another order
    numbers = np.arange(len(mate)).reshape(-1, 3)
    renamed = np.where(given[:, None] < 0, numbers[:, [1, 0, 2]], numbers).reshape(-1)
    paired = np.where(mate[renamed] >= 0, renamed[mate[renamed]], -1)
    turned = np.ascontiguousarray(turned)
    origin = turned.reshape(-1)
    # a band with a twist can't be oriented: it ends where it would contradict itself
    paired[(paired >= 0) & (origin == origin[paired])] = -1
    return Patches(turned, patch, given, paired, free[renamed])


def _mates(faces: Int64) -> tuple[Int64, Bool]:
    """The other half of each edge of just two faces, else -1, and which edges have only one."""
    a, b = faces.reshape(-1), faces[:, [1, 2, 0]].reshape(-1)
    key = np.minimum(a, b) * (faces.max(initial=0) + np.int64(1)) + np.maximum(a, b)
    order = np.argsort(key)
    ranked = key[order]
    first = np.flatnonzero(np.concatenate([[True], ranked[1:] != ranked[:-1]]))
    count = np.diff(np.append(first, len(key)))
    free = np.zeros(len(key), dtype=bool)
    free[order[first[count == 1]]] = True
    one, other = order[first[count == 2]], order[first[count == 2] + 1]
    mate = np.full(len(key), -1, dtype=np.int64)
    mate[one], mate[other] = other, one
    return mate, free


@kernel
def _flood(mate: Int64, clash: Bool) -> tuple[Int64, Signs]:
    """Patch of each face, and -1 where it must be turned to agree with the patch's first."""
    count = len(mate) // 3
    patch = np.full(count, -1, dtype=np.int64)
    sign = np.ones(count, dtype=np.int8)
    waiting = np.empty(count, dtype=np.int64)
    patches = 0
    for seed in range(count):
        if patch[seed] >= 0:
            continue
        patch[seed] = patches
        waiting[0] = seed
        left = 1
        while left > 0:
            left -= 1
            f = waiting[left]
            for h in range(3 * f, 3 * f + 3):
                g = mate[h] // 3
                if mate[h] < 0 or patch[g] >= 0:
                    continue
                patch[g] = patches
                sign[g] = -sign[f] if clash[h] else sign[f]
                waiting[left] = g
                left += 1
        patches += 1
    return patch, sign
