"""Airplanes: jets and propeller planes, and the odd ones."""

from __future__ import annotations

import math
from collections.abc import Callable

from pnabs.dataset.samples.airplane_parts import (
    Rib,
    fuselage,
    nacelle,
    propeller_at,
    tail_unit,
    undercarriage,
    wing,
)
from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.odd_airplanes import ODD_AIRPLANES
from pnabs.dataset.samples.parts import Part, both_sides, moved, turned
from pnabs.dataset.samples.solids import block, ellipsoid, prism, rod

KINDS = (
    "airliner",
    "light",
    "biplane",
    "delta",
    "fighter",
    "glider",
    "twin prop",
    "boom",
    "business",
    "four engines",
    "flying wing",
    "triplane",
    "seaplane",
    "canard",
    "gull",
    "ultralight",
    "forward swept",
    "parasol",
    "heavy lifter",
    "supersonic",
    "paper",
    "box wing",
    "racer",
    "drone",
)


def airplane(draw: Draw) -> list[Part]:
    """One airplane along z, its nose towards -z; the fuselage's length is about 10."""
    kind = draw.kind(KINDS)
    return {**MAKERS, **ODD_AIRPLANES}.get(kind, _propelled)(draw, kind)


def _jet(draw: Draw, kind: str) -> list[Part]:
    r = {"airliner": 0.55, "business": 0.5, "heavy lifter": 0.8}.get(kind, 0.6)
    r *= draw.between(0.9, 1.15)
    profile = [
        (0.0, -5),
        (r * 0.5, -4.75),
        (r * 0.85, -4.3),
        (r, -3.7),
        (r, 2.2),
        (r * 0.6, 4),
        (0.08, 5),
    ]
    high = kind == "heavy lifter"
    y = r * 0.75 if high else -r * 0.5
    span, sweep = draw.between(3.8, 5), draw.between(1.4, 2.6)
    root, lift = draw.between(1.7, 2.2), -0.3 if high else draw.between(0.2, 0.6)
    main = wing(
        "wing",
        [
            (0.2, y, -1.2, root),
            (span * 0.4, y + lift * 0.3, -1.2 + sweep * 0.45, root * 0.65),
            (span, y + lift, -1.2 + sweep, root * 0.3),
        ],
    )
    hollow, er = draw.chance(0.6), r * draw.between(0.38, 0.5)
    engines: list[Part]
    if kind == "business":
        engines = [
            nacelle(r + er * 1.1, 0.25, 1.6, er, 1.6, hollow=hollow),
            block("pylon", (r, 0.25, 2.3), (0.8, 0.08, 0.7)),
        ]
    else:
        engines = []
        for f in (0.33,) if kind == "airliner" else (0.3, 0.58):
            at = (span * f, y - er * 1.3 + lift * f, -1.5 + sweep * f)
            engines += [
                nacelle(*at, er, 1.5, hollow=hollow),
                block("pylon", (at[0], at[1] + er, at[2] + 0.9), (0.08, er * 0.8, 0.9)),
            ]
    if draw.chance(0.4):
        engines.append(
            wing(
                "winglet",
                [
                    (span, y + lift, -1.2 + sweep, root * 0.3),
                    (span + 0.1, y + lift + 0.7, -0.9 + sweep, root * 0.15),
                ],
                upright=True,
            )
        )
    tail = "T" if kind in ("business", "heavy lifter") else draw.pick(("low", "low", "cruciform"))
    return [
        fuselage(profile, tall=draw.between(0.95, 1.15)),
        *both_sides([main, *engines]),
        *tail_unit(draw, tail, 3.1, draw.between(1.3, 1.7), r * 0.4),
        *undercarriage(draw, draw.pick(("none", "wheels")), 0.8, 0.4, -r),
    ]


def _fast(draw: Draw, kind: str) -> list[Part]:
    r = 0.3 if kind == "supersonic" else draw.between(0.4, 0.5)
    nose = draw.between(-5.6, -5)
    profile = [(0.0, nose), (r * 0.55, -3.8), (r, -2), (r, 3), (r * 0.8, 4.4)]
    body = fuselage(profile, wide=draw.between(0.9, 1.2), sides=12)
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
        parts.append(
            prism(
                "intake",
                2,
                [(r * 0.7, -r), (r * 1.7, -r), (r * 1.7, r * 0.5), (r * 0.7, r * 0.6)],
                (-1.6, 3.6),
            )
        )
    twin = draw.chance(0.5) and kind != "supersonic"
    fins = (
        [wing("fin", [(0.45, r * 0.5, 2.6, 1.6), (0.75, r + 1.2, 3.7, 0.7)], upright=True)]
        if twin
        else []
    )
    tail = (
        [wing("tailplane", [(0.3, y, 3.6, 1.2), (1.5, y, 4.4, 0.6)])] if kind == "fighter" else []
    )
    middle = (
        []
        if twin
        else [wing("fin", [(0, r * 0.6, 2.4, 2.0), (0, r + 1.4, 4.0, 0.7)], upright=True)]
    )
    stores: list[Part] = []
    if kind == "supersonic":
        stores = [block("engine", (1.0, y - 0.35, 2.6), (0.8, 0.5, 2.4))]
    elif draw.chance(0.5):
        stores = [
            moved(
                fuselage([(0.0, -1), (0.1, -0.6), (0.1, 0.8)], sides=6), (f * span, y - 0.25, 1.2)
            )
            for f in (0.45, 0.7)
        ]
    return [body, canopy, *middle, *both_sides([*parts, *fins, *tail, *stores])]


def _propelled(draw: Draw, kind: str) -> list[Part]:
    r = {"glider": 0.35, "drone": 0.4}.get(kind, draw.between(0.5, 0.62))
    boxy = kind in ("light", "parasol") and draw.chance(0.6)
    profile = [(r * 0.55, -4.2), (r * 0.9, -3.6), (r, -1.8), (r * 0.85, 0), (r * 0.25, 4.6)]
    if kind in ("glider", "drone"):
        profile = [(0.0, -4.2), (r, -3), (r, -1.6), (r * 0.35, 1), (0.1, 4.6)]
    body = fuselage(profile, sides=4 if boxy else 12)
    body = turned(body, 2, 45) if boxy else body
    span = {"glider": 7.5, "drone": 6.5, "racer": 3.0}.get(kind, draw.between(4.4, 5.4))
    chord = {"glider": 0.85, "drone": 0.8}.get(kind, draw.between(1.3, 1.6))
    y = {
        "parasol": r + 0.7,
        "light": r * 0.85,
        "seaplane": r,
        "glider": r * 0.6,
        "twin prop": r * 0.7,
        "drone": r * 0.5,
    }.get(kind, -r * 0.5)
    z = -2.2
    taper = draw.between(0.5, 1.0)
    ribs: list[Rib] = [
        (0, y, z, chord),
        (span, y + 0.25, z + chord * (1 - taper) * 0.5, chord * taper),
    ]
    if kind == "gull":
        ribs = [
            (0, y, z, chord),
            (span * 0.3, y - 0.55, z, chord),
            (span, y + 0.5, z + 0.4, chord * 0.5),
        ]
    if kind == "racer":
        ribs = [
            (
                span * f,
                y + 0.1 * f,
                z + chord * 0.5 * (1 - math.sqrt(1 - f * f)) * 0.9,
                chord * math.sqrt(1 - f * f),
            )
            for f in (0, 0.4, 0.7, 0.9, 0.985)
        ]
    half = [wing("wing", ribs, flat=kind == "light" and draw.chance(0.3))]
    if kind in ("parasol", "light"):
        half += [
            rod("strut", (r * 0.6, -r * 0.5, z + 0.5), (span * 0.5, y, z + 0.5), 0.04, sides=6)
        ]
    if kind == "parasol":
        half += [
            rod("strut", (r * 0.4, r * 0.5, z + dz), (r * 0.5, y, z + dz), 0.04, sides=6)
            for dz in (0.2, 1.1)
        ]
    parts: list[Part] = []
    blades = draw.pick((2, 3, 4))
    if kind in ("twin prop", "seaplane"):
        x = span * 0.33
        half.append(
            moved(
                fuselage([(0.2, -1.2), (0.32, -0.8), (0.3, 0.6), (0.05, 1.8)], sides=10), (x, y, z)
            )
        )
        props = [
            part for side in (-1, 1) for part in propeller_at(side * x, y, z - 1.2, 1.0, blades)
        ]
        parts += props
    elif kind == "drone":
        parts += propeller_at(0, 0, 4.7, 0.9, blades)
    elif kind != "glider":
        parts += propeller_at(0, 0, -4.25, 1.2, blades)
    if not boxy:
        parts.append(
            ellipsoid(
                "canopy",
                (0, r * 0.75, -1.5 if kind != "glider" else -2.6),
                (r * 0.55, r * 0.7, 1.0),
                8,
                7,
            )
        )
    else:
        parts.append(block("cabin", (0, r * 0.75, z + 0.9), (r * 1.1, r * 0.7, 1.6)))
    gear = {"seaplane": "floats", "glider": "none"}.get(
        kind, draw.pick(("wheels", "wheels", "none"))
    )
    tail = {"drone": "V", "glider": draw.variant("glider", ("T", "V", "low"))}.get(
        kind, draw.pick(("low", "twin", "cruciform", "low"))
    )
    return [
        body,
        *parts,
        *both_sides(half),
        *tail_unit(draw, tail, 3.4, draw.between(1.1, 1.4), 0.1),
        *undercarriage(draw, gear, 0.9, -2.0, -r),
    ]


MAKERS: dict[str, Callable[[Draw, str], list[Part]]] = {
    **dict.fromkeys(("airliner", "business", "four engines", "heavy lifter"), _jet),
    **dict.fromkeys(("delta", "fighter", "forward swept", "canard", "supersonic"), _fast),
}
