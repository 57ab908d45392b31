"""Closed building blocks: boxes, prisms, lofts and what is turned or drawn along a path."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pnabs.dataset.samples.parts import Part, outward
from pnabs.geometry.types import Float64

Span = tuple[float, float]

_BOX_FACES = {
    "-x": (0, 1, 3, 2),
    "+x": (4, 6, 7, 5),
    "-y": (0, 4, 5, 1),
    "+y": (2, 3, 7, 6),
    "-z": (0, 2, 6, 4),
    "+z": (1, 5, 7, 3),
}


def box(name: str, x: Span, y: Span, z: Span, without: Sequence[str] = ()) -> Part:
    """A box of six quads; sides named in `without` ("-x" to "+z") are left open."""
    corners = [(a, b, c) for a in sorted(x) for b in sorted(y) for c in sorted(z)]
    faces = tuple(face for side, face in _BOX_FACES.items() if side not in without)
    return Part(name, np.array(corners, dtype=np.float64), faces)


def block(name: str, centre: ArrayLike, size: ArrayLike) -> Part:
    """A box by centre and full side lengths."""
    middle, half = np.asarray(centre, dtype=np.float64), np.asarray(size, dtype=np.float64) / 2
    x, y, z = zip(middle - half, middle + half, strict=True)
    return box(name, x, y, z)


def _ears(name: str, outline: Float64) -> list[tuple[int, ...]]:
    """Triangles of a simple polygon given counter-clockwise, (N, 2): ears cut one by one."""

    def cross(a: int, b: int, c: int) -> float:
        (ax, ay), (bx, by), (cx, cy) = outline[a], outline[b], outline[c]
        return float((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))

    left, triangles = list(range(len(outline))), []
    while len(left) > 3:
        for place in range(len(left)):
            a, b, c = left[place - 1], left[place], left[(place + 1) % len(left)]
            if cross(a, b, c) <= 0:
                continue
            others = (p for p in left if p not in (a, b, c))
            if not any(min(cross(a, b, p), cross(b, c, p), cross(c, a, p)) >= 0 for p in others):
                triangles.append((a, b, c))
                del left[place]
                break
        else:
            raise ValueError(f"prism {name!r}: its outline crosses itself")
    return [*triangles, tuple(left)]


def prism(name: str, axis: int, outline: ArrayLike, span: Span) -> Part:
    """A flat outline drawn out along an axis.

    Parameters
    ----------
    axis
        0, 1 or 2; the outline's two coordinates are the other axes in rising order.
    outline : (N, 2)
        A simple polygon, either way round; concave ones get triangulated ends.
    span
        From where to where along the axis.

    Raises
    ------
    ValueError
        If a concave outline crosses itself.
    """
    points = np.asarray(outline, dtype=np.float64)
    ahead, behind = np.roll(points, -1, axis=0), np.roll(points, 1, axis=0)
    if float(np.sum(points[:, 0] * ahead[:, 1] - points[:, 1] * ahead[:, 0])) < 0:
        points = points[::-1]
        ahead, behind = np.roll(points, -1, axis=0), np.roll(points, 1, axis=0)
    count = len(points)
    first, second = points - behind, ahead - points
    convex = bool(np.all(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0] >= 0))
    cap = [tuple(range(count))] if convex else _ears(name, points)
    sides = [(i, i + count, (i + 1) % count + count, (i + 1) % count) for i in range(count)]
    vertices = np.concatenate(
        [np.insert(points, axis, end, axis=1) for end in (min(span), max(span))]
    )
    tops = [tuple(i + count for i in reversed(face)) for face in cap]
    return outward(name, vertices, [*cap, *tops, *sides])


def loft(
    name: str,
    rings: ArrayLike,
    *,
    capped: bool = True,
    closed: bool = True,
    cap: Sequence[tuple[int, ...]] | None = None,
) -> Part:
    """Quads between rings of as many points; a ring shrunk to a point becomes a pole.

    Parameters
    ----------
    rings : (K, N, 3)
    capped
        Whether the first and last ring are closed with an N-gon.
    closed
        Whether the last point of a ring joins the first.
    cap
        Polygons of a ring that close an end, where the N-gon would be concave.
    """
    stations = np.asarray(rings, dtype=np.float64)
    count = stations.shape[1]
    vertices: list[Float64] = []
    indices: list[list[int]] = []
    for ring in stations:
        pole = bool(np.all(np.abs(ring - ring[0]) < 1e-9))
        start = len(vertices)
        vertices.extend(ring[:1] if pole else ring)
        indices.append([start] * count if pole else list(range(start, start + count)))
    faces: list[tuple[int, ...]] = []
    for low, high in itertools.pairwise(indices):
        for i in range(count if closed else count - 1):
            j = (i + 1) % count
            quad = tuple(dict.fromkeys((low[i], low[j], high[j], high[i])))
            if len(quad) > 2:
                faces.append(quad)
    if capped:
        polygons = cap or [tuple(range(count))]
        for ring, step in ((indices[0], -1), (indices[-1], 1)):
            if ring[0] != ring[1]:
                faces += [tuple(ring[i] for i in polygon[::step]) for polygon in polygons]
    return outward(name, np.array(vertices), faces)


def circle(sides: int, phase: float = 0.0) -> Float64:
    """Points of the unit circle, (sides, 2); `phase` in steps between points."""
    angle = 2 * math.pi * (np.arange(sides) + phase) / sides
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def lathe(
    name: str,
    profile: Sequence[tuple[float, float]],
    sides: int = 14,
    centre: ArrayLike = (0, 0, 0),
    *,
    capped: bool = True,
    phase: float = 0.0,
) -> Part:
    """A profile of (radius, height) turned about the vertical through `centre`."""
    unit = circle(sides, phase)
    rings = [np.insert(unit * radius, 1, height, axis=1) for radius, height in profile]
    return loft(name, np.array(rings) + np.asarray(centre, dtype=np.float64), capped=capped)


def tube(
    name: str,
    path: ArrayLike,
    radius: float | Sequence[float],
    sides: int = 8,
    *,
    capped: bool = True,
    squash: float = 1.0,
) -> Part:
    """A round bar along a path.

    Parameters
    ----------
    path : (K, 3)
    radius
        One for all, or one a point of the path.
    sides
        Corners of the cross-section; 4 gives a square bar of side ``radius * sqrt(2)``.
    squash
        Ratio of the radius sideways of the path (in the frame's second direction).
    """
    points = np.asarray(path, dtype=np.float64)
    steps = np.diff(points, axis=0)
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    tangents = np.concatenate([steps[:1], steps[:-1] + steps[1:], steps[-1:]])
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    normal = np.array([0.0, 1.0, 0.0] if abs(tangents[0, 1]) < 0.9 else [0.0, 0.0, 1.0])
    normal -= tangents[0] * float(normal @ tangents[0])
    last = tangents[0]
    radii = np.broadcast_to(np.asarray(radius, dtype=np.float64), (len(points),))
    unit = circle(sides, 0.5)
    rings = []
    for point, tangent, reach in zip(points, tangents, radii, strict=True):
        # The smallest turn from one tangent to the next keeps the tube from twisting.
        turn = np.cross(last, tangent)
        normal = (
            normal * float(last @ tangent)
            + np.cross(turn, normal)
            + turn * (float(turn @ normal) / (1 + float(last @ tangent)))
        )
        normal /= np.linalg.norm(normal)
        last = tangent
        side = np.cross(tangent, normal)
        rings.append(point + reach * (unit[:, :1] * normal + unit[:, 1:] * side * squash))
    return loft(name, np.array(rings), capped=capped)


def rod(
    name: str,
    start: ArrayLike,
    end: ArrayLike,
    radius: float,
    end_radius: float | None = None,
    sides: int = 10,
) -> Part:
    """A straight round bar, tapered if `end_radius` differs."""
    radii = [radius, radius if end_radius is None else end_radius]
    return tube(name, np.array([start, end], dtype=np.float64), radii, sides)


def ellipsoid(
    name: str, centre: ArrayLike, radii: ArrayLike, sides: int = 12, rings: int = 7
) -> Part:
    """An ellipsoid along the axes, poles at its z ends."""
    unit = circle(sides)
    stations = [
        np.concatenate([unit * math.sin(angle), np.full((sides, 1), -math.cos(angle))], axis=1)
        for angle in np.linspace(0, math.pi, rings)
    ]
    stations[0][:, :2] = stations[-1][:, :2] = 0
    scale, middle = np.asarray(radii, dtype=np.float64), np.asarray(centre, dtype=np.float64)
    return loft(name, np.array(stations) * scale + middle, capped=False)
