"""Which side of each patch is seen from outside: votes of depth buffers."""

from __future__ import annotations

import numpy as np

from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import Float64, Int64, Mesh

PIXELS = 96
"""Side of a depth buffer."""

DIRECTIONS = (
    (1, 0, 0),
    (0, 1, 0),
    (0, 0, 1),
    (1, 1, 1),
    (1, 1, -1),
    (1, -1, 1),
    (-1, 1, 1),
)
"""Lines of sight, each looked along from both ends."""


def patch_votes(mesh: Mesh, patch: Int64) -> Int64:
    """Count the pixels in which each patch shows its front and its back.

    Parameters
    ----------
    mesh : Mesh
        In the normalised frame.
    patch : (F,) int64
        Patch of each face, from 0.

    Returns
    -------
    votes : (patches, 2) int64
        Pixels that see the front, and the back.
    """
    votes = np.zeros((int(patch.max(initial=-1)) + 1, 2), dtype=np.int64)
    for direction in DIRECTIONS:
        seen = mesh.vertices @ _frame(direction)
        _look(np.ascontiguousarray(seen), mesh.faces, patch, votes, PIXELS)
    return votes


def _frame(direction: tuple[int, int, int]) -> Float64:
    """A right-handed orthonormal frame as columns, (3, 3), its third axis along `direction`."""
    w = np.array(direction, dtype=np.float64)
    w /= np.linalg.norm(w)
    # any fixed vector that is parallel to none of the directions
    u = np.cross(np.array([0.3, -0.5, 0.8]), w)
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(w, u), w], axis=1)


@kernel
def _look(seen: Float64, faces: Int64, patch: Int64, votes: Int64, pixels: int) -> None:
    """Draw all faces into a near and a far buffer, then let each pixel vote."""
    low_u, low_v = seen[:, 0].min(), seen[:, 1].min()
    extent = max(seen[:, 0].max() - low_u, seen[:, 1].max() - low_v)
    if extent <= 0:
        return
    scale = pixels / extent
    near = np.full((pixels, pixels), np.inf)
    far = np.full((pixels, pixels), -np.inf)
    near_face = np.full((pixels, pixels), -1, dtype=np.int64)
    far_face = np.full((pixels, pixels), -1, dtype=np.int64)
    upward = np.zeros(len(faces), dtype=np.bool_)
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        u0, v0 = (seen[a, 0] - low_u) * scale, (seen[a, 1] - low_v) * scale
        u1, v1 = (seen[b, 0] - low_u) * scale, (seen[b, 1] - low_v) * scale
        u2, v2 = (seen[c, 0] - low_u) * scale, (seen[c, 1] - low_v) * scale
        area = (u1 - u0) * (v2 - v0) - (v1 - v0) * (u2 - u0)
        if area == 0:
            continue
        upward[f] = area > 0
        i_low = max(0, int(np.ceil(min(u0, u1, u2) - 0.5)))
        i_high = min(pixels - 1, int(np.floor(max(u0, u1, u2) - 0.5)))
        j_low = max(0, int(np.ceil(min(v0, v1, v2) - 0.5)))
        j_high = min(pixels - 1, int(np.floor(max(v0, v1, v2) - 0.5)))
        for i in range(i_low, i_high + 1):
            pu = i + 0.5
            for j in range(j_low, j_high + 1):
                pv = j + 0.5
                wa = ((u1 - pu) * (v2 - pv) - (v1 - pv) * (u2 - pu)) / area
                wb = ((u2 - pu) * (v0 - pv) - (v2 - pv) * (u0 - pu)) / area
                wc = 1 - wa - wb
                if wa < 0 or wb < 0 or wc < 0:
                    continue
                depth = wa * seen[a, 2] + wb * seen[b, 2] + wc * seen[c, 2]
                if depth < near[i, j]:
                    near[i, j] = depth
                    near_face[i, j] = f
                if depth > far[i, j]:
                    far[i, j] = depth
                    far_face[i, j] = f
    for i in range(pixels):
        for j in range(pixels):
            f = near_face[i, j]
            if f >= 0:
                votes[patch[f], 1 if upward[f] else 0] += 1
            f = far_face[i, j]
            if f >= 0:
                votes[patch[f], 0 if upward[f] else 1] += 1
