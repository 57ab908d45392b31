"""Lamps: on floors and tables, and the mounted ones."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.mounted_lamps import MOUNTED_LAMPS, bulb
from pnabs.dataset.samples.parts import Part, both_sides, moved, turned
from pnabs.dataset.samples.sheets import shade, sheet
from pnabs.dataset.samples.solids import block, box, ellipsoid, lathe, rod, tube


def lamp(draw: Draw) -> list[Part]:
    """One lamp, upright along y."""
    return draw.kind(KINDS)(draw)


def _shade(draw: Draw, y: float, r: float) -> list[Part]:
    """A shade standing on height `y`, about the y axis."""
    kind = draw.cycle(
        "shade", ("cone", "drum", "box", "thick cone", "globe", "dome", "hexagon", "pyramid")
    )
    high = r * draw.between(0.9, 1.5)
    if kind == "drum":
        return [shade("shade", r, r, (y, y + high))]
    if kind == "box":
        return [box("shade", (-r, r), (y, y + high), (-r, r), without=("-y", "+y"))]
    if kind == "thick cone":
        return [shade("shade", r, 0.55 * r, (y, y + high), 24, thickness=0.012)]
    if kind == "globe":
        return [moved(ellipsoid("globe", (0, 0, 0), (0.8 * r,) * 3, 14, 9), (0, y + 0.8 * r, 0))]
    if kind == "dome":
        profile = [
            (r * math.cos(a), y + 0.9 * r * math.sin(a))
            for a in np.linspace(0, math.pi / 2 - 0.1, 6)
        ]
        return [lathe("dome", profile, 18, capped=False)]
    if kind == "hexagon":
        return [shade("shade", r, 0.7 * r, (y, y + high), 6)]
    if kind == "pyramid":
        return [shade("shade", 1.2 * r, 0.4 * r, (y, y + high * 0.8), 4)]
    return [shade("shade", r, draw.between(0.3, 0.7) * r, (y, y + high))]


def _floor(draw: Draw) -> list[Part]:
    h, foot = draw.between(1.2, 1.6), draw.between(0.12, 0.18)
    base = lathe(
        "foot", [(foot, 0), (foot, 0.02), (0.02, 0.05), (0.012, 0.06), (0.012, h + 0.05)], 16
    )
    return [base, bulb(h + 0.1), *_shade(draw, h, draw.between(0.16, 0.28))]


def _arc(draw: Draw) -> list[Part]:
    h, reach = draw.between(1.3, 1.7), draw.between(0.7, 1.1)
    path = [(0, 0.05, 0.3)] + [
        (0, h * (0.55 + 0.45 * math.sin(a)), 0.3 - reach * 0.5 * (1 - math.cos(a)))
        for a in np.linspace(0, math.pi * 0.8, 9)
    ]
    end, foot = path[-1], block("foot", (0, 0.03, 0.3), (0.3, 0.06, 0.2))
    if draw.variant("arc", ("dome", "globe")) == "globe":
        arms = [turned(tube("arc", path, 0.012, 6), 1, a, (0, 0, 0.3)) for a in (-40, 0, 40)]
        balls = [
            turned(
                ellipsoid("globe", np.add(end, (0, -0.1, 0)), (0.11, 0.11, 0.11), 12, 7),
                1,
                a,
                (0, 0, 0.3),
            )
            for a in (-40, 0, 40)
        ]
        return [foot, *arms, *balls]
    head = moved(
        lathe("dome", [(0.18, -0.1), (0.16, -0.02), (0.1, 0.05), (0.02, 0.08)], 16, capped=False),
        end,
    )
    return [foot, tube("arc", path, 0.012, 6), head]


def _tripod(draw: Draw) -> list[Part]:
    h, spread = draw.between(1.0, 1.4), draw.between(0.22, 0.35)
    legs = [
        rod(
            "leg",
            (0.02 * math.sin(a), h, 0.02 * math.cos(a)),
            (spread * math.sin(a), 0, spread * math.cos(a)),
            0.016,
            0.01,
            8,
        )
        for a in (2 * math.pi * i / 3 for i in range(3))
    ]
    return [
        *legs,
        lathe("hub", [(0.04, h - 0.05), (0.04, h + 0.02)], 10),
        *_shade(draw, h + 0.02, draw.between(0.2, 0.3)),
    ]


def _vase(draw: Draw) -> list[Part]:
    r, h = draw.between(0.07, 0.14), draw.between(0.25, 0.4)
    swell = draw.between(0.3, 0.7)
    profile = [
        (r * 0.7, 0),
        (r * 0.7, 0.015),
        (r * 0.5, 0.04),
        (r, h * swell),
        (r * 0.9, h * 0.75),
        (r * 0.25, h),
        (0.012, h + 0.02),
        (0.012, h + 0.07),
    ]
    return [
        lathe("vase", profile, draw.cycle("facets", (16, 4, 6)), phase=0.5),
        *_shade(draw, h + 0.05, draw.between(0.14, 0.22)),
    ]


def _stacked(draw: Draw) -> list[Part]:
    parts, y = [block("foot", (0, 0.015, 0), (0.18, 0.03, 0.18))], 0.03
    for i in range(draw.whole(2, 4)):
        r = draw.between(0.05, 0.09)
        kind = ("ball", "cube", "ring")[(i + draw.whole(0, 1)) % 3]
        if kind == "ball":
            parts.append(moved(ellipsoid("ball", (0, 0, 0), (r, r, r), 12, 7), (0, y + r, 0)))
        elif kind == "cube":
            parts.append(block("cube", (0, y + r, 0), (1.5 * r, 2 * r, 1.5 * r)))
        else:
            parts.append(
                lathe("ring", [(0.02, y), (r, y + r * 0.6), (r, y + r * 1.4), (0.02, y + 2 * r)])
            )
        y += 2 * r - 0.004
    return [
        *parts,
        *_shade(draw, y + 0.02, draw.between(0.14, 0.2)),
        rod("stem", (0, y - 0.01, 0), (0, y + 0.08, 0), 0.01),
    ]


def _desk(draw: Draw) -> list[Part]:
    """Two arms and a head, bent in the plane of symmetry or aside."""
    lower, upper = draw.between(0.3, 0.4), draw.between(0.28, 0.38)
    lean, bend = math.radians(draw.between(10, 35)), math.radians(draw.between(30, 75))
    elbow = (0, 0.04 + lower * math.cos(lean), lower * math.sin(lean))
    wrist = (0, elbow[1] + upper * math.cos(bend), elbow[2] - upper * math.sin(bend))
    head = lathe("head", [(0.09, -0.1), (0.05, -0.02), (0.03, 0.03)], 14, capped=False)
    arms = [
        *both_sides(
            [
                rod("arm", (0.012, 0.04, 0), (0.012, *elbow[1:]), 0.006, sides=6),
                rod("arm", (0.012, *elbow[1:]), (0.012, *wrist[1:]), 0.006, sides=6),
            ]
        ),
        rod("joint", (-0.02, *elbow[1:]), (0.02, *elbow[1:]), 0.015),
    ]
    foot = lathe("foot", [(0.1, 0), (0.1, 0.025), (0.03, 0.045)], 16)
    parts = [*arms, moved(turned(head, 0, draw.between(10, 40)), wrist)]
    aside = draw.between(20, 60) if draw.chance(0.4) else 0.0
    return [foot, *[turned(part, 1, aside) for part in parts]]


def _banker(draw: Draw) -> list[Part]:
    w, r, h = draw.between(0.12, 0.18), 0.07, draw.between(0.28, 0.36)
    angles = np.linspace(-0.2, math.pi - 0.5, 8)
    shell = [[(x, h + r * math.sin(a), -r * math.cos(a)) for a in angles] for x in (-w, w)]
    vertices = np.array(shell).reshape(-1, 3)
    faces = tuple((i, i + 1, i + 9, i + 8) for i in range(7))
    return [
        Part("shade", vertices, faces),
        rod("tube", (-w * 0.9, h + 0.01, 0), (w * 0.9, h + 0.01, 0), 0.018, sides=8),
        rod("stem", (0, 0.02, 0), (0, h + r * 0.9, 0), 0.01),
        box("foot", (-0.1, 0.1), (0, 0.025), (-0.07, 0.07)),
    ]


def _torchiere(draw: Draw) -> list[Part]:
    h, r = draw.between(1.4, 1.8), draw.between(0.16, 0.24)
    bowl = lathe("bowl", [(0.015, h), (r * 0.6, h + 0.03), (r, h + 0.12)], 18, capped=False)
    arm = tube("arm", [(0, h * 0.6, -0.01), (0, h * 0.68, -0.12), (0, h * 0.75, -0.28)], 0.007, 6)
    head = moved(turned(shade("spot", 0.05, 0.025, (-0.1, 0), 10), 0, 25), (0, h * 0.75, -0.28))
    foot = lathe("foot", [(0.15, 0), (0.15, 0.025), (0.012, 0.04), (0.012, h)], 16)
    return [foot, bowl, *([arm, head] if draw.chance(0.6) else [])]


def _mushroom(draw: Draw) -> list[Part]:
    r, h = draw.between(0.14, 0.24), draw.between(0.18, 0.32)
    dome = [(r * math.cos(a), h + 0.75 * r * math.sin(a)) for a in np.linspace(0.1, math.pi / 2, 7)]
    cone = [(r * 1.1, h + 0.02), (0.0, h + 0.9 * r)]
    cap = lathe("cap", [(r * 0.97, h), *draw.variant("cap", (dome, cone))], 20)
    return [cap, lathe("stem", [(r * 0.65, 0), (r * 0.35, h * 0.3), (r * 0.25, h + 0.02)], 16)]


def _column(draw: Draw) -> list[Part]:
    s, h, round_ = draw.between(0.1, 0.16), draw.between(0.9, 1.4), draw.chance(0.5)
    sides = 16 if round_ else 4
    bands = draw.whole(2, 5)
    step = h / bands
    paper = [
        shade("paper", s, s, (0.05 + i * step, 0.05 + (i + 0.85) * step), sides)
        for i in range(bands)
    ]
    posts = both_sides(
        [
            box("post", (s * 0.66, s * 0.72), (0, h + 0.05), (z - 0.006, z + 0.006))
            for z in (-s * 0.7, s * 0.7)
        ]
    )
    return [*paper, *posts, lathe("foot", [(s * 1.1, 0), (s * 1.1, 0.03)], sides, phase=0.5)]


def _light_box(draw: Draw) -> list[Part]:
    """A studio light: an open box on a stand with a yoke."""
    w, h = draw.between(0.2, 0.3), draw.between(0.9, 1.3)
    head = box("head", (-w, w), (-w * 0.7, w * 0.7), (-0.08, 0.08), without=("-z",))
    flaps = both_sides(
        [
            sheet(
                "flap",
                (w, -w * 0.7, -0.08),
                (w, w * 0.7, -0.08),
                (w + 0.1, w * 0.7, -0.25),
                (w + 0.1, -w * 0.7, -0.25),
            )
        ]
    )
    yoke = tube(
        "yoke",
        [(-w - 0.02, 0, 0), (-w - 0.02, -w, 0), (w + 0.02, -w, 0), (w + 0.02, 0, 0)],
        0.01,
        6,
    )
    tilt = draw.between(-5, 25)
    top = [turned(part, 0, tilt) for part in (head, *flaps)]
    legs = [
        rod("leg", (0, 0.35, 0), (0.35 * math.sin(a), 0, 0.35 * math.cos(a)), 0.01, sides=6)
        for a in (2 * math.pi * i / 3 for i in range(3))
    ]
    return [
        *[moved(part, (0, h + w, 0)) for part in (*top, yoke)],
        rod("stand", (0, 0.2, 0), (0, h, 0), 0.015),
        *legs,
    ]


def _spots(draw: Draw) -> list[Part]:
    """A standing pole with several turned spots."""
    h, count = draw.between(1.3, 1.7), draw.whole(3, 5)
    parts = [lathe("pole", [(0.14, 0), (0.14, 0.02), (0.012, 0.04), (0.012, h)], 14)]
    for i in range(count):
        y = h * (0.5 + 0.5 * i / (count - 1)) - 0.03
        spot = moved(shade("spot", 0.065, 0.03, (-0.16, 0), 12), (0, -0.02, 0))
        out = turned(moved(turned(spot, 0, 50), (0, 0, -0.03)), 1, 137.0 * i)
        parts.append(moved(out, (0, y, 0)))
    return parts


def _cube_frame(draw: Draw) -> list[Part]:
    """A glowing ball in an open cube of bars."""
    s, t = draw.between(0.12, 0.2), 0.012
    bars = [
        block("bar", center, size)
        for a in (-s, s)
        for b in (-s, s)
        for center, size in (
            ((a, s, b), (t, 2 * s, t)),
            ((a, s + b, 0), (t, t, 2 * s)),
            ((0, s + a, b), (2 * s, t, t)),
        )
    ]
    r = s * draw.between(0.4, 0.6)
    return [
        *bars,
        ellipsoid("globe", (0, r + t, 0), (r, r, r), 14, 8),
        box("floor", (-s, s), (-t, 0), (-s, s)),
    ]


def _candelabra(draw: Draw) -> list[Part]:
    count, step, h = draw.pick((3, 5, 7)), draw.between(0.1, 0.14), 0.45
    parts = [lathe("stem", [(0.12, 0), (0.1, 0.03), (0.025, 0.06), (0.02, h)], 14)]
    half = (count - 1) // 2
    for k in range(1, half + 1):
        x = k * step
        path = (
            [(0.0, h * 0.75 - x, 0)]
            + [(x * math.sin(a), h * 0.75 - x * math.cos(a), 0) for a in (0.5, 1.0, math.pi / 2)]
            + [(x, h, 0)]
        )
        parts += both_sides([tube("arm", path, 0.012, 6)])
    cups = [
        lathe("cup", [(0.02, h - 0.01), (0.035, h + 0.02)], 8, (k * step, 0, 0))
        for k in range(-half, half + 1)
    ]
    candles = [
        rod("candle", (k * step, h, 0), (k * step, h + 0.14, 0), 0.014, sides=8)
        for k in range(-half, half + 1)
    ]
    return parts + cups + candles


KINDS: tuple[Callable[[Draw], list[Part]], ...] = (
    _floor,
    _arc,
    _tripod,
    _vase,
    _stacked,
    _desk,
    _banker,
    _torchiere,
    _mushroom,
    _column,
    _light_box,
    _spots,
    _cube_frame,
    _candelabra,
    *MOUNTED_LAMPS,
    _vase,
    _floor,
    _tripod,
)
