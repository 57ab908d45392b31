"""Buses: pierced shells with decks, seats and wheels."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pnabs.dataset.samples.bus_body import (
    city_body,
    door_holes,
    extras,
    pierced_shell,
    screens,
    seat_rows,
    wheel_pairs,
    window_row,
)
from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides
from pnabs.dataset.samples.sheets import panel
from pnabs.dataset.samples.small_buses import SMALL_BUSES
from pnabs.dataset.samples.solids import block, box, rod
from pnabs.dataset.samples.special_buses import SPECIAL_BUSES


def bus(draw: Draw) -> list[Part]:
    """One bus along z, its front looking along -z."""
    return draw.kind(KINDS)(draw)


def _city(draw: Draw) -> list[Part]:
    b = city_body(draw, draw.between(9, 12), 0.4, draw.between(2.8, 3.1))
    low, high, n = 1.3, b.roof - 0.35, draw.whole(5, 8)
    doors = draw.pick(((b.z[0] + 0.9,), (b.z[0] + 0.9, 0.3), ()))
    right = window_row((b.z[0] + 1.6, b.z[1] - 0.4), (low, high), n, 0.16)
    right = [h for h in right if all(h[3] < d - 0.55 or h[2] > d + 0.55 for d in doors)]
    left = window_row((b.z[0] + 0.4, b.z[1] - 0.4), (low, high), n, 0.16)
    front, rear = screens(b, low, high)
    return [
        *pierced_shell(b, left, right + door_holes(b, doors), front, rear),
        *extras(draw, b),
        *wheel_pairs(draw, b, (b.z[0] + 2.2, b.z[1] - 2.6)),
        *seat_rows(draw, b, b.floor, (b.z[0] + 2, b.z[1] - 0.4)),
    ]


def _coach(draw: Draw) -> list[Part]:
    b = city_body(draw, draw.between(11, 13.5), 0.45, draw.between(3.2, 3.6))
    deck, high = 1.3, b.roof - 0.25
    side = window_row((b.z[0] + 0.8, b.z[1] - 0.8), (1.9, high), draw.whole(3, 6), 0.08)
    hold = window_row((-2.2, 2.0), (0.6, 1.15), 3, 0.1) if draw.chance(0.5) else []
    front = [(-b.w + 0.1, b.w - 0.1, 1.2, high)]
    return [
        *pierced_shell(b, side + hold, side + hold, front, [(-b.w + 0.3, b.w - 0.3, 2.2, high)]),
        box("deck", (-b.w + b.t, b.w - b.t), (deck - 0.05, deck), (b.z[0] + 1.2, b.z[1] - b.t)),
        *wheel_pairs(draw, b, (b.z[0] + 2.4, b.z[1] - 3.6, b.z[1] - 2.4)),
        *seat_rows(draw, b, deck, (b.z[0] + 1.4, b.z[1] - 0.3)),
        *extras(draw, b),
    ]


def _double(draw: Draw) -> list[Part]:
    b = city_body(draw, draw.between(9, 11), 0.4, draw.between(4.1, 4.4))
    n, deck = draw.whole(5, 7), 2.25
    z = (b.z[0] + 0.4, b.z[1] - 0.4)
    upper = window_row(z, (2.9, b.roof - 0.3), n, 0.14)
    lower = window_row((z[0] + 1.2, z[1]), (1.2, 1.95), n - 1, 0.14)
    door = [(b.floor - 1, 2.0, b.z[0] + 0.3, b.z[0] + 1.3)]
    front = [(-b.w + 0.1, b.w - 0.1, 1.1, 1.95), (-b.w + 0.1, b.w - 0.1, 2.8, b.roof - 0.3)]
    open_top = draw.variant("open top", (False, True))
    shell = pierced_shell(
        b, upper + lower, upper + lower + door, front, front[1:], roof=not open_top
    )
    return [
        *shell,
        box("deck", (-b.w + b.t, b.w - b.t), (deck, deck + 0.08), (b.z[0] + b.t, b.z[1] - b.t)),
        *seat_rows(draw, b, deck + 0.08, (b.z[0] + 1, b.z[1] - 0.5)),
        *seat_rows(draw, b, b.floor, (b.z[0] + 2, b.z[1] - 0.5)),
        *wheel_pairs(draw, b, (b.z[0] + 2.3, b.z[1] - 2.3)),
    ]


def _articulated(draw: Draw) -> list[Part]:
    b = city_body(draw, 8.5, 0.4, 2.95)
    ahead, behind = b._replace(z=(-8.6, -0.5)), b._replace(z=(0.7, 8.0))
    parts: list[Part] = []
    for car in (ahead, behind):
        side = window_row((car.z[0] + 0.4, car.z[1] - 0.4), (1.3, 2.55), draw.whole(4, 5), 0.2)
        pass_through = [(-0.8, 0.8, 0.5, 2.5)]
        screen = screens(car, 1.3, 2.55)
        front = screen[0] if car is ahead else pass_through
        rear = pass_through if car is ahead else screen[1]
        parts += pierced_shell(car, side, side, front, rear)
        parts += seat_rows(draw, car, car.floor, (car.z[0] + 0.8, car.z[1] - 0.4))
    folds = draw.whole(3, 6)
    step = 1.2 / folds
    parts += [
        panel(
            "bellows",
            2,
            (-0.5 + (i + 0.2) * step, -0.5 + (i + 0.7) * step),
            (-b.w + 0.06, b.w - 0.06),
            (0.4, 2.9),
            [(-0.9, 0.9, 0.5, 2.6)],
        )
        for i in range(folds)
    ]
    return [*parts, *wheel_pairs(draw, b, (-6.4, -2.2, 5.2)), *extras(draw, ahead)]


def _trolley(draw: Draw) -> list[Part]:
    parts = _city(draw)
    roof = max(float(part.vertices[:, 1].max()) for part in parts if part.name == "roof")
    poles = both_sides(
        [
            rod(
                "trolley_pole",
                (0.25, roof + 0.1, 1.0),
                (0.3, roof + draw.between(1.2, 1.8), 6.5),
                0.03,
                sides=6,
            )
        ]
    )
    return [*parts, block("pole_base", (0, roof + 0.1, 1.0), (1.0, 0.2, 1.2)), *poles]


def _half_cab(draw: Draw) -> list[Part]:
    """A double-decker with its cab beside the bonnet and an open platform with stairs behind."""
    b = city_body(draw, draw.between(7.5, 8.5), 0.5, 4.2)
    n, z = draw.whole(4, 6), (b.z[0] + 0.3, b.z[1] - 0.3)
    upper, lower = (
        window_row(z, (2.9, 3.7), n, 0.14),
        window_row((z[0], z[1] - 1.4), (1.3, 2.0), n - 1, 0.14),
    )
    gap = [(0.0, 2.05, b.z[1] - 1.4, b.z[1])]
    front = [(-b.w + 0.1, b.w - 0.1, 2.9, 3.8), (-b.w + 0.2, b.w - 0.2, 1.3, 2.0)]
    bonnet = box("bonnet", (-b.w + 0.1, 0.1), (0.5, 1.5), (b.z[0] - 1.5, b.z[0]))
    cab = panel(
        "cab",
        0,
        (b.w - 0.05, b.w),
        (0.5, 2.2),
        (b.z[0] - 1.4, b.z[0]),
        [(1.3, 2.0, b.z[0] - 1.2, b.z[0] - 0.2)],
    )
    roof = [
        box("cab_roof", (0.1, b.w), (2.2, 2.26), (b.z[0] - 1.4, b.z[0])),
        panel(
            "cab_front",
            2,
            (b.z[0] - 1.45, b.z[0] - 1.4),
            (0.1, b.w),
            (0.5, 2.2),
            [(0.2, b.w - 0.1, 1.3, 2.0)],
        ),
    ]
    stairs = [
        block("stair", (0.7, 0.7 + 0.28 * i, b.z[1] - 0.25 - 0.2 * i), (0.7, 0.06, 0.24))
        for i in range(6)
    ]
    return [
        *pierced_shell(b, upper + lower, upper + lower + gap, front, front[:1]),
        bonnet,
        cab,
        *roof,
        *stairs,
        panel(
            "deck",
            1,
            (2.2, 2.28),
            (-b.w + b.t, b.w - b.t),
            (b.z[0] + b.t, b.z[1] - b.t),
            [(0.3, 1.0, b.z[1] - 1.4, b.z[1] - 0.2)],
        ),
        *seat_rows(draw, b, 2.28, (b.z[0] + 0.5, b.z[1] - 1.6)),
        *wheel_pairs(draw, b, (b.z[0] - 0.7, b.z[1] - 2.3)),
    ]


def _apron(draw: Draw) -> list[Part]:
    """An airport bus: wide, low, with broad doors on both sides."""
    b = city_body(draw, draw.between(10, 12), 0.3, 2.9)._replace(w=1.6)
    doors = door_holes(b, np.linspace(b.z[0] * 0.55, b.z[1] * 0.55, draw.whole(2, 3)).tolist(), 1.7)
    ends = [(-1.4, 1.4, 1.1, 2.6)]
    bars = [
        rod("bar", (x, 2.5, b.z[0] + 0.5), (x, 2.5, b.z[1] - 0.5), 0.03, sides=6)
        for x in (-0.7, 0.7)
    ]
    poles = [
        rod("pole", (x, 0.3, z), (x, 2.9, z), 0.03, sides=6)
        for x in (-0.7, 0.7)
        for z in np.linspace(b.z[0] + 0.6, b.z[1] - 0.6, 6).tolist()
    ]
    return [
        *pierced_shell(b, doors, doors, ends, ends),
        *bars,
        *poles,
        *extras(draw, b),
        *wheel_pairs(draw, b, (b.z[0] + 1.1, b.z[1] - 1.1), 0.4),
    ]


def _observation(draw: Draw) -> list[Part]:
    """A coach whose rear half carries a second, raised saloon."""
    b = city_body(draw, draw.between(10.5, 12), 0.45, 2.6)
    start, top = draw.between(-2.0, 0.5), draw.between(3.7, 4.1)
    low = window_row((b.z[0] + 0.5, start - 0.2), (1.4, 2.3), draw.whole(2, 4), 0.15)
    upper = b._replace(z=(start, b.z[1]), floor=2.66, roof=top)
    high = window_row((start + 0.3, b.z[1] - 0.3), (2.9, top - 0.15), draw.whole(3, 4), 0.12)
    pane = [(-b.w + 0.1, b.w - 0.1, 2.9, top - 0.15)]
    parts = [
        *pierced_shell(b, low, low, [(-b.w + 0.1, b.w - 0.1, 1.2, 2.4)], []),
        *pierced_shell(upper, high, high, pane, pane),
    ]
    return [
        *parts,
        *seat_rows(draw, upper, 2.66, (start + 0.8, b.z[1] - 0.4)),
        *wheel_pairs(draw, b, (b.z[0] + 2.0, b.z[1] - 3.2, b.z[1] - 2.1)),
    ]


KINDS: tuple[Callable[[Draw], list[Part]], ...] = (
    _city,
    _coach,
    _double,
    _articulated,
    _trolley,
    _half_cab,
    _apron,
    _observation,
    *SPECIAL_BUSES,
    *SMALL_BUSES,
    _double,
    _city,
    _coach,
)
