"""Buses with bonnets, trailers or open sides."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pnabs.dataset.samples.bus_body import (
    Body,
    city_body,
    pierced_shell,
    screens,
    seat_rows,
    wheel_pairs,
    window_row,
)
from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, moved, turned
from pnabs.dataset.samples.sheets import panel, sheet
from pnabs.dataset.samples.solids import block, box, lathe, prism, rod


def _school(draw: Draw) -> list[Part]:
    b = city_body(draw, draw.between(7, 9.5), 0.75, 2.95)
    n = draw.whole(6, 10)
    side = window_row((b.z[0] + 0.5, b.z[1] - 0.2), (1.75, 2.5), n, 0.14)
    front, rear = screens(b, 1.8, 2.6)
    hood = prism(
        "hood",
        0,
        [(0.6, b.z[0]), (1.7, b.z[0]), (1.5, b.z[0] - 1.3), (0.6, b.z[0] - 1.4)],
        (-0.85, 0.85),
    )
    fenders = both_sides(
        [
            prism(
                "fender",
                0,
                [
                    (0.55, b.z[0]),
                    (1.15, b.z[0] - 0.2),
                    (1.15, b.z[0] - 0.95),
                    (0.7, b.z[0] - 1.35),
                    (0.95, b.z[0] - 0.6),
                ],
                (0.85, b.w),
            )
        ]
    )
    return [
        *pierced_shell(b, side, side, front, rear),
        hood,
        *fenders,
        *seat_rows(draw, b, b.floor, (b.z[0] + 1, b.z[1] - 0.3)),
        *wheel_pairs(draw, b, (b.z[0] - 0.6, b.z[1] - 2.0)),
        *both_sides([block("lamp", (0.5, 1.15, b.z[0] - 1.4), (0.2, 0.2, 0.08))]),
    ]


def _rounded(draw: Draw) -> list[Part]:
    """An old-time bus: arched section drawn out, rounded roof, window band of boxes set in."""
    w, length = 1.15, draw.between(7, 9)
    arch = [(w * math.cos(a), 2.1 + 0.75 * math.sin(a)) for a in np.linspace(0, math.pi, 11)]
    outer = [(-w, 0.5), (w, 0.5), *arch]
    roof = [(w, 2.1), *arch, (-w, 2.1)]
    inner = [(x * 0.93, y * 0.93 + 0.1) for x, y in arch]
    vault = prism("roof", 2, [*roof[1:-1], *inner[::-1]], (-length / 2, length / 2))
    n = draw.whole(5, 8)
    side = panel(
        "side",
        0,
        (w - 0.06, w),
        (0.5, 2.12),
        (-length / 2, length / 2),
        window_row((-length / 2 + 0.6, length / 2 - 0.3), (1.3, 2.0), n, 0.2),
    )
    ends = []
    for at, name in ((-length / 2, "front"), (length / 2, "rear")):
        ends.append(
            panel(
                name,
                2,
                (at, at),
                (-w, w),
                (0.5, 2.1),
                [(-w + 0.15, -0.08, 1.3, 2.0), (0.08, w - 0.15, 1.3, 2.0)],
            )
        )
        ends.append(sheet(name, *[(x, y, at) for x, y in outer[2:]]))
    nose = rod("nose", (0, 0.95, -length / 2 - 0.5), (0, 0.95, -length / 2 + 0.1), 0.45, 0.6, 12)
    b = Body(w, (-length / 2, length / 2), 0.5, 2.8, 0.06)
    return [
        vault,
        *both_sides([side]),
        *ends,
        nose,
        box("floor", (-w, w), (0.44, 0.5), b.z),
        *wheel_pairs(draw, b, (-length / 2 + 1.2, length / 2 - 1.6)),
        *seat_rows(draw, b._replace(roof=2.4), 0.5, (-length / 2 + 1, length / 2 - 0.4)),
    ]


def _open_tour(draw: Draw) -> list[Part]:
    """An open bus: low sides, posts and a canopy."""
    b = city_body(draw, draw.between(6, 9), 0.5, draw.between(2.5, 2.9))
    low = 1.15
    walls = [
        *both_sides([box("side", (b.w - 0.06, b.w), (b.floor, low), b.z)]),
        box("front", (-b.w, b.w), (b.floor, low + 0.1), (b.z[0], b.z[0] + 0.06)),
        box("rear", (-b.w, b.w), (b.floor, low), (b.z[1] - 0.06, b.z[1])),
        box("floor", (-b.w, b.w), (b.floor - 0.06, b.floor), b.z),
    ]
    count = draw.whole(4, 6)
    posts = both_sides(
        [
            rod("post", (b.w - 0.04, low - 0.05, z), (b.w - 0.04, b.roof, z), 0.035, sides=6)
            for z in np.linspace(b.z[0] + 0.05, b.z[1] - 0.05, count).tolist()
        ]
    )
    roof = [box("canopy", (-b.w, b.w), (b.roof, b.roof + 0.05), b.z)]
    if draw.chance(0.5):
        roof += both_sides(
            [
                sheet(
                    "fringe",
                    (b.w, b.roof, b.z[0]),
                    (b.w, b.roof, b.z[1]),
                    (b.w, b.roof - 0.25, b.z[1]),
                    (b.w, b.roof - 0.25, b.z[0]),
                )
            ]
        )
    return [
        *walls,
        *posts,
        *roof,
        *wheel_pairs(draw, b, (b.z[0] + 1.4, b.z[1] - 1.4), 0.42),
        *seat_rows(draw, b, b.floor, (b.z[0] + 0.6, b.z[1] - 0.2)),
    ]


def _truck_bus(draw: Draw) -> list[Part]:
    """An expedition bus: a cabin high above large wheels, with a rack and a ladder."""
    b = city_body(draw, draw.between(5.5, 7), 1.3, 3.4)
    side = window_row((b.z[0] + 0.5, b.z[1] - 0.5), (2.2, 3.0), draw.whole(3, 5), 0.35)
    front, rear = screens(b, 2.3, 3.0)
    cab = prism(
        "cab",
        0,
        [
            (0.7, b.z[0] - 0.1),
            (2.2, b.z[0] - 0.1),
            (2.1, b.z[0] - 0.7),
            (1.5, b.z[0] - 1.5),
            (0.7, b.z[0] - 1.5),
        ],
        (-1.0, 1.0),
    )
    rack = panel(
        "rack",
        1,
        (b.roof + 0.3, b.roof + 0.35),
        (-b.w, b.w),
        (b.z[0] + 0.4, b.z[1] - 0.4),
        [(-b.w + 0.1, b.w - 0.1, b.z[0] + 0.5, b.z[1] - 0.5)],
    )
    posts = both_sides(
        [
            block("post", (b.w - 0.05, b.roof + 0.15, z), (0.05, 0.35, 0.05))
            for z in (b.z[0] + 0.45, 0, b.z[1] - 0.45)
        ]
    )
    boxes = [block("luggage", (0, b.roof + 0.45, z), (1.4, 0.5, 0.9)) for z in (-1.2, 0.8)]
    spare = moved(
        turned(lathe("spare", [(0.5, -0.14), (0.5, 0.14)], 14), 0, 90), (0, 2.0, b.z[1] + 0.16)
    )
    return [
        *pierced_shell(b, side, side, front, rear),
        cab,
        rack,
        *posts,
        *boxes,
        spare,
        box("chassis", (-0.5, 0.5), (0.8, 1.24), (b.z[0] - 0.2, b.z[1])),
        *wheel_pairs(draw, b, (b.z[0] - 0.6, b.z[1] - 1.3), 0.62),
    ]


def _trailer(draw: Draw) -> list[Part]:
    """A tractor with a long passenger trailer behind."""
    b = Body(1.25, (-2.5, draw.between(5.5, 7.5)), 1.0, 3.4, 0.05)
    side = window_row((b.z[0] + 0.4, b.z[1] - 0.4), (1.9, 3.0), draw.whole(5, 8), 0.2)
    door = [(0.5, 3.0, b.z[1] - 1.6, b.z[1] - 0.7)]
    right = [hole for hole in side if hole[3] < door[0][2] - 0.1] + door
    cab = [
        panel("cab_side", 0, (x, x), (0.7, 2.8), (-5.2, -3.4), [(1.7, 2.5, -4.9, -4.0)])
        for x in (-1.1, 1.1)
    ]
    front = [
        panel("cab_front", 2, (-5.2, -5.2), (-1.1, 1.1), (0.7, 2.8), [(-0.95, 0.95, 1.7, 2.5)]),
        panel("cab_rear", 2, (-3.4, -3.4), (-1.1, 1.1), (0.7, 2.8)),
        box("cab_roof", (-1.1, 1.1), (2.8, 2.95), (-5.2, -3.4)),
        box("chassis", (-0.5, 0.5), (0.65, 0.95), (-5.1, -0.5)),
    ]
    return [
        *pierced_shell(b, side, right, [(-1, 1, 1.9, 3.0)], [(-0.9, 0.9, 1.9, 3.0)]),
        *cab,
        *front,
        *seat_rows(draw, b, 1.0, (b.z[0] + 0.4, b.z[1] - 1.8)),
        *wheel_pairs(draw, b, (-4.3, -1.7, b.z[1] - 2.6, b.z[1] - 1.5)),
    ]


def _jeepney(draw: Draw) -> list[Part]:
    """A long bonnet, open sides above a low wall, benches, and a rack on the roof."""
    b = Body(0.95, (-1.6, draw.between(2.4, 3.6)), 0.6, 2.2, 0.04)
    side = window_row((b.z[0] + 0.1, b.z[1]), (1.2, 2.0), draw.whole(3, 5), 0.08)
    hood = [
        box("bonnet", (-0.6, 0.6), (0.6, 1.25), (b.z[0] - 1.5, b.z[0])),
        panel(
            "grille",
            2,
            (b.z[0] - 1.6, b.z[0] - 1.52),
            (-0.6, 0.6),
            (0.5, 1.2),
            [(-0.5 + 0.2 * i, -0.38 + 0.2 * i, 0.6, 1.1) for i in range(5)],
        ),
    ]
    fender = both_sides([box("fender", (0.6, 0.95), (0.85, 0.92), (b.z[0] - 1.5, b.z[0]))])
    rack = [
        panel("rack", 1, (2.35, 2.38), (-0.9, 0.9), b.z, [(-0.8, 0.8, b.z[0] + 0.1, b.z[1] - 0.1)]),
        *both_sides(
            [
                block("post", (0.85, 2.28, z), (0.04, 0.15, 0.04))
                for z in (b.z[0] + 0.1, b.z[1] - 0.1)
            ]
        ),
    ]
    bench = both_sides([box("bench", (0.5, 0.9), (0.95, 1.05), (b.z[0] + 0.8, b.z[1]))])
    ladder = [
        rod("rail", (x, 0.6, b.z[1] + 0.05), (x, 2.4, b.z[1] + 0.05), 0.02, sides=6)
        for x in (0.3, 0.6)
    ]
    return [
        *pierced_shell(b, side, side, [(-0.8, 0.8, 1.3, 2.0)], [(-0.5, 0.2, 0.0, 2.0)]),
        *hood,
        *fender,
        *rack,
        *bench,
        *ladder,
        *wheel_pairs(draw, b, (b.z[0] - 0.8, b.z[1] - 0.9), 0.38),
    ]


SPECIAL_BUSES: tuple[Callable[[Draw], list[Part]], ...] = (
    _school,
    _rounded,
    _open_tour,
    _truck_bus,
    _trailer,
    _jeepney,
)
"""Makers of special buses."""
