"""Chairs: bases, backs and armrests in ever new combinations."""

from __future__ import annotations

import math

import numpy as np

from pnabs.dataset.samples.chair_bases import BASES, Size, chair_base
from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, moved, turned
from pnabs.dataset.samples.sheets import panel, strip
from pnabs.dataset.samples.solids import block, box, lathe, rod, tube

BACKS = ("solid", "upright slats", "ladder", "frame", "shell", "none", "low", "rods", "pierced")


ARMS = ("none", "open", "panel", "none", "loop")


SEATS = ("board", "cushion", "sheet", "round", "slats")


def chair(draw: Draw) -> list[Part]:
    """One chair, its front looking along -z."""
    base, back = draw.cycle("base", BASES), draw.cycle("back", BACKS)
    arms, seat = draw.cycle("arms", ARMS), draw.cycle("seat", SEATS)
    size = Size(
        draw.between(0.2, 0.28),
        draw.between(0.2, 0.26),
        draw.between(0.38, 0.5),
        draw.between(0.025, 0.045),
    )
    if back == "none":
        arms = "none"
        if base in ("three legs", "disc", "star"):
            size = size._replace(h=draw.between(0.6, 0.75), w=0.18, d=0.18)
    if base in ("three legs", "drum"):
        seat = "round"
    elif base not in ("star", "disc") and seat == "round":
        seat = "board"
    if seat == "round":
        # A round seat meets a back only at its middle and armrests nowhere.
        size, arms = size._replace(d=size.w * 0.95), "none"
    parts = _seat(draw, seat, size) + chair_base(draw, base, size)
    return parts + _back(draw, back, size) + _arms(draw, arms, size)


def _seat(draw: Draw, kind: str, s: Size) -> list[Part]:
    low = s.h - s.t
    if kind == "cushion":
        frame = box("seat_frame", (-s.w, s.w), (low - 0.02, low), (-s.d, s.d))
        top = s.h + draw.between(0.02, 0.06)
        return [
            frame,
            box(
                "cushion", (-s.w + 0.01, s.w - 0.01), (low - 0.005, top), (-s.d - 0.01, s.d - 0.03)
            ),
        ]
    if kind == "sheet":
        across = np.linspace(-s.d, s.d, 6)
        sag = s.h - 0.03 * np.cos(across / s.d * math.pi / 2)
        return [
            strip(
                "seat", [[(x, y, z) for y, z in zip(sag, across, strict=True)] for x in (-s.w, s.w)]
            ),
            *both_sides([box("rail", (s.w - s.t, s.w), (low, s.h), (-s.d, s.d))]),
        ]
    if kind == "round":
        return [lathe("seat", [(s.w, low), (s.w, s.h - 0.01), (s.w - 0.02, s.h)], 18)]
    if kind == "slats":
        count = draw.whole(4, 7)
        step = 2 * s.d / count
        slats = [
            block(
                "slat", (0, s.h - s.t / 4, (i + 0.5) * step - s.d), (2 * s.w, s.t / 2, step * 0.7)
            )
            for i in range(count)
        ]
        return slats + both_sides(
            [box("rail", (s.w - 2 * s.t, s.w - s.t), (low, s.h - s.t / 2), (-s.d, s.d))]
        )
    return [box("seat", (-s.w, s.w), (low, s.h), (-s.d, s.d))]


def _back(draw: Draw, kind: str, s: Size) -> list[Part]:
    """The back, built upright behind the seat and then leant."""
    w, t, high = s.w, s.t, draw.between(0.38, 0.62)
    upright = both_sides([box("post", (w - t, w), (-s.t, high), (0, t))])
    rail = box("rail", (-w + t, w - t), (high - 2 * t, high), (0, t))
    thin = (t * 0.3, t * 0.7)
    if kind == "none":
        return []
    if kind == "solid":
        parts = [box("back", (-w, w), (-s.t, high), (0, t))]
    elif kind == "low":
        parts = [
            box("back", (-w, w), (high * 0.45, high * 0.75), (0, t)),
            *both_sides([box("post", (w - 2 * t, w - t), (-s.t, high * 0.5), (t, 1.6 * t))]),
        ]
    elif kind == "upright slats":
        count = draw.whole(3, 6)
        step = 2 * (w - t) / count
        slats = [
            block(
                "slat",
                ((i + 0.5) * step - w + t, high / 2, t / 2),
                (step * 0.5, high - 2 * t, t * 0.5),
            )
            for i in range(count)
        ]
        parts = [*upright, rail, *slats]
    elif kind == "ladder":
        count = draw.whole(2, 5)
        step = high / count
        rungs = [
            box("rung", (-w + t, w - t), ((i + 0.5) * step, (i + 0.95) * step), thin)
            for i in range(count)
        ]
        parts = [*upright, *rungs]
    elif kind == "frame":
        parts = [
            panel(
                "back",
                2,
                (0, t),
                (-w, w),
                (-s.t, high),
                [(-w + 2 * t, w - 2 * t, 0.1, high - 2 * t)],
            )
        ]
    elif kind == "pierced":
        gap = high / 4
        parts = [
            panel(
                "back",
                2,
                (0, t),
                (-w, w),
                (-s.t, high),
                [(-w + 2 * t, -t, gap, high - gap), (t, w - 2 * t, gap, high - gap)],
            )
        ]
    elif kind == "shell":
        wrap = draw.between(0.06, 0.2)
        line = [
            (w * math.sin(a) / math.sin(1), t - wrap * (1 - math.cos(a)) / (1 - math.cos(1)))
            for a in np.linspace(-1, 1, 7)
        ]
        parts = [
            strip(
                "shell",
                [
                    [(x * (1 - 0.3 * lift * lift), -t + lift * (high + t), z) for x, z in line]
                    for lift in (0, 0.5, 1)
                ],
            )
        ]
    else:
        count = draw.whole(5, 8)
        arch = [
            (w * math.cos(a), high * (0.55 + 0.45 * math.sin(a)), t)
            for a in np.linspace(0, math.pi, 9)
        ]
        hoop_path = [(w, -s.t, t), *arch, (-w, -s.t, t)]
        parts = [tube("hoop", hoop_path, 0.013, 6)]
        for i in range(count):
            x = w * (2 * (i + 0.5) / count - 1) * 0.85
            top = high * (0.55 + 0.45 * math.sqrt(1 - (x / w) ** 2))
            parts.append(rod("rod", (x * 0.8, -s.t / 2, t), (x, top, t), 0.008, sides=6))
    lean = draw.between(0, 14)
    return [moved(turned(part, 0, lean), (0, s.h, s.d - t)) for part in parts]


def _arms(draw: Draw, kind: str, s: Size) -> list[Part]:
    w, d, t = s.w, s.d, s.t
    rest = s.h + draw.between(0.17, 0.25)
    if kind == "open":
        return both_sides(
            [
                box("armrest", (w - t / 2, w + t), (rest - 0.025, rest), (-d * 0.8, d + t)),
                box(
                    "arm_post",
                    (w - t / 4, w + t / 2),
                    (s.h - s.t, rest - 0.02),
                    (-d * 0.7, -d * 0.7 + t),
                ),
            ]
        )
    if kind == "panel":
        return both_sides([box("arm", (w - t / 2, w + t), (s.h - 0.1, rest), (-d, d))])
    if kind == "loop":
        path = [
            (w + t / 2, s.h - s.t, -d * 0.8),
            (w + t / 2, rest, -d * 0.7),
            (w + t / 2, rest, d * 0.6),
            (w + t / 2, s.h - s.t, d * 0.7),
        ]
        return both_sides([tube("arm", path, 0.014, 6)])
    return []
