"""Buses: pierced shells with decks, seats and wheels."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, moved, turned
from pnabs.dataset.samples.sheets import Hole, panel, sheet
from pnabs.dataset.samples.solids import Span, block, box, lathe, prism, rod


class Body(NamedTuple):
    """One car: half width, length, heights of floor and roof, thickness of its walls.

    A thickness of 0 gives walls that are single sheets.
    """

    w: float
    z: Span
    floor: float
    roof: float
    t: float


def bus(draw: Draw) -> list[Part]:
    """One bus along z, its front looking along -z."""
    return draw.kind(KINDS)(draw)


def _body(draw: Draw, length: float, floor: float, roof: float) -> Body:
    t = draw.cycle("walls", (0.06, 0.04, 0.0))
    return Body(draw.between(1.15, 1.3), (-length / 2, length / 2), floor, roof, t)


def _windows(z: Span, y: Span, count: int, gap: float) -> list[Hole]:
    step = (z[1] - z[0]) / count
    return [(*y, z[0] + i * step + gap / 2, z[0] + (i + 1) * step - gap / 2) for i in range(count)]


def _shell(
    b: Body, left: Sequence[Hole], right: Sequence[Hole], front: Sequence[Hole],
    rear: Sequence[Hole], *, roof: bool = True,
) -> list[Part]:
    """Walls with openings; a side's holes are (y, y, z, z), an end's (x, x, y, y)."""
    y = (b.floor, b.roof)
    inner = (b.z[0] + b.t, b.z[1] - b.t)
    parts = [panel("left_side", 0, (b.w - b.t, b.w), y, inner, left),
             panel("right_side", 0, (-b.w, -b.w + b.t), y, inner, right),
             panel("front", 2, (b.z[0], b.z[0] + b.t), (-b.w, b.w), y, front),
             panel("rear", 2, (b.z[1] - b.t, b.z[1]), (-b.w, b.w), y, rear),
             box("floor", (-b.w, b.w), (b.floor - 0.06, b.floor), b.z)]
    if roof and b.t:
        parts.append(box("roof", (-b.w, b.w), (b.roof, b.roof + b.t), b.z))
    elif roof:
        parts.append(sheet("roof", (-b.w, b.roof, b.z[0]), (-b.w, b.roof, b.z[1]),
                           (b.w, b.roof, b.z[1]), (b.w, b.roof, b.z[0])))
    return parts


def _wheels(draw: Draw, b: Body, places: Sequence[float], radius: float = 0.48) -> list[Part]:
    kind = draw.cycle("wheels", ("plain", "hub", "faceted"))
    sides = 10 if kind == "faceted" else 16
    parts = []
    for z in places:
        at = (b.w - 0.3, radius, z)
        parts.append(rod("tyre", at, (b.w - 0.02, radius, z), radius, sides=sides))
        if kind == "hub":
            parts.append(rod("hub", (b.w - 0.05, radius, z), (b.w + 0.02, radius, z), radius * 0.45,
                             sides=8))
    return both_sides(parts)


def _seats(draw: Draw, b: Body, floor: float, z: Span) -> list[Part]:
    kind = draw.cycle("seats", ("rows", "benches", "none", "rows"))
    if kind == "none":
        return [rod("pole", (x, floor, a), (x, b.roof, a), 0.025, sides=6)
                for x in (-0.35, 0.35) for a in np.linspace(z[0] + 0.5, z[1] - 0.5, 4)]
    if kind == "benches":
        seat = box("bench", (b.w - b.t - 0.5, b.w - b.t - 0.02), (floor + 0.35, floor + 0.45), z)
        return both_sides([seat])
    parts = []
    for a in np.arange(z[0] + 0.5, z[1] - 0.4, draw.between(0.85, 1.1)).tolist():
        x = (b.w - b.t - 0.95, b.w - b.t - 0.05)
        parts += [box("seat", x, (floor + 0.3, floor + 0.44), (a - 0.22, a + 0.22)),
                  box("seat_back", x, (floor + 0.4, floor + 1.0), (a + 0.2, a + 0.28))]
    return both_sides(parts)


def _extras(draw: Draw, b: Body) -> list[Part]:
    parts = []
    if draw.chance(0.5):
        parts.append(block("cooler", (0, b.roof + 0.15, draw.between(-1, 1)), (1.4, 0.25, 2.0)))
    if draw.chance(0.6):
        parts += both_sides([block("mirror", (b.w + 0.14, b.roof - 0.9, b.z[0] - 0.08), (0.16, 0.4, 0.06)),
                             rod("mirror_arm", (b.w - 0.02, b.roof - 0.6, b.z[0] + 0.02),
                                 (b.w + 0.14, b.roof - 0.75, b.z[0] - 0.08), 0.02, sides=6)])
    if draw.chance(0.6):
        parts += [block("bumper", (0, b.floor + 0.12, end), (2 * b.w, 0.2, 0.16))
                  for end in (b.z[0] - 0.05, b.z[1] + 0.05)]
    return parts


def _door_holes(b: Body, places: Sequence[float], wide: float = 1.0) -> list[Hole]:
    return [(b.floor - 1, b.roof - 0.35, z - wide / 2, z + wide / 2) for z in places]


def _ends(b: Body, low: float, high: float) -> tuple[list[Hole], list[Hole]]:
    screen = [(-b.w + 0.12, b.w - 0.12, low - 0.1, high)]
    return screen, [(-b.w + 0.25, b.w - 0.25, low + 0.1, high)]


def _city(draw: Draw) -> list[Part]:
    b = _body(draw, draw.between(9, 12), 0.4, draw.between(2.8, 3.1))
    low, high, n = 1.3, b.roof - 0.35, draw.whole(5, 8)
    doors = draw.pick(((b.z[0] + 0.9,), (b.z[0] + 0.9, 0.3), ()))
    right = _windows((b.z[0] + 1.6, b.z[1] - 0.4), (low, high), n, 0.16)
    right = [h for h in right if all(h[3] < d - 0.55 or h[2] > d + 0.55 for d in doors)]
    left = _windows((b.z[0] + 0.4, b.z[1] - 0.4), (low, high), n, 0.16)
    front, rear = _ends(b, low, high)
    return [*_shell(b, left, right + _door_holes(b, doors), front, rear), *_extras(draw, b),
            *_wheels(draw, b, (b.z[0] + 2.2, b.z[1] - 2.6)),
            *_seats(draw, b, b.floor, (b.z[0] + 2, b.z[1] - 0.4))]


def _coach(draw: Draw) -> list[Part]:
    b = _body(draw, draw.between(11, 13.5), 0.45, draw.between(3.2, 3.6))
    deck, high = 1.3, b.roof - 0.25
    side = _windows((b.z[0] + 0.8, b.z[1] - 0.8), (1.9, high), draw.whole(3, 6), 0.08)
    hold = _windows((-2.2, 2.0), (0.6, 1.15), 3, 0.1) if draw.chance(0.5) else []
    front = [(-b.w + 0.1, b.w - 0.1, 1.2, high)]
    return [*_shell(b, side + hold, side + hold, front, [(-b.w + 0.3, b.w - 0.3, 2.2, high)]),
            box("deck", (-b.w + b.t, b.w - b.t), (deck - 0.05, deck), (b.z[0] + 1.2, b.z[1] - b.t)),
            *_wheels(draw, b, (b.z[0] + 2.4, b.z[1] - 3.6, b.z[1] - 2.4)),
            *_seats(draw, b, deck, (b.z[0] + 1.4, b.z[1] - 0.3)), *_extras(draw, b)]


def _double(draw: Draw) -> list[Part]:
    b = _body(draw, draw.between(9, 11), 0.4, draw.between(4.1, 4.4))
    n, deck = draw.whole(5, 7), 2.25
    z = (b.z[0] + 0.4, b.z[1] - 0.4)
    upper = _windows(z, (2.9, b.roof - 0.3), n, 0.14)
    lower = _windows((z[0] + 1.2, z[1]), (1.2, 1.95), n - 1, 0.14)
    door = [(b.floor - 1, 2.0, b.z[0] + 0.3, b.z[0] + 1.3)]
    front = [(-b.w + 0.1, b.w - 0.1, 1.1, 1.95), (-b.w + 0.1, b.w - 0.1, 2.8, b.roof - 0.3)]
    open_top = draw.variant("open top", (False, True))
    shell = _shell(b, upper + lower, upper + lower + door, front, front[1:], roof=not open_top)
    return [*shell, box("deck", (-b.w + b.t, b.w - b.t), (deck, deck + 0.08), (b.z[0] + b.t, b.z[1] - b.t)),
            *_seats(draw, b, deck + 0.08, (b.z[0] + 1, b.z[1] - 0.5)),
            *_seats(draw, b, b.floor, (b.z[0] + 2, b.z[1] - 0.5)),
            *_wheels(draw, b, (b.z[0] + 2.3, b.z[1] - 2.3))]


def _articulated(draw: Draw) -> list[Part]:
    b = _body(draw, 8.5, 0.4, 2.95)
    ahead, behind = b._replace(z=(-8.6, -0.5)), b._replace(z=(0.7, 8.0))
    parts: list[Part] = []
    for car in (ahead, behind):
        side = _windows((car.z[0] + 0.4, car.z[1] - 0.4), (1.3, 2.55), draw.whole(4, 5), 0.2)
        pass_through = [(-0.8, 0.8, 0.5, 2.5)]
        screen = _ends(car, 1.3, 2.55)
        front = screen[0] if car is ahead else pass_through
        rear = pass_through if car is ahead else screen[1]
        parts += _shell(car, side, side, front, rear)
        parts += _seats(draw, car, car.floor, (car.z[0] + 0.8, car.z[1] - 0.4))
    folds = draw.whole(3, 6)
    step = 1.2 / folds
    parts += [panel("bellows", 2, (-0.5 + (i + 0.2) * step, -0.5 + (i + 0.7) * step),
                    (-b.w + 0.06, b.w - 0.06), (0.4, 2.9), [(-0.9, 0.9, 0.5, 2.6)])
              for i in range(folds)]
    return [*parts, *_wheels(draw, b, (-6.4, -2.2, 5.2)), *_extras(draw, ahead)]


def _school(draw: Draw) -> list[Part]:
    b = _body(draw, draw.between(7, 9.5), 0.75, 2.95)
    n = draw.whole(6, 10)
    side = _windows((b.z[0] + 0.5, b.z[1] - 0.2), (1.75, 2.5), n, 0.14)
    front, rear = _ends(b, 1.8, 2.6)
    hood = prism("hood", 0, [(0.6, b.z[0]), (1.7, b.z[0]), (1.5, b.z[0] - 1.3), (0.6, b.z[0] - 1.4)],
                 (-0.85, 0.85))
    fenders = both_sides([prism("fender", 0, [(0.55, b.z[0]), (1.15, b.z[0] - 0.2), (1.15, b.z[0] - 0.9),
                                              (0.7, b.z[0] - 1.35), (0.95, b.z[0] - 0.6)],
                                (0.85, b.w))])
    return [*_shell(b, side, side, front, rear), hood, *fenders,
            *_seats(draw, b, b.floor, (b.z[0] + 1, b.z[1] - 0.3)),
            *_wheels(draw, b, (b.z[0] - 0.6, b.z[1] - 2.0)),
            *both_sides([block("lamp", (0.5, 1.15, b.z[0] - 1.4), (0.2, 0.2, 0.08))])]


def _minibus(draw: Draw) -> list[Part]:
    w, length, roof, t = 0.95, draw.between(4.6, 5.8), draw.between(2.0, 2.5), 0.04
    nose = length / 2
    line = [(0.35, -nose), (0.95, -nose), (1.25, -nose + 0.5), (roof, -nose + 1.2),
            (roof, nose - 0.15), (roof - 0.3, nose), (0.35, nose)]
    cap = prism("nose", 0, [(0.35, -nose), (0.95, -nose), (1.25, -nose + 0.5), (0.35, -nose + 0.9)],
                (-w, w))
    z = (-nose + 1.2, nose)
    b = Body(w, z, 0.35, roof, t)
    side = _windows((z[0] + 0.1, z[1] - 0.2), (1.2, roof - 0.25), draw.whole(2, 4), 0.12)
    sliding = [(0.45, roof - 0.2, z[0] + 0.1, z[0] + 1.1)] if draw.chance(0.4) else []
    right = [h for h in side if not sliding or h[2] > sliding[0][3] + 0.05] + sliding
    shell = _shell(b, side, right, [(-w + 0.1, w - 0.1, 0.5, roof - 0.1)],
                   [(-w + 0.15, w - 0.15, 1.2, roof - 0.3)])
    pillars = both_sides([sheet("cheek", (w, *line[2]), (w, 0.35, -nose + 0.9), (w, 0.35, z[0]),
                                (w, roof, z[0]))])
    return [cap, *shell, *pillars, *_wheels(draw, b, (-nose + 0.9, nose - 1.1), 0.34),
            *_seats(draw, b, b.floor, (z[0] + 0.2, z[1] - 0.3))]


def _trolley(draw: Draw) -> list[Part]:
    parts = _city(draw)
    roof = max(float(part.vertices[:, 1].max()) for part in parts if part.name == "roof")
    poles = both_sides([rod("trolley_pole", (0.25, roof + 0.1, 1.0),
                            (0.3, roof + draw.between(1.2, 1.8), 6.5), 0.03, sides=6)])
    return [*parts, block("pole_base", (0, roof + 0.1, 1.0), (1.0, 0.2, 1.2)), *poles]


def _rounded(draw: Draw) -> list[Part]:
    """An old-time bus: arched section drawn out, rounded roof, window band of boxes set in."""
    w, length = 1.15, draw.between(7, 9)
    arch = [(w * math.cos(a), 2.1 + 0.75 * math.sin(a)) for a in np.linspace(0, math.pi, 11)]
    outer = [(-w, 0.5), (w, 0.5), *arch]
    roof = [(w, 2.1), *arch, (-w, 2.1)]
    inner = [(x * 0.93, y * 0.93 + 0.1) for x, y in arch]
    vault = prism("roof", 2, [*roof[1:-1], *inner[::-1]], (-length / 2, length / 2))
    n = draw.whole(5, 8)
    side = panel("side", 0, (w - 0.06, w), (0.5, 2.12), (-length / 2, length / 2),
                 _windows((-length / 2 + 0.6, length / 2 - 0.3), (1.3, 2.0), n, 0.2))
    ends = []
    for at, name in ((-length / 2, "front"), (length / 2, "rear")):
        ends.append(panel(name, 2, (at, at), (-w, w), (0.5, 2.1),
                          [(-w + 0.15, -0.08, 1.3, 2.0), (0.08, w - 0.15, 1.3, 2.0)]))
        ends.append(sheet(name, *[(x, y, at) for x, y in outer[2:]]))
    nose = rod("nose", (0, 0.95, -length / 2 - 0.5), (0, 0.95, -length / 2 + 0.1), 0.45, 0.6, 12)
    b = Body(w, (-length / 2, length / 2), 0.5, 2.8, 0.06)
    return [vault, *both_sides([side]), *ends, nose, box("floor", (-w, w), (0.44, 0.5), b.z),
            *_wheels(draw, b, (-length / 2 + 1.2, length / 2 - 1.6)),
            *_seats(draw, b._replace(roof=2.4), 0.5, (-length / 2 + 1, length / 2 - 0.4))]


def _open_tour(draw: Draw) -> list[Part]:
    """An open bus: low sides, posts and a canopy."""
    b = _body(draw, draw.between(6, 9), 0.5, draw.between(2.5, 2.9))
    low = 1.15
    walls = [*both_sides([box("side", (b.w - 0.06, b.w), (b.floor, low), b.z)]),
             box("front", (-b.w, b.w), (b.floor, low + 0.1), (b.z[0], b.z[0] + 0.06)),
             box("rear", (-b.w, b.w), (b.floor, low), (b.z[1] - 0.06, b.z[1])),
             box("floor", (-b.w, b.w), (b.floor - 0.06, b.floor), b.z)]
    count = draw.whole(4, 6)
    posts = both_sides([rod("post", (b.w - 0.04, low - 0.05, z), (b.w - 0.04, b.roof, z), 0.035, sides=6)
                        for z in np.linspace(b.z[0] + 0.05, b.z[1] - 0.05, count).tolist()])
    roof = [box("canopy", (-b.w, b.w), (b.roof, b.roof + 0.05), b.z)]
    if draw.chance(0.5):
        roof += both_sides([sheet("fringe", (b.w, b.roof, b.z[0]), (b.w, b.roof, b.z[1]),
                                  (b.w, b.roof - 0.25, b.z[1]), (b.w, b.roof - 0.25, b.z[0]))])
    return [*walls, *posts, *roof, *_wheels(draw, b, (b.z[0] + 1.4, b.z[1] - 1.4), 0.42),
            *_seats(draw, b, b.floor, (b.z[0] + 0.6, b.z[1] - 0.2))]


def _front_slanted(draw: Draw) -> list[Part]:
    """A shuttle with a raked front and large panes."""
    b = _body(draw, draw.between(5.5, 7.5), 0.35, draw.between(2.6, 2.9))
    rake = draw.between(0.6, 1.1)
    side = _windows((b.z[0] + 0.3, b.z[1] - 0.3), (1.1, b.roof - 0.2), draw.whole(2, 3), 0.1)
    shell = [part for part in _shell(b, side, side, [], []) if part.name != "front"]
    cheeks = both_sides([sheet("cheek", (b.w, b.floor, b.z[0]), (b.w, b.floor, b.z[0] - rake),
                               (b.w, 1.0, b.z[0] - rake), (b.w, b.roof, b.z[0]))])
    front = sheet("nose", (-b.w, b.floor, b.z[0] - rake), (b.w, b.floor, b.z[0] - rake),
                  (b.w, 1.0, b.z[0] - rake), (-b.w, 1.0, b.z[0] - rake))
    sill = sheet("sill", (-b.w, b.floor, b.z[0] - rake), (-b.w, b.floor, b.z[0]), (b.w, b.floor, b.z[0]),
                 (b.w, b.floor, b.z[0] - rake))
    return [*shell, *cheeks, front, sill, *_wheels(draw, b, (b.z[0] + 0.9, b.z[1] - 1.3), 0.42),
            *_seats(draw, b, b.floor, (b.z[0] + 1.2, b.z[1] - 0.3)), *_extras(draw, b)]


def _truck_bus(draw: Draw) -> list[Part]:
    """An expedition bus: a cabin high above large wheels, with a rack and a ladder."""
    b = _body(draw, draw.between(5.5, 7), 1.3, 3.4)
    side = _windows((b.z[0] + 0.5, b.z[1] - 0.5), (2.2, 3.0), draw.whole(3, 5), 0.35)
    front, rear = _ends(b, 2.3, 3.0)
    cab = prism("cab", 0, [(0.7, b.z[0] - 0.1), (2.2, b.z[0] - 0.1), (2.1, b.z[0] - 0.7),
                           (1.5, b.z[0] - 1.5), (0.7, b.z[0] - 1.5)], (-1.0, 1.0))
    rack = panel("rack", 1, (b.roof + 0.3, b.roof + 0.35), (-b.w, b.w), (b.z[0] + 0.4, b.z[1] - 0.4),
                 [(-b.w + 0.1, b.w - 0.1, b.z[0] + 0.5, b.z[1] - 0.5)])
    posts = both_sides([block("post", (b.w - 0.05, b.roof + 0.15, z), (0.05, 0.35, 0.05))
                        for z in (b.z[0] + 0.45, 0, b.z[1] - 0.45)])
    boxes = [block("luggage", (0, b.roof + 0.45, z), (1.4, 0.5, 0.9)) for z in (-1.2, 0.8)]
    spare = moved(turned(lathe("spare", [(0.5, -0.14), (0.5, 0.14)], 14), 0, 90),
                  (0, 2.0, b.z[1] + 0.16))
    return [*_shell(b, side, side, front, rear), cab, rack, *posts, *boxes, spare,
            box("chassis", (-0.5, 0.5), (0.8, 1.24), (b.z[0] - 0.2, b.z[1])),
            *_wheels(draw, b, (b.z[0] - 0.6, b.z[1] - 1.3), 0.62)]


def _half_cab(draw: Draw) -> list[Part]:
    """A double-decker with its cab beside the bonnet and an open platform with stairs behind."""
    b = _body(draw, draw.between(7.5, 8.5), 0.5, 4.2)
    n, z = draw.whole(4, 6), (b.z[0] + 0.3, b.z[1] - 0.3)
    upper, lower = _windows(z, (2.9, 3.7), n, 0.14), _windows((z[0], z[1] - 1.4), (1.3, 2.0), n - 1, 0.14)
    gap = [(0.0, 2.05, b.z[1] - 1.4, b.z[1])]
    front = [(-b.w + 0.1, b.w - 0.1, 2.9, 3.8), (-b.w + 0.2, b.w - 0.2, 1.3, 2.0)]
    bonnet = box("bonnet", (-b.w + 0.1, 0.1), (0.5, 1.5), (b.z[0] - 1.5, b.z[0]))
    cab = panel("cab", 0, (b.w - 0.05, b.w), (0.5, 2.2), (b.z[0] - 1.4, b.z[0]),
                [(1.3, 2.0, b.z[0] - 1.2, b.z[0] - 0.2)])
    roof = [box("cab_roof", (0.1, b.w), (2.2, 2.26), (b.z[0] - 1.4, b.z[0])),
            panel("cab_front", 2, (b.z[0] - 1.45, b.z[0] - 1.4), (0.1, b.w), (0.5, 2.2), [(0.2, b.w - 0.1, 1.3, 2.0)])]
    stairs = [block("stair", (0.7, 0.7 + 0.28 * i, b.z[1] - 0.25 - 0.2 * i), (0.7, 0.06, 0.24)) for i in range(6)]
    return [*_shell(b, upper + lower, upper + lower + gap, front, front[:1]), bonnet, cab, *roof, *stairs,
            panel("deck", 1, (2.2, 2.28), (-b.w + b.t, b.w - b.t), (b.z[0] + b.t, b.z[1] - b.t),
                  [(0.3, 1.0, b.z[1] - 1.4, b.z[1] - 0.2)]),
            *_seats(draw, b, 2.28, (b.z[0] + 0.5, b.z[1] - 1.6)), *_wheels(draw, b, (b.z[0] - 0.7, b.z[1] - 2.3))]


def _apron(draw: Draw) -> list[Part]:
    """An airport bus: wide, low, with broad doors on both sides."""
    b = _body(draw, draw.between(10, 12), 0.3, 2.9)._replace(w=1.6)
    doors = _door_holes(b, np.linspace(b.z[0] * 0.55, b.z[1] * 0.55, draw.whole(2, 3)).tolist(), 1.7)
    ends = [(-1.4, 1.4, 1.1, 2.6)]
    bars = [rod("bar", (x, 2.5, b.z[0] + 0.5), (x, 2.5, b.z[1] - 0.5), 0.03, sides=6) for x in (-0.7, 0.7)]
    poles = [rod("pole", (x, 0.3, z), (x, 2.9, z), 0.03, sides=6) for x in (-0.7, 0.7)
             for z in np.linspace(b.z[0] + 0.6, b.z[1] - 0.6, 6).tolist()]
    return [*_shell(b, doors, doors, ends, ends), *bars, *poles, *_extras(draw, b),
            *_wheels(draw, b, (b.z[0] + 1.1, b.z[1] - 1.1), 0.4)]


def _trailer(draw: Draw) -> list[Part]:
    """A tractor with a long passenger trailer behind."""
    b = Body(1.25, (-2.5, draw.between(5.5, 7.5)), 1.0, 3.4, 0.05)
    side = _windows((b.z[0] + 0.4, b.z[1] - 0.4), (1.9, 3.0), draw.whole(5, 8), 0.2)
    door = [(0.5, 3.0, b.z[1] - 1.6, b.z[1] - 0.7)]
    right = [hole for hole in side if hole[3] < door[0][2] - 0.1] + door
    cab = [panel("cab_side", 0, (x, x), (0.7, 2.8), (-5.2, -3.4), [(1.7, 2.5, -4.9, -4.0)]) for x in (-1.1, 1.1)]
    front = [panel("cab_front", 2, (-5.2, -5.2), (-1.1, 1.1), (0.7, 2.8), [(-0.95, 0.95, 1.7, 2.5)]),
             panel("cab_rear", 2, (-3.4, -3.4), (-1.1, 1.1), (0.7, 2.8)),
             box("cab_roof", (-1.1, 1.1), (2.8, 2.95), (-5.2, -3.4)),
             box("chassis", (-0.5, 0.5), (0.65, 0.95), (-5.1, -0.5))]
    return [*_shell(b, side, right, [(-1, 1, 1.9, 3.0)], [(-0.9, 0.9, 1.9, 3.0)]), *cab, *front,
            *_seats(draw, b, 1.0, (b.z[0] + 0.4, b.z[1] - 1.8)),
            *_wheels(draw, b, (-4.3, -1.7, b.z[1] - 2.6, b.z[1] - 1.5))]


def _camper(draw: Draw) -> list[Part]:
    """A camper with a lifted roof, an awning at its side and a rack behind."""
    b = Body(0.9, (-2.2, 2.2), 0.35, 2.0, 0.04)
    side = _windows((b.z[0] + 0.2, b.z[1] - 0.2), (1.2, 1.75), 3, 0.15)
    door = [(0.45, 1.8, -0.5, 0.6)]
    ends = [(-0.75, 0.75, 1.2, 1.75)]
    top = box("pop_top", (-0.75, 0.75), (2.0, 2.08), (-1.9, 1.6))
    lifted = turned(top, 0, -draw.between(12, 22), (0, 2.0, 1.6))
    low = float(lifted.vertices[:, 1].max())
    cloth = both_sides([sheet("cloth", (0.7, 2.0, 1.6), (0.7, 2.0, -1.8), (0.7, low - 0.1, -1.75))])
    reach = draw.between(1.4, 2.2)
    awning = [sheet("awning", (-0.9, 2.0, -1.5), (-0.9, 2.0, 1.5), (-0.9 - reach, 1.8, 1.5),
                    (-0.9 - reach, 1.8, -1.5)),
              *(rod("pole", (-0.88 - reach, 0, z), (-0.88 - reach, 1.8, z), 0.025, sides=6) for z in (-1.4, 1.4))]
    spare = moved(turned(lathe("spare", [(0.32, 0), (0.32, 0.18)], 14), 0, 90), (0, 1.0, -2.4))
    return [*_shell(b, side, door, ends, ends), lifted, *cloth, *awning,
            spare, *_wheels(draw, b, (-1.3, 1.3), 0.32)]


def _jeepney(draw: Draw) -> list[Part]:
    """A long bonnet, open sides above a low wall, benches, and a rack on the roof."""
    b = Body(0.95, (-1.6, draw.between(2.4, 3.6)), 0.6, 2.2, 0.04)
    side = _windows((b.z[0] + 0.1, b.z[1]), (1.2, 2.0), draw.whole(3, 5), 0.08)
    hood = [box("bonnet", (-0.6, 0.6), (0.6, 1.25), (b.z[0] - 1.5, b.z[0])),
            panel("grille", 2, (b.z[0] - 1.6, b.z[0] - 1.52), (-0.6, 0.6), (0.5, 1.2),
                  [(-0.5 + 0.2 * i, -0.38 + 0.2 * i, 0.6, 1.1) for i in range(5)])]
    fender = both_sides([box("fender", (0.6, 0.95), (0.85, 0.92), (b.z[0] - 1.5, b.z[0]))])
    rack = [panel("rack", 1, (2.35, 2.38), (-0.9, 0.9), b.z, [(-0.8, 0.8, b.z[0] + 0.1, b.z[1] - 0.1)]),
            *both_sides([block("post", (0.85, 2.28, z), (0.04, 0.15, 0.04)) for z in (b.z[0] + 0.1, b.z[1] - 0.1)])]
    bench = both_sides([box("bench", (0.5, 0.9), (0.95, 1.05), (b.z[0] + 0.8, b.z[1]))])
    ladder = [rod("rail", (x, 0.6, b.z[1] + 0.05), (x, 2.4, b.z[1] + 0.05), 0.02, sides=6) for x in (0.3, 0.6)]
    return [*_shell(b, side, side, [(-0.8, 0.8, 1.3, 2.0)], [(-0.5, 0.2, 0.0, 2.0)]), *hood, *fender, *rack, *bench,
            *ladder, *_wheels(draw, b, (b.z[0] - 0.8, b.z[1] - 0.9), 0.38)]


def _van(draw: Draw) -> list[Part]:
    """A box body without side windows, its rear doors open."""
    high = draw.between(2.3, 3.0)
    b = Body(1.0, (-1.5, draw.between(2.2, 3.4)), 0.5, high, 0.05)
    nose = prism("nose", 0, [(0.4, -3.0), (1.1, -3.0), (1.3, -2.4), (2.1, -1.5), (0.4, -1.5)], (-0.95, 0.95))
    angle = draw.between(60, 115)
    door = turned(box("door", (0.02, 1.0), (0.5, high), (b.z[1], b.z[1] + 0.05)), 1, -angle, (1.0, 0, b.z[1]))
    shell = _shell(b, [], [(0.6, high - 0.2, -0.9, 0.3)] if draw.chance(0.5) else [], [], [])
    steps = [block("step", (0, 0.3, b.z[1] + 0.2), (1.2, 0.06, 0.35))]
    benches = both_sides([box("bench", (0.45, 0.93), (0.85, 0.95), (b.z[0] + 0.3, b.z[1] - 0.2))])
    return [*(part for part in shell if part.name != "rear"), nose, *both_sides([door]), *steps, *benches,
            *_wheels(draw, b, (-2.2, b.z[1] - 1.1), 0.38)]


def _observation(draw: Draw) -> list[Part]:
    """A coach whose rear half carries a second, raised saloon."""
    b = _body(draw, draw.between(10.5, 12), 0.45, 2.6)
    start, top = draw.between(-2.0, 0.5), draw.between(3.7, 4.1)
    low = _windows((b.z[0] + 0.5, start - 0.2), (1.4, 2.3), draw.whole(2, 4), 0.15)
    upper = b._replace(z=(start, b.z[1]), floor=2.66, roof=top)
    high = _windows((start + 0.3, b.z[1] - 0.3), (2.9, top - 0.15), draw.whole(3, 4), 0.12)
    pane = [(-b.w + 0.1, b.w - 0.1, 2.9, top - 0.15)]
    parts = [*_shell(b, low, low, [(-b.w + 0.1, b.w - 0.1, 1.2, 2.4)], []), *_shell(upper, high, high, pane, pane)]
    return [*parts, *_seats(draw, upper, 2.66, (start + 0.8, b.z[1] - 0.4)),
            *_wheels(draw, b, (b.z[0] + 2.0, b.z[1] - 3.2, b.z[1] - 2.1))]


KINDS: tuple[Callable[[Draw], list[Part]], ...] = (
    _city, _coach, _double, _articulated, _school, _minibus, _trolley, _rounded, _open_tour,
    _front_slanted, _truck_bus, _double, _city, _coach, _half_cab, _apron, _trailer, _camper,
    _jeepney, _van, _observation,
)
