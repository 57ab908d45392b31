"""Wings, fuselages, tails, propellers, engines and undercarriages."""

from __future__ import annotations

from collections.abc import Sequence

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, moved, stretched, turned
from pnabs.dataset.samples.sheets import hoop, sheet, strip
from pnabs.dataset.samples.solids import ellipsoid, lathe, loft, rod

Rib = tuple[float, float, float, float]
"""One end of a wing: position x, y, z of the leading edge, and chord."""


_AIRFOIL = (
    (0, 0),
    (0.22, 0.065),
    (0.55, 0.05),
    (1, 0.004),
    (1, -0.004),
    (0.55, -0.03),
    (0.22, -0.04),
)


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


def fuselage(
    profile: Sequence[tuple[float, float]], *, wide: float = 1.0, tall: float = 1.0, sides: int = 14
) -> Part:
    """A body turned about z from (radius, z), then widened and heightened."""
    body = turned(lathe("fuselage", profile, sides), 0, 90)
    return stretched(body, (wide, tall, 1))


def tail_unit(draw: Draw, kind: str, z: float, size: float, y: float = 0.2) -> list[Part]:
    """Fin and tailplane with leading edges about `z`."""
    sweep, flat = size * draw.between(0.2, 0.5), draw.chance(0.15)
    fin_top = y + size * 1.1
    fin = wing("fin", [(0, y, z, size), (0, fin_top, z + sweep + 0.2, size * 0.5)], upright=True)
    level = {"T": fin_top - 0.05, "cruciform": y + size * 0.6}.get(kind, y)
    if kind == "V":
        blade = wing("tail", [(0.05, y, z, size), (size, y + size * 0.8, z + sweep, size * 0.5)])
        return both_sides([blade])
    plane = wing(
        "tailplane",
        [
            (0, level, z + 0.25 * size, size * 0.7),
            (size * 1.25, level, z + 0.25 * size + sweep, size * 0.4),
        ],
        flat=flat,
    )
    if kind == "twin":
        end = wing(
            "fin",
            [
                (size * 1.2, level - 0.25 * size, z + 0.3, size * 0.7),
                (size * 1.2, level + 0.6 * size, z + 0.5, size * 0.45),
            ],
            upright=True,
        )
        return both_sides([plane, end])
    return [fin, *both_sides([plane])]


def propeller_at(x: float, y: float, z: float, reach: float, blades: int) -> list[Part]:
    """Spinner and blades, the first blade upright."""
    parts = [moved(fuselage([(0.0, -0.3), (0.13, -0.05), (0.14, 0.05)], sides=8), (x, y, z))]
    for i in range(blades):
        blade = sheet(
            "blade",
            (-0.04, 0.08, 0),
            (0.04, 0.08, 0.02),
            (0.09, 0.7 * reach, 0.05),
            (0.02, reach, 0),
            (-0.06, 0.7 * reach, -0.03),
        )
        parts.append(moved(turned(blade, 2, 360 * i / blades), (x, y, z)))
    return parts


def nacelle(x: float, y: float, z: float, r: float, length: float, *, hollow: bool) -> Part:
    """A jet engine along z: an open duct, or a closed body."""
    if hollow:
        line = [
            (r * 0.85, 0),
            (r, 0.1),
            (r, length * 0.6),
            (r * 0.7, length),
            (r * 0.62, length),
            (r * 0.8, length * 0.4),
        ]
        return moved(turned(hoop("engine", line, 12), 0, 90), (x, y, z))
    profile = [(r * 0.85, 0), (r, length * 0.15), (r, length * 0.6), (r * 0.55, length)]
    return moved(turned(lathe("engine", profile, 12), 0, 90), (x, y, z))


def undercarriage(draw: Draw, kind: str, x: float, z: float, low: float) -> list[Part]:
    """Undercarriage: main wheels at (x, z), a third one ahead or behind, or floats or skids."""
    if kind == "none":
        return []
    if kind == "floats":
        hull = ellipsoid("float", (x * 1.2, low - 0.9, z - 0.4), (0.28, 0.25, 2.4), 8, 8)
        struts = [
            rod("strut", (x * 0.3, low * 0.3, at), (x * 1.2, low - 0.75, at), 0.04, sides=6)
            for at in (z - 1.2, z + 0.5)
        ]
        return both_sides([hull, *struts])
    wheel = rod("wheel", (x - 0.08, low - 0.6, z), (x + 0.08, low - 0.6, z), 0.26, sides=12)
    leg = rod("leg", (x * 0.4, low * 0.4, z), (x, low - 0.6, z), 0.05, sides=6)
    third = draw.pick((-3.2, 4.2))
    small = [
        rod("wheel", (-0.06, low - 0.6, third), (0.06, low - 0.6, third), 0.2, sides=10),
        rod("leg", (0, 0, third), (0, low - 0.6, third), 0.04, sides=6),
    ]
    return [*both_sides([wheel, leg]), *small]
