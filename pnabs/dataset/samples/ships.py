"""Ships: large ones here, boats and working ships beside them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pnabs.dataset.samples.boats import BOATS
from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.hulls import decked_hull, deckhouse, hull_stations, mast_at
from pnabs.dataset.samples.parts import Part, both_sides, moved, turned
from pnabs.dataset.samples.sheets import panel, sheet
from pnabs.dataset.samples.solids import block, box, ellipsoid, lathe, prism, rod, tube
from pnabs.dataset.samples.workships import WORKSHIPS


def ship(draw: Draw) -> list[Part]:
    """One ship along z, its bow looking along -z, keel at height 0."""
    return draw.kind(KINDS)(draw)


def _containers(draw: Draw) -> list[Part]:
    length = draw.between(60, 90)
    beam, depth = length * 0.15, length * 0.09
    rings = hull_stations(length, beam, depth, stern=0.9, bow=0.2, fullness=0.85, rake=0.06)
    parts = [decked_hull("hull", rings)]
    bays, wide = draw.whole(4, 7), draw.whole(2, 4)
    step = length * 0.6 / bays
    for i in range(bays):
        z = -length * 0.34 + i * step
        for j in range(wide):
            x = -beam * 0.46 + beam * 0.92 * j / wide
            tall = draw.whole(0, 3)
            if tall:
                parts.append(
                    box(
                        "containers",
                        (x, x + beam * 0.9 / wide),
                        (depth, depth + 2.4 * tall),
                        (z, z + step * 0.9),
                    )
                )
    bridge = length * 0.33
    parts += [
        deckhouse("bridge", beam * 0.42, (depth, depth + 10), (bridge, bridge + 6)),
        box("wings", (-beam * 0.55, beam * 0.55), (depth + 8, depth + 10), (bridge, bridge + 2.5)),
        block("funnel", (0, depth + 7, bridge + 8), (3, 14, 3)),
    ]
    return parts


def _tanker(draw: Draw) -> list[Part]:
    length = draw.between(60, 80)
    beam, depth = length * 0.17, length * 0.08
    rings = hull_stations(length, beam, depth, stern=0.85, bow=0.15, fullness=0.9, rake=0.02)
    parts = [decked_hull("hull", rings)]
    if draw.chance(0.5):
        r = beam * 0.4
        parts += [
            moved(ellipsoid("tank", (0, 0, 0), (r, r, r), 14, 8), (0, depth + r * 0.4, z))
            for z in np.linspace(-length * 0.28, length * 0.18, draw.whole(3, 4)).tolist()
        ]
    else:
        parts += [
            rod("pipe", (x, depth + 1, -length * 0.35), (x, depth + 1, length * 0.25), 0.4, sides=6)
            for x in (-1, 1)
        ]
        parts += [
            block("pump", (0, depth + 1.5, z), (beam * 0.7, 3, 2))
            for z in np.linspace(-length * 0.25, length * 0.15, 3).tolist()
        ]
    z = length * 0.32
    return [
        *parts,
        deckhouse("bridge", beam * 0.4, (depth, depth + 7), (z, z + 8), 1),
        rod("funnel", (0, depth + 6, z + 6), (0, depth + 11, z + 6), 1.5, 1.2, 12),
    ]


def _carrier(draw: Draw) -> list[Part]:
    length = draw.between(90, 110)
    beam, depth = length * 0.12, length * 0.07
    rings = hull_stations(length, beam, depth, stern=0.9, bow=0.3, fullness=0.7)
    h = length / 2
    deck = [
        (-beam * 0.9, -h * 0.2),
        (-beam * 0.5, -h * 0.95),
        (beam * 0.4, -h),
        (beam * 0.6, -h * 0.3),
        (beam * 0.8, h * 0.5),
        (beam * 0.6, h),
        (-beam * 0.6, h),
        (-beam * 0.9, h * 0.5),
    ]
    island = draw.between(0, h * 0.3)
    x = beam * 0.55
    parts = [
        decked_hull("hull", rings),
        prism("deck", 1, deck, (depth, depth + 2)),
        box("island", (x - 2, x + 2), (depth + 2, depth + 8), (island, island + 12)),
        box("tower", (x - 1.2, x + 1.2), (depth + 8, depth + 13), (island + 3, island + 7)),
        rod("mast", (x, depth + 12, island + 5), (x, depth + 20, island + 5), 0.3, sides=6),
    ]
    for i in range(draw.whole(0, 6)):
        z = -h * 0.6 + i * 8
        parts += [
            sheet(
                "aircraft", (-7, depth + 3, z + 3), (-4, depth + 3, z - 3), (-1, depth + 3, z + 3)
            )
        ]
    return parts


def _liner(draw: Draw) -> list[Part]:
    length = draw.between(90, 120)
    beam, depth = length * 0.13, length * 0.07
    rings = hull_stations(length, beam, depth, stern=0.6, bow=0.35, sheer=0.1, fullness=0.75)
    parts, y = [decked_hull("hull", rings)], depth
    decks, funnels = draw.whole(3, 5), draw.whole(1, 4)
    for i in range(decks):
        x, z = beam * (0.48 - 0.03 * i), (-length * (0.3 - 0.03 * i), length * (0.4 - 0.04 * i))
        parts.append(deckhouse("deck", x, (y, y + 2.4), z, 1.5))
        y += 2.6
        parts.append(box("gallery", (-x - 0.5, x + 0.5), (y - 0.2, y), (z[0] - 1, z[1] + 2)))
    for i in range(funnels):
        at = length * 0.12 * (i - (funnels - 1) / 2)
        parts.append(tube("funnel", [(0, y - 0.5, at), (0, y + 7, at + 1.2)], 2.0, 12))
    boats = [
        ellipsoid("lifeboat", (beam * 0.5, depth + 4, z), (0.8, 0.8, 2.6), 8, 6)
        for z in np.linspace(-length * 0.15, length * 0.25, 5).tolist()
    ]
    return parts + both_sides(boats)


def _warship(draw: Draw) -> list[Part]:
    length = draw.between(80, 110)
    beam, depth = length * 0.12, length * 0.055
    rings = hull_stations(length, beam, depth, stern=0.6, bow=0.5, sheer=0.2, fullness=0.5)
    parts = [decked_hull("hull", rings)]
    fore = draw.whole(1, 2)
    places = [(-length * 0.3 + i * 9.0, -1.0) for i in range(fore)] + [(length * 0.33, 1.0)]
    for z, way in places:
        parts += [
            lathe("turret", [(2.6, depth), (2.6, depth + 2), (2.0, depth + 3.4)], 8, (0, 0, z))
        ]
        parts += [
            rod("gun", (x, depth + 2, z + way * 2), (x, depth + 2.8, z + way * 10), 0.3, sides=6)
            for x in (-0.8, 0.8)
        ]
    parts += [
        deckhouse("bridge", beam * 0.25, (depth, depth + 7), (-length * 0.12, -length * 0.02), 2),
        deckhouse("house", beam * 0.3, (depth, depth + 3), (-length * 0.02, length * 0.22)),
        deckhouse(
            "tower", beam * 0.14, (depth + 7, depth + 11), (-length * 0.1, -length * 0.05), 0.5
        ),
        mast_at(depth + 10, depth + 20, -length * 0.06, 0.4),
        rod(
            "yard", (-4, depth + 17, -length * 0.06), (4, depth + 17, -length * 0.06), 0.2, sides=6
        ),
    ]
    return parts + [
        tube("funnel", [(0, depth + 2, z), (0, depth + 9, z + 1.5)], 1.8, 10)
        for z in ((length * 0.06,) if draw.chance(0.5) else (length * 0.04, length * 0.14))
    ]


def _ferry(draw: Draw) -> list[Part]:
    """A car ferry, open right through at both ends."""
    length, beam = draw.between(50, 70), 15.0
    half = length / 2
    outline = [
        (1.2, -half + 4),
        (4, -half),
        (4, half),
        (1.2, half - 4),
        (0, half - 8),
        (0, -half + 8),
    ]
    hull = prism("hull", 0, outline, (-beam / 2, beam / 2))
    holes = [
        (5.5, 7.5, z - 2, z + 2) for z in np.linspace(-half * 0.6, half * 0.6, draw.whole(4, 7))
    ]
    sides = both_sides(
        [panel("side", 0, (beam / 2 - 0.6, beam / 2), (4, 9), (-half * 0.85, half * 0.85), holes)]
    )
    upper = box("upper_deck", (-beam / 2, beam / 2), (9, 9.6), (-half * 0.88, half * 0.88))
    saloon = panel(
        "saloon",
        2,
        (-half * 0.5, half * 0.5),
        (-beam * 0.4, beam * 0.4),
        (9.6, 12.6),
        [(-beam * 0.4 + 0.5, beam * 0.4 - 0.5, 10, 12.2)],
    )
    bridges = [
        box("bridge", (-beam * 0.3, beam * 0.3), (12.6, 15), (z - 2, z + 2))
        for z in ((-half * 0.4, half * 0.4) if draw.chance(0.5) else (-half * 0.35,))
    ]
    funnels = both_sides(
        [rod("funnel", (beam * 0.3, 9, half * 0.15), (beam * 0.3, 17, half * 0.15), 0.9, sides=10)]
    )
    return [hull, *sides, upper, saloon, *bridges, *funnels]


def _submarine(draw: Draw) -> list[Part]:
    length = draw.between(40, 60)
    r = length * 0.06
    profile = [
        (0.0, -0.5),
        (0.55, -0.46),
        (0.9, -0.4),
        (1.0, -0.3),
        (1.0, 0.15),
        (0.75, 0.3),
        (0.35, 0.44),
        (0.0, 0.5),
    ]
    hull = turned(lathe("hull", [(r * f, length * at) for f, at in profile], 16), 0, 90)
    sail = prism(
        "sail",
        1,
        [
            (-0.6, -length * 0.16),
            (0, -length * 0.18),
            (0.6, -length * 0.16),
            (0.4, -length * 0.06),
            (-0.4, -length * 0.06),
        ],
        (r * 0.9, r * 2),
    )
    fin = box("plane", (r * 0.2, r * 1.7), (-0.15, 0.15), (length * 0.4, length * 0.45))
    dive = box("plane", (0.4, r * 1.2), (r * 1.5, r * 1.6), (-length * 0.14, -length * 0.11))
    upright = box("rudder", (-0.15, 0.15), (-r * 1.5, r * 1.5), (length * 0.4, length * 0.45))
    periscope = [
        rod("periscope", (0, r * 1.9, z), (0, r * draw.between(2.3, 3), z), 0.12, sides=6)
        for z in (-length * 0.12, -length * 0.1)
    ]
    return [hull, sail, *both_sides([fin, dive]), upright, *periscope]


KINDS: tuple[Callable[[Draw], list[Part]], ...] = (
    _containers,
    _tanker,
    _carrier,
    _liner,
    _warship,
    _ferry,
    _submarine,
    *BOATS,
    *WORKSHIPS,
)
