# ruff: noqa: RUF005
"""Animals: quadrupeds, birds, fish and others, of tapered tubes and ellipsoids."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from pnabs.dataset.samples.birds import BIRDS
from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, moved, turned
from pnabs.dataset.samples.quadrupeds import BEASTS, ball, beast
from pnabs.dataset.samples.sheets import sheet
from pnabs.dataset.samples.solids import lathe, loft, rod, tube


def animal(draw: Draw) -> list[Part]:
    """One animal, its head towards -z."""
    others = {**BIRDS, **OTHERS}
    kind = draw.kind((*BEASTS, *others))
    return beast(draw, BEASTS[kind]) if kind in BEASTS else others[kind](draw)


def _fish_body(length: float, high: float, wide: float, peak: float) -> Part:
    rings = []
    for f in np.linspace(0, 1, 9):
        swell = math.sin(math.pi * f**peak) if f < 0.92 else 0.16
        rings.append(
            [
                (
                    wide * swell * math.cos(a),
                    high * max(swell, 0.0) * math.sin(a),
                    length * (f - 0.5),
                )
                for a in np.linspace(0, 2 * math.pi, 12, endpoint=False)
            ]
        )
    return loft("body", rings)


def _fish(draw: Draw) -> list[Part]:
    high, wide = draw.between(0.16, 0.34), draw.between(0.06, 0.13)
    fork = draw.between(0.05, 0.2)
    tail = [
        sheet("tail_fin", (0, 0.02, 0.45), (0, 0.24, 0.72), (0, 0, 0.72 - fork)),
        sheet("tail_fin", (0, -0.02, 0.45), (0, 0, 0.72 - fork), (0, -0.24, 0.72)),
    ]
    fins = [
        sheet(
            "back_fin",
            (0, high * 0.9, -0.15),
            (0, high + 0.14, 0.02),
            (0, high + 0.05, 0.2),
            (0, high * 0.75, 0.18),
        ),
        sheet("belly_fin", (0, -high * 0.85, 0), (0, -high - 0.1, 0.15), (0, -high * 0.7, 0.18)),
    ]
    side = both_sides(
        [
            sheet(
                "side_fin",
                (wide * 0.9, -0.03, -0.12),
                (wide + 0.14, -0.09, 0.02),
                (wide * 0.9, -0.1, -0.03),
            )
        ]
    )
    return [_fish_body(1.0, high, wide, draw.between(0.7, 0.9)), *tail, *fins, *side]


def _shark(draw: Draw) -> list[Part]:
    r = draw.between(0.11, 0.14)
    profile = [
        (0.0, -0.6),
        (r * 0.7, -0.45),
        (r, -0.2),
        (r * 0.85, 0.1),
        (r * 0.3, 0.5),
        (r * 0.15, 0.6),
    ]
    body = turned(lathe("body", profile, 12), 0, 90)
    tail = [
        sheet("tail_fin", (0, 0.03, 0.5), (0, draw.between(0.25, 0.35), 0.78), (0, 0.0, 0.62)),
        sheet("tail_fin", (0, -0.03, 0.5), (0, 0.0, 0.62), (0, -0.16, 0.7)),
    ]
    back = sheet("back_fin", (0, r * 0.85, -0.12), (0, r + 0.18, 0.06), (0, r * 0.8, 0.08))
    fins = [
        sheet("side_fin", (r * 0.8, -0.05, -0.18), (r + 0.28, -0.14, 0.02), (r * 0.8, -0.06, -0.02))
    ]
    if draw.chance(0.4):
        fins.append(ball("hammer", (0.1, 0, -0.56), (0.14, 0.025, 0.05), 8))
    return [body, *tail, back, *both_sides(fins)]


def _ray(draw: Draw) -> list[Part]:
    span, long_tail = draw.between(0.5, 0.75), draw.between(0.6, 1.1)
    rings = [
        [
            (span * f, 0.07 * (1.05 - f) * rise + 0.1 * f * f, z * (1 - 0.85 * f) + 0.08 * f)
            for z, rise in ((-0.4, 0), (-0.1, 1), (0.35, 0.0), (-0.1, -0.6))
        ]
        for f in (0, 0.35, 0.7, 1)
    ]
    return [
        *both_sides([loft("wing", rings)]),
        tube(
            "tail",
            [(0, 0, 0.25), (0.0, 0.03, 0.25 + long_tail * 0.5), (0, 0, 0.25 + long_tail)],
            (0.04, 0.02, 0.005),
            6,
        ),
    ]


def _whale(draw: Draw) -> list[Part]:
    head = draw.between(0.15, 0.24)
    path = [(0, 0, -0.62), (0, 0, -0.5), (0, 0, -0.1), (0, 0.02, 0.25), (0, 0.1, 0.6)]
    body = tube("body", path, (head * 0.55, head, 0.24, 0.15, 0.035), 14)
    half = [
        sheet("fluke", (0, 0.1, 0.55), (0.32, 0.13, 0.72), (0.05, 0.11, 0.72), (0, 0.1, 0.68)),
        sheet("flipper", (0.18, -0.1, -0.25), (0.42, -0.22, -0.02), (0.18, -0.12, -0.12)),
    ]
    return [body, *both_sides(half)]


def _snake(draw: Draw) -> list[Part]:
    waves, swing = draw.between(1.2, 2.4), draw.between(0.12, 0.3)
    at = np.linspace(0, 1, 25)
    path = np.stack(
        [swing * np.sin(2 * math.pi * waves * at), np.full(25, 0.04), 1.8 * at - 0.9], axis=1
    )
    radius = 0.05 * np.minimum(1, np.minimum(0.5 + 5 * at, 0.1 + 1.8 * (1 - at)))
    head = path[0]
    return [
        tube("body", path, radius.tolist(), 8),
        ball("head", head + (0, 0.01, -0.05), (0.05, 0.035, 0.09), 8),
    ]


def _coil(draw: Draw) -> list[Part]:
    turns, rise = draw.between(2.2, 3.2), draw.between(0.07, 0.1)
    at = np.linspace(0, turns * 2 * math.pi, 32)
    r = np.linspace(0.34, 0.16, 32)
    path = np.stack([r * np.cos(at), 0.05 + rise * at / (2 * math.pi), r * np.sin(at)], axis=1)
    neck = [
        path[-1],
        path[-1] + (0, 0.15, -0.02),
        (0, path[-1][1] + 0.3, -0.1),
        (0, path[-1][1] + 0.34, -0.25),
    ]
    return [
        tube("body", path, 0.055, 8),
        tube("neck", neck, (0.055, 0.05, 0.04, 0.035), 8),
        ball("head", np.array(neck[-1]) + (0, 0, -0.05), (0.06, 0.04, 0.09), 8),
    ]


def _spider(draw: Draw) -> list[Part]:
    r, arch = draw.between(0.5, 0.75), draw.between(0.25, 0.45)
    legs = []
    for a in np.radians((-55, -20, 20, 55)):
        x, z = math.cos(a), math.sin(a)
        legs.append(
            tube(
                "leg",
                [
                    (0.08 * x, 0.2, 0.08 * z),
                    (0.5 * r * x, 0.2 + arch, 0.5 * r * z),
                    (r * x, 0, r * z),
                ],
                (0.03, 0.022, 0.01),
                6,
            )
        )
    return [
        ball("head", (0, 0.2, -0.1), (0.12, 0.09, 0.14)),
        ball("body", (0, 0.25, 0.24), (0.18, 0.17, 0.24)),
        *both_sides(legs),
    ]


def _crab(draw: Draw) -> list[Part]:
    wide = draw.between(0.3, 0.42)
    half = []
    for z, reach in zip((-0.1, 0.02, 0.14), (0.34, 0.36, 0.3), strict=True):
        half.append(
            tube(
                "leg",
                [
                    (wide * 0.8, 0.16, z),
                    (wide + reach * 0.5, 0.3, z * 1.4),
                    (wide + reach, 0, z * 1.8),
                ],
                (0.035, 0.03, 0.01),
                6,
            )
        )
    arm = [(wide * 0.7, 0.16, -0.16), (wide + 0.12, 0.2, -0.32), (wide - 0.05, 0.2, -0.48)]
    half += [
        tube("arm", arm, (0.045, 0.05, 0.05), 6),
        rod("claw", (wide - 0.03, 0.2, -0.46), (wide - 0.2, 0.22, -0.68), 0.08, 0.01, 6),
        rod("claw", (wide - 0.05, 0.2, -0.46), (wide - 0.02, 0.18, -0.68), 0.06, 0.01, 6),
        rod("eye", (0.08, 0.2, -0.18), (0.09, 0.32, -0.22), 0.02, sides=6),
    ]
    return [ball("shell", (0, 0.17, 0), (wide, 0.1, 0.24), 14), *both_sides(half)]


def _octopus(draw: Draw) -> list[Part]:
    reach, curl = draw.between(0.55, 0.8), draw.between(0.1, 0.3)
    arms = []
    for a in np.arange(8) * math.pi / 4 + math.pi / 8:
        x, z = math.sin(a), math.cos(a)
        arms.append(
            tube(
                "arm",
                [
                    (0.1 * x, 0.2, 0.1 * z),
                    (0.4 * reach * x, 0.05, 0.4 * reach * z),
                    (0.8 * reach * x, 0.05, 0.8 * reach * z),
                    (reach * x, curl, reach * z),
                ],
                (0.07, 0.05, 0.03, 0.01),
                6,
            )
        )
    head = lathe("head", [(0.12, 0.15), (0.16, 0.3), (0.24, 0.5), (0.2, 0.68), (0.0, 0.78)], 12)
    return [head, *arms]


def _butterfly(draw: Draw) -> list[Part]:
    lift, span = draw.between(0.1, 0.6), draw.between(0.5, 0.7)

    def wing(name: str, line: Sequence[tuple[float, float]]) -> Part:
        return sheet(name, *[(x, lift * x, z) for x, z in line])

    half = [
        wing(
            "fore_wing",
            [(0.03, -0.18), (span * 0.6, -0.5), (span, -0.42), (span * 0.85, -0.12), (0.03, 0.0)],
        ),
        wing(
            "hind_wing",
            [(0.03, 0.0), (span * 0.7, -0.02), (span * 0.75, 0.3), (span * 0.4, 0.5), (0.03, 0.16)],
        ),
        tube("feeler", [(0.02, 0.03, -0.3), (0.08, 0.1, -0.45), (0.14, 0.12, -0.6)], 0.008, 5),
    ]
    return [ball("body", (0, 0, 0), (0.045, 0.045, 0.32), 8), *both_sides(half)]


def _snail(draw: Draw) -> list[Part]:
    turns = draw.between(1.6, 2.4)
    at = np.linspace(0, turns * 2 * math.pi, 26)
    r = 0.03 + 0.26 * (at / at[-1])
    end = at[-1] + math.pi * 0.6
    path = np.stack(
        [0.1 * (1 - at / at[-1]), 0.36 + r * np.sin(at - end), 0.12 + r * np.cos(at - end)], axis=1
    )
    radius = (0.02 + 0.13 * at / at[-1]).tolist()
    foot = tube(
        "foot", [(0, 0.06, -0.55), (0, 0.06, 0), (0, 0.03, 0.6)], (0.07, 0.1, 0.02), 8, squash=1.3
    )
    horns = both_sides([rod("horn", (0.03, 0.16, -0.5), (0.1, 0.36, -0.62), 0.018, sides=6)])
    return [
        tube("shell", path, radius, 8),
        foot,
        rod("neck", (0, 0.06, -0.35), (0, 0.18, -0.55), 0.08, 0.06, 8),
        *horns,
    ]


def _frog(draw: Draw) -> list[Part]:
    body = turned(ball("body", (0, 0, 0), (0.26, 0.18, 0.36), 12), 0, -draw.between(10, 30))
    half = [
        ball("eye", (0.12, 0.46, -0.3), (0.07, 0.07, 0.07), 8),
        tube(
            "hind_leg",
            [(0.18, 0.22, 0.22), (0.4, 0.3, -0.02), (0.34, 0.06, 0.3), (0.45, 0.02, 0.0)],
            (0.1, 0.08, 0.05, 0.04),
            8,
        ),
        tube(
            "fore_leg",
            [(0.18, 0.24, -0.16), (0.28, 0.12, -0.1), (0.26, 0.01, -0.3)],
            (0.06, 0.04, 0.04),
            8,
        ),
    ]
    return [
        moved(body, (0, 0.27, 0)),
        ball("head", (0, 0.36, -0.32), (0.22, 0.13, 0.2)),
        *both_sides(half),
    ]


OTHERS: dict[str, Callable[[Draw], list[Part]]] = {
    "fish": _fish,
    "shark": _shark,
    "ray": _ray,
    "whale": _whale,
    "snake": _snake,
    "coil": _coil,
    "spider": _spider,
    "crab": _crab,
    "octopus": _octopus,
    "butterfly": _butterfly,
    "snail": _snail,
    "frog": _frog,
}
"""Makers of other animals by kind."""
