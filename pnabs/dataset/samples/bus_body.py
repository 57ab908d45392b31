"""What buses have in common: pierced shells, wheels and seats."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides
from pnabs.dataset.samples.sheets import Hole, panel, sheet
from pnabs.dataset.samples.solids import Span, block, box, rod


class Body(NamedTuple):
    """One car: half width, length, heights of floor and roof, thickness of its walls.

    A thickness of 0 gives walls that are single sheets.
    """

    w: float
    z: Span
    floor: float
    roof: float
    t: float


def city_body(draw: Draw, length: float, floor: float, roof: float) -> Body:
    """A body of the given length and heights; its wall thickness comes round evenly, 0 included."""
    t = draw.cycle("walls", (0.06, 0.04, 0.0))
    return Body(draw.between(1.15, 1.3), (-length / 2, length / 2), floor, roof, t)


def window_row(z: Span, y: Span, count: int, gap: float) -> list[Hole]:
    """Evenly spaced openings along z, `gap` apart, as a side wall's holes."""
    step = (z[1] - z[0]) / count
    return [(*y, z[0] + i * step + gap / 2, z[0] + (i + 1) * step - gap / 2) for i in range(count)]


def pierced_shell(
    b: Body,
    left: Sequence[Hole],
    right: Sequence[Hole],
    front: Sequence[Hole],
    rear: Sequence[Hole],
    *,
    roof: bool = True,
) -> list[Part]:
    """Walls with openings; a side's holes are (y, y, z, z), an end's (x, x, y, y)."""
    y = (b.floor, b.roof)
    inner = (b.z[0] + b.t, b.z[1] - b.t)
    parts = [
        panel("left_side", 0, (b.w - b.t, b.w), y, inner, left),
        panel("right_side", 0, (-b.w, -b.w + b.t), y, inner, right),
        panel("front", 2, (b.z[0], b.z[0] + b.t), (-b.w, b.w), y, front),
        panel("rear", 2, (b.z[1] - b.t, b.z[1]), (-b.w, b.w), y, rear),
        box("floor", (-b.w, b.w), (b.floor - 0.06, b.floor), b.z),
    ]
    if roof and b.t:
        parts.append(box("roof", (-b.w, b.w), (b.roof, b.roof + b.t), b.z))
    elif roof:
        parts.append(
            sheet(
                "roof",
                (-b.w, b.roof, b.z[0]),
                (-b.w, b.roof, b.z[1]),
                (b.w, b.roof, b.z[1]),
                (b.w, b.roof, b.z[0]),
            )
        )
    return parts


def wheel_pairs(draw: Draw, b: Body, places: Sequence[float], radius: float = 0.48) -> list[Part]:
    """A wheel on each side at every place along z."""
    kind = draw.cycle("wheels", ("plain", "hub", "faceted"))
    sides = 10 if kind == "faceted" else 16
    parts = []
    for z in places:
        at = (b.w - 0.3, radius, z)
        parts.append(rod("tyre", at, (b.w - 0.02, radius, z), radius, sides=sides))
        if kind == "hub":
            parts.append(
                rod("hub", (b.w - 0.05, radius, z), (b.w + 0.02, radius, z), radius * 0.45, sides=8)
            )
    return both_sides(parts)


def seat_rows(draw: Draw, b: Body, floor: float, z: Span) -> list[Part]:
    """What stands on a deck between two ends: rows of seats, benches along the walls or poles."""
    kind = draw.cycle("seats", ("rows", "benches", "none", "rows"))
    if kind == "none":
        return [
            rod("pole", (x, floor, a), (x, b.roof, a), 0.025, sides=6)
            for x in (-0.35, 0.35)
            for a in np.linspace(z[0] + 0.5, z[1] - 0.5, 4)
        ]
    if kind == "benches":
        seat = box("bench", (b.w - b.t - 0.5, b.w - b.t - 0.02), (floor + 0.35, floor + 0.45), z)
        return both_sides([seat])
    parts = []
    for a in np.arange(z[0] + 0.5, z[1] - 0.4, draw.between(0.85, 1.1)).tolist():
        x = (b.w - b.t - 0.95, b.w - b.t - 0.05)
        parts += [
            box("seat", x, (floor + 0.3, floor + 0.44), (a - 0.22, a + 0.22)),
            box("seat_back", x, (floor + 0.4, floor + 1.0), (a + 0.2, a + 0.28)),
        ]
    return both_sides(parts)


def extras(draw: Draw, b: Body) -> list[Part]:
    """Cooler, mirrors and bumpers, each on some of the buses."""
    parts = []
    if draw.chance(0.5):
        parts.append(block("cooler", (0, b.roof + 0.15, draw.between(-1, 1)), (1.4, 0.25, 2.0)))
    if draw.chance(0.6):
        parts += both_sides(
            [
                block("mirror", (b.w + 0.14, b.roof - 0.9, b.z[0] - 0.08), (0.16, 0.4, 0.06)),
                rod(
                    "mirror_arm",
                    (b.w - 0.02, b.roof - 0.6, b.z[0] + 0.02),
                    (b.w + 0.14, b.roof - 0.75, b.z[0] - 0.08),
                    0.02,
                    sides=6,
                ),
            ]
        )
    if draw.chance(0.6):
        parts += [
            block("bumper", (0, b.floor + 0.12, end), (2 * b.w, 0.2, 0.16))
            for end in (b.z[0] - 0.05, b.z[1] + 0.05)
        ]
    return parts


def door_holes(b: Body, places: Sequence[float], wide: float = 1.0) -> list[Hole]:
    """Openings of a side wall down to its sill, as wide as `wide`, about places along z."""
    return [(b.floor - 1, b.roof - 0.35, z - wide / 2, z + wide / 2) for z in places]


def screens(b: Body, low: float, high: float) -> tuple[list[Hole], list[Hole]]:
    """Openings of the front and the rear wall between two heights."""
    screen = [(-b.w + 0.12, b.w - 0.12, low - 0.1, high)]
    return screen, [(-b.w + 0.25, b.w - 0.25, low + 0.1, high)]
