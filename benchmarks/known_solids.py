"""Meshes whose solid is known, and the eleven ways in which they are spoilt.

The truth of a model made of closed parts is the exact union of the parts (manifold3d),
point-sampled at cell centres by libigl's winding number, with the rule for thin parts
applied to the union's surface.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import igl
import manifold3d
import numpy as np
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pnabs.dataset.samples.collection import CATEGORIES, make_model
from pnabs.geometry.load import InvalidMeshError, parse_mesh
from pnabs.geometry.normalise import normalise
from pnabs.geometry.shell import surface_cells
from pnabs.geometry.types import Bool, Float64, Int64, Mesh, grid_points
from pnabs.settings import Limits

UP = 1
"""The axis that points up, in ShapeNetCore.v2, the dev corpus and the samples."""

LOOKS_DOWN = -0.5
"""A face looks down where its unit normal's upward part is less: within 60 degrees of down."""

LEAST_CELLS = 30
"""Solids with fewer cells are left out: an IoU of a handful of cells says little."""


@dataclass(frozen=True, slots=True)
class KnownSolid:
    """A model of closed parts, in the normalised frame.

    Attributes
    ----------
    name : str
    parts : Mesh
        The parts side by side, overlapping as they may, each with vertices of its own.
    component : (F,) int64
        Part of each face.
    union : Mesh
        The exact union of the parts.
    known : dict
        Truths computed so far, by resolution.
    """

    name: str
    parts: Mesh
    component: Int64
    union: Mesh
    known: dict[int, Bool] = field(default_factory=dict, compare=False, repr=False)

    def truth(self, resolution: int) -> Bool:
        """The solid at cell centres, thin parts included, (G, G, G) bool."""
        if resolution not in self.known:
            winding = igl.fast_winding_number(
                self.union.vertices, self.union.faces, grid_points(resolution)
            )
            core = np.asarray(winding > 0.5).reshape(resolution, resolution, resolution)
            self.known[resolution] = with_thin_parts(self.union, core)
        return self.known[resolution]


def with_thin_parts(mesh: Mesh, core: Bool) -> Bool:
    """A solid and the cells that the surface passes where no solid lies next to them."""
    near = ndimage.binary_dilation(core, np.ones((3, 3, 3), dtype=bool))
    return core | (surface_cells(mesh, len(core)) & ~near)


def concatenate(meshes: Sequence[Mesh]) -> Mesh:
    """Meshes side by side, each with vertices of its own."""
    starts = itertools.accumulate((len(mesh.vertices) for mesh in meshes[:-1]), initial=0)
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]),
    )


def known_solid(name: str, parts: Sequence[Mesh]) -> KnownSolid | None:
    """The model of these parts, or None where one of them isn't closed, or looks inward."""
    solids = []
    for part in parts:
        # a sheet given twice, back to back, is closed to a mesh library and yet no solid
        if len(np.unique(np.sort(part.faces, axis=1), axis=0)) < len(part.faces):
            return None
        try:
            solid = manifold3d.Manifold(
                manifold3d.Mesh64(part.vertices, part.faces.astype(np.uint64))
            )
        except ValueError:
            return None
        if solid.status() != manifold3d.Error.NoError or solid.volume() <= 1e-12:
            return None
        solids.append(solid)
    union = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add).to_mesh64()
    together = concatenate(parts)
    # one frame for both: that of the parts
    normalised, transform = normalise(together)
    if len(normalised.faces) != len(together.faces):
        return None
    vertices = (np.asarray(union.vert_properties)[:, :3] - transform[:3, 3]) / transform[0, 0]
    component = np.repeat(np.arange(len(parts)), [len(part.faces) for part in parts])
    faces = np.asarray(union.tri_verts, dtype=np.int64)
    return KnownSolid(name, normalised, component, Mesh(vertices, faces))


def components(mesh: Mesh) -> list[Mesh]:
    """The pieces that share vertices, after vertices at the very same place are joined."""
    vertices, index = np.unique(mesh.vertices, axis=0, return_inverse=True)
    faces = index.reshape(-1)[mesh.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_array((np.ones(len(edges)), edges.T), shape=(len(vertices), len(vertices)))
    label = connected_components(graph, directed=False)[1][faces[:, 0]]
    order = np.argsort(label, kind="stable")
    cuts = np.flatnonzero(np.diff(label[order])) + 1
    out = []
    for chosen in np.split(order, cuts):
        used, own = np.unique(faces[chosen], return_inverse=True)
        out.append(Mesh(vertices[used], own.reshape(-1, 3).astype(np.int64)))
    return out


def sample_solids(count: int) -> Iterator[KnownSolid]:
    """Embedded samples without flaws, of closed parts: of `count` models a category."""
    for category, index in itertools.product(CATEGORIES, range(count)):
        model = make_model(category, 0, index)
        if model.flaws:
            continue
        parts = [
            Mesh(
                part.vertices,
                np.array(
                    [(f[0], *pair) for f in part.faces for pair in itertools.pairwise(f[1:])],
                    dtype=np.int64,
                ),
            )
            for part in model.parts
        ]
        found = known_solid(f"{category}-{index}", parts)
        if found is not None:
            yield found


def corpus_solids(root: Path, limit: int | None = None) -> Iterator[KnownSolid]:
    """Closed models of a collection in ShapeNetCore.v2's layout, by path."""
    for path in sorted(root.glob("*/*/models/model_normalized.obj"))[:limit]:
        try:
            mesh = parse_mesh(path.read_bytes(), ".obj", Limits())
        except InvalidMeshError:
            continue
        found = known_solid(path.parts[-3], components(mesh))
        if found is not None:
            yield found


def spoil(mesh: Mesh, ways: str, rng: np.random.Generator, component: Int64 | None = None) -> Mesh:
    """Do to a mesh what modellers and converters do: several ways joined by `+`.

    Parameters
    ----------
    mesh : Mesh
    ways : str
        `unweld` (every face with its own vertices), `repeat` (30 % of the faces twice),
        `turn` (half of the components inside out), `invert` (all faces), `flip` (30 % of the
        faces), `double` (every face with its reverse), `tear` (10 % of the faces gone),
        `bottom` (faces that look down gone), `shuffle` (faces in another order).
    rng : numpy.random.Generator
    component : (F,) int64, optional
        Part of each face, for `turn`.
    """
    vertices, faces = mesh.vertices, mesh.faces
    for way in ways.split("+"):
        chosen = rng.random(len(faces))
        if way == "unweld":
            vertices = vertices[faces].reshape(-1, 3)
            faces = np.arange(len(vertices)).reshape(-1, 3)
        elif way == "repeat":
            faces = np.concatenate([faces, faces[chosen < 0.3]])
        elif way == "turn":
            assert component is not None, "whose components?"
            turned = rng.permutation(int(component.max()) + 1)[component] % 2 == 0
            faces = np.where(turned[:, None], faces[:, ::-1], faces)
        elif way == "invert":
            faces = faces[:, ::-1]
        elif way == "flip":
            faces = np.where((chosen < 0.3)[:, None], faces[:, ::-1], faces)
        elif way == "double":
            faces = np.concatenate([faces, faces[:, ::-1]])
        elif way == "tear":
            faces = faces[chosen >= 0.1]
        elif way == "bottom":
            faces = faces[_upward(vertices[faces]) >= LOOKS_DOWN]
        elif way == "shuffle":
            faces = rng.permutation(faces)
        else:
            raise ValueError(way)
    return Mesh(vertices, faces)


def _upward(corners: Float64) -> Float64:
    """The upward part of each face's unit normal, (F,); 0 without area."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    return np.asarray(normals[:, UP] / np.where(length > 0, length, 1.0))


WAYS: dict[str, Callable[[KnownSolid, np.random.Generator], Mesh]] = {
    "1 as is": lambda known, _: known.union,
    "2 overlapping parts": lambda known, _: known.parts,
    "3 own vertices": lambda known, rng: spoil(known.parts, "unweld", rng),
    "4 30 % repeated": lambda known, rng: spoil(known.parts, "repeat", rng),
    "5 half the parts flipped": lambda known, rng: spoil(known.parts, "turn", rng, known.component),
    "6 inverted": lambda known, rng: spoil(known.parts, "invert", rng),
    "7 30 % flipped": lambda known, rng: spoil(known.parts, "flip", rng),
    "8 double-sided": lambda known, rng: spoil(known.parts, "double", rng),
    "9 10 % deleted": lambda known, rng: spoil(known.parts, "tear", rng),
    "10 bottoms deleted": lambda known, rng: spoil(known.parts, "bottom", rng),
    "11 = 3 + 4 + 7 + 9": lambda known, rng: spoil(known.parts, "repeat+flip+tear+unweld", rng),
}
"""The eleven ways, by name: a mesh in the known solid's frame."""
