"""Hulls drawn through stations, deckhouses and masts."""

from __future__ import annotations

import math

import numpy as np

from pnabs.dataset.samples.parts import Part
from pnabs.dataset.samples.sheets import sheet, strip
from pnabs.dataset.samples.solids import Span, loft, prism, rod
from pnabs.geometry.types import Float64


def hull_stations(
    length: float,
    beam: float,
    depth: float,
    *,
    stern: float = 0.8,
    bow: float = 0.3,
    sheer: float = 0.0,
    fullness: float = 0.5,
    rake: float = 0.08,
    count: int = 9,
) -> Float64:
    """Cross-sections from stern to bow, (count, 9, 3), each from gunwale to gunwale.

    `stern` is the transom's share of the beam, `bow` the length of the bow's taper as a
    share of the whole, `sheer` how far the ends rise, `fullness` how boxy sections are
    (0 a wedge, 1 a box) and `rake` how far the stem leans forward.
    """
    rings = []
    for along in np.linspace(0, 1, count):
        taper = min(1.0, (1 - along) / bow) if bow else 1.0
        swell = stern + (1 - stern) * min(1.0, along / 0.35)
        # A stem without width would leave faces without area.
        half = beam / 2 * max(0.015, swell * math.sqrt(1 - (1 - taper) ** 2))
        top = depth * (1 + sheer * (2 * along - 1) ** 2)
        ring = []
        for s in np.linspace(-1, 1, 9):
            low = abs(s)
            height = top * low ** (1 + 4 * fullness)
            width = half * math.copysign(low ** (1 - 0.85 * fullness), s) if s else 0.0
            lean = rake * length * height / depth * along**3
            ring.append((width, height, length * (0.5 - along) - lean))
        rings.append(ring)
    return np.array(rings)


def hull_skin(name: str, rings: Float64) -> list[Part]:
    """Hull skin with its transom, without thickness, open above."""
    skin = strip(name, rings)
    return [skin, sheet("transom", *rings[0])]


def decked_hull(name: str, rings: Float64) -> Part:
    """A closed hull, decked along its gunwales."""
    return loft(name, rings)


def open_hull(name: str, rings: Float64, share: float = 0.88, floor: float = 0.12) -> list[Part]:
    """An open hull with a wall: the skin, an inner skin, the rim between and a transom."""
    inner = rings * (share, 1, share)
    low = rings[:, :, 1].max() * floor
    inner[:, :, 1] = np.maximum(inner[:, :, 1], low)
    inner[:, (0, -1), 1] = rings[:, (0, -1), 1]
    ends = [(i, i + 1, 16 - i, 17 - i) for i in range(8)]
    wall = loft(name, np.concatenate([rings, inner[:, ::-1]], axis=1), cap=ends)
    return [wall, sheet("transom", *rings[0])]


def deckhouse(name: str, x: float, y: Span, z: Span, slope: float = 0.0) -> Part:
    """A deckhouse whose front leans back."""
    line = [(y[0], z[0]), (y[1], z[0] + slope), (y[1], z[1]), (y[0], z[1])]
    return prism(name, 0, line, (-x, x))


def mast_at(y: float, top: float, z: float, radius: float = 0.05) -> Part:
    """A tapered mast at `z` along the middle line, from height `y` to `top`."""
    return rod("mast", (0, y, z), (0, top, z), radius, radius * 0.6, 8)
