"""Tables: a top on legs, trestles or pedestals, and the other kinds."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pnabs.dataset.samples.desks import DESKS, corners
from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, moved
from pnabs.dataset.samples.sheets import panel, sheet
from pnabs.dataset.samples.solids import block, box, circle, lathe, prism, rod, tube
from pnabs.dataset.samples.special_tables import SPECIAL_TABLES


def table(draw: Draw) -> list[Part]:
    """One table, its long side along x."""
    return draw.kind(KINDS)(draw)


def _size(draw: Draw) -> tuple[float, float, float]:
    return draw.between(0.45, 0.95), draw.between(0.3, 0.48), draw.between(0.68, 0.78)


def _top(draw: Draw, w: float, d: float, h: float) -> list[Part]:
    """A rectangular top: board, planks, pane without thickness, or with cut corners."""
    kind, t = draw.cycle("top", ("board", "planks", "pane", "cut corners")), 0.035
    if kind == "planks":
        count = draw.whole(4, 7)
        step = 2 * d / count
        return [
            block("plank", (0, h - t / 2, (i + 0.5) * step - d), (2 * w, t, step * 0.9))
            for i in range(count)
        ]
    if kind == "pane":
        frame = panel(
            "frame", 1, (h - t, h), (-w, w), (-d, d), [(-w + 0.07, w - 0.07, -d + 0.07, d - 0.07)]
        )
        y, a, b = h - t / 2, w - 0.07, d - 0.07
        return [frame, sheet("pane", (-a, y, -b), (-a, y, b), (a, y, b), (a, y, -b))]
    if kind == "cut corners":
        c = 0.12
        outline = [
            (-w + c, -d),
            (w - c, -d),
            (w, -d + c),
            (w, d - c),
            (w - c, d),
            (-w + c, d),
            (-w, d - c),
            (-w, -d + c),
        ]
        return [prism("top", 1, outline, (h - t, h))]
    return [box("top", (-w, w), (h - t, h), (-d, d))]


def _four_legs(draw: Draw) -> list[Part]:
    w, d, h = _size(draw)
    t = draw.between(0.05, 0.1)
    legs = [
        block("leg", (x, (h - 0.035) / 2, z), (t, h - 0.035, t)) for x, z in corners(w - t, d - t)
    ]
    apron = [
        *[
            box("apron", (-w + t, w - t), (h - 0.13, h - 0.035), (z - 0.012, z + 0.012))
            for z in (-d + t, d - t)
        ],
        *both_sides(
            [box("apron", (w - t - 0.012, w - t + 0.012), (h - 0.13, h - 0.035), (-d + t, d - t))]
        ),
    ]
    return _top(draw, w, d, h) + legs + apron


def _turned_legs(draw: Draw) -> list[Part]:
    w, d, h = _size(draw)
    profile = [
        (0.02, 0),
        (0.035, 0.08),
        (0.022, 0.14),
        (0.045, h * 0.45),
        (0.025, h * 0.6),
        (0.04, h * 0.66),
        (0.04, h - 0.03),
    ]
    legs = [lathe("leg", profile, 10, (x, 0, z)) for x, z in corners(w - 0.07, d - 0.07)]
    return _top(draw, w, d, h) + legs


def _low_with_shelf(draw: Draw) -> list[Part]:
    w, d, h = draw.between(0.4, 0.7), draw.between(0.25, 0.4), draw.between(0.38, 0.5)
    level = h * draw.between(0.25, 0.5)
    legs = [
        block("leg", (x, h / 2 - 0.02, z), (0.045, h - 0.035, 0.045))
        for x, z in corners(w - 0.03, d - 0.03)
    ]
    return [
        *_top(draw, w, d, h),
        *legs,
        box("shelf", (-w + 0.02, w - 0.02), (level, level + 0.02), (-d + 0.02, d - 0.02)),
    ]


def _trestle(draw: Draw) -> list[Part]:
    w, d, h = _size(draw)
    x = w * 0.7
    ends = [
        rod("leg", (x, h - 0.03, end * 0.08), (x, 0, end * (d - 0.04)), 0.03, sides=4)
        for end in (-1, 1)
    ]
    cross = block("cross", (x, h * 0.45, 0), (0.03, 0.06, d))
    return [
        *_top(draw, w, d, h),
        *both_sides([*ends, cross]),
        block("beam", (0, h * 0.45, 0), (2 * x, 0.05, 0.03)),
    ]


def _round_pedestal(draw: Draw) -> list[Part]:
    r, h = draw.between(0.4, 0.65), draw.between(0.68, 0.76)
    top = lathe("top", [(r, h - 0.03), (r, h)], 24)
    profile = [
        (r * 0.55, 0),
        (r * 0.55, 0.02),
        (0.05, 0.09),
        (0.035, h * 0.5),
        (0.06, h - 0.1),
        (0.14, h - 0.03),
    ]
    return [top, lathe("column", profile, 14)]


def _clawed(draw: Draw) -> list[Part]:
    r, h, feet = draw.between(0.35, 0.6), draw.between(0.6, 0.74), draw.pick((3, 4))
    top = lathe("top", [(r, h - 0.025), (r, h)], draw.pick((6, 8, 20)))
    claws = []
    for a in (2 * math.pi * (i + 0.5) / feet for i in range(feet)):
        c, s = math.sin(a), math.cos(a)
        path = [
            (0.02 * c, 0.3, 0.02 * s),
            (0.4 * r * c, 0.25, 0.4 * r * s),
            (0.75 * r * c, 0.02, 0.75 * r * s),
            (0.9 * r * c, 0.02, 0.9 * r * s),
        ]
        claws.append(tube("claw", path, (0.03, 0.028, 0.022, 0.018), 6))
    return [top, rod("column", (0, 0.22, 0), (0, h - 0.02, 0), 0.045, 0.03), *claws]


def _double_pedestal(draw: Draw) -> list[Part]:
    w, d, h = draw.between(0.8, 1.2), draw.between(0.4, 0.5), 0.75
    outline = circle(24) * (w, d)
    top = prism("top", 1, outline, (h - 0.04, h))
    post = [
        block("post", (w * 0.5, h / 2, 0), (0.1, h - 0.05, 0.18)),
        block("foot", (w * 0.5, 0.03, 0), (0.14, 0.06, 1.5 * d)),
        block("head", (w * 0.5, h - 0.06, 0), (0.12, 0.05, 1.2 * d)),
    ]
    return [top, *both_sides(post)]


def _nested(draw: Draw) -> list[Part]:
    parts = []
    for i in range(draw.whole(2, 3)):
        w, d, h = 0.42 - 0.08 * i, 0.28 - 0.03 * i, 0.55 - 0.09 * i
        z = -0.13 * i
        parts += [
            block("top", (0, h, z), (2 * w, 0.02, 2 * d)),
            *[
                block("leg", (x, h / 2, z + c), (0.025, h, 0.025))
                for x, c in corners(w - 0.02, d - 0.02)
            ],
        ]
    return parts


def _crossed(draw: Draw) -> list[Part]:
    w, d, h = _size(draw)
    x = w * draw.between(0.6, 0.85)
    legs = [
        rod("leg", (x, h - 0.03, end * (d - 0.05)), (x, 0, -end * (d - 0.05)), 0.035, sides=4)
        for end in (-1, 1)
    ]
    return [
        *_top(draw, w, d, h),
        *both_sides(legs),
        rod("stretcher", (-x, h / 2 - 0.015, 0), (x, h / 2 - 0.015, 0), 0.02, sides=6),
    ]


def _hairpin(draw: Draw) -> list[Part]:
    w, d, h = draw.between(0.4, 0.8), draw.between(0.25, 0.4), draw.between(0.4, 0.74)
    pins = []
    for end in (-1, 1):
        x, z = w - 0.08, end * (d - 0.08)
        pins.append(
            tube(
                "hairpin",
                [
                    (x - 0.06, h - 0.03, z),
                    (x + 0.04, 0.008, z + end * 0.04),
                    (x, h - 0.03, z - end * 0.06),
                ],
                0.008,
                6,
            )
        )
    return [*_top(draw, w, d, h), *both_sides(pins)]


def _console(draw: Draw) -> list[Part]:
    w, d, h = draw.between(0.5, 0.75), 0.17, 0.82
    arc = [
        (h * 0.5 - 0.03 + 0.42 * h * math.sin(a), d * 0.3 * math.cos(a))
        for a in np.linspace(math.pi / 2, -math.pi / 2, 7)
    ]
    path = [(w - 0.04, y, -d * 0.3 - z) for y, z in arc]
    return [
        *_top(draw, w, d, h),
        *both_sides(
            [tube("leg", path, 0.02, 6), moved(tube("leg", path, 0.02, 6), (0, 0, 2 * d * 0.6))]
        ),
        box("shelf", (-w + 0.02, w - 0.02), (0.05, 0.075), (-d, d)),
        block("drawer", (0, h - 0.09, 0), (1.6 * w, 0.1, 1.7 * d)),
    ]


KINDS: tuple[Callable[[Draw], list[Part]], ...] = (
    _four_legs,
    _turned_legs,
    _low_with_shelf,
    _trestle,
    _round_pedestal,
    _clawed,
    _double_pedestal,
    _nested,
    _crossed,
    _hairpin,
    _console,
    *DESKS,
    *SPECIAL_TABLES,
)
