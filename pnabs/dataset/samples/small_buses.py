"""Minibuses, shuttles, campers and vans."""

from __future__ import annotations

from collections.abc import Callable

from pnabs.dataset.samples.bus_body import (
    Body,
    city_body,
    extras,
    pierced_shell,
    seat_rows,
    wheel_pairs,
    window_row,
)
from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, moved, turned
from pnabs.dataset.samples.sheets import sheet
from pnabs.dataset.samples.solids import block, box, lathe, prism, rod


def _minibus(draw: Draw) -> list[Part]:
    w, length, roof, t = 0.95, draw.between(4.6, 5.8), draw.between(2.0, 2.5), 0.04
    nose = length / 2
    line = [
        (0.35, -nose),
        (0.95, -nose),
        (1.25, -nose + 0.5),
        (roof, -nose + 1.2),
        (roof, nose - 0.15),
        (roof - 0.3, nose),
        (0.35, nose),
    ]
    cap = prism(
        "nose", 0, [(0.35, -nose), (0.95, -nose), (1.25, -nose + 0.5), (0.35, -nose + 0.9)], (-w, w)
    )
    z = (-nose + 1.2, nose)
    b = Body(w, z, 0.35, roof, t)
    side = window_row((z[0] + 0.1, z[1] - 0.2), (1.2, roof - 0.25), draw.whole(2, 4), 0.12)
    sliding = [(0.45, roof - 0.2, z[0] + 0.1, z[0] + 1.1)] if draw.chance(0.4) else []
    right = [h for h in side if not sliding or h[2] > sliding[0][3] + 0.05] + sliding
    shell = pierced_shell(
        b,
        side,
        right,
        [(-w + 0.1, w - 0.1, 0.5, roof - 0.1)],
        [(-w + 0.15, w - 0.15, 1.2, roof - 0.3)],
    )
    pillars = both_sides(
        [sheet("cheek", (w, *line[2]), (w, 0.35, -nose + 0.9), (w, 0.35, z[0]), (w, roof, z[0]))]
    )
    return [
        cap,
        *shell,
        *pillars,
        *wheel_pairs(draw, b, (-nose + 0.9, nose - 1.1), 0.34),
        *seat_rows(draw, b, b.floor, (z[0] + 0.2, z[1] - 0.3)),
    ]


def _front_slanted(draw: Draw) -> list[Part]:
    """A shuttle with a raked front and large panes."""
    b = city_body(draw, draw.between(5.5, 7.5), 0.35, draw.between(2.6, 2.9))
    rake = draw.between(0.6, 1.1)
    side = window_row((b.z[0] + 0.3, b.z[1] - 0.3), (1.1, b.roof - 0.2), draw.whole(2, 3), 0.1)
    shell = [part for part in pierced_shell(b, side, side, [], []) if part.name != "front"]
    cheeks = both_sides(
        [
            sheet(
                "cheek",
                (b.w, b.floor, b.z[0]),
                (b.w, b.floor, b.z[0] - rake),
                (b.w, 1.0, b.z[0] - rake),
                (b.w, b.roof, b.z[0]),
            )
        ]
    )
    front = sheet(
        "nose",
        (-b.w, b.floor, b.z[0] - rake),
        (b.w, b.floor, b.z[0] - rake),
        (b.w, 1.0, b.z[0] - rake),
        (-b.w, 1.0, b.z[0] - rake),
    )
    sill = sheet(
        "sill",
        (-b.w, b.floor, b.z[0] - rake),
        (-b.w, b.floor, b.z[0]),
        (b.w, b.floor, b.z[0]),
        (b.w, b.floor, b.z[0] - rake),
    )
    return [
        *shell,
        *cheeks,
        front,
        sill,
        *wheel_pairs(draw, b, (b.z[0] + 0.9, b.z[1] - 1.3), 0.42),
        *seat_rows(draw, b, b.floor, (b.z[0] + 1.2, b.z[1] - 0.3)),
        *extras(draw, b),
    ]


def _camper(draw: Draw) -> list[Part]:
    """A camper with a lifted roof, an awning at its side and a rack behind."""
    b = Body(0.9, (-2.2, 2.2), 0.35, 2.0, 0.04)
    side = window_row((b.z[0] + 0.2, b.z[1] - 0.2), (1.2, 1.75), 3, 0.15)
    door = [(0.45, 1.8, -0.5, 0.6)]
    ends = [(-0.75, 0.75, 1.2, 1.75)]
    top = box("pop_top", (-0.75, 0.75), (2.0, 2.08), (-1.9, 1.6))
    lifted = turned(top, 0, -draw.between(12, 22), (0, 2.0, 1.6))
    low = float(lifted.vertices[:, 1].max())
    cloth = both_sides([sheet("cloth", (0.7, 2.0, 1.6), (0.7, 2.0, -1.8), (0.7, low - 0.1, -1.75))])
    reach = draw.between(1.4, 2.2)
    awning = [
        sheet(
            "awning",
            (-0.9, 2.0, -1.5),
            (-0.9, 2.0, 1.5),
            (-0.9 - reach, 1.8, 1.5),
            (-0.9 - reach, 1.8, -1.5),
        ),
        *(
            rod("pole", (-0.88 - reach, 0, z), (-0.88 - reach, 1.8, z), 0.025, sides=6)
            for z in (-1.4, 1.4)
        ),
    ]
    spare = moved(turned(lathe("spare", [(0.32, 0), (0.32, 0.18)], 14), 0, 90), (0, 1.0, -2.4))
    return [
        *pierced_shell(b, side, door, ends, ends),
        lifted,
        *cloth,
        *awning,
        spare,
        *wheel_pairs(draw, b, (-1.3, 1.3), 0.32),
    ]


def _van(draw: Draw) -> list[Part]:
    """A box body without side windows, its rear doors open."""
    high = draw.between(2.3, 3.0)
    b = Body(1.0, (-1.5, draw.between(2.2, 3.4)), 0.5, high, 0.05)
    nose = prism(
        "nose", 0, [(0.4, -3.0), (1.1, -3.0), (1.3, -2.4), (2.1, -1.5), (0.4, -1.5)], (-0.95, 0.95)
    )
    angle = draw.between(60, 115)
    door = turned(
        box("door", (0.02, 1.0), (0.5, high), (b.z[1], b.z[1] + 0.05)), 1, -angle, (1.0, 0, b.z[1])
    )
    shell = pierced_shell(b, [], [(0.6, high - 0.2, -0.9, 0.3)] if draw.chance(0.5) else [], [], [])
    steps = [block("step", (0, 0.3, b.z[1] + 0.2), (1.2, 0.06, 0.35))]
    benches = both_sides([box("bench", (0.45, 0.93), (0.85, 0.95), (b.z[0] + 0.3, b.z[1] - 0.2))])
    return [
        *(part for part in shell if part.name != "rear"),
        nose,
        *both_sides([door]),
        *steps,
        *benches,
        *wheel_pairs(draw, b, (-2.2, b.z[1] - 1.1), 0.38),
    ]


SMALL_BUSES: tuple[Callable[[Draw], list[Part]], ...] = (
    _minibus,
    _front_slanted,
    _camper,
    _van,
)
"""Makers of small buses."""
