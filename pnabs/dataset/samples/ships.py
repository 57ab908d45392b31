"""Ships and boats: hulls drawn through stations, and what stands on them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, moved, turned
from pnabs.dataset.samples.sheets import hoop, panel, sheet, strip
from pnabs.dataset.samples.solids import Span, block, box, ellipsoid, lathe, loft, prism, rod, tube
from pnabs.geometry.types import Float64


def ship(draw: Draw) -> list[Part]:
    """One ship along z, its bow looking along -z, keel at height 0."""
    return draw.kind(KINDS)(draw)


def _stations(
    length: float, beam: float, depth: float, *, stern: float = 0.8, bow: float = 0.3,
    sheer: float = 0.0, fullness: float = 0.5, rake: float = 0.08, count: int = 9,
) -> Float64:
    """Cross-sections from stern to bow, (count, 9, 3), each from gunwale to gunwale.

    `stern` is the transom's share of the beam, `bow` the length of the bow's taper as a
    share of the whole, `sheer` how far the ends rise, `fullness` how boxy sections are
    (0 a wedge, 1 a box) and `rake` how far the stem leans forward.
    """
    rings = []
    for along in np.linspace(0, 1, count):
        taper = min(1.0, (1 - along) / bow) if bow else 1.0
        swell = stern + (1 - stern) * min(1.0, along / 0.35)
        # A stem without width would leave faces without area.
        half = beam / 2 * max(0.015, swell * math.sqrt(1 - (1 - taper) ** 2))
        top = depth * (1 + sheer * (2 * along - 1) ** 2)
        ring = []
        for s in np.linspace(-1, 1, 9):
            low = abs(s)
            height = top * low ** (1 + 4 * fullness)
            width = half * math.copysign(low ** (1 - 0.85 * fullness), s) if s else 0.0
            lean = rake * length * height / depth * along**3
            ring.append((width, height, length * (0.5 - along) - lean))
        rings.append(ring)
    return np.array(rings)


def _shell(name: str, rings: Float64) -> list[Part]:
    """Hull skin with its transom, without thickness, open above."""
    skin = strip(name, rings)
    return [skin, sheet("transom", *rings[0])]


def _solid(name: str, rings: Float64) -> Part:
    """A closed hull, decked along its gunwales."""
    return loft(name, rings)


def _thick(name: str, rings: Float64, share: float = 0.88, floor: float = 0.12) -> list[Part]:
    """An open hull with a wall: the skin, an inner skin, the rim between and a transom."""
    inner = rings * (share, 1, share)
    low = rings[:, :, 1].max() * floor
    inner[:, :, 1] = np.maximum(inner[:, :, 1], low)
    inner[:, (0, -1), 1] = rings[:, (0, -1), 1]
    ends = [(i, i + 1, 16 - i, 17 - i) for i in range(8)]
    wall = loft(name, np.concatenate([rings, inner[:, ::-1]], axis=1), cap=ends)
    return [wall, sheet("transom", *rings[0])]


def _house(name: str, x: float, y: Span, z: Span, slope: float = 0.0) -> Part:
    """A deckhouse whose front leans back."""
    line = [(y[0], z[0]), (y[1], z[0] + slope), (y[1], z[1]), (y[0], z[1])]
    return prism(name, 0, line, (-x, x))


def _mast(y: float, top: float, z: float, radius: float = 0.05) -> Part:
    return rod("mast", (0, y, z), (0, top, z), radius, radius * 0.6, 8)


def _sloop(draw: Draw) -> list[Part]:
    length, top = draw.between(7, 10), draw.between(9, 12)
    rings = _stations(length, length * 0.3, 1.1, stern=0.6, bow=0.6, sheer=0.2, fullness=0.25)
    mast = -length * 0.08
    belly = draw.between(0.2, 0.6)
    main = strip("mainsail", [[(belly * f * (1 - f) * 2, 1.9, mast + 0.1 + f * length * 0.4)
                               for f in np.linspace(0, 1, 5)],
                              [(0, top - 0.2, mast + 0.1 + 0.1 * f) for f in np.linspace(0, 1, 5)]])
    jib = sheet("jib", (0, 1.4, -length * 0.52), (0, 1.7, mast - 0.2), (0, top * 0.85, mast - 0.08))
    keel = prism("keel", 0, [(0.1, -1), (0.1, 1.2), (-1.2, 0.8), (-1.2, -0.1)], (-0.06, 0.06))
    cabin = _house("cabin", length * 0.09, (1.0, 1.6), (-length * 0.2, length * 0.15), 0.5)
    boom = rod("boom", (0, 1.85, mast), (0, 1.8, mast + length * 0.42), 0.05, sides=6)
    hull = [_solid("hull", rings), _mast(1, top, mast), boom, keel, cabin]
    rig = draw.variant("rig", ("sloop", "ketch", "furled", "catboat", "lateen"))
    aft, low = length * 0.33, top * 0.6
    if rig == "ketch":
        mizzen = sheet("mizzen", (0, 1.8, aft + 0.1), (0, 1.7, aft + length * 0.2), (0, low, aft + 0.1))
        return [*hull, main, jib, _mast(1, low + 0.2, aft), mizzen]
    if rig == "lateen":
        yard = rod("yard", (0, 2.2, -length * 0.5), (0, top * 1.05, length * 0.25), 0.06, 0.03, 6)
        sail = sheet("sail", (0, 2.2, -length * 0.5), (0, 1.9, length * 0.35), (0, top * 1.05, length * 0.25))
        return [*hull[:2], keel, yard, sail]
    return hull + {"sloop": [main, jib], "catboat": [main], "furled": [
        rod("furled", (0, 2.0, mast), (0, 1.95, mast + length * 0.4), 0.14, 0.06, 8)]}[rig]


def _containers(draw: Draw) -> list[Part]:
    length = draw.between(60, 90)
    beam, depth = length * 0.15, length * 0.09
    rings = _stations(length, beam, depth, stern=0.9, bow=0.2, fullness=0.85, rake=0.06)
    parts = [_solid("hull", rings)]
    bays, wide = draw.whole(4, 7), draw.whole(2, 4)
    step = length * 0.6 / bays
    for i in range(bays):
        z = -length * 0.34 + i * step
        for j in range(wide):
            x = -beam * 0.46 + beam * 0.92 * j / wide
            tall = draw.whole(0, 3)
            if tall:
                parts.append(box("containers", (x, x + beam * 0.9 / wide), (depth, depth + 2.4 * tall),
                                 (z, z + step * 0.9)))
    bridge = length * 0.33
    parts += [_house("bridge", beam * 0.42, (depth, depth + 10), (bridge, bridge + 6)),
              box("wings", (-beam * 0.55, beam * 0.55), (depth + 8, depth + 10), (bridge, bridge + 2.5)),
              block("funnel", (0, depth + 7, bridge + 8), (3, 14, 3))]
    return parts


def _tanker(draw: Draw) -> list[Part]:
    length = draw.between(60, 80)
    beam, depth = length * 0.17, length * 0.08
    rings = _stations(length, beam, depth, stern=0.85, bow=0.15, fullness=0.9, rake=0.02)
    parts = [_solid("hull", rings)]
    if draw.chance(0.5):
        r = beam * 0.4
        parts += [moved(ellipsoid("tank", (0, 0, 0), (r, r, r), 14, 8), (0, depth + r * 0.4, z))
                  for z in np.linspace(-length * 0.28, length * 0.18, draw.whole(3, 4)).tolist()]
    else:
        parts += [rod("pipe", (x, depth + 1, -length * 0.35), (x, depth + 1, length * 0.25), 0.4, sides=6)
                  for x in (-1, 1)]
        parts += [block("pump", (0, depth + 1.5, z), (beam * 0.7, 3, 2))
                  for z in np.linspace(-length * 0.25, length * 0.15, 3).tolist()]
    z = length * 0.32
    return [*parts, _house("bridge", beam * 0.4, (depth, depth + 7), (z, z + 8), 1),
            rod("funnel", (0, depth + 6, z + 6), (0, depth + 11, z + 6), 1.5, 1.2, 12)]


def _carrier(draw: Draw) -> list[Part]:
    length = draw.between(90, 110)
    beam, depth = length * 0.12, length * 0.07
    rings = _stations(length, beam, depth, stern=0.9, bow=0.3, fullness=0.7)
    h = length / 2
    deck = [(-beam * 0.9, -h * 0.2), (-beam * 0.5, -h * 0.95), (beam * 0.4, -h), (beam * 0.6, -h * 0.3),
            (beam * 0.8, h * 0.5), (beam * 0.6, h), (-beam * 0.6, h), (-beam * 0.9, h * 0.5)]
    island = draw.between(0, h * 0.3)
    x = beam * 0.55
    parts = [_solid("hull", rings), prism("deck", 1, deck, (depth, depth + 2)),
             box("island", (x - 2, x + 2), (depth + 2, depth + 8), (island, island + 12)),
             box("tower", (x - 1.2, x + 1.2), (depth + 8, depth + 13), (island + 3, island + 7)),
             rod("mast", (x, depth + 12, island + 5), (x, depth + 20, island + 5), 0.3, sides=6)]
    for i in range(draw.whole(0, 6)):
        z = -h * 0.6 + i * 8
        parts += [sheet("aircraft", (-7, depth + 3, z + 3), (-4, depth + 3, z - 3), (-1, depth + 3, z + 3))]
    return parts


def _rowing(draw: Draw) -> list[Part]:
    length = draw.between(3, 4.5)
    rings = _stations(length, length * 0.36, 0.55, stern=draw.between(0.4, 0.8), bow=0.55, sheer=0.25,
                      fullness=0.35)
    hull = _thick("hull", rings) if draw.chance(0.6) else _shell("hull", rings)
    thwarts = [block("thwart", (0, 0.38, z), (length * 0.3, 0.04, 0.25)) for z in (-0.6, 0.2, 1.0)]
    reach, pairs = length * 0.55, draw.variant("oars", (1, 0, 2))
    half = [rod("oar", (0.1, 0.75, 0.4), (reach, 0.35, -0.1), 0.025, sides=6),
            sheet("blade", (reach, 0.42, -0.1), (reach, 0.26, -0.1), (reach + 0.45, 0.14, -0.2),
                  (reach + 0.45, 0.3, -0.2))]
    oars = [moved(part, (0, 0, 0.8 * i - 0.3)) for i in range(pairs) for part in both_sides(half)]
    if not pairs:
        oars = [block("motor", (0, 0.7, length * 0.53), (0.25, 0.45, 0.3)),
                block("shaft", (0, 0.2, length * 0.53), (0.08, 0.7, 0.12)),
                box("locker", (-0.4, 0.4), (0.1, 0.45), (-length * 0.3, -length * 0.18))]
    return [*hull, *thwarts, *oars]


def _canoe(draw: Draw) -> list[Part]:
    length = draw.between(4, 5.5)
    front = _stations(length, 0.9, 0.42, stern=0.04, bow=0.5, sheer=0.5, fullness=0.4, rake=0.0, count=11)
    parts = _shell("hull", front)
    parts += [block("thwart", (0, 0.36, z), (0.8, 0.03, 0.12)) for z in (-0.9, 0.0, 0.9)]
    if draw.chance(0.6):
        side = draw.pick((-1, 1))
        floatation = ellipsoid("outrigger", (side * 1.5, 0.12, 0), (0.13, 0.13, length * 0.3), 8, 8)
        arms = [tube("arm", [(0, 0.42, z), (side * 0.9, 0.5, z), (side * 1.5, 0.15, z)], 0.03, 6)
                for z in (-0.8, 0.8)]
        parts += [floatation, *arms]
    return parts


def _catamaran(draw: Draw) -> list[Part]:
    length, gap = draw.between(9, 13), draw.between(1.8, 2.6)
    rings = _stations(length, 1.3, 1.5, stern=0.7, bow=0.6, fullness=0.4)
    hulls = both_sides([moved(_solid("hull", rings), (gap, 0, 0))])
    deck = box("deck", (-gap, gap), (1.2, 1.45), (-length * 0.15, length * 0.4))
    net = sheet("net", (-gap, 1.4, -length * 0.15), (gap, 1.4, -length * 0.15), (gap, 1.4, -length * 0.4),
                (-gap, 1.4, -length * 0.4))
    cabin = _house("cabin", gap * 0.75, (1.4, 2.7), (-length * 0.12, length * 0.25), 1.2)
    parts = [*hulls, deck, net, cabin]
    if draw.chance(0.6):
        top = length * 1.25
        parts += [_mast(1.4, top, -length * 0.1, 0.08),
                  sheet("sail", (0, 3.2, -length * 0.08), (0, 3.2, length * 0.35), (0, top * 0.97,
                                                                                  -length * 0.08))]
    return parts


def _tug(draw: Draw) -> list[Part]:
    length = draw.between(16, 22)
    rings = _stations(length, length * 0.35, 3.2, stern=0.8, bow=0.4, sheer=0.25, fullness=0.6)
    funnel = draw.between(5.5, 8)
    tyres = both_sides([moved(turned(hoop("fender", [(0.25, -0.15), (0.5, -0.15), (0.5, 0.15), (0.25, 0.15)],
                                         10), 2, 90), (length * 0.18, 2.6, z))
                        for z in (-length * 0.1, length * 0.1, length * 0.28)])
    return [_solid("hull", rings), _house("house", length * 0.11, (3, 5.4), (-length * 0.15, length * 0.15)),
            _house("wheelhouse", length * 0.08, (5.4, 7.6), (-length * 0.13, 0.3), 0.4),
            rod("funnel", (0, 5, length * 0.09), (0, funnel + 2, length * 0.09), 0.8, 0.7, 12),
            _mast(7.5, 11, -length * 0.05), *tyres]


def _liner(draw: Draw) -> list[Part]:
    length = draw.between(90, 120)
    beam, depth = length * 0.13, length * 0.07
    rings = _stations(length, beam, depth, stern=0.6, bow=0.35, sheer=0.1, fullness=0.75)
    parts, y = [_solid("hull", rings)], depth
    decks, funnels = draw.whole(3, 5), draw.whole(1, 4)
    for i in range(decks):
        x, z = beam * (0.48 - 0.03 * i), (-length * (0.3 - 0.03 * i), length * (0.4 - 0.04 * i))
        parts.append(_house("deck", x, (y, y + 2.4), z, 1.5))
        y += 2.6
        parts.append(box("gallery", (-x - 0.5, x + 0.5), (y - 0.2, y), (z[0] - 1, z[1] + 2)))
    for i in range(funnels):
        z = length * 0.12 * (i - (funnels - 1) / 2)
        parts.append(tube("funnel", [(0, y - 0.5, z), (0, y + 7, z + 1.2)], 2.0, 12))
    boats = [ellipsoid("lifeboat", (beam * 0.5, depth + 4, z), (0.8, 0.8, 2.6), 8, 6)
             for z in np.linspace(-length * 0.15, length * 0.25, 5).tolist()]
    return parts + both_sides(boats)


def _warship(draw: Draw) -> list[Part]:
    length = draw.between(80, 110)
    beam, depth = length * 0.12, length * 0.055
    rings = _stations(length, beam, depth, stern=0.6, bow=0.5, sheer=0.2, fullness=0.5)
    parts = [_solid("hull", rings)]
    fore = draw.whole(1, 2)
    places = [(-length * 0.3 + i * 9.0, -1.0) for i in range(fore)] + [(length * 0.33, 1.0)]
    for z, way in places:
        parts += [lathe("turret", [(2.6, depth), (2.6, depth + 2), (2.0, depth + 3.4)], 8, (0, 0, z))]
        parts += [rod("gun", (x, depth + 2, z + way * 2), (x, depth + 2.8, z + way * 10), 0.3, sides=6)
                  for x in (-0.8, 0.8)]
    parts += [_house("bridge", beam * 0.25, (depth, depth + 7), (-length * 0.12, -length * 0.02), 2),
              _house("house", beam * 0.3, (depth, depth + 3), (-length * 0.02, length * 0.22)),
              _house("tower", beam * 0.14, (depth + 7, depth + 11), (-length * 0.1, -length * 0.05), 0.5),
              _mast(depth + 10, depth + 20, -length * 0.06, 0.4),
              rod("yard", (-4, depth + 17, -length * 0.06), (4, depth + 17, -length * 0.06), 0.2, sides=6)]
    return parts + [tube("funnel", [(0, depth + 2, z), (0, depth + 9, z + 1.5)], 1.8, 10)
                    for z in ((length * 0.06,) if draw.chance(0.5) else (length * 0.04, length * 0.14))]


def _square_rigger(draw: Draw) -> list[Part]:
    length = draw.between(28, 36)
    rings = _stations(length, length * 0.26, 5, stern=0.7, bow=0.35, sheer=0.35, fullness=0.55)
    masts = draw.pick((2, 3))
    castle = _house("sterncastle", length * 0.1, (5, 8), (length * 0.28, length * 0.48))
    parts = [_solid("hull", rings), castle,
             rod("bowsprit", (0, 6.5, -length * 0.45), (0, 10, -length * 0.72), 0.25, 0.12, 8)]
    for z in np.linspace(-length * 0.27, length * 0.27, masts).tolist():
        top = draw.between(24, 30)
        parts.append(_mast(4, top, z, 0.35))
        for low, high, wide in ((8, 14, 7.5), (14.5, 19, 6), (19.5, 23, 4.5)):
            parts.append(rod("yard", (-wide, high, z - 0.4), (wide, high, z - 0.4), 0.15, sides=6))
            drum = [[(x, high, z - 0.5), (x * 0.98, (low + high) / 2, z - 1.6), (x, low, z - 0.6)]
                    for x in np.linspace(-wide, wide, 4)]
            parts.append(strip("sail", drum))
    return parts


def _junk(draw: Draw) -> list[Part]:
    length = draw.between(14, 20)
    rings = _stations(length, length * 0.32, 2.6, stern=0.85, bow=0.3, sheer=0.6, fullness=0.7)
    parts = [*_thick("hull", rings, floor=0.4), _house("cabin", length * 0.11, (2, 4.4), (length * 0.2,
                                                                                      length * 0.4))]
    for z, top in ((-length * 0.3, 9.0), (0.0, 13.0), (length * 0.33, 8.0))[: draw.whole(2, 3)]:
        wide = length * 0.2
        fan = [(0, 3.6, z - wide * 0.3), (0, 3.8, z + wide * 0.8), (0, top * 0.75, z + wide),
               (0, top, z + wide * 0.4), (0, top - 0.5, z - wide * 0.2)]
        parts += [_mast(1, top + 0.5, z, 0.15), sheet("sail", *fan)]
        parts += [rod("batten", (0.03, 3.6 + f * (top - 4.5), z - wide * 0.28),
                      (0.03, 3.8 + f * (top * 0.75 - 3.8), z + wide * 0.95), 0.06, sides=4)
                  for f in (0.25, 0.5, 0.75)]
    return parts


def _speedboat(draw: Draw) -> list[Part]:
    length = draw.between(5, 8)
    rings = _stations(length, length * 0.32, 0.9, stern=0.95, bow=0.6, sheer=0.15, fullness=0.3, rake=0.12)
    shield = [(x, 0.9, -length * 0.08 - 0.3 * (1 - abs(x) / (length * 0.13))) for x in
              np.linspace(-length * 0.13, length * 0.13, 5)]
    screen = strip("windscreen", [shield, [(x, 1.4, z + 0.45) for x, _, z in shield]])
    seats = both_sides([block("seat", (0.4, 0.75, z), (0.5, 0.3, 0.5)) for z in (0.2, 1.1)])
    motor = [block("motor", (0, 0.9, length * 0.53), (0.4, 0.6, 0.4)),
             block("shaft", (0, 0.3, length * 0.53), (0.12, 0.9, 0.2))]
    fore = rings[:, (0, -1)][4:]
    deck = strip("foredeck", fore)
    return [*_thick("hull", rings, 0.86, 0.5), deck, screen, *seats, *(motor if draw.chance(0.7) else [])]


def _ferry(draw: Draw) -> list[Part]:
    """A car ferry, open right through at both ends."""
    length, beam = draw.between(50, 70), 15.0
    half = length / 2
    outline = [(1.2, -half + 4), (4, -half), (4, half), (1.2, half - 4), (0, half - 8), (0, -half + 8)]
    hull = prism("hull", 0, outline, (-beam / 2, beam / 2))
    holes = [(5.5, 7.5, z - 2, z + 2) for z in np.linspace(-half * 0.6, half * 0.6, draw.whole(4, 7))]
    sides = both_sides([panel("side", 0, (beam / 2 - 0.6, beam / 2), (4, 9), (-half * 0.85, half * 0.85),
                              holes)])
    upper = box("upper_deck", (-beam / 2, beam / 2), (9, 9.6), (-half * 0.88, half * 0.88))
    saloon = panel("saloon", 2, (-half * 0.5, half * 0.5), (-beam * 0.4, beam * 0.4), (9.6, 12.6),
                   [(-beam * 0.4 + 0.5, beam * 0.4 - 0.5, 10, 12.2)])
    bridges = [box("bridge", (-beam * 0.3, beam * 0.3), (12.6, 15), (z - 2, z + 2))
               for z in ((-half * 0.4, half * 0.4) if draw.chance(0.5) else (-half * 0.35,))]
    funnels = both_sides([rod("funnel", (beam * 0.3, 9, half * 0.15), (beam * 0.3, 17, half * 0.15), 0.9,
                              sides=10)])
    return [hull, *sides, upper, saloon, *bridges, *funnels]


def _submarine(draw: Draw) -> list[Part]:
    length = draw.between(40, 60)
    r = length * 0.06
    profile = [(0.0, -0.5), (0.55, -0.46), (0.9, -0.4), (1.0, -0.3), (1.0, 0.15), (0.75, 0.3), (0.35, 0.44),
               (0.0, 0.5)]
    hull = turned(lathe("hull", [(r * f, length * at) for f, at in profile], 16), 0, 90)
    sail = prism("sail", 1, [(-0.6, -length * 0.16), (0, -length * 0.18), (0.6, -length * 0.16),
                             (0.4, -length * 0.06), (-0.4, -length * 0.06)], (r * 0.9, r * 2))
    fin = box("plane", (r * 0.2, r * 1.7), (-0.15, 0.15), (length * 0.4, length * 0.45))
    dive = box("plane", (0.4, r * 1.2), (r * 1.5, r * 1.6), (-length * 0.14, -length * 0.11))
    upright = box("rudder", (-0.15, 0.15), (-r * 1.5, r * 1.5), (length * 0.4, length * 0.45))
    periscope = [rod("periscope", (0, r * 1.9, z), (0, r * draw.between(2.3, 3), z), 0.12, sides=6)
                 for z in (-length * 0.12, -length * 0.1)]
    return [hull, sail, *both_sides([fin, dive]), upright, *periscope]


def _paddle(draw: Draw) -> list[Part]:
    length = draw.between(30, 42)
    rings = _stations(length, length * 0.2, 2, stern=0.9, bow=0.2, fullness=0.9, rake=0.02)
    half, parts = length * 0.09, [_solid("hull", rings)]
    for i in range(draw.whole(2, 3)):
        y = 2 + 2.8 * i
        z = (-length * (0.32 - 0.04 * i), length * (0.38 - 0.04 * i))
        parts += [box("house", (-half * 0.75, half * 0.75), (y, y + 2.5), (z[0] + 2, z[1] - 1)),
                  box("roof", (-half, half), (y + 2.5, y + 2.8), z)]
        parts += both_sides([rod("post", (half - 0.2, y, at), (half - 0.2, y + 2.6, at), 0.1, sides=4)
                             for at in np.linspace(z[0] + 0.5, z[1] - 0.5, 6).tolist()])
    top = float(max(part.vertices[:, 1].max() for part in parts))
    parts += both_sides([rod("stack", (1.2, top - 0.5, -length * 0.15), (1.2, top + 5, -length * 0.15), 0.45,
                             0.6, 10)])
    blades = [turned(box("blade", (-half * 0.8, half * 0.8), (0.3, 2.6), (-0.06, 0.06)), 0, 45 * i)
              for i in range(8)]
    rims = [turned(hoop("rim", [(2.3, x), (2.6, x), (2.6, x + 0.2), (2.3, x + 0.2)], 16), 2, 90)
            for x in (-half * 0.8, half * 0.8 - 0.2)]
    return parts + [moved(part, (0, 2.2, length * 0.5 + 2.2)) for part in (*blades, *rims)]


def _barge(draw: Draw) -> list[Part]:
    length, beam = draw.between(35, 50), draw.between(7, 10)
    h, depth = length / 2, 3.0
    hold = panel("hull", 1, (0.6, depth), (-beam / 2, beam / 2), (-h * 0.85, h * 0.85),
                 [(-beam / 2 + 0.6, beam / 2 - 0.6, a, b) for a, b in
                  _cells(-h * 0.82, h * 0.6, draw.whole(1, 4), 0.8)])
    ends = [prism("end", 0, [(0.6, s * h * 0.85), (depth, s * h * 0.85), (depth, s * h), (2, s * h)],
                  (-beam / 2, beam / 2)) for s in (-1, 1)]
    floor = box("floor", (-beam / 2, beam / 2), (0, 0.6), (-h * 0.85, h * 0.85))
    heap = [ellipsoid("cargo", (0, 1.5, (a + b) / 2), (beam * 0.4, 2.2, (b - a) * 0.45), 8, 6)
            for a, b in _cells(-h * 0.82, h * 0.6, 2, 0.8)] if draw.chance(0.4) else []
    house = [_house("house", beam * 0.35, (depth, depth + 2.6), (h * 0.66, h * 0.9)),
             _house("wheelhouse", beam * 0.2, (depth + 2.6, depth + 4.6), (h * 0.66, h * 0.78))]
    return [hold, *ends, floor, *heap, *house]


def _cells(low: float, high: float, count: int, gap: float) -> list[Span]:
    step = (high - low) / count
    return [(low + i * step + gap / 2, low + (i + 1) * step - gap / 2) for i in range(count)]


def _trawler(draw: Draw) -> list[Part]:
    length = draw.between(18, 26)
    rings = _stations(length, length * 0.28, 3, stern=0.85, bow=0.45, sheer=0.4, fullness=0.55)
    aft = draw.chance(0.5)
    z = (length * 0.15, length * 0.4) if aft else (-length * 0.28, -length * 0.03)
    gallows = length * (-0.05 if aft else 0.42)
    frame = tube("gallows", [(-2.2, 2.5, gallows), (-1.6, 7, gallows), (1.6, 7, gallows),
                             (2.2, 2.5, gallows)], 0.15, 6)
    booms = both_sides([rod("boom", (0.2, 4, gallows), (5.5, 10, gallows), 0.1, sides=6)])
    return [*_thick("hull", rings, 0.9, 0.6), _house("house", length * 0.1, (1.8, 5), z, 0.6),
            _mast(4, 10, (z[0] + z[1]) / 2, 0.15), frame, *(booms if draw.chance(0.6) else [])]


def _hovercraft(draw: Draw) -> list[Part]:
    length = draw.between(14, 20)
    w, h = length * 0.25, length / 2
    skirt = [(-w, -h * 0.7), (-w * 0.5, -h), (w * 0.5, -h), (w, -h * 0.7), (w, h), (-w, h)]
    upper = [(x * 0.85, z * 0.92) for x, z in skirt]
    base = loft("skirt", [[(x, 0, z) for x, z in skirt], [(x * 1.05, 0.8, z * 1.03) for x, z in skirt],
                          [(x, 1.8, z) for x, z in upper]])
    cabin = _house("cabin", w * 0.6, (1.8, 4), (-h * 0.7, h * 0.2), 1.2)
    fans = []
    for x in (-w * 0.4, w * 0.4):
        duct = turned(hoop("duct", [(1.5, 0), (1.7, 0), (1.7, 0.9), (1.5, 0.9)], 16), 0, 90)
        fans += [moved(duct, (x, 3.6, h * 0.8)), block("blade", (x, 3.6, h * 0.85), (0.25, 2.8, 0.08)),
                 block("blade", (x, 3.6, h * 0.85), (2.8, 0.25, 0.08)),
                 block("pylon", (x, 2.2, h * 0.85), (0.5, 1.2, 0.8))]
    rudders = [block("rudder", (x, 3.6, h * 0.98), (0.1, 2.6, 0.7)) for x in (-w * 0.4, w * 0.4)]
    return [base, cabin, *fans, *rudders]


def _platform(draw: Draw) -> list[Part]:
    """A twin-hulled research ship with a tall working deck on struts."""
    length = draw.between(30, 40)
    pods = [ellipsoid("pod", (s * 7, 1.5, 0), (1.6, 1.5, length / 2), 12, 9) for s in (-1, 1)]
    struts = [prism("strut", 1, [(s * 7 - 0.6, z - 4), (s * 7 + 0.6, z - 4), (s * 7 + 0.6, z + 4),
                                 (s * 7 - 0.6, z + 4)], (2, 8))
              for s in (-1, 1) for z in (-length * 0.25, length * 0.25)]
    deck = panel("deck", 1, (8, 10), (-8.5, 8.5), (-length * 0.42, length * 0.42),
                 [(-2, 2, length * 0.05, length * 0.2)])
    crane = [_mast(10, 18, length * 0.25, 0.6), rod("jib", (0, 17.5, length * 0.25), (9, 22, length * 0.1),
                                                   0.35, sides=6)]
    house = [_house("house", 6, (10, 14), (-length * 0.38, -length * 0.1), 1.5),
             _house("bridge", 4, (14, 16.5), (-length * 0.35, -length * 0.22), 0.8)]
    return [*pods, *struts, deck, *crane, *house]


def _longship(draw: Draw) -> list[Part]:
    length, rowers = draw.between(14, 20), draw.whole(5, 8)
    rings = _stations(length, length * 0.2, 1.6, stern=0.05, bow=0.5, sheer=1.1, fullness=0.4, rake=0.05, count=11)
    parts = _thick("hull", rings, 0.9, 0.25)
    for z in np.linspace(-length * 0.25, length * 0.25, rowers).tolist():
        half = length * 0.1 * math.sqrt(max(0.2, 1 - (2 * z / length) ** 2))
        shield = turned(lathe("shield", [(0.45, 0), (0.4, 0.06), (0.0, 0.12)], 8), 2, -90)
        parts += both_sides([moved(shield, (half, 1.6, z)),
                             rod("oar", (half * 0.6, 1.7, z), (half + length * 0.18, 0.1, z + 0.8), 0.06,
                                 sides=4)])
    top, wide = length * 0.6, length * 0.2
    sail = strip("sail", [[(x, top - 0.3, 0), (x, top * 0.65, -0.9), (x, 2.8, -0.2)]
                          for x in np.linspace(-wide, wide, 4)])
    mast = [_mast(0.4, top, 0.1, 0.15), rod("yard", (-wide, top - 0.3, 0), (wide, top - 0.3, 0), 0.09, sides=6)]
    return parts + mast + ([sail] if draw.chance(0.8) else [])


def _houseboat(draw: Draw) -> list[Part]:
    length, w = draw.between(9, 13), 2.0
    h = length / 2
    floats = both_sides([rod("pontoon", (w * 0.65, 0.5, -h), (w * 0.65, 0.5, h), 0.5, sides=10)])
    windows = [(1.9, 2.8, z - 0.6, z + 0.6) for z in (-h * 0.3, h * 0.1, h * 0.45)]
    sides = both_sides([panel("wall", 0, (w * 0.8 - 0.1, w * 0.8), (1.1, 3.3), (-h * 0.55, h * 0.7), windows)])
    ends = [panel("wall", 2, (z, z + 0.1), (-w * 0.8 + 0.1, w * 0.8 - 0.1), (1.1, 3.3), [(-0.5, 0.5, 1.0, 2.9)])
            for z in (-h * 0.55, h * 0.7 - 0.1)]
    roof = (prism("roof", 2, [(-w, 3.2), (w, 3.2), (0, 4.5)], (-h * 0.65, h * 0.8)) if draw.chance(0.5)
            else box("roof", (-w, w), (3.3, 3.45), (-h * 0.9, h * 0.8)))
    posts = both_sides([rod("post", (w - 0.1, 1, -h * 0.85), (w - 0.1, 3.35, -h * 0.85), 0.05, sides=6)])
    rail = both_sides([panel("rail", 0, (w - 0.06, w), (1.1, 1.9), (-h, -h * 0.55), [(1.2, 1.8, -h + 0.1, -h * 0.6)])])
    return [*floats, box("deck", (-w, w), (0.95, 1.1), (-h, h)), *sides, *ends, roof, *posts, *rail]


def _crane_ship(draw: Draw) -> list[Part]:
    """A flat pontoon with a lattice crane."""
    length = draw.between(26, 36)
    w, h = length * 0.18, length / 2
    hull = prism("hull", 0, [(0, -h * 0.85), (2.5, -h), (2.5, h), (0, h * 0.85)], (-w, w))
    pivot, tip, top = np.array((0, 6.0, -h * 0.2)), draw.between(0.6, 1.1), draw.between(14, 20)
    end = np.array((0, top, -h * tip - h * 0.2))
    chords = both_sides([rod("chord", pivot + (1, dy, 0), end + (0.3, dy * 0.4, 0), 0.15, sides=4)
                         for dy in (-0.7, 0.7)])
    rungs = [rod("brace", pivot * (1 - f) + end * f + (x * (1 - 0.7 * f), -0.7, 0),
                 pivot * (1 - f) + end * f + (-x * (1 - 0.7 * f), 0.7, 0), 0.08, sides=4)
             for f, x in zip(np.linspace(0.1, 0.9, 6).tolist(), (1, -1) * 3, strict=True)]
    cab = [lathe("turntable", [(2.2, 2.5), (2.2, 3.6)], 12, (0, 0, -h * 0.1)),
           box("cab", (-1.8, 1.8), (3.6, 6.4), (-h * 0.25, h * 0.1))]
    hook = [rod("rope", end, end * (1, 0, 1) + (0, 4, 0), 0.06, sides=4),
            block("load", end * (1, 0, 1) + (0, 3.4, 0), (1.6, 1.2, 1.6))]
    return [hull, *chords, *rungs, *cab, *hook, _house("house", w * 0.7, (2.5, 6), (h * 0.55, h * 0.85)),
            rod("stay", (0, 6.4, h * 0.05), end, 0.06, sides=4)]


KINDS: tuple[Callable[[Draw], list[Part]], ...] = (
    _sloop, _containers, _tanker, _carrier, _rowing, _canoe, _catamaran, _tug, _liner, _warship,
    _square_rigger, _junk, _speedboat, _ferry, _submarine, _paddle, _barge, _trawler, _hovercraft,
    _platform, _longship, _houseboat, _crane_ship,
)
