"""Building blocks with openings, most of them without thickness."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pnabs.dataset.samples.parts import Part
from pnabs.dataset.samples.solids import Span, lathe, loft

Hole = tuple[float, float, float, float]
"""A rectangular opening: from and to in the first direction, from and to in the second."""


def sheet(name: str, *corners: ArrayLike) -> Part:
    """One polygon without thickness, its corners in order round the rim."""
    return Part(name, np.asarray(corners, dtype=np.float64), (tuple(range(len(corners))),))


def strip(name: str, edges: ArrayLike) -> Part:
    """A sheet between lines of as many points, (K, N, 3)."""
    return loft(name, edges, capped=False, closed=False)


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
    cuts = []
    for bounds, ends in ((first, (0, 1)), (second, (2, 3))):
        inner = {hole[end] for hole in holes for end in ends}
        cuts.append(sorted({*bounds, *(cut for cut in inner if bounds[0] < cut < bounds[1])}))
    us, vs = cuts
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
        vertices[place, axis] = span[side]
        vertices[place, along] = us[i], vs[j]
    # Rising order of the other axes is left-handed about y.
    made = tuple(faces) if axis != 1 else tuple(tuple(reversed(face)) for face in faces)
    return Part(name, vertices, made)


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
    profile = [(bottom, low), (top, high)]
    phase = 0.5
    if thickness:
        profile += [(top - thickness, high), (bottom - thickness, low), (bottom, low)]
        wall = lathe(name, profile[:4], sides, centre, capped=False, phase=phase)
        rim = tuple((3 * sides + i, 3 * sides + (i + 1) % sides, (i + 1) % sides, i)
                    for i in range(sides))
        first = wall.faces[0]
        # The loft may have been turned about; the rim follows its direction.
        ahead = first.index(1) - first.index(0) in (1, -3)
        faces = rim if ahead else tuple(tuple(reversed(face)) for face in rim)
        return wall._replace(faces=wall.faces + faces)
    return lathe(name, profile, sides, centre, capped=False, phase=phase)
