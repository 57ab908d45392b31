"""Boats: sailed, rowed and for leisure."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.hulls import (
    decked_hull,
    deckhouse,
    hull_skin,
    hull_stations,
    mast_at,
    open_hull,
)
from pnabs.dataset.samples.parts import Part, both_sides, moved, turned
from pnabs.dataset.samples.sheets import panel, sheet, strip
from pnabs.dataset.samples.solids import block, box, ellipsoid, lathe, prism, rod, tube


def _sloop(draw: Draw) -> list[Part]:
    length, top = draw.between(7, 10), draw.between(9, 12)
    rings = hull_stations(length, length * 0.3, 1.1, stern=0.6, bow=0.6, sheer=0.2, fullness=0.25)
    mast = -length * 0.08
    belly = draw.between(0.2, 0.6)
    main = strip(
        "mainsail",
        [
            [
                (belly * f * (1 - f) * 2, 1.9, mast + 0.1 + f * length * 0.4)
                for f in np.linspace(0, 1, 5)
            ],
            [(0, top - 0.2, mast + 0.1 + 0.1 * f) for f in np.linspace(0, 1, 5)],
        ],
    )
    jib = sheet("jib", (0, 1.4, -length * 0.52), (0, 1.7, mast - 0.2), (0, top * 0.85, mast - 0.08))
    keel = prism("keel", 0, [(0.1, -1), (0.1, 1.2), (-1.2, 0.8), (-1.2, -0.1)], (-0.06, 0.06))
    cabin = deckhouse("cabin", length * 0.09, (1.0, 1.6), (-length * 0.2, length * 0.15), 0.5)
    boom = rod("boom", (0, 1.85, mast), (0, 1.8, mast + length * 0.42), 0.05, sides=6)
    hull = [decked_hull("hull", rings), mast_at(1, top, mast), boom, keel, cabin]
    rig = draw.variant("rig", ("sloop", "ketch", "furled", "catboat", "lateen"))
    aft, low = length * 0.33, top * 0.6
    if rig == "ketch":
        mizzen = sheet(
            "mizzen", (0, 1.8, aft + 0.1), (0, 1.7, aft + length * 0.2), (0, low, aft + 0.1)
        )
        return [*hull, main, jib, mast_at(1, low + 0.2, aft), mizzen]
    if rig == "lateen":
        yard = rod("yard", (0, 2.2, -length * 0.5), (0, top * 1.05, length * 0.25), 0.06, 0.03, 6)
        sail = sheet(
            "sail", (0, 2.2, -length * 0.5), (0, 1.9, length * 0.35), (0, top * 1.05, length * 0.25)
        )
        return [*hull[:2], keel, yard, sail]
    return (
        hull
        + {
            "sloop": [main, jib],
            "catboat": [main],
            "furled": [
                rod("furled", (0, 2.0, mast), (0, 1.95, mast + length * 0.4), 0.14, 0.06, 8)
            ],
        }[rig]
    )


def _rowing(draw: Draw) -> list[Part]:
    length = draw.between(3, 4.5)
    rings = hull_stations(
        length,
        length * 0.36,
        0.55,
        stern=draw.between(0.4, 0.8),
        bow=0.55,
        sheer=0.25,
        fullness=0.35,
    )
    hull = open_hull("hull", rings) if draw.chance(0.6) else hull_skin("hull", rings)
    thwarts = [block("thwart", (0, 0.38, z), (length * 0.3, 0.04, 0.25)) for z in (-0.6, 0.2, 1.0)]
    reach, pairs = length * 0.55, draw.variant("oars", (1, 0, 2))
    half = [
        rod("oar", (0.1, 0.75, 0.4), (reach, 0.35, -0.1), 0.025, sides=6),
        sheet(
            "blade",
            (reach, 0.42, -0.1),
            (reach, 0.26, -0.1),
            (reach + 0.45, 0.14, -0.2),
            (reach + 0.45, 0.3, -0.2),
        ),
    ]
    oars = [moved(part, (0, 0, 0.8 * i - 0.3)) for i in range(pairs) for part in both_sides(half)]
    if not pairs:
        oars = [
            block("motor", (0, 0.7, length * 0.53), (0.25, 0.45, 0.3)),
            block("shaft", (0, 0.2, length * 0.53), (0.08, 0.7, 0.12)),
            box("locker", (-0.4, 0.4), (0.1, 0.45), (-length * 0.3, -length * 0.18)),
        ]
    return [*hull, *thwarts, *oars]


def _canoe(draw: Draw) -> list[Part]:
    length = draw.between(4, 5.5)
    front = hull_stations(
        length, 0.9, 0.42, stern=0.04, bow=0.5, sheer=0.5, fullness=0.4, rake=0.0, count=11
    )
    parts = hull_skin("hull", front)
    parts += [block("thwart", (0, 0.36, z), (0.8, 0.03, 0.12)) for z in (-0.9, 0.0, 0.9)]
    if draw.variant("outrigger", (True, False)):
        side = draw.pick((-1, 1))
        floatation = ellipsoid("outrigger", (side * 1.5, 0.12, 0), (0.13, 0.13, length * 0.3), 8, 8)
        arms = [
            tube("arm", [(0, 0.42, z), (side * 0.9, 0.5, z), (side * 1.5, 0.15, z)], 0.03, 6)
            for z in (-0.8, 0.8)
        ]
        parts += [floatation, *arms]
    return parts


def _catamaran(draw: Draw) -> list[Part]:
    length, gap = draw.between(9, 13), draw.between(1.8, 2.6)
    rings = hull_stations(length, 1.3, 1.5, stern=0.7, bow=0.6, fullness=0.4)
    hulls = both_sides([moved(decked_hull("hull", rings), (gap, 0, 0))])
    deck = box("deck", (-gap, gap), (1.2, 1.45), (-length * 0.15, length * 0.4))
    net = sheet(
        "net",
        (-gap, 1.4, -length * 0.15),
        (gap, 1.4, -length * 0.15),
        (gap, 1.4, -length * 0.4),
        (-gap, 1.4, -length * 0.4),
    )
    cabin = deckhouse("cabin", gap * 0.75, (1.4, 2.7), (-length * 0.12, length * 0.25), 1.2)
    parts = [*hulls, deck, net, cabin]
    if draw.chance(0.6):
        top = length * 1.25
        parts += [
            mast_at(1.4, top, -length * 0.1, 0.08),
            sheet(
                "sail",
                (0, 3.2, -length * 0.08),
                (0, 3.2, length * 0.35),
                (0, top * 0.97, -length * 0.08),
            ),
        ]
    return parts


def _square_rigger(draw: Draw) -> list[Part]:
    length = draw.between(28, 36)
    rings = hull_stations(length, length * 0.26, 5, stern=0.7, bow=0.35, sheer=0.35, fullness=0.55)
    masts = draw.pick((2, 3))
    castle = deckhouse("sterncastle", length * 0.1, (5, 8), (length * 0.28, length * 0.48))
    parts = [
        decked_hull("hull", rings),
        castle,
        rod("bowsprit", (0, 6.5, -length * 0.45), (0, 10, -length * 0.72), 0.25, 0.12, 8),
    ]
    for z in np.linspace(-length * 0.27, length * 0.27, masts).tolist():
        top = draw.between(24, 30)
        parts.append(mast_at(4, top, z, 0.35))
        for low, high, wide in ((8, 14, 7.5), (14.5, 19, 6), (19.5, 23, 4.5)):
            parts.append(rod("yard", (-wide, high, z - 0.4), (wide, high, z - 0.4), 0.15, sides=6))
            drum = [
                [(x, high, z - 0.5), (x * 0.98, (low + high) / 2, z - 1.6), (x, low, z - 0.6)]
                for x in np.linspace(-wide, wide, 4)
            ]
            parts.append(strip("sail", drum))
    return parts


def _junk(draw: Draw) -> list[Part]:
    length = draw.between(14, 20)
    rings = hull_stations(length, length * 0.32, 2.6, stern=0.85, bow=0.3, sheer=0.6, fullness=0.7)
    parts = [
        *open_hull("hull", rings, floor=0.4),
        deckhouse("cabin", length * 0.11, (2, 4.4), (length * 0.2, length * 0.4)),
    ]
    for z, top in ((-length * 0.3, 9.0), (0.0, 13.0), (length * 0.33, 8.0))[: draw.whole(2, 3)]:
        wide = length * 0.2
        fan = [
            (0, 3.6, z - wide * 0.3),
            (0, 3.8, z + wide * 0.8),
            (0, top * 0.75, z + wide),
            (0, top, z + wide * 0.4),
            (0, top - 0.5, z - wide * 0.2),
        ]
        parts += [mast_at(1, top + 0.5, z, 0.15), sheet("sail", *fan)]
        parts += [
            rod(
                "batten",
                (0.03, 3.6 + f * (top - 4.5), z - wide * 0.28),
                (0.03, 3.8 + f * (top * 0.75 - 3.8), z + wide * 0.95),
                0.06,
                sides=4,
            )
            for f in (0.25, 0.5, 0.75)
        ]
    return parts


def _speedboat(draw: Draw) -> list[Part]:
    length = draw.between(5, 8)
    rings = hull_stations(
        length, length * 0.32, 0.9, stern=0.95, bow=0.6, sheer=0.15, fullness=0.3, rake=0.12
    )
    shield = [
        (x, 0.9, -length * 0.08 - 0.3 * (1 - abs(x) / (length * 0.13)))
        for x in np.linspace(-length * 0.13, length * 0.13, 5)
    ]
    screen = strip("windscreen", [shield, [(x, 1.4, z + 0.45) for x, _, z in shield]])
    seats = both_sides([block("seat", (0.4, 0.75, z), (0.5, 0.3, 0.5)) for z in (0.2, 1.1)])
    motor = [
        block("motor", (0, 0.9, length * 0.53), (0.4, 0.6, 0.4)),
        block("shaft", (0, 0.3, length * 0.53), (0.12, 0.9, 0.2)),
    ]
    fore = rings[:, (0, -1)][4:]
    deck = strip("foredeck", fore)
    return [
        *open_hull("hull", rings, 0.86, 0.5),
        deck,
        screen,
        *seats,
        *(motor if draw.chance(0.7) else []),
    ]


def _longship(draw: Draw) -> list[Part]:
    length, rowers = draw.between(14, 20), draw.whole(5, 8)
    rings = hull_stations(
        length, length * 0.2, 1.6, stern=0.05, bow=0.5, sheer=1.1, fullness=0.4, rake=0.05, count=11
    )
    parts = open_hull("hull", rings, 0.9, 0.25)
    for z in np.linspace(-length * 0.25, length * 0.25, rowers).tolist():
        half = length * 0.1 * math.sqrt(max(0.2, 1 - (2 * z / length) ** 2))
        shield = turned(lathe("shield", [(0.45, 0), (0.4, 0.06), (0.0, 0.12)], 8), 2, -90)
        parts += both_sides(
            [
                moved(shield, (half, 1.6, z)),
                rod(
                    "oar", (half * 0.6, 1.7, z), (half + length * 0.18, 0.1, z + 0.8), 0.06, sides=4
                ),
            ]
        )
    top, wide = length * 0.6, length * 0.2
    sail = strip(
        "sail",
        [
            [(x, top - 0.3, 0), (x, top * 0.65, -0.9), (x, 2.8, -0.2)]
            for x in np.linspace(-wide, wide, 4)
        ],
    )
    mast = [
        mast_at(0.4, top, 0.1, 0.15),
        rod("yard", (-wide, top - 0.3, 0), (wide, top - 0.3, 0), 0.09, sides=6),
    ]
    return parts + mast + ([sail] if draw.chance(0.8) else [])


def _houseboat(draw: Draw) -> list[Part]:
    length, w = draw.between(9, 13), 2.0
    h = length / 2
    floats = both_sides([rod("pontoon", (w * 0.65, 0.5, -h), (w * 0.65, 0.5, h), 0.5, sides=10)])
    windows = [(1.9, 2.8, z - 0.6, z + 0.6) for z in (-h * 0.3, h * 0.1, h * 0.45)]
    sides = both_sides(
        [panel("wall", 0, (w * 0.8 - 0.1, w * 0.8), (1.1, 3.3), (-h * 0.55, h * 0.7), windows)]
    )
    ends = [
        panel(
            "wall",
            2,
            (z, z + 0.1),
            (-w * 0.8 + 0.1, w * 0.8 - 0.1),
            (1.1, 3.3),
            [(-0.5, 0.5, 1.0, 2.9)],
        )
        for z in (-h * 0.55, h * 0.7 - 0.1)
    ]
    roof = (
        prism("roof", 2, [(-w, 3.2), (w, 3.2), (0, 4.5)], (-h * 0.65, h * 0.8))
        if draw.chance(0.5)
        else box("roof", (-w, w), (3.3, 3.45), (-h * 0.9, h * 0.8))
    )
    posts = both_sides(
        [rod("post", (w - 0.1, 1, -h * 0.85), (w - 0.1, 3.35, -h * 0.85), 0.05, sides=6)]
    )
    rail = both_sides(
        [
            panel(
                "rail",
                0,
                (w - 0.06, w),
                (1.1, 1.9),
                (-h, -h * 0.55),
                [(1.2, 1.8, -h + 0.1, -h * 0.6)],
            )
        ]
    )
    return [*floats, box("deck", (-w, w), (0.95, 1.1), (-h, h)), *sides, *ends, roof, *posts, *rail]


BOATS: tuple[Callable[[Draw], list[Part]], ...] = (
    _sloop,
    _rowing,
    _canoe,
    _catamaran,
    _square_rigger,
    _junk,
    _speedboat,
    _longship,
    _houseboat,
)
"""Makers of boats."""
