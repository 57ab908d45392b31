"""What the negatives leave of each positive: as it is, or split into convex parts.

Physics engines collide convex bodies alone.  A positive that a negative has hollowed out is
split along the negative's face planes, so that what was opened stays open: together the
parts are the result, and nothing else.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from manifold3d import Manifold, Mesh64, OpType

from pnabs.geometry.crop import Boxes, crop, placed
from pnabs.geometry.debris import find_pieces, is_debris
from pnabs.geometry.solidify import CropRecipe
from pnabs.geometry.types import Cuboids, Float64, Int64

_SLIVER = 1e-10
"""A part with less than this share of its positive's volume is left out."""

_SAME = 1e-9
"""Volumes that differ by less, as a share of the larger, count as equal."""


@dataclass(frozen=True, slots=True)
class Part:
    """A closed part of the result, in the normalised frame.

    Attributes
    ----------
    source : int
        Index of the positive that it is a part of.
    vertices : (V, 3) float64
    faces : (F, 3) int64
        Outward.
    box : Boxes or None
        The part as one cuboid, where it is one along its positive's axes.
    """

    source: int
    vertices: Float64
    faces: Int64
    box: Boxes | None


def cropped_parts(positives: Cuboids, negatives: Cuboids, recipe: CropRecipe) -> list[Part]:
    """The connected parts that the negatives leave of each positive, without debris.

    Parts of different positives overlap where the positives do; their union is the result.

    Parameters
    ----------
    positives, negatives, recipe
        As for `pnabs.geometry.solidify.make_solid`.
    """
    return [
        _part(one.source, solid, one.box)
        for one in _cropped(positives, negatives, recipe)
        for solid in one.without_debris(one.left())
    ]


def convex_parts(positives: Cuboids, negatives: Cuboids, recipe: CropRecipe) -> list[Part]:
    """The result as convex parts.

    A positive that no negative touches is one part, a cuboid.  Of any other, the parts are
    disjoint, and cut along face planes of negatives alone.  Parts of different positives
    overlap where the positives do.

    Parameters
    ----------
    positives, negatives, recipe
        As for `pnabs.geometry.solidify.make_solid`.
    """
    return [
        _part(one.source, cell, one.box)
        for one in _cropped(positives, negatives, recipe)
        for cell in one.without_debris(_merged(one.cells()))
    ]


@dataclass(frozen=True, slots=True)
class _Cutter:
    """A negative: its solid and its faces' planes, (6, 4) normals outward and offsets."""

    solid: Manifold
    planes: Float64


@dataclass(frozen=True, slots=True)
class _Cropped:
    """A positive with the negatives that take something of it, and all that is dropped."""

    source: int
    box: Boxes
    solid: Manifold
    cutters: list[_Cutter]
    debris: Manifold | None

    @property
    def least(self) -> float:
        return _SLIVER * float(np.prod(self.box.scale))

    def left(self) -> list[Manifold]:
        """The connected solids that are left of it."""
        if not self.cutters:
            return [self.solid]
        cut = [self.solid, *(cutter.solid for cutter in self.cutters)]
        shells: list[Manifold] = Manifold.batch_boolean(cut, OpType.Subtract).decompose()
        # A cavity is a shell of its own, inside out.
        hollows = [_turned_over(shell) for shell in shells if shell.volume() < 0]
        outer = [shell for shell in shells if shell.volume() > 0]
        if not hollows:
            return outer
        return [Manifold.batch_boolean([shell, *hollows], OpType.Subtract) for shell in outer]

    def cells(self) -> list[Manifold]:
        """Disjoint convex solids that together are what is left of it."""
        cells = [self.solid]
        for cutter in self.cutters:
            cells = [part for cell in cells for part in _without(cell, cutter, self.least)]
        return cells

    def without_debris(self, solids: list[Manifold]) -> list[Manifold]:
        """Of connected solids, those that aren't dropped, nor slivers."""
        solids = [solid for solid in solids if solid.volume() > self.least]
        if self.debris is None:
            return solids
        return [one for one in solids if (one ^ self.debris).volume() < one.volume() / 2]


def _cropped(positives: Cuboids, negatives: Cuboids, recipe: CropRecipe) -> Iterator[_Cropped]:
    added, removed = placed(positives, negatives, **recipe.options())
    normals = np.concatenate([removed.axes.swapaxes(1, 2), -removed.axes.swapaxes(1, 2)], axis=1)
    offsets = np.einsum("nki,ni->nk", normals, removed.translation)
    offsets += np.concatenate([removed.scale, removed.scale], axis=1) / 2
    cutters = [
        _Cutter(solid, planes)
        for solid, planes in zip(
            removed.solids(), np.concatenate([normals, offsets[..., None]], axis=2), strict=True
        )
    ]
    debris = _debris(positives, negatives, recipe)
    for row, solid in enumerate(added.solids()):
        least = _SLIVER * solid.volume()
        mine = [cutter for cutter in cutters if (solid ^ cutter.solid).volume() > least]
        yield _Cropped(int(added.index[row]), added[row], solid, mine, debris)


def _debris(positives: Cuboids, negatives: Cuboids, recipe: CropRecipe) -> Manifold | None:
    """All that is dropped as debris, if anything is."""
    whole = crop(positives, negatives, **recipe.options())
    pieces = find_pieces(whole)
    if len(pieces) < 2:
        return None
    small = is_debris(pieces, recipe.debris)
    if not small.any():
        return None
    used, faces = np.unique(whole.faces[small[pieces.label]], return_inverse=True)
    mesh = Mesh64(whole.vertices[used], faces.reshape(-1, 3).astype(np.uint64))
    return Manifold(mesh)


def _turned_over(shell: Manifold) -> Manifold:
    mesh = shell.to_mesh64()
    faces = np.array(mesh.tri_verts[:, ::-1], dtype=np.uint64, order="C")
    return Manifold(
        Mesh64(np.array(mesh.vert_properties[:, :3], dtype=np.float64, order="C"), faces)
    )


def _without(cell: Manifold, cutter: _Cutter, least: float) -> list[Manifold]:
    """A convex cell without a cutter, plane by plane, the one that takes most first."""
    if (cell ^ cutter.solid).volume() <= least:
        return [cell]
    parts, planes = [], list(cutter.planes)
    while planes:
        splits = [cell.split_by_plane(plane[:3], plane[3]) for plane in planes]
        volumes = [beyond.volume() for beyond, _ in splits]
        most = int(np.argmax(volumes))
        if volumes[most] <= least:
            break
        beyond, cell = splits[most]
        parts.append(beyond)
        del planes[most]
    return parts


def _merged(cells: list[Manifold]) -> list[Manifold]:
    """Cells that are convex together become one."""
    done: list[Manifold] = []
    for cell in cells:
        grown = True
        while grown:
            grown = False
            for other in done:
                hull = Manifold.batch_hull([cell, other])
                if _equal(hull.volume(), cell.volume() + other.volume()):
                    done.remove(other)
                    cell, grown = hull, True
                    break
        done.append(cell)
    return done


def _equal(a: float, b: float) -> bool:
    return abs(a - b) <= _SAME * max(a, b)


def _part(source: int, solid: Manifold, positive: Boxes) -> Part:
    mesh = solid.to_mesh64()
    vertices = np.array(mesh.vert_properties[:, :3], dtype=np.float64)
    axes = positive.axes[0]
    along = (vertices - positive.translation[0]) @ axes
    low, high = along.min(axis=0), along.max(axis=0)
    box = None
    if _equal(float(np.prod(high - low)), solid.volume()):
        centre = axes @ ((low + high) / 2) + positive.translation[0]
        box = Boxes((high - low)[None], positive.rotation, centre[None], positive.index)
    return Part(source, vertices, np.array(mesh.tri_verts, dtype=np.int64), box)
