"""Lamps that hang, sit on walls or stand in streets."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides
from pnabs.dataset.samples.sheets import hoop, panel, shade
from pnabs.dataset.samples.solids import block, box, ellipsoid, lathe, prism, rod, tube


def bulb(y: float) -> Part:
    """A light bulb about the height `y` on the y axis."""
    return ellipsoid("bulb", (0, y, 0), (0.03, 0.045, 0.03), 8, 6)


def _pendant(draw: Draw) -> list[Part]:
    cord = draw.between(0.4, 0.9)
    profile = draw.pick(
        (
            ((0.2, 0.0), (0.18, 0.08), (0.06, 0.2), (0.03, 0.26)),
            ((0.26, 0.0), (0.05, 0.12), (0.03, 0.2)),
            ((0.12, 0.0), (0.17, 0.1), (0.15, 0.2), (0.04, 0.3)),
        )
    )
    top = profile[-1][1]
    return [
        lathe("shade", profile, 20, capped=False),
        bulb(top * 0.4),
        rod("cord", (0, top, 0), (0, top + cord, 0), 0.006, sides=6),
        lathe("rose", [(0.06, top + cord), (0.05, top + cord + 0.03)], 12),
    ]


def _pendant_row(draw: Draw) -> list[Part]:
    count, step = draw.variant("pendants", (3, 5, 2)), 0.24
    half = (count - 1) / 2
    parts = [block("rail", (0, 0.8, 0), (count * step, 0.03, 0.06))]
    for i in range(count):
        low = 0.3 + 0.06 * abs(i - half) if draw.chance(0.5) else 0.3
        parts += [
            shade("shade", 0.09, 0.04, (low, low + 0.14), 12, ((i - half) * step, 0, 0)),
            rod(
                "cord",
                ((i - half) * step, low + 0.12, 0),
                ((i - half) * step, 0.79, 0),
                0.004,
                sides=6,
            ),
        ]
    return parts


def _chandelier(draw: Draw) -> list[Part]:
    arms, r = draw.pick((4, 6, 8)), draw.between(0.3, 0.42)
    body = lathe(
        "body",
        [
            (0.0, 0),
            (0.05, 0.05),
            (0.02, 0.12),
            (0.06, 0.2),
            (0.015, 0.3),
            (0.01, 0.7),
            (0.05, 0.72),
            (0.05, 0.74),
        ],
        12,
    )
    parts = [body]
    for a in (2 * math.pi * i / arms for i in range(arms)):
        c, s = math.sin(a), math.cos(a)
        path = [
            (0.02 * c, 0.18, 0.02 * s),
            (0.5 * r * c, 0.06, 0.5 * r * s),
            (r * c, 0.12, r * s),
            (r * c, 0.2, r * s),
        ]
        parts += [
            tube("arm", path, 0.009, 6),
            shade("shade", 0.06, 0.03, (0.24, 0.33), 8, (r * c, 0, r * s)),
            lathe("candle", [(0.012, 0.19), (0.012, 0.28)], 6, (r * c, 0, r * s)),
        ]
    return parts


def _ring(draw: Draw) -> list[Part]:
    parts = []
    for i in range(draw.whole(1, 3)):
        r, y = 0.4 - 0.1 * i, 0.14 * i
        parts.append(hoop("ring", [(r - 0.03, y), (r, y), (r, y + 0.05), (r - 0.03, y + 0.05)], 24))
    top = 0.9
    cords = [
        rod("cord", (0.38 * math.sin(a), 0.04, 0.38 * math.cos(a)), (0, top, 0), 0.004, sides=6)
        for a in (2 * math.pi * k / 3 for k in range(3))
    ]
    return [*parts, *cords, lathe("rose", [(0.06, top), (0.06, top + 0.03)], 12)]


def _cage(draw: Draw) -> list[Part]:
    """A bulb hanging in a cage of wires."""
    r, h, wires = draw.between(0.14, 0.22), draw.between(0.25, 0.4), draw.whole(5, 8)
    line = [(0.03, h), (r, h * 0.6), (r * 0.8, h * 0.2), (r * 0.45, 0)]
    parts = [
        rod("cord", (0, h, 0), (0, h + 0.5, 0), 0.006, sides=6),
        lathe("socket", [(0.035, h - 0.06), (0.035, h + 0.02), (0.015, h + 0.05)], 10),
        bulb(h - 0.1),
    ]
    for i in range(wires):
        a = 2 * math.pi * i / wires
        parts.append(
            tube("wire", [(x * math.sin(a), y, x * math.cos(a)) for x, y in line], 0.005, 5)
        )
    for x, y in line[1:]:
        parts.append(
            hoop(
                "ring",
                [
                    (x - 0.005, y - 0.005),
                    (x + 0.005, y - 0.005),
                    (x + 0.005, y + 0.005),
                    (x - 0.005, y + 0.005),
                ],
                16,
            )
        )
    return parts


def _cluster(draw: Draw) -> list[Part]:
    """Globes hanging at unlike heights."""
    parts = [lathe("rose", [(0.25, 1.2), (0.25, 1.23)], 16)]
    count = draw.whole(3, 6)
    for i in range(count):
        a, r, y = 2.4 * i, 0.2 * math.sqrt((i + 0.5) / count), draw.between(0.1, 0.8)
        x, z, size = r * math.cos(a), r * math.sin(a), draw.between(0.06, 0.1)
        parts += [
            ellipsoid("globe", (x, y, z), (size, size, size), 12, 7),
            rod("cord", (x, y, z), (x, 1.21, z), 0.004, sides=5),
        ]
    return parts


def _sconce(draw: Draw) -> list[Part]:
    reach = draw.between(0.12, 0.22)
    plate = box("plate", (-0.06, 0.06), (-0.15, 0.15), (0, 0.02))
    parts = [plate]
    for x in (0.0,) if draw.chance(0.4) else (-0.14, 0.14):
        parts += [
            tube("arm", [(0, 0, 0), (x * 0.7, -0.07, -reach * 0.7), (x, 0, -reach)], 0.01, 6),
            shade("shade", 0.08, 0.05, (0.0, 0.14), 12, (x, 0, -reach)),
        ]
    return parts


def _lantern(draw: Draw) -> list[Part]:
    s, h, t = draw.between(0.08, 0.14), draw.between(0.25, 0.4), 0.012
    window = [(-s + 0.02, s - 0.02, 0.05, h - 0.04)]
    front = [
        panel("frame", 2, (z, z + math.copysign(t, -z)), (-s, s), (0.02, h), window)
        for z in (-s, s)
    ]
    side = both_sides(
        [
            panel(
                "frame",
                0,
                (s - t, s),
                (0.02, h),
                (-s + t, s - t),
                [(0.05, h - 0.04, -s + 0.02, s - 0.02)],
            )
        ]
    )
    roof = lathe("roof", [(s * 1.5, h), (0.03, h + 0.1), (0.03, h + 0.12)], 4, phase=0.5)
    ring_path = [
        (0.05 * math.sin(a), h + 0.17 - 0.05 * math.cos(a), 0)
        for a in np.linspace(0, 2 * math.pi, 11)
    ]
    return [
        box("floor", (-s, s), (0, 0.02), (-s, s)),
        *front,
        *side,
        roof,
        bulb(h * 0.4),
        rod("candle", (0, 0.02, 0), (0, h * 0.35, 0), 0.025),
        tube("handle", ring_path, 0.006, 6),
    ]


def _street(draw: Draw) -> list[Part]:
    h, reach = draw.between(2.6, 3.4), draw.between(0.5, 0.9)
    pole = lathe("pole", [(0.12, 0), (0.12, 0.25), (0.06, 0.3), (0.035, h)], 10)
    arm = [(0, h - 0.1, 0), (0, h + 0.12, -reach * 0.4), (0, h + 0.15, -reach)]
    head = prism(
        "head",
        0,
        [
            (h + 0.12, -reach + 0.05),
            (h + 0.22, -reach),
            (h + 0.18, -reach - 0.45),
            (h + 0.1, -reach - 0.4),
        ],
        (-0.1, 0.1),
    )
    parts = [tube("arm", arm, 0.03, 6), head]
    if draw.chance(0.5):
        parts += [part._replace(vertices=part.vertices * (-1, 1, -1)) for part in parts]
    return [pole, *parts]


def _lamppost(draw: Draw) -> list[Part]:
    h = draw.between(1.6, 2.3)
    pole = lathe(
        "pole", [(0.16, 0), (0.16, 0.08), (0.09, 0.2), (0.05, 0.4), (0.04, h), (0.08, h + 0.03)], 12
    )
    cage = shade("glass", 0.09, 0.16, (h + 0.03, h + 0.35), 6)
    cap = lathe("cap", [(0.2, h + 0.35), (0.05, h + 0.5), (0.0, h + 0.6)], 6, phase=0.5)
    return [
        pole,
        cage,
        cap,
        *both_sides([rod("bar", (0.04, h - 0.15, 0), (0.25, h - 0.15, 0), 0.012, sides=6)]),
    ]


MOUNTED_LAMPS: tuple[Callable[[Draw], list[Part]], ...] = (
    _pendant,
    _pendant_row,
    _chandelier,
    _ring,
    _cage,
    _cluster,
    _sconce,
    _lantern,
    _street,
    _lamppost,
)
"""Makers of mounted lamps."""
