"""Parts of a sample model, and how they are moved about."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pnabs.geometry.types import Float64

Faces = tuple[tuple[int, ...], ...]
"""Polygons as vertex indices; anything but a triangle is convex."""


class Part(NamedTuple):
    """One named piece of a model, with vertices of its own.

    Attributes
    ----------
    name : str
    vertices : (V, 3) float64
    faces : tuple of polygons
    """

    name: str
    vertices: Float64
    faces: Faces


def signed_volume(part: Part) -> float:
    """Volume by the divergence theorem about the vertices' mean; exact for closed parts."""
    points = part.vertices - part.vertices.mean(axis=0)
    fans = [(face[0], *pair) for face in part.faces for pair in itertools.pairwise(face[1:])]
    a, b, c = points[np.array(fans)].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def reversed_faces(faces: Iterable[tuple[int, ...]]) -> Faces:
    """The same polygons seen from the other side."""
    return tuple(tuple(reversed(face)) for face in faces)


def outward(name: str, vertices: ArrayLike, faces: Iterable[Sequence[int]]) -> Part:
    """A part whose consistently oriented faces are turned to look outward."""
    part = Part(name, np.asarray(vertices, dtype=np.float64), tuple(tuple(f) for f in faces))
    if signed_volume(part) < 0:
        part = part._replace(faces=reversed_faces(part.faces))
    return part


def moved(part: Part, offset: ArrayLike) -> Part:
    """The part shifted by `offset`, (3,)."""
    return part._replace(vertices=part.vertices + np.asarray(offset, dtype=np.float64))


def turned(part: Part, axis: int, degrees: float, about: ArrayLike = (0, 0, 0)) -> Part:
    """The part turned right-handedly about a line along `axis` through `about`, (3,)."""
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    first, second = (axis + 1) % 3, (axis + 2) % 3
    rotation = np.eye(3)
    rotation[first, first] = rotation[second, second] = cos
    rotation[first, second], rotation[second, first] = -sin, sin
    centre = np.asarray(about, dtype=np.float64)
    return part._replace(vertices=(part.vertices - centre) @ rotation.T + centre)


def stretched(part: Part, factors: ArrayLike) -> Part:
    """The part scaled by positive `factors`, (3,), about the origin."""
    return part._replace(vertices=part.vertices * np.asarray(factors, dtype=np.float64))


def reflected(part: Part, axis: int = 0) -> Part:
    """The part's image in the plane through the origin across `axis`."""
    sign = np.ones(3)
    sign[axis] = -1
    return Part(part.name, part.vertices * sign, reversed_faces(part.faces))


def both_sides(parts: Iterable[Part], axis: int = 0) -> list[Part]:
    """Every part with its mirror image, left to right unless `axis` says otherwise."""
    return [side for part in parts for side in (part, reflected(part, axis))]
