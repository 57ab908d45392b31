"""Tables that aren't a top on four legs."""

from __future__ import annotations

import math
from collections.abc import Callable

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, reflected, turned
from pnabs.dataset.samples.sheets import hoop, panel, sheet
from pnabs.dataset.samples.solids import block, box, circle, lathe, prism, rod, tube


def _waterfall(draw: Draw) -> list[Part]:
    w, d, h = draw.between(0.4, 0.7), draw.between(0.2, 0.4), draw.between(0.4, 0.72)
    t = draw.between(0.03, 0.08)
    outline = [
        (-w, 0),
        (-w, h),
        (w, h),
        (w, 0),
        (w - t, 0),
        (w - t, h - t),
        (-w + t, h - t),
        (-w + t, 0),
    ]
    return [prism("sheet", 2, outline, (-d, d))]


def _cube(draw: Draw) -> list[Part]:
    s, t = draw.between(0.2, 0.3), 0.03
    y = (0, 2 * s)
    sides = [
        panel(
            "side",
            2,
            (z, z + math.copysign(t, -z)),
            (-s, s),
            y,
            [(-s + 0.08, s - 0.08, 0.08, 2 * s - 0.08)],
        )
        for z in (-s, s)
    ]
    return [
        *sides,
        *both_sides([panel("side", 0, (s - t, s), y, (-s + t, s - t))]),
        box("top", (-s - 0.01, s + 0.01), (2 * s, 2 * s + 0.03), (-s - 0.01, s + 0.01)),
    ]


def _side_c(draw: Draw) -> list[Part]:
    w, d, h = 0.22, 0.2, draw.between(0.55, 0.68)
    post = [
        tube("post", [(w, h, z), (w, 0.015, z), (-w, 0.015, z)], 0.016, 6)
        for z in (-d + 0.02, d - 0.02)
    ]
    return [box("top", (-w, w + 0.01), (h, h + 0.03), (-d, d)), *post]


def _tripod_glass(draw: Draw) -> list[Part]:
    r, h = draw.between(0.35, 0.55), draw.between(0.4, 0.6)
    rim = hoop("rim", [(r - 0.02, h), (r, h), (r, h + 0.025), (r - 0.02, h + 0.025)], 24)
    unit = circle(24, 0.5) * (r - 0.02)
    pane = sheet("glass", *[(x, h + 0.012, z) for x, z in unit[::-1]])
    turn = draw.between(0, 1)
    legs = [
        rod(
            "leg",
            (0.9 * r * math.sin(a), h, 0.9 * r * math.cos(a)),
            (0.7 * r * math.sin(a + 2), 0, 0.7 * r * math.cos(a + 2)),
            0.014,
            sides=8,
        )
        for a in (2 * math.pi * i / 3 + turn for i in range(3))
    ]
    return [rim, pane, *legs]


def _drop_leaf(draw: Draw) -> list[Part]:
    w, d, h = 0.3, draw.between(0.35, 0.5), 0.74
    leaf = box("leaf", (w + 0.005, w + 0.025), (h - draw.between(0.3, 0.45), h), (-d, d))
    legs = both_sides(
        [
            lathe("leg", [(0.02, 0), (0.03, h * 0.5), (0.03, h - 0.02)], 8, (w - 0.04, 0, z))
            for z in (-d + 0.05, d - 0.05)
        ]
    )
    return [
        box("top", (-w, w), (h - 0.02, h), (-d, d)),
        *both_sides([leaf]),
        *legs,
        box("apron", (-w + 0.03, w - 0.03), (h - 0.13, h - 0.02), (-d + 0.04, d - 0.04)),
    ]


def _picnic(draw: Draw) -> list[Part]:
    w, h = draw.between(0.75, 1.0), 0.74
    if draw.variant("picnic", ("long", "round")) == "round":
        return _round_picnic(h)
    boards = [block("board", (0, h, (i - 2) * 0.15), (2 * w, 0.03, 0.14)) for i in range(5)]
    seats = [block("seat", (0, 0.44, z), (2 * w, 0.03, 0.25)) for z in (-0.65, 0.65)]
    frame = [
        *[
            rod("leg", (w * 0.7, h - 0.02, end * 0.2), (w * 0.7, 0, end * 0.6), 0.035, sides=4)
            for end in (-1, 1)
        ],
        block("bearer", (w * 0.7, 0.4, 0), (0.04, 0.09, 1.5)),
        block("bearer", (w * 0.7, h - 0.05, 0), (0.04, 0.07, 0.7)),
    ]
    return boards + seats + both_sides(frame)


def _round_picnic(h: float) -> list[Part]:
    parts = [
        lathe("top", [(0.6, h - 0.04), (0.6, h)], 8, phase=0.5),
        rod("column", (0, 0, 0), (0, h, 0), 0.06),
    ]
    for i in range(4):
        seat = [
            lathe("seat", [(0.2, 0.42), (0.2, 0.46)], 12, (0, 0, -0.95)),
            tube("arm", [(0, 0.3, 0), (0, 0.2, -0.6), (0, 0.42, -0.95)], 0.03, 6),
            rod("foot", (0, 0.02, 0), (0, 0.02, -0.8), 0.03, sides=4),
        ]
        parts += [turned(part, 1, 45 + 90 * i) for part in seat]
    return parts


def _ping_pong(draw: Draw) -> list[Part]:
    w, d, h = 1.37, 0.76, 0.76
    half = box("half", (0.01, w), (h - 0.025, h), (-d, d))
    folded = draw.variant("fold", (False, True))
    halves = [reflected(half), turned(half, 2, 85, (0.01, h, 0)) if folded else half]
    net = sheet(
        "net", (0, h, -d - 0.1), (0, h, d + 0.1), (0, h + 0.15, d + 0.1), (0, h + 0.15, -d - 0.1)
    )
    far = draw.between(0.8, 1.1)
    legs = [
        tube(
            "frame",
            [
                (x, h - 0.02, -d * 0.8),
                (x, 0.02, -d * 0.8),
                (x, 0.02, d * 0.8),
                (x, h - 0.02, d * 0.8),
            ],
            0.02,
            6,
        )
        for x in ((-far, -0.25, 0.1) if folded else (-far, -0.25, 0.25, far))
    ]
    return [*halves, net, *legs]


SPECIAL_TABLES: tuple[Callable[[Draw], list[Part]], ...] = (
    _waterfall,
    _cube,
    _side_c,
    _tripod_glass,
    _drop_leaf,
    _picnic,
    _ping_pong,
)
"""Makers of special tables."""
