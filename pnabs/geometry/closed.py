"""The exact solid of a mesh whose components are all closed.

Such a *closed* model has a volume without any grid, by exact booleans.  Most collections hold
models that aren't closed; why one isn't is told, so that it can be counted.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from manifold3d import Manifold
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pnabs.geometry.manifolds import to_manifold, union
from pnabs.geometry.types import Bool, Float64, Int64, Mesh

NotExact = Literal["", "open", "refused", "large", "empty"]
"""Why there is no exact solid: a component isn't closed, manifold3d refuses one, there are too
many faces to ask, nothing is enclosed.  Empty where there is one."""

LEAST_VOLUME = 1e-9
"""A component that encloses less is a sheet folded back on itself, in normalised units."""

INSIDE = 0.999
"""An inward component is a cavity if this share of it lies in the outward ones."""


def closed_solid(mesh: Mesh) -> tuple[Manifold | None, NotExact]:
    """The union of a mesh's closed components, less its cavities.

    Outward components are united.  An inward one that lies in them is a cavity; any other inward
    one is turned outward.

    Parameters
    ----------
    mesh : Mesh
        Welded, without degenerate and repeated faces (`pnabs.geometry.weld.weld`), in the
        normalised frame.

    Returns
    -------
    (Manifold, "")
        The solid, or None and why there is none.
    """
    if not len(mesh.faces):
        return None, "empty"
    label = closed_components(mesh.faces)
    if label is None:
        return None, "open"
    volume = _volumes(mesh, label)
    if np.any(np.abs(volume) < LEAST_VOLUME):
        return None, "open"
    outward: list[Manifold] = []
    inward: list[Manifold] = []
    order = np.argsort(label, kind="stable")
    ends = np.searchsorted(label[order], np.arange(len(volume) + 1))
    for k in range(len(volume)):
        faces = mesh.faces[order[ends[k] : ends[k + 1]]]
        used, corners = np.unique(faces, return_inverse=True)
        corners = corners.reshape(-1, 3)
        turned = volume[k] < 0
        solid = to_manifold(mesh.vertices[used], corners[:, ::-1] if turned else corners)
        if solid is None or solid.is_empty():
            return None, "refused"
        (inward if turned else outward).append(solid)
    if not outward:
        outward, inward = inward, []
    whole = union(outward)
    cavities: list[Manifold] = []
    turned_outward: list[Manifold] = []
    for solid in inward:
        within = (whole ^ solid).volume() > INSIDE * solid.volume()
        (cavities if within else turned_outward).append(solid)
    if turned_outward:
        whole = union([whole, *turned_outward])
    if cavities:
        whole = whole - union(cavities)
    if whole.is_empty() or whole.volume() < LEAST_VOLUME:
        return None, "empty"
    return whole, ""


def closed_components(faces: Int64) -> Int64 | None:
    """The component of each face, (F,) from 0; None where one of them isn't closed.

    Faces belong together over an edge that just two share.  Where parts touch along an edge, more
    than two faces share it, and it joins only what would be open there otherwise.

    Parameters
    ----------
    faces : (F, 3) int64
    """
    a, b = faces.reshape(-1), faces[:, [1, 2, 0]].reshape(-1)
    ends = np.minimum(a, b) * (faces.max(initial=0) + np.int64(1)) + np.maximum(a, b)
    _, edge, count = np.unique(ends, return_inverse=True, return_counts=True)
    if np.any(count % 2):
        return None
    face = np.arange(len(faces)).repeat(3)
    label = _joined(face, edge, count[edge] == 2, len(faces))
    while True:
        pair, index, times = np.unique(
            label[face] * np.int64(len(count)) + edge, return_inverse=True, return_counts=True
        )
        lacking = (times % 2 == 1)[index]
        if not lacking.any():
            return label
        # the pieces that an edge leaves open, joined over it
        components = int(label.max()) + 1
        piece, over = np.divmod(pair[times % 2 == 1], np.int64(len(count)))
        merged = _joined(piece, over, np.ones(len(piece), dtype=bool), components)
        label = merged[label]


def _joined(item: Int64, key: Int64, chosen: Bool, count: int) -> Int64:
    """Labels of `count` items, those that share a key over chosen entries being one."""
    item, key = item[chosen], key[chosen]
    order = np.argsort(key, kind="stable")
    item, key = item[order], key[order]
    same = np.flatnonzero(key[1:] == key[:-1])
    ones = np.ones(len(same), dtype=np.int8)
    graph = coo_array((ones, (item[same], item[same + 1])), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _volumes(mesh: Mesh, label: Int64) -> Float64:
    """Signed volume of each component about its own middle, (components,)."""
    corners = mesh.triangles
    means = corners.mean(axis=1)
    sums = np.stack([np.bincount(label, weights=means[:, k]) for k in range(3)], axis=1)
    middle = sums / np.bincount(label)[:, None]
    a, b, c = np.moveaxis(corners - middle[label][:, None], 1, 0)
    return np.bincount(label, weights=np.einsum("fi,fi->f", a, np.cross(b, c))) / 6
