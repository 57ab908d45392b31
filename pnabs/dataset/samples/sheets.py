"""Building blocks with openings, most of them without thickness."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pnabs.dataset.samples.parts import Part, outward
from pnabs.dataset.samples.solids import Span, circle, lathe, loft

Hole = tuple[float, float, float, float]
"""A rectangular opening: from and to in the first direction, from and to in the second."""


def sheet(name: str, *corners: ArrayLike) -> Part:
    """One polygon without thickness, its corners in order round the rim."""
    return Part(name, np.asarray(corners, dtype=np.float64), (tuple(range(len(corners))),))


def strip(name: str, edges: ArrayLike) -> Part:
    """A sheet between lines of as many points, (K, N, 3)."""
    return loft(name, edges, capped=False, closed=False)


def _cuts(bounds: Span, places: Sequence[float]) -> list[float]:
    """Both bounds and the places between them, in order and none next to another."""
    cuts = [bounds[0]]
    for place in sorted(places):
        # Sums that ought to be equal differ in their last bits and would give slivers.
        if cuts[-1] + 1e-6 < place < bounds[1] - 1e-6:
            cuts.append(place)
    return [*cuts, bounds[1]]


def panel(
    name: str, axis: int, span: Span, first: Span, second: Span, holes: Sequence[Hole] = ()
) -> Part:
    """A rectangular panel across an axis, with rectangular windows.

    Parameters
    ----------
    axis
        The panel's normal; `first` and `second` run along the other axes in rising order.
    span
        The panel's two faces along the axis; equal ends give a sheet without thickness.
    holes
        Openings, apart from each other, inside the panel or reaching over its rim.

    Raises
    ------
    ValueError
        If the holes leave nothing.
    """
    us = _cuts(first, [hole[end] for hole in holes for end in (0, 1)])
    vs = _cuts(second, [hole[end] for hole in holes for end in (2, 3)])
    filled = np.ones((len(us) + 1, len(vs) + 1), dtype=bool)
    filled[0] = filled[-1] = filled[:, 0] = filled[:, -1] = False
    middle_u = (np.array(us[:-1]) + us[1:]) / 2
    middle_v = (np.array(vs[:-1]) + vs[1:]) / 2
    for u0, u1, v0, v1 in holes:
        inside_u = (middle_u > u0) & (middle_u < u1)
        inside_v = (middle_v > v0) & (middle_v < v1)
        filled[1:-1, 1:-1] &= ~(inside_u[:, None] & inside_v[None, :])
    if not filled.any():
        raise ValueError(f"panel {name!r}: the holes leave nothing of it")

    index: dict[tuple[int, int, int], int] = {}

    def corner(i: int, j: int, side: int) -> int:
        return index.setdefault((i, j, side), len(index))

    thick = span[0] != span[1]
    faces: list[tuple[int, ...]] = []
    for i, j in np.argwhere(filled).tolist():
        low = [(i - 1, j - 1), (i, j - 1), (i, j), (i - 1, j)]
        faces.append(tuple(corner(*at, 1) for at in low))
        if not thick:
            continue
        faces.append(tuple(corner(*at, 0) for at in reversed(low)))
        for k, (di, dj) in enumerate(((0, -1), (1, 0), (0, 1), (-1, 0))):
            if not filled[i + di, j + dj]:
                a, b = low[k], low[(k + 1) % 4]
                faces.append((corner(*a, 0), corner(*b, 0), corner(*b, 1), corner(*a, 1)))
    vertices = np.zeros((len(index), 3))
    along = [other for other in range(3) if other != axis]
    for (i, j, side), place in index.items():
        vertices[place, axis] = sorted(span)[side]
        vertices[place, along] = us[i], vs[j]
    # Rising order of the other axes is left-handed about y.
    made = tuple(faces) if axis != 1 else tuple(tuple(reversed(face)) for face in faces)
    return Part(name, vertices, made)


def hoop(name: str, profile: ArrayLike, sides: int = 20, centre: ArrayLike = (0, 0, 0)) -> Part:
    """A closed outline of (radius, height), (N, 2), turned about the vertical: a ring."""
    outline = np.asarray(profile, dtype=np.float64)
    count = len(outline)
    unit = circle(sides, 0.5)
    rings = [np.stack([outline[:, 0] * c, outline[:, 1], outline[:, 0] * s], 1) for c, s in unit]
    faces = [
        (i * count + j, i * count + k, m * count + k, m * count + j)
        for i, m in ((i, (i + 1) % sides) for i in range(sides))
        for j, k in ((j, (j + 1) % count) for j in range(count))
    ]
    return outward(name, np.concatenate(rings) + np.asarray(centre, dtype=np.float64), faces)


def shade(
    name: str,
    bottom: float,
    top: float,
    span: Span,
    sides: int = 20,
    centre: ArrayLike = (0, 0, 0),
    thickness: float = 0.0,
) -> Part:
    """A lampshade open at both ends: radii at bottom and top, from height to height.

    With a thickness it is a closed wall, without one a single sheet.
    """
    low, high = span
    if thickness:
        wall = [(bottom, low), (top, high), (top - thickness, high), (bottom - thickness, low)]
        return hoop(name, wall, sides, centre)
    return lathe(name, [(bottom, low), (top, high)], sides, centre, capped=False, phase=0.5)
