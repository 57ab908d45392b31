"""Benches: seats, supports, backs and what is under the seat."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, moved, turned
from pnabs.dataset.samples.sheets import panel, sheet
from pnabs.dataset.samples.solids import block, box, lathe, prism, rod, tube

SUPPORTS = (
    "legs",
    "panels",
    "blocks",
    "cast ends",
    "trestle",
    "sled",
    "drums",
    "crossed legs",
    "boxes",
    "legs and shelf",
    "frames",
    "racks",
)
SEATS = ("plank", "long slats", "cross slats", "cushion", "two planks", "sheet")
BACKS = ("none", "solid", "long slats", "none", "upright slats", "frame", "rails")


class Size(NamedTuple):
    """Half length, half depth, height of the seat's top and thickness of members."""

    half: float
    d: float
    h: float
    t: float


def bench(draw: Draw) -> list[Part]:
    """One bench along x, its front looking along -z."""
    size = Size(
        draw.between(0.5, 1.0),
        draw.between(0.16, 0.25),
        draw.between(0.38, 0.48),
        draw.between(0.03, 0.06),
    )
    support, back = draw.cycle("support", SUPPORTS), draw.cycle("back", BACKS)
    arms = draw.cycle("arms", ("none", "ends", "none", "loop"))
    parts = _seat(draw, size) + _support(draw, support, size) + _back(draw, back, size)
    if back != "none" and arms != "none":
        parts += _arms(arms, size)
    return parts


def _seat(draw: Draw, s: Size) -> list[Part]:
    kind = draw.cycle("seat", SEATS)
    low = s.h - s.t
    if kind == "long slats":
        count = draw.whole(3, 6)
        step = 2 * s.d / count
        return [
            block(
                "slat", (0, s.h - s.t / 2, (i + 0.5) * step - s.d), (2 * s.half, s.t, step * 0.75)
            )
            for i in range(count)
        ]
    if kind == "cross slats":
        count = draw.whole(9, 16)
        step = 2 * s.half / count
        return [
            block(
                "slat",
                ((i + 0.5) * step - s.half, s.h - s.t / 4, 0),
                (step * 0.65, s.t / 2, 2 * s.d),
            )
            for i in range(count)
        ] + [
            box("rail", (-s.half, s.half), (low, s.h - s.t / 2), (end - s.t / 2, end + s.t / 2))
            for end in (-s.d * 0.8, s.d * 0.8)
        ]
    if kind == "cushion":
        return [
            box("frame", (-s.half, s.half), (low, s.h), (-s.d, s.d)),
            box(
                "cushion",
                (-s.half + 0.02, s.half - 0.02),
                (s.h - 0.01, s.h + 0.07),
                (-s.d + 0.02, s.d - 0.02),
            ),
        ]
    if kind == "two planks":
        return [
            box("plank", (-s.half, s.half), (low, s.h), ends)
            for ends in ((-s.d, -0.02), (0.02, s.d))
        ]
    if kind == "sheet":
        return [
            sheet(
                "seat",
                (-s.half, s.h, -s.d),
                (-s.half, s.h, s.d),
                (s.half, s.h, s.d),
                (s.half, s.h, -s.d),
            ),
            *[
                box("rail", (-s.half, s.half), (low, s.h), ends)
                for ends in ((-s.d, -s.d + 0.03), (s.d - 0.03, s.d))
            ],
        ]
    return [box("plank", (-s.half, s.half), (low, s.h), (-s.d, s.d))]


def _support(draw: Draw, kind: str, s: Size) -> list[Part]:
    w, d, top, t = s.half, s.d, s.h - s.t, s.t
    inset = w * draw.between(0.75, 0.95)
    ends = (-1, 1)
    if kind in ("legs", "legs and shelf"):
        legs = both_sides(
            [block("leg", (inset, top / 2, end * (d - t / 2)), (t, top, t)) for end in ends]
        )
        if kind == "legs":
            return [
                *legs,
                *both_sides([block("rail", (inset, top - 0.05, 0), (t / 2, 0.06, 2 * d))]),
            ]
        if draw.chance(0.5):
            return [*legs, block("shelf", (0, 0.14, 0), (2 * inset, 0.025, 2 * d - t))]
        return legs + [
            block("shelf_slat", (0, 0.14, (i - 1.5) * d / 2.2), (2 * inset, 0.02, d / 3.5))
            for i in range(4)
        ]
    if kind == "panels":
        shelf = [block("shelf", (0, 0.15, 0), (2 * inset, 0.025, 2 * d - 0.04))]
        return both_sides([block("side", (inset, top / 2, 0), (t, top, 2 * d))]) + (
            shelf if draw.chance(0.6) else []
        )
    if kind == "blocks":
        return both_sides([block("block", (w * 0.7, top / 2, 0), (0.25 * w, top, 1.7 * d))])
    if kind == "cast ends":
        arch = [
            (top * 0.8 * math.sin(a), d * 0.75 * math.cos(a)) for a in np.linspace(0, math.pi, 9)
        ]
        outline = [(0, -d), (top, -d), (top, d), (0, d), *arch]
        return both_sides([prism("end", 0, outline, (inset - t / 2, inset + t / 2))])
    return _open_support(draw, kind, s, inset)


def _open_support(draw: Draw, kind: str, s: Size, inset: float) -> list[Part]:
    w, d, top, t = s.half, s.d, s.h - s.t, s.t
    ends = (-1, 1)
    if kind == "trestle":
        return [
            *both_sides(
                [
                    block("post", (inset * 0.8, top / 2, 0), (t * 1.5, top, d)),
                    block("foot", (inset * 0.8, 0.03, 0), (t * 1.5, 0.06, 2 * d)),
                ]
            ),
            block("beam", (0, top * 0.5, 0), (1.9 * inset, 0.08, t)),
        ]
    if kind == "sled":
        path = [(inset, top, -d), (inset, 0.015, -d), (inset, 0.015, d), (inset, top, d)]
        return both_sides([tube("runner", path, 0.018, 8)])
    if kind == "drums":
        count = draw.pick((2, 3))
        return [
            lathe(
                "drum",
                [(d * 0.9, 0), (d * 0.6, top / 2), (d * 0.9, top)],
                14,
                ((2 * i / (count - 1) - 1) * w * 0.7, 0, 0),
            )
            for i in range(count)
        ]
    if kind == "crossed legs":
        return [
            *both_sides(
                [
                    rod("leg", (inset, top, end * d), (inset, 0, -end * d), t / 2, sides=6)
                    for end in ends
                ]
            ),
            rod("brace", (-inset, top / 2, 0), (inset, top / 2, 0), t / 2.5, sides=6),
        ]
    if kind == "boxes":
        cells = draw.whole(2, 4)
        step = 2 * w / cells
        return [
            box("bottom", (-w, w), (0.03, 0.055), (-d, d)),
            *[
                block(
                    "divider",
                    (
                        i * step - w + (0.0125 if i == 0 else -0.0125 if i == cells else 0),
                        top / 2,
                        0,
                    ),
                    (0.025, top, 2 * d),
                )
                for i in range(cells + 1)
            ],
            *([box("rear", (-w, w), (0.03, top), (d - 0.012, d))] if draw.chance(0.6) else []),
        ]
    if kind == "frames":
        return both_sides(
            [
                panel(
                    "frame",
                    0,
                    (inset - t / 2, inset + t / 2),
                    (0, top),
                    (-d, d),
                    [(t, top - t / 2, -d + t, d - t)],
                )
            ]
        )
    shelves = [
        block("rack", (0, level * top, 0), (2 * inset, 0.015, 1.9 * d)) for level in (0.2, 0.5)
    ]
    legs = both_sides(
        [
            rod("leg", (inset, top, end * d * 0.9), (inset, 0, end * d * 0.9), 0.014, sides=8)
            for end in ends
        ]
    )
    return [*legs, *shelves]


def _back(draw: Draw, kind: str, s: Size) -> list[Part]:
    """The back, built upright behind the seat and then leant."""
    w, t, high = s.half, s.t, draw.between(0.3, 0.5)
    posts = both_sides([box("post", (w * 0.9 - t, w * 0.9), (-t, high), (0, t))])
    if kind == "none":
        return []
    if kind == "solid":
        parts = [box("back", (-w, w), (-t, high), (0, t))]
    elif kind == "long slats":
        count = draw.whole(2, 4)
        step = (high - 0.06) / count
        parts = posts + [
            box("slat", (-w, w), (0.06 + i * step, 0.06 + (i + 0.7) * step), (-t / 2, 0))
            for i in range(count)
        ]
    elif kind == "upright slats":
        count = draw.whole(7, 14)
        step = 1.7 * w / count
        parts = [*posts, box("rail", (-w * 0.9, w * 0.9), (high - 0.06, high), (0, t))] + [
            block(
                "slat",
                ((i + 0.5) * step - 0.85 * w, high / 2 - 0.03, t / 2),
                (step * 0.4, high - 0.06, t / 3),
            )
            for i in range(count)
        ]
    elif kind == "frame":
        middle = draw.chance(0.5)
        holes = (
            [(-w + 0.1, -0.04, 0.1, high - 0.08), (0.04, w - 0.1, 0.1, high - 0.08)]
            if middle
            else [(-w + 0.1, w - 0.1, 0.1, high - 0.08)]
        )
        parts = [panel("back", 2, (0, t), (-w, w), (-t, high), holes)]
    else:
        parts = posts + [
            rod("rail", (-w, level * high, 0), (w, level * high, 0), 0.015, sides=8)
            for level in (0.5, 0.75, 1)
        ]
    lean = draw.between(0, 15)
    return [moved(turned(part, 0, lean), (0, s.h, s.d - t)) for part in parts]


def _arms(kind: str, s: Size) -> list[Part]:
    rest = s.h + 0.22
    if kind == "ends":
        return both_sides(
            [
                box(
                    "armrest",
                    (s.half * 0.9 - 0.03, s.half * 0.9 + 0.03),
                    (rest, rest + 0.03),
                    (-s.d, s.d),
                ),
                box(
                    "arm_post",
                    (s.half * 0.9 - 0.02, s.half * 0.9 + 0.02),
                    (s.h - s.t, rest),
                    (-s.d + 0.02, -s.d + 0.06),
                ),
            ]
        )
    x = s.half * 0.92
    path = [(x, s.h - s.t, -s.d), (x, rest, -s.d * 0.8), (x, rest, s.d)]
    return both_sides([tube("arm", path, 0.018, 6)])
