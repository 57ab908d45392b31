# ruff: noqa: RUF005
"""Working ships: tugs, barges, trawlers and the like."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.hulls import decked_hull, deckhouse, hull_stations, mast_at, open_hull
from pnabs.dataset.samples.parts import Part, both_sides, moved, turned
from pnabs.dataset.samples.sheets import hoop, panel
from pnabs.dataset.samples.solids import Span, block, box, ellipsoid, lathe, loft, prism, rod, tube


def _tug(draw: Draw) -> list[Part]:
    length = draw.between(16, 22)
    rings = hull_stations(length, length * 0.35, 3.2, stern=0.8, bow=0.4, sheer=0.25, fullness=0.6)
    funnel = draw.between(5.5, 8)
    tyres = both_sides(
        [
            moved(
                turned(
                    hoop("fender", [(0.25, -0.15), (0.5, -0.15), (0.5, 0.15), (0.25, 0.15)], 10),
                    2,
                    90,
                ),
                (length * 0.18, 2.6, z),
            )
            for z in (-length * 0.1, length * 0.1, length * 0.28)
        ]
    )
    return [
        decked_hull("hull", rings),
        deckhouse("house", length * 0.11, (3, 5.4), (-length * 0.15, length * 0.15)),
        deckhouse("wheelhouse", length * 0.08, (5.4, 7.6), (-length * 0.13, 0.3), 0.4),
        rod("funnel", (0, 5, length * 0.09), (0, funnel + 2, length * 0.09), 0.8, 0.7, 12),
        mast_at(7.5, 11, -length * 0.05),
        *tyres,
    ]


def _paddle(draw: Draw) -> list[Part]:
    length = draw.between(30, 42)
    rings = hull_stations(length, length * 0.2, 2, stern=0.9, bow=0.2, fullness=0.9, rake=0.02)
    half, parts = length * 0.09, [decked_hull("hull", rings)]
    for i in range(draw.whole(2, 3)):
        y = 2 + 2.8 * i
        z = (-length * (0.32 - 0.04 * i), length * (0.38 - 0.04 * i))
        parts += [
            box("house", (-half * 0.75, half * 0.75), (y, y + 2.5), (z[0] + 2, z[1] - 1)),
            box("roof", (-half, half), (y + 2.5, y + 2.8), z),
        ]
        parts += both_sides(
            [
                rod("post", (half - 0.2, y, at), (half - 0.2, y + 2.6, at), 0.1, sides=4)
                for at in np.linspace(z[0] + 0.5, z[1] - 0.5, 6).tolist()
            ]
        )
    top = float(max(part.vertices[:, 1].max() for part in parts))
    parts += both_sides(
        [
            rod(
                "stack",
                (1.2, top - 0.5, -length * 0.15),
                (1.2, top + 5, -length * 0.15),
                0.45,
                0.6,
                10,
            )
        ]
    )
    blades = [
        turned(box("blade", (-half * 0.8, half * 0.8), (0.3, 2.6), (-0.06, 0.06)), 0, 45 * i)
        for i in range(8)
    ]
    rims = [
        turned(hoop("rim", [(2.3, x), (2.6, x), (2.6, x + 0.2), (2.3, x + 0.2)], 16), 2, 90)
        for x in (-half * 0.8, half * 0.8 - 0.2)
    ]
    return parts + [moved(part, (0, 2.2, length * 0.5 + 2.2)) for part in (*blades, *rims)]


def _barge(draw: Draw) -> list[Part]:
    length, beam = draw.between(35, 50), draw.between(7, 10)
    h, depth = length / 2, 3.0
    hold = panel(
        "hull",
        1,
        (0.6, depth),
        (-beam / 2, beam / 2),
        (-h * 0.85, h * 0.85),
        [
            (-beam / 2 + 0.6, beam / 2 - 0.6, a, b)
            for a, b in _cells(-h * 0.82, h * 0.6, draw.whole(1, 4), 0.8)
        ],
    )
    ends = [
        prism(
            "end",
            0,
            [(0.6, s * h * 0.85), (depth, s * h * 0.85), (depth, s * h), (2, s * h)],
            (-beam / 2, beam / 2),
        )
        for s in (-1, 1)
    ]
    floor = box("floor", (-beam / 2, beam / 2), (0, 0.6), (-h * 0.85, h * 0.85))
    heap = (
        [
            ellipsoid("cargo", (0, 1.5, (a + b) / 2), (beam * 0.4, 2.2, (b - a) * 0.45), 8, 6)
            for a, b in _cells(-h * 0.82, h * 0.6, 2, 0.8)
        ]
        if draw.chance(0.4)
        else []
    )
    house = [
        deckhouse("house", beam * 0.35, (depth, depth + 2.6), (h * 0.66, h * 0.9)),
        deckhouse("wheelhouse", beam * 0.2, (depth + 2.6, depth + 4.6), (h * 0.66, h * 0.78)),
    ]
    return [hold, *ends, floor, *heap, *house]


def _cells(low: float, high: float, count: int, gap: float) -> list[Span]:
    step = (high - low) / count
    return [(low + i * step + gap / 2, low + (i + 1) * step - gap / 2) for i in range(count)]


def _trawler(draw: Draw) -> list[Part]:
    length = draw.between(18, 26)
    rings = hull_stations(length, length * 0.28, 3, stern=0.85, bow=0.45, sheer=0.4, fullness=0.55)
    aft = draw.chance(0.5)
    z = (length * 0.15, length * 0.4) if aft else (-length * 0.28, -length * 0.03)
    gallows = length * (-0.05 if aft else 0.42)
    frame = tube(
        "gallows",
        [(-2.2, 2.5, gallows), (-1.6, 7, gallows), (1.6, 7, gallows), (2.2, 2.5, gallows)],
        0.15,
        6,
    )
    booms = both_sides([rod("boom", (0.2, 4, gallows), (5.5, 10, gallows), 0.1, sides=6)])
    return [
        *open_hull("hull", rings, 0.9, 0.6),
        deckhouse("house", length * 0.1, (1.8, 5), z, 0.6),
        mast_at(4, 10, (z[0] + z[1]) / 2, 0.15),
        frame,
        *(booms if draw.chance(0.6) else []),
    ]


def _hovercraft(draw: Draw) -> list[Part]:
    length = draw.between(14, 20)
    w, h = length * 0.25, length / 2
    skirt = [(-w, -h * 0.7), (-w * 0.5, -h), (w * 0.5, -h), (w, -h * 0.7), (w, h), (-w, h)]
    plan = np.insert(skirt, 1, 0.0, axis=1)
    upper = plan * (0.85, 1, 0.92) + (0, 1.8, 0)
    base = loft("skirt", np.array([plan, plan * (1.05, 1, 1.03) + (0, 0.8, 0), upper]))
    cabin = deckhouse("cabin", w * 0.6, (1.8, 4), (-h * 0.7, h * 0.2), 1.2)
    fans = []
    for x in (-w * 0.4, w * 0.4):
        duct = turned(hoop("duct", [(1.5, 0), (1.7, 0), (1.7, 0.9), (1.5, 0.9)], 16), 0, 90)
        fans += [
            moved(duct, (x, 3.6, h * 0.8)),
            block("blade", (x, 3.6, h * 0.85), (0.25, 2.8, 0.08)),
            block("blade", (x, 3.6, h * 0.85), (2.8, 0.25, 0.08)),
            block("pylon", (x, 2.2, h * 0.85), (0.5, 1.2, 0.8)),
        ]
    rudders = [block("rudder", (x, 3.6, h * 0.98), (0.1, 2.6, 0.7)) for x in (-w * 0.4, w * 0.4)]
    return [base, cabin, *fans, *rudders]


def _platform(draw: Draw) -> list[Part]:
    """A twin-hulled research ship with a tall working deck on struts."""
    length = draw.between(30, 40)
    pods = [ellipsoid("pod", (s * 7, 1.5, 0), (1.6, 1.5, length / 2), 12, 9) for s in (-1, 1)]
    struts = [
        prism(
            "strut",
            1,
            [
                (s * 7 - 0.6, z - 4),
                (s * 7 + 0.6, z - 4),
                (s * 7 + 0.6, z + 4),
                (s * 7 - 0.6, z + 4),
            ],
            (2, 8),
        )
        for s in (-1, 1)
        for z in (-length * 0.25, length * 0.25)
    ]
    deck = panel(
        "deck",
        1,
        (8, 10),
        (-8.5, 8.5),
        (-length * 0.42, length * 0.42),
        [(-2, 2, length * 0.05, length * 0.2)],
    )
    crane = [
        mast_at(10, 18, length * 0.25, 0.6),
        rod("jib", (0, 17.5, length * 0.25), (9, 22, length * 0.1), 0.35, sides=6),
    ]
    house = [
        deckhouse("house", 6, (10, 14), (-length * 0.38, -length * 0.1), 1.5),
        deckhouse("bridge", 4, (14, 16.5), (-length * 0.35, -length * 0.22), 0.8),
    ]
    return [*pods, *struts, deck, *crane, *house]


def _crane_ship(draw: Draw) -> list[Part]:
    """A flat pontoon with a lattice crane."""
    length = draw.between(26, 36)
    w, h = length * 0.18, length / 2
    hull = prism("hull", 0, [(0, -h * 0.85), (2.5, -h), (2.5, h), (0, h * 0.85)], (-w, w))
    pivot, tip, top = np.array((0, 6.0, -h * 0.2)), draw.between(0.6, 1.1), draw.between(14, 20)
    end = np.array((0, top, -h * tip - h * 0.2))
    chords = both_sides(
        [
            rod("chord", pivot + (1, dy, 0), end + (0.3, dy * 0.4, 0), 0.15, sides=4)
            for dy in (-0.7, 0.7)
        ]
    )
    rungs = [
        rod(
            "brace",
            pivot * (1 - f) + end * f + (x * (1 - 0.7 * f), -0.7, 0),
            pivot * (1 - f) + end * f + (-x * (1 - 0.7 * f), 0.7, 0),
            0.08,
            sides=4,
        )
        for f, x in zip(np.linspace(0.1, 0.9, 6).tolist(), (1, -1) * 3, strict=True)
    ]
    cab = [
        lathe("turntable", [(2.2, 2.5), (2.2, 3.6)], 12, (0, 0, -h * 0.1)),
        box("cab", (-1.8, 1.8), (3.6, 6.4), (-h * 0.25, h * 0.1)),
    ]
    hook = [
        rod("rope", end, end * (1, 0, 1) + (0, 4, 0), 0.06, sides=4),
        block("load", end * (1, 0, 1) + (0, 3.4, 0), (1.6, 1.2, 1.6)),
    ]
    return [
        hull,
        *chords,
        *rungs,
        *cab,
        *hook,
        deckhouse("house", w * 0.7, (2.5, 6), (h * 0.55, h * 0.85)),
        rod("stay", (0, 6.4, h * 0.05), end, 0.06, sides=4),
    ]


WORKSHIPS: tuple[Callable[[Draw], list[Part]], ...] = (
    _tug,
    _paddle,
    _barge,
    _trawler,
    _hovercraft,
    _platform,
    _crane_ship,
)
"""Makers of working ships."""
