# ruff: noqa: RUF005
"""Bookshelves: cases, and ladders, steps, honeycombs and other open ones."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np

from pnabs.dataset.samples.bookcases import BOARD, BOOKCASES, board_levels
from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, reflected
from pnabs.dataset.samples.sheets import hoop, panel
from pnabs.dataset.samples.solids import block, box, lathe, prism, rod


def bookshelf(draw: Draw) -> list[Part]:
    """One bookshelf, its open front looking along -z."""
    return draw.kind(KINDS)(draw)


def _ladder(draw: Draw) -> list[Part]:
    w, h, foot, count = draw.between(0.3, 0.45), draw.between(1.6, 2.0), 0.25, draw.whole(4, 5)
    rails = both_sides([rod("rail", (w, 0, -foot), (w, h, 0.17), 0.025, sides=4)])
    parts = list(rails)
    for i in range(count):
        y = h * (0.12 + 0.8 * i / (count - 1))
        front = -foot + (foot + 0.17) * y / h
        parts += [
            box("shelf", (-w, w), (y, y + 0.02), (front, 0.2)),
            box("lip", (-w, w), (y, y + 0.05), (0.19, 0.2)),
        ]
    return parts


def _a_frame(draw: Draw) -> list[Part]:
    w, h, reach, count = draw.between(0.3, 0.5), draw.between(1.3, 1.8), 0.32, draw.whole(3, 5)
    legs = both_sides(
        [rod("leg", (w, 0, end * reach), (w, h, end * 0.04), 0.022, sides=4) for end in (-1, 1)]
    )
    shelves = []
    for i in range(count):
        y = h * (0.1 + 0.75 * i / (count - 1))
        deep = reach - (reach - 0.04) * y / h
        shelves.append(box("shelf", (-w, w), (y, y + 0.02), (-deep, deep)))
    return legs + shelves


def _posts(draw: Draw) -> list[Part]:
    w, h, d = draw.between(0.3, 0.5), draw.between(1.0, 1.9), draw.between(0.14, 0.22)
    posts = both_sides(
        [
            rod(
                "post",
                (w - 0.02, 0, end * (d - 0.02)),
                (w - 0.02, h, end * (d - 0.02)),
                0.014,
                sides=8,
            )
            for end in (-1, 1)
        ]
    )
    shelves = [
        box("shelf", (-w, w), (y, y + 0.015), (-d, d))
        for y in board_levels(draw, 0.08, h - 0.02, draw.whole(3, 5))
    ]
    if draw.chance(0.5):
        shelves.append(
            rod("cross", (-w + 0.02, 0.1, d - 0.02), (w - 0.02, h - 0.05, d - 0.02), 0.006, sides=6)
        )
        shelves.append(
            rod("cross", (w - 0.02, 0.1, d - 0.02), (-w + 0.02, h - 0.05, d - 0.02), 0.006, sides=6)
        )
    return posts + shelves


def _steps(draw: Draw) -> list[Part]:
    count, cell, side = draw.whole(3, 5), draw.between(0.3, 0.38), draw.pick((-1, 1))
    parts = []
    for i in range(count):
        x = ((i - count / 2) * cell, (i + 1 - count / 2) * cell)
        for j in range(count - i):
            y = (j * cell, (j + 1) * cell)
            frame = panel(
                "cell",
                2,
                (-0.17, 0.17),
                x,
                y,
                [(x[0] + BOARD / 2, x[1] - BOARD / 2, y[0] + BOARD / 2, y[1] - BOARD / 2)],
            )
            parts.append(frame)
    return parts if side > 0 else [reflected(part) for part in parts]


def _staggered(draw: Draw) -> list[Part]:
    w, rows, cell, d = draw.between(0.4, 0.6), draw.whole(3, 5), draw.between(0.28, 0.36), 0.15
    parts = [box("shelf", (-w, w), (i * cell, i * cell + BOARD), (-d, d)) for i in range(rows + 1)]
    for i in range(rows):
        places = (-w * 0.7, w * 0.35) if i % 2 else (-w * 0.35, w * 0.7)
        parts += [
            block("upright", (x, (i + 0.5) * cell + BOARD / 2, 0), (BOARD, cell - BOARD, 2 * d))
            for x in places
        ]
    return parts


def _zigzag(draw: Draw) -> list[Part]:
    w, rows, rise, d, t = draw.between(0.25, 0.4), draw.whole(4, 6), 0.3, 0.14, 0.03
    line = []
    for i in range(rows):
        line += [(-w, i * rise), (w, i * rise)] if i % 2 == 0 else [(w, i * rise), (-w, i * rise)]
    parts = []
    for (x0, y0), (x1, y1) in itertools.pairwise(line):
        parts.append(
            box(
                "board",
                (min(x0, x1) - t / 2, max(x0, x1) + t / 2),
                (min(y0, y1) - t / 2, max(y0, y1) + t / 2),
                (-d, d),
            )
        )
    return parts


def _floating(draw: Draw) -> list[Part]:
    count, parts = draw.whole(3, 4), []
    for i in range(count):
        w = draw.between(0.25, 0.5)
        y = i * draw.between(0.3, 0.36)
        parts.append(box("shelf", (-w, w), (y, y + 0.03), (-0.12, 0.12)))
        parts += both_sides(
            [
                prism(
                    "bracket",
                    0,
                    [(y, 0.12), (y, -0.08), (y - 0.16, 0.12)],
                    (w * 0.7, w * 0.7 + 0.02),
                )
            ]
        )
    rail = both_sides([box("rail", (0.16, 0.19), (-0.2, count * 0.36), (0.12, 0.135))])
    return parts + rail


def _corner(draw: Draw) -> list[Part]:
    r, h, rows = draw.between(0.35, 0.5), draw.between(1.2, 1.8), draw.whole(4, 6)
    arc = [(r * math.cos(a), -r * math.sin(a)) for a in np.linspace(0, math.pi / 2, 8)]
    shelves = [
        prism("shelf", 1, [(0, 0), *arc], (y, y + 0.02)) for y in board_levels(draw, 0.05, h, rows)
    ]
    return [
        *shelves,
        box("wall", (-BOARD, r), (0, h), (0, BOARD)),
        box("wall", (-BOARD, 0), (0, h), (-r, 0)),
    ]


def _revolving(draw: Draw) -> list[Part]:
    r, rows, rise = draw.between(0.22, 0.32), draw.whole(3, 5), draw.between(0.28, 0.34)
    plates = [
        lathe("plate", [(r, y), (r, y + 0.02)], draw.pick((16, 8)))
        for y in (0.1 + i * rise for i in range(rows + 1))
    ]
    fins = [
        block("fin", (0, 0.11 + (i + 0.5) * rise, 0), size)
        for i in range(rows)
        for size in ((1.9 * r, rise - 0.02, 0.015), (0.015, rise - 0.02, 1.9 * r))
    ]
    return [
        *plates,
        *fins,
        lathe("foot", [(0.8 * r, 0), (0.8 * r, 0.03), (0.06, 0.05), (0.06, 0.1)]),
    ]


def _honeycomb(draw: Draw) -> list[Part]:
    r, rows = draw.between(0.17, 0.22), draw.whole(3, 4)
    parts = []
    for i in range(rows):
        for j in range(3 - i % 2):
            x, y = (j - 1 + (i % 2) / 2) * r * math.sqrt(3), i * 1.5 * r + r
            shell = hoop("cell", [(r, -0.13), (r, 0.13), (r - 0.02, 0.13), (r - 0.02, -0.13)], 6)
            # The ring stands about y; turned into the plane its axis runs along z.
            turned = shell.vertices[:, [0, 2, 1]] * (1, 1, -1)
            parts.append(shell._replace(vertices=turned + (x, y, 0)))
    return parts


def _tower(draw: Draw) -> list[Part]:
    low, high, h, rows = draw.between(0.35, 0.5), draw.between(0.12, 0.25), 1.7, draw.whole(4, 6)
    sides = both_sides(
        [
            prism(
                "side", 2, [(low, 0), (high, h), (high - BOARD, h), (low - BOARD, 0)], (-0.15, 0.15)
            )
        ]
    )
    shelves = []
    for y in board_levels(draw, 0.04, h, rows):
        half = low + (high - low) * y / h - BOARD / 2
        shelves.append(box("shelf", (-half, half), (y, y + 0.02), (-0.15, 0.15)))
    return sides + shelves


def _room_divider(draw: Draw) -> list[Part]:
    """One thick panel with openings all through, of unlike sizes."""
    w, h, d = draw.between(0.6, 0.9), draw.between(1.2, 1.8), 0.15
    holes = []
    rows = draw.whole(3, 4)
    step = h / rows
    for j in range(rows):
        cut = -w + 2 * w * draw.between(0.3, 0.7)
        for a, b in ((-w, cut), (cut, w)):
            holes.append((a + BOARD, b - BOARD, j * step + BOARD, (j + 1) * step - BOARD))
    return [panel("body", 2, (-d, d), (-w, w), (0, h), holes)]


KINDS: tuple[Callable[[Draw], list[Part]], ...] = (
    *BOOKCASES,
    _ladder,
    _a_frame,
    _posts,
    _steps,
    _staggered,
    _zigzag,
    _floating,
    _corner,
    _revolving,
    _honeycomb,
    _tower,
    _room_divider,
    *BOOKCASES[:2],
    _posts,
)
