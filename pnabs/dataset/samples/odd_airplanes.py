"""Airplanes that aren't one wing on one fuselage."""

from __future__ import annotations

from collections.abc import Callable

from pnabs.dataset.samples.airplane_parts import (
    fuselage,
    nacelle,
    propeller_at,
    tail_unit,
    undercarriage,
    wing,
)
from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, moved, turned
from pnabs.dataset.samples.sheets import hoop, panel, sheet
from pnabs.dataset.samples.solids import block, ellipsoid, rod, tube


def _stacked(draw: Draw, kind: str) -> list[Part]:
    """Two or three wings above one another, with struts and open space between."""
    r, levels = 0.5, 3 if kind == "triplane" else 2
    gap, span, chord = draw.between(0.9, 1.5), draw.between(3.4, 4.6), draw.between(1.1, 1.4)
    body = fuselage(
        [(r, -3.4), (r * 1.05, -2.6), (r * 0.9, 0), (0.12, 4)], sides=draw.pick((12, 6))
    )
    stagger, parts = draw.between(-0.4, 0.4), []
    flat = draw.chance(0.4)
    ys = [-r * 0.6 + gap * i for i in range(levels)]
    for i, y in enumerate(ys):
        reach = span * (1 - 0.06 * (levels - 1 - i))
        parts.append(
            wing(
                "wing",
                [(0, y, -2.4 - stagger * i, chord), (reach, y, -2.4 - stagger * i, chord)],
                flat=flat,
            )
        )
    top = ys[-1]
    for f in (0.45, 0.85) if draw.chance(0.5) else (0.75,):
        parts += [
            rod(
                "strut",
                (span * f, ys[0], -2.1 + dz),
                (span * f, top, -2.1 + dz - stagger * (levels - 1)),
                0.04,
                sides=6,
            )
            for dz in (0.0, 0.7)
        ]
    parts += [
        rod(
            "strut",
            (r * 0.6, 0, -2.0),
            (r * 0.9, top, -2.1 - stagger * (levels - 1)),
            0.04,
            sides=6,
        )
    ]
    cockpit = hoop(
        "cockpit", [(0.28, 0), (0.34, 0), (0.34, 0.12), (0.28, 0.12)], 10, (0, r * 0.85, -0.5)
    )
    gear = draw.pick(("wheels", "wheels", "floats"))
    return [
        body,
        cockpit,
        *both_sides(parts),
        *propeller_at(0, 0, -3.5, 1.3, 2),
        *tail_unit(draw, "low", 2.9, draw.between(1.0, 1.3), 0.1),
        *undercarriage(draw, gear, 0.9, -2.0, -r),
    ]


def _twin_boom(draw: Draw, kind: str) -> list[Part]:
    x, end = draw.between(1.1, 1.7), 4.2
    pod = fuselage([(0.0, -3.2), (0.5, -2.4), (0.55, -0.8), (0.3, 0.6)], sides=12)
    boom = moved(fuselage([(0.0, -2.6), (0.26, -2.2), (0.24, 0), (0.1, end)], sides=8), (x, 0.1, 0))
    fin = wing("fin", [(x, 0.1, end - 1.0, 1.1), (x, 1.3, end - 0.6, 0.6)], upright=True)
    span = draw.between(4.5, 6)
    main = wing("wing", [(0, 0.1, -1.6, 1.6), (span, 0.3, -1.2, 0.7)])
    level = draw.pick((0.15, 1.2))
    plane = wing("tailplane", [(0, level, end - 0.8, 0.8), (x, level, end - 0.8, 0.8)])
    pusher = draw.chance(0.5)
    props = (
        propeller_at(0, 0, 0.75, 1.0, 3)
        if pusher
        else [p for s in (-1, 1) for p in propeller_at(s * x, 0.1, -2.65, 0.9, 3)]
    )
    return [
        pod,
        *both_sides([boom, fin, main, plane]),
        *props,
        *undercarriage(draw, draw.pick(("none", "wheels")), 0.9, -0.6, -0.5),
    ]


def _flying_wing(draw: Draw, kind: str) -> list[Part]:
    span, sweep = draw.between(4.5, 6), draw.between(2, 3)
    main = wing(
        "wing",
        [(0, 0, -2, 4.2), (1.2, 0, -1.2, 2.8), (span, draw.between(0, 0.3), sweep - 1.4, 0.8)],
    )
    bulge = ellipsoid("body", (0, 0.12, -0.6), (0.7, 0.4, 1.6), 10, 8)
    engines = [
        nacelle(0.8 + 0.5 * i, 0.22, -0.4 + 0.3 * i, 0.24, 1.5, hollow=False)
        for i in range(draw.whole(1, 2))
    ]
    fins = [
        wing(
            "fin", [(span, 0, sweep - 1.2, 0.8), (span + 0.1, 0.9, sweep - 0.8, 0.4)], upright=True
        )
    ]
    return [bulge, *both_sides([main, *engines, *(fins if draw.chance(0.5) else [])])]


def _ultralight(draw: Draw, kind: str) -> list[Part]:
    """A sail over an open frame of tubes."""
    span, top = draw.between(3.4, 4.6), 1.6
    half = [
        sheet(
            "sail",
            (0, top, -1.6),
            (span, top + 0.15, 0.6),
            (span * 0.85, top + 0.05, 1.0),
            (0, top - 0.1, 0.9),
        ),
        rod("edge", (0, top, -1.6), (span, top + 0.15, 0.6), 0.04, sides=6),
        rod("brace", (0, 0, -0.4), (span * 0.6, top + 0.05, 0), 0.025, sides=6),
    ]
    trike = [
        rod("keel", (0, top, -1.7), (0, top - 0.1, 1.2), 0.04, sides=6),
        rod("mast", (0, top, 0), (0, -0.6, 0.3), 0.05, sides=6),
        tube("frame", [(0, -0.6, 0.4), (0, -0.65, -1.5), (0, 0.1, -0.6), (0, top, -0.2)], 0.04, 6),
        block("seat", (0, -0.35, -0.2), (0.5, 0.12, 0.5)),
        turned(block("seat_back", (0, 0, 0.05), (0.5, 0.7, 0.08)), 0, 15),
        block("motor", (0, 0.2, 0.6), (0.4, 0.4, 0.5)),
        *propeller_at(0, 0.2, 0.95, 0.8, 3),
    ]
    wheels = [
        rod("wheel", (0.85, -0.85, 0.4), (1.0, -0.85, 0.4), 0.25, sides=12),
        rod("axle", (0, -0.6, 0.3), (0.9, -0.85, 0.4), 0.035, sides=6),
    ]
    return [
        *both_sides([*half, *wheels]),
        *trike,
        rod("wheel", (-0.06, -0.85, -1.5), (0.06, -0.85, -1.5), 0.22, sides=12),
    ]


def _paper(draw: Draw, kind: str) -> list[Part]:
    """Folded sheets, nothing else."""
    w, keel = draw.between(1.4, 2.6), draw.between(0.6, 1.1)
    lift = draw.between(0.1, 0.5)
    half = [
        sheet("wing", (0.06, 0, -4), (w, lift, 4), (0.06, 0, 4)),
        sheet("keel", (0.06, 0, -4), (0.06, 0, 4), (0, -keel, 4), (0, -keel * 0.3, -3.9)),
    ]
    if draw.chance(0.6):
        half.append(
            sheet("tip", (w, lift, 4), (w, lift + 0.7, 4), (w * 0.75, lift * 0.75 + 0.1, 2))
        )
    return both_sides(half)


def _box_wing(draw: Draw, kind: str) -> list[Part]:
    r, span = 0.5, draw.between(4, 5)
    body = fuselage([(0.0, -5), (r * 0.8, -4.2), (r, -3), (r, 2.5), (0.1, 5)])
    low = wing("wing", [(0.2, -0.3, -2.2, 1.5), (span, 0, -0.2, 0.8)])
    high = wing("wing", [(0.1, 1.9, 3.4, 1.3), (span, 1.6, 1.2, 0.8)])
    end = wing("side", [(span, 0, -0.2, 0.8), (span, 1.6, 1.2, 0.8)], upright=True)
    fin = wing("fin", [(0, 0.2, 2.6, 2.0), (0, 1.9, 3.4, 1.3)], upright=True)
    tunnel = panel("intake", 2, (0.4, 1.8), (0.5, 1.1), (-0.2, 0.4), [(0.58, 1.02, -0.12, 0.32)])
    return [body, fin, *both_sides([low, high, end, tunnel])]


ODD_AIRPLANES: dict[str, Callable[[Draw, str], list[Part]]] = {
    "biplane": _stacked,
    "triplane": _stacked,
    "boom": _twin_boom,
    "flying wing": _flying_wing,
    "ultralight": _ultralight,
    "paper": _paper,
    "box wing": _box_wing,
}
"""Makers of odd airplanes by kind."""
