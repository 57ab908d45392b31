"""What chairs stand on."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides
from pnabs.dataset.samples.sheets import hoop, panel
from pnabs.dataset.samples.solids import block, box, ellipsoid, lathe, rod, tube

BASES = (
    "straight legs",
    "splayed legs",
    "star",
    "disc",
    "sled",
    "cantilever",
    "panels",
    "cube",
    "rocker",
    "three legs",
    "crossed legs",
    "drum",
)


class Size(NamedTuple):
    """Half width, half depth, height of the seat's top and thickness of members."""

    w: float
    d: float
    h: float
    t: float


def _legs(draw: Draw, s: Size, splay: float) -> list[Part]:
    top, t = s.h - s.t, s.t
    x, z = s.w - t / 2, s.d - t / 2
    if splay:
        legs = both_sides(
            [
                rod(
                    "leg",
                    (x * 0.8, top, end * z * 0.8),
                    (x + splay, 0, end * (z + splay)),
                    t / 2,
                    t / 4,
                    8,
                )
                for end in (-1, 1)
            ]
        )
    else:
        legs = both_sides([block("leg", (x, top / 2, end * z), (t, top, t)) for end in (-1, 1)])
    kind = draw.cycle("stretcher", ("none", "h", "box", "none"))
    level = draw.between(0.1, 0.18)
    if kind != "none" and not splay:
        legs += both_sides([block("stretcher", (x, level, 0), (t * 0.6, t * 0.8, 2 * z))])
        ends = (0.0,) if kind == "h" else (-z, z)
        legs += [block("stretcher", (0, level, end), (2 * x, t * 0.8, t * 0.6)) for end in ends]
    return legs


def chair_base(draw: Draw, kind: str, s: Size) -> list[Part]:
    """What the seat stands on, of a kind in `BASES`, with `s` the chair's measures."""
    w, d, top, t = s.w, s.d, s.h - s.t, s.t
    if kind == "straight legs":
        return _legs(draw, s, 0)
    if kind == "splayed legs":
        return _legs(draw, s, draw.between(0.02, 0.07))
    if kind == "star":
        arms, reach = draw.pick((4, 5)), draw.between(0.24, 0.3)
        ends = [
            (reach * math.sin(a), reach * math.cos(a))
            for a in (2 * math.pi * i / arms for i in range(arms))
        ]
        star = [rod("spoke", (0, 0.09, 0), (x, 0.06, z), 0.025, 0.015, 6) for x, z in ends]
        castors = [ellipsoid("castor", (x, 0.03, z), (0.02, 0.03, 0.03), 8, 5) for x, z in ends]
        return [
            lathe("column", [(0.03, 0.06), (0.03, top / 2), (0.02, top / 2), (0.02, top)]),
            *star,
            *castors,
        ]
    if kind == "disc":
        reach = draw.between(0.18, 0.25)
        return [
            lathe(
                "stand",
                [
                    (reach, 0),
                    (reach, 0.015),
                    (0.03, 0.05),
                    (0.025, top * 0.6),
                    (0.025, top * 0.9),
                    (0.1, top),
                ],
                18,
            )
        ]
    if kind == "sled":
        path = [(w - t, top, -d + t), (w - t, 0.012, -d), (w - t, 0.012, d), (w - t, top, d - t)]
        return [
            *both_sides([tube("runner", path, 0.012, 6)]),
            rod("brace", (-w + t, 0.012, d), (w - t, 0.012, d), 0.012, sides=6),
        ]
    if kind == "cantilever":
        path = [
            (w - t, top, d),
            (w - t, top, -d),
            (w - t, 0.015, -d - 0.02),
            (w - t, 0.015, d),
            (0, 0.015, d),
        ]
        return both_sides([tube("frame", path, 0.014, 8)])
    if kind == "panels":
        return both_sides([box("side", (w - t, w), (0, s.h), (-d, d))])
    if kind == "cube":
        return [
            panel(
                "front", 2, (-d, -d + t), (-w, w), (0, top), [(-w + 0.08, w - 0.08, -1, top - 0.1)]
            ),
            box("rear", (-w, w), (0, top), (d - t, d)),
            *both_sides([box("side", (w - t, w), (0, top), (-d + t, d - t))]),
        ]
    if kind == "rocker":
        arc = np.linspace(-1.3 * d, 1.4 * d, 9)
        path = [(w - t, 0.02 + 0.35 * z * z, z) for z in arc]
        return [
            *both_sides([tube("rocker", path, 0.02, 4)]),
            *both_sides(
                [
                    block("leg", (w - t, (top + 0.03) / 2, end * (d - t)), (t, top - 0.03, t))
                    for end in (-1, 1)
                ]
            ),
        ]
    if kind == "three legs":
        return [
            rod(
                "leg",
                (0.5 * w * math.sin(a), top, 0.5 * w * math.cos(a)),
                (w * math.sin(a), 0, w * math.cos(a)),
                0.016,
                0.012,
                8,
            )
            for a in (2 * math.pi * i / 3 for i in range(3))
        ] + [
            hoop(
                "footrest",
                [
                    (0.62 * w, top * 0.3),
                    (0.68 * w, top * 0.3),
                    (0.68 * w, top * 0.3 + 0.02),
                    (0.62 * w, top * 0.3 + 0.02),
                ],
            )
        ]
    if kind == "crossed legs":
        legs = [
            rod("leg", (w - t, top, end * d), (w - t, 0, -end * d), t * 0.4, sides=6)
            for end in (-1, 1)
        ]
        bar = rod("bar", (-w, top / 2, 0), (w, top / 2, 0), t * 0.4, sides=6)
        return [*both_sides(legs), bar]
    return [lathe("drum", [(0.8 * w, 0), (0.9 * w, top / 2), (0.8 * w, top)], 16)]
