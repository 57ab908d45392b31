"""Airplanes: fuselages, wings, tails, engines and undercarriages combined."""

from __future__ import annotations

import math
from collections.abc import Sequence


from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, moved, stretched, turned
from pnabs.dataset.samples.sheets import hoop, panel, sheet, strip
from pnabs.dataset.samples.solids import block, ellipsoid, lathe, loft, prism, rod, tube

Rib = tuple[float, float, float, float]
"""One end of a wing: position x, y, z of the leading edge, and chord."""

_AIRFOIL = ((0, 0), (0.22, 0.065), (0.55, 0.05), (1, 0.004), (1, -0.004), (0.55, -0.03), (0.22, -0.04))

KINDS = (
    "airliner", "light", "biplane", "delta", "fighter", "glider", "twin prop", "boom", "business",
    "four engines", "flying wing", "triplane", "seaplane", "canard", "gull", "ultralight",
    "forward swept", "parasol", "heavy lifter", "supersonic", "paper", "box wing", "racer", "drone",
)


def airplane(draw: Draw) -> list[Part]:
    """One airplane along z, its nose towards -z; the fuselage's length is about 10."""
    kind = draw.kind(KINDS)
    maker = {
        "airliner": _jet, "business": _jet, "four engines": _jet, "heavy lifter": _jet,
        "delta": _fast, "fighter": _fast, "forward swept": _fast, "canard": _fast, "supersonic": _fast,
        "biplane": _stacked, "triplane": _stacked, "boom": _twin_boom, "flying wing": _flying_wing,
        "ultralight": _ultralight, "paper": _paper, "box wing": _box_wing,
    }.get(kind, _propeller)
    return maker(draw, kind)


def wing(name: str, ribs: Sequence[Rib], *, upright: bool = False, flat: bool = False) -> Part:
    """A wing through ribs, with an airfoil as its section or, if `flat`, a sheet.

    `upright` makes it a fin: its thickness lies along x instead of y.
    """
    if flat:
        return strip(name, [[(x, y, z + chord * end) for x, y, z, chord in ribs] for end in (0, 1)])
    rings = []
    for x, y, z, chord in ribs:
        up = [(chord * rise, z + chord * along) for along, rise in _AIRFOIL]
        rings.append([(x + rise, y, at) if upright else (x, y + rise, at) for rise, at in up])
    return loft(name, rings)


def _fuselage(
    profile: Sequence[tuple[float, float]], *, wide: float = 1.0, tall: float = 1.0, sides: int = 14
) -> Part:
    """A body turned about z from (radius, z), then widened and heightened."""
    body = turned(lathe("fuselage", profile, sides), 0, 90)
    return stretched(body, (wide, tall, 1))


def _tail(draw: Draw, kind: str, z: float, size: float, y: float = 0.2) -> list[Part]:
    """Fin and tailplane with leading edges about `z`."""
    sweep, flat = size * draw.between(0.2, 0.5), draw.chance(0.15)
    fin_top = y + size * 1.1
    fin = wing("fin", [(0, y, z, size), (0, fin_top, z + sweep + 0.2, size * 0.5)], upright=True)
    level = {"T": fin_top - 0.05, "cruciform": y + size * 0.6}.get(kind, y)
    if kind == "V":
        blade = wing("tail", [(0.05, y, z, size), (size, y + size * 0.8, z + sweep, size * 0.5)])
        return both_sides([blade])
    plane = wing("tailplane", [(0, level, z + 0.25 * size, size * 0.7),
                               (size * 1.25, level, z + 0.25 * size + sweep, size * 0.4)], flat=flat)
    if kind == "twin":
        end = wing("fin", [(size * 1.2, level - 0.25 * size, z + 0.3, size * 0.7),
                           (size * 1.2, level + 0.6 * size, z + 0.5, size * 0.45)], upright=True)
        return both_sides([plane, end])
    return [fin, *both_sides([plane])]


def _propeller_part(x: float, y: float, z: float, reach: float, blades: int) -> list[Part]:
    """Spinner and blades, the first blade upright."""
    parts = [moved(_fuselage([(0.0, -0.3), (0.13, -0.05), (0.14, 0.05)], sides=8), (x, y, z))]
    for i in range(blades):
        blade = sheet("blade", (-0.04, 0.08, 0), (0.04, 0.08, 0.02), (0.09, 0.7 * reach, 0.05),
                      (0.02, reach, 0), (-0.06, 0.7 * reach, -0.03))
        parts.append(moved(turned(blade, 2, 360 * i / blades), (x, y, z)))
    return parts


def _nacelle(x: float, y: float, z: float, r: float, length: float, *, hollow: bool) -> Part:
    """A jet engine along z: an open duct, or a closed body."""
    if hollow:
        line = [(r * 0.85, 0), (r, 0.1), (r, length * 0.6), (r * 0.7, length), (r * 0.62, length),
                (r * 0.8, length * 0.4)]
        return moved(turned(hoop("engine", line, 12), 0, 90), (x, y, z))
    profile = [(r * 0.85, 0), (r, length * 0.15), (r, length * 0.6), (r * 0.55, length)]
    return moved(turned(lathe("engine", profile, 12), 0, 90), (x, y, z))


def _gear(draw: Draw, kind: str, x: float, z: float, low: float) -> list[Part]:
    """Undercarriage: main wheels at (x, z), a third one ahead or behind, or floats or skids."""
    if kind == "none":
        return []
    if kind == "floats":
        hull = ellipsoid("float", (x * 1.2, low - 0.9, z - 0.4), (0.28, 0.25, 2.4), 8, 8)
        struts = [rod("strut", (x * 0.3, low * 0.3, at), (x * 1.2, low - 0.75, at), 0.04, sides=6)
                  for at in (z - 1.2, z + 0.5)]
        return both_sides([hull, *struts])
    wheel = rod("wheel", (x - 0.08, low - 0.6, z), (x + 0.08, low - 0.6, z), 0.26, sides=12)
    leg = rod("leg", (x * 0.4, low * 0.4, z), (x, low - 0.6, z), 0.05, sides=6)
    third = draw.pick((-3.2, 4.2))
    small = [rod("wheel", (-0.06, low - 0.6, third), (0.06, low - 0.6, third), 0.2, sides=10),
             rod("leg", (0, 0, third), (0, low - 0.6, third), 0.04, sides=6)]
    return [*both_sides([wheel, leg]), *small]


def _jet(draw: Draw, kind: str) -> list[Part]:
    r = {"airliner": 0.55, "business": 0.5, "heavy lifter": 0.8}.get(kind, 0.6)
    r *= draw.between(0.9, 1.15)
    profile = [(0.0, -5), (r * 0.5, -4.75), (r * 0.85, -4.3), (r, -3.7), (r, 2.2), (r * 0.6, 4), (0.08, 5)]
    high = kind == "heavy lifter"
    y = r * 0.75 if high else -r * 0.5
    span, sweep = draw.between(3.8, 5), draw.between(1.4, 2.6)
    root, lift = draw.between(1.7, 2.2), -0.3 if high else draw.between(0.2, 0.6)
    main = wing("wing", [(0.2, y, -1.2, root), (span * 0.4, y + lift * 0.3, -1.2 + sweep * 0.45, root * 0.65),
                         (span, y + lift, -1.2 + sweep, root * 0.3)])
    hollow, er = draw.chance(0.6), r * draw.between(0.38, 0.5)
    engines: list[Part]
    if kind == "business":
        engines = [_nacelle(r + er * 1.1, 0.25, 1.6, er, 1.6, hollow=hollow),
                   block("pylon", (r, 0.25, 2.3), (0.8, 0.08, 0.7))]
    else:
        engines = []
        for f in (0.33,) if kind == "airliner" else (0.3, 0.58):
            at = (span * f, y - er * 1.3 + lift * f, -1.5 + sweep * f)
            engines += [_nacelle(*at, er, 1.5, hollow=hollow),
                        block("pylon", (at[0], at[1] + er, at[2] + 0.9), (0.08, er * 0.8, 0.9))]
    if draw.chance(0.4):
        engines.append(wing("winglet", [(span, y + lift, -1.2 + sweep, root * 0.3),
                                        (span + 0.1, y + lift + 0.7, -0.9 + sweep, root * 0.15)],
                            upright=True))
    tail = "T" if kind in ("business", "heavy lifter") else draw.pick(("low", "low", "cruciform"))
    return [_fuselage(profile, tall=draw.between(0.95, 1.15)), *both_sides([main, *engines]),
            *_tail(draw, tail, 3.1, draw.between(1.3, 1.7), r * 0.4),
            *_gear(draw, draw.pick(("none", "wheels")), 0.8, 0.4, -r)]


def _fast(draw: Draw, kind: str) -> list[Part]:
    r = 0.3 if kind == "supersonic" else draw.between(0.4, 0.5)
    nose = draw.between(-5.6, -5)
    profile = [(0.0, nose), (r * 0.55, -3.8), (r, -2), (r, 3), (r * 0.8, 4.4)]
    body = _fuselage(profile, wide=draw.between(0.9, 1.2), sides=12)
    canopy = ellipsoid("canopy", (0, r * 0.85, -2.6), (0.26, 0.3, 0.9), 8, 7)
    y = -r * 0.2
    span = draw.between(2.4, 3.2)
    plans: dict[str, list[Rib]] = {
        "delta": [(0.2, y, -1.6, 5.4), (span, y, 2.9, 0.8)],
        "supersonic": [(0.15, y, -2.8, 7.0), (1.0, y, -0.2, 4.4), (2.6, y, 3.2, 0.7)],
        "canard": [(0.2, y, -0.4, 4.0), (span, y, 2.6, 0.9)],
        "forward swept": [(0.2, y, 1.0, 2.6), (span * 1.1, y + 0.1, -0.6, 1.0)],
        "fighter": [(0.2, y, -1.0, 3.0), (span, y, 1.2, 1.0)],
    }
    parts: list[Part] = [wing("wing", plans[kind], flat=draw.chance(0.2))]
    if kind in ("canard", "forward swept"):
        parts.append(wing("canard", [(0.2, r * 0.4, -2.4, 1.1), (1.5, r * 0.4, -1.8, 0.4)]))
    if kind in ("fighter", "canard") or draw.chance(0.3):
        parts.append(prism("intake", 2, [(r * 0.7, -r), (r * 1.7, -r), (r * 1.7, r * 0.5), (r * 0.7, r * 0.6)],
                           (-1.6, 3.6)))
    twin = draw.chance(0.5) and kind != "supersonic"
    fins = [wing("fin", [(0.45, r * 0.5, 2.6, 1.6), (0.75, r + 1.2, 3.7, 0.7)], upright=True)] if twin else []
    tail = [wing("tailplane", [(0.3, y, 3.6, 1.2), (1.5, y, 4.4, 0.6)])] if kind == "fighter" else []
    middle = [] if twin else [wing("fin", [(0, r * 0.6, 2.4, 2.0), (0, r + 1.4, 4.0, 0.7)], upright=True)]
    stores: list[Part] = []
    if kind == "supersonic":
        stores = [block("engine", (1.0, y - 0.35, 2.6), (0.8, 0.5, 2.4))]
    elif draw.chance(0.5):
        stores = [moved(_fuselage([(0.0, -1), (0.1, -0.6), (0.1, 0.8)], sides=6), (f * span, y - 0.25, 1.2))
                  for f in (0.45, 0.7)]
    return [body, canopy, *middle, *both_sides([*parts, *fins, *tail, *stores])]


def _propeller(draw: Draw, kind: str) -> list[Part]:
    r = {"glider": 0.35, "drone": 0.4}.get(kind, draw.between(0.5, 0.62))
    boxy = kind in ("light", "parasol") and draw.chance(0.6)
    profile = [(r * 0.55, -4.2), (r * 0.9, -3.6), (r, -1.8), (r * 0.85, 0), (r * 0.25, 4.6)]
    if kind in ("glider", "drone"):
        profile = [(0.0, -4.2), (r, -3), (r, -1.6), (r * 0.35, 1), (0.1, 4.6)]
    body = _fuselage(profile, sides=4 if boxy else 12)
    body = turned(body, 2, 45) if boxy else body
    span = {"glider": 7.5, "drone": 6.5, "racer": 3.0}.get(kind, draw.between(4.4, 5.4))
    chord = {"glider": 0.85, "drone": 0.8}.get(kind, draw.between(1.3, 1.6))
    y = {"parasol": r + 0.7, "light": r * 0.85, "seaplane": r, "glider": r * 0.6, "twin prop": r * 0.7,
         "drone": r * 0.5}.get(kind, -r * 0.5)
    z = -2.2
    taper = draw.between(0.5, 1.0)
    ribs: list[Rib] = [(0, y, z, chord), (span, y + 0.25, z + chord * (1 - taper) * 0.5, chord * taper)]
    if kind == "gull":
        ribs = [(0, y, z, chord), (span * 0.3, y - 0.55, z, chord), (span, y + 0.5, z + 0.4, chord * 0.5)]
    if kind == "racer":
        ribs = [(span * f, y + 0.1 * f, z + chord * 0.5 * (1 - math.sqrt(1 - f * f)) * 0.9,
                 chord * math.sqrt(1 - f * f)) for f in (0, 0.4, 0.7, 0.9, 0.985)]
    half = [wing("wing", ribs, flat=kind == "light" and draw.chance(0.3))]
    if kind in ("parasol", "light"):
        half += [rod("strut", (r * 0.6, -r * 0.5, z + 0.5), (span * 0.5, y, z + 0.5), 0.04, sides=6)]
    if kind == "parasol":
        half += [rod("strut", (r * 0.4, r * 0.5, z + dz), (r * 0.5, y, z + dz), 0.04, sides=6)
                 for dz in (0.2, 1.1)]
    parts: list[Part] = []
    blades = draw.pick((2, 3, 4))
    if kind in ("twin prop", "seaplane"):
        x = span * 0.33
        half.append(moved(_fuselage([(0.2, -1.2), (0.32, -0.8), (0.3, 0.6), (0.05, 1.8)], sides=10),
                          (x, y, z)))
        props = [part for side in (-1, 1) for part in _propeller_part(side * x, y, z - 1.2, 1.0, blades)]
        parts += props
    elif kind == "drone":
        parts += _propeller_part(0, 0, 4.7, 0.9, blades)
    elif kind != "glider":
        parts += _propeller_part(0, 0, -4.25, 1.2, blades)
    if not boxy:
        parts.append(ellipsoid("canopy", (0, r * 0.75, -1.5 if kind != "glider" else -2.6),
                               (r * 0.55, r * 0.7, 1.0), 8, 7))
    else:
        parts.append(block("cabin", (0, r * 0.75, z + 0.9), (r * 1.1, r * 0.7, 1.6)))
    gear = {"seaplane": "floats", "glider": "none"}.get(kind, draw.pick(("wheels", "wheels", "none")))
    tail = {"drone": "V", "glider": "T"}.get(kind, draw.pick(("low", "twin", "cruciform", "low")))
    return [body, *parts, *both_sides(half), *_tail(draw, tail, 3.4, draw.between(1.1, 1.4), 0.1),
            *_gear(draw, gear, 0.9, -2.0, -r)]


def _stacked(draw: Draw, kind: str) -> list[Part]:
    """Two or three wings above one another, with struts and open space between."""
    r, levels = 0.5, 3 if kind == "triplane" else 2
    gap, span, chord = draw.between(0.9, 1.5), draw.between(3.4, 4.6), draw.between(1.1, 1.4)
    body = _fuselage([(r, -3.4), (r * 1.05, -2.6), (r * 0.9, 0), (0.12, 4)], sides=draw.pick((12, 6)))
    stagger, parts = draw.between(-0.4, 0.4), []
    flat = draw.chance(0.4)
    ys = [-r * 0.6 + gap * i for i in range(levels)]
    for i, y in enumerate(ys):
        reach = span * (1 - 0.06 * (levels - 1 - i))
        parts.append(wing("wing", [(0, y, -2.4 - stagger * i, chord), (reach, y, -2.4 - stagger * i, chord)],
                          flat=flat))
    top = ys[-1]
    for f in (0.45, 0.85) if draw.chance(0.5) else (0.75,):
        parts += [rod("strut", (span * f, ys[0], -2.1 + dz), (span * f, top, -2.1 + dz - stagger * (levels - 1)),
                      0.04, sides=6) for dz in (0.0, 0.7)]
    parts += [rod("strut", (r * 0.6, 0, -2.0), (r * 0.9, top, -2.1 - stagger * (levels - 1)), 0.04, sides=6)]
    cockpit = hoop("cockpit", [(0.28, 0), (0.34, 0), (0.34, 0.12), (0.28, 0.12)], 10, (0, r * 0.85, -0.5))
    gear = draw.pick(("wheels", "wheels", "floats"))
    return [body, cockpit, *both_sides(parts), *_propeller_part(0, 0, -3.5, 1.3, 2),
            *_tail(draw, "low", 2.9, draw.between(1.0, 1.3), 0.1), *_gear(draw, gear, 0.9, -2.0, -r)]


def _twin_boom(draw: Draw, kind: str) -> list[Part]:
    x, end = draw.between(1.1, 1.7), 4.2
    pod = _fuselage([(0.0, -3.2), (0.5, -2.4), (0.55, -0.8), (0.3, 0.6)], sides=12)
    boom = moved(_fuselage([(0.0, -2.6), (0.26, -2.2), (0.24, 0), (0.1, end)], sides=8), (x, 0.1, 0))
    fin = wing("fin", [(x, 0.1, end - 1.0, 1.1), (x, 1.3, end - 0.6, 0.6)], upright=True)
    span = draw.between(4.5, 6)
    main = wing("wing", [(0, 0.1, -1.6, 1.6), (span, 0.3, -1.2, 0.7)])
    level = draw.pick((0.15, 1.2))
    plane = wing("tailplane", [(0, level, end - 0.8, 0.8), (x, level, end - 0.8, 0.8)])
    pusher = draw.chance(0.5)
    props = (_propeller_part(0, 0, 0.75, 1.0, 3) if pusher else
             [p for s in (-1, 1) for p in _propeller_part(s * x, 0.1, -2.65, 0.9, 3)])
    return [pod, *both_sides([boom, fin, main, plane]), *props,
            *_gear(draw, draw.pick(("none", "wheels")), 0.9, -0.6, -0.5)]


def _flying_wing(draw: Draw, kind: str) -> list[Part]:
    span, sweep = draw.between(4.5, 6), draw.between(2, 3)
    main = wing("wing", [(0, 0, -2, 4.2), (1.2, 0, -1.2, 2.8), (span, draw.between(0, 0.3), sweep - 1.4, 0.8)])
    bulge = ellipsoid("body", (0, 0.12, -0.6), (0.7, 0.4, 1.6), 10, 8)
    engines = [_nacelle(0.8 + 0.5 * i, 0.22, -0.4 + 0.3 * i, 0.24, 1.5, hollow=False)
               for i in range(draw.whole(1, 2))]
    fins = [wing("fin", [(span, 0, sweep - 1.2, 0.8), (span + 0.1, 0.9, sweep - 0.8, 0.4)], upright=True)]
    return [bulge, *both_sides([main, *engines, *(fins if draw.chance(0.5) else [])])]


def _ultralight(draw: Draw, kind: str) -> list[Part]:
    """A sail over an open frame of tubes."""
    span, top = draw.between(3.4, 4.6), 1.6
    half = [sheet("sail", (0, top, -1.6), (span, top + 0.15, 0.6), (span * 0.85, top + 0.05, 1.0),
                  (0, top - 0.1, 0.9)),
            rod("edge", (0, top, -1.6), (span, top + 0.15, 0.6), 0.04, sides=6),
            rod("brace", (0, 0, -0.4), (span * 0.6, top + 0.05, 0), 0.025, sides=6)]
    trike = [rod("keel", (0, top, -1.7), (0, top - 0.1, 1.2), 0.04, sides=6),
             rod("mast", (0, top, 0), (0, -0.6, 0.3), 0.05, sides=6),
             tube("frame", [(0, -0.6, 0.4), (0, -0.65, -1.5), (0, 0.1, -0.6), (0, top, -0.2)], 0.04, 6),
             block("seat", (0, -0.35, -0.2), (0.5, 0.12, 0.5)),
             turned(block("seat_back", (0, 0, 0.05), (0.5, 0.7, 0.08)), 0, 15),
             block("motor", (0, 0.2, 0.6), (0.4, 0.4, 0.5)), *_propeller_part(0, 0.2, 0.95, 0.8, 3)]
    wheels = [rod("wheel", (0.85, -0.85, 0.4), (1.0, -0.85, 0.4), 0.25, sides=12),
              rod("axle", (0, -0.6, 0.3), (0.9, -0.85, 0.4), 0.035, sides=6)]
    return [*both_sides([*half, *wheels]), *trike,
            rod("wheel", (-0.06, -0.85, -1.5), (0.06, -0.85, -1.5), 0.22, sides=12)]


def _paper(draw: Draw, kind: str) -> list[Part]:
    """Folded sheets, nothing else."""
    w, keel = draw.between(1.4, 2.6), draw.between(0.6, 1.1)
    lift = draw.between(0.1, 0.5)
    half = [sheet("wing", (0.06, 0, -4), (w, lift, 4), (0.06, 0, 4)),
            sheet("keel", (0.06, 0, -4), (0.06, 0, 4), (0, -keel, 4), (0, -keel * 0.3, -3.9))]
    if draw.chance(0.6):
        half.append(sheet("tip", (w, lift, 4), (w, lift + 0.7, 4), (w * 0.75, lift * 0.75 + 0.1, 2)))
    return both_sides(half)


def _box_wing(draw: Draw, kind: str) -> list[Part]:
    r, span = 0.5, draw.between(4, 5)
    body = _fuselage([(0.0, -5), (r * 0.8, -4.2), (r, -3), (r, 2.5), (0.1, 5)])
    low = wing("wing", [(0.2, -0.3, -2.2, 1.5), (span, 0, -0.2, 0.8)])
    high = wing("wing", [(0.1, 1.9, 3.4, 1.3), (span, 1.6, 1.2, 0.8)])
    end = wing("side", [(span, 0, -0.2, 0.8), (span, 1.6, 1.2, 0.8)], upright=True)
    fin = wing("fin", [(0, 0.2, 2.6, 2.0), (0, 1.9, 3.4, 1.3)], upright=True)
    tunnel = panel("intake", 2, (0.4, 1.8), (0.5, 1.1), (-0.2, 0.4), [(0.58, 1.02, -0.12, 0.32)])
    return [body, fin, *both_sides([low, high, end, tunnel])]


