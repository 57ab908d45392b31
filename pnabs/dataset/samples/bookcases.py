"""Bookcases: boards between two sides."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides
from pnabs.dataset.samples.sheets import sheet
from pnabs.dataset.samples.solids import Span, block, box, rod, tube

BOARD = 0.025
"""Thickness of boards in metres."""


def _case(
    x: Span, y: Span, z: Span, levels: list[float], *, back: str, dividers: tuple[float, ...] = ()
) -> list[Part]:
    """Sides, boards at `levels`, uprights at `dividers` and a back: "board", "sheet", "none"."""
    parts = [box("side", (x[0], x[0] + BOARD), y, z), box("side", (x[1] - BOARD, x[1]), y, z)]
    parts += [
        box("shelf", (x[0] + BOARD, x[1] - BOARD), (level, level + BOARD), z) for level in levels
    ]
    parts += [
        box("divider", (at - BOARD / 2, at + BOARD / 2), (levels[0] + BOARD, levels[-1]), z)
        for at in dividers
    ]
    if back == "board":
        parts.append(box("back", x, y, (z[1], z[1] + 0.012)))
    elif back == "sheet":
        parts.append(
            sheet(
                "back",
                (x[0], y[0], z[1]),
                (x[0], y[1], z[1]),
                (x[1], y[1], z[1]),
                (x[1], y[0], z[1]),
            )
        )
    return parts


def board_levels(draw: Draw, low: float, high: float, count: int) -> list[float]:
    """Heights of `count` + 1 boards, evenly or growing downward."""
    share = np.linspace(0, 1, count + 1) ** draw.pick((1.0, 1.0, 0.85))
    return [low + (high - BOARD - low) * float(f) for f in share]


def _back(draw: Draw) -> str:
    return draw.cycle("back", ("board", "none", "sheet"))


def _books(draw: Draw, x: Span, y: Span, z: Span) -> list[Part]:
    """A row of books that ends somewhere along the shelf."""
    books, at = [], x[0] + 0.01
    end = x[0] + (x[1] - x[0]) * draw.between(0.4, 0.95)
    while at < end - 0.08:
        wide = draw.between(0.03, 0.07)
        high = (y[1] - y[0]) * draw.between(0.6, 0.9)
        books.append(
            box(
                "book",
                (at, at + wide),
                (y[0], y[0] + high),
                (z[0] + draw.between(0.02, 0.06), z[1] - 0.01),
            )
        )
        at += wide + 0.004
    return books


def _plain(draw: Draw) -> list[Part]:
    w, h, d = draw.between(0.3, 0.6), draw.between(1.2, 2.1), draw.between(0.13, 0.2)
    levels = board_levels(draw, 0.06, h, draw.whole(3, 6))
    return _case((-w, w), (0, h), (-d, d), levels, back=_back(draw))


def _grid(draw: Draw) -> list[Part]:
    columns, rows, cell = draw.whole(2, 5), draw.whole(2, 5), draw.between(0.3, 0.4)
    w, h, d = columns * cell / 2, rows * cell + BOARD, 0.18
    at = tuple(-w + cell * i for i in range(1, columns))
    return _case(
        (-w, w), (0, h), (-d, d), board_levels(draw, 0, h, rows), back=_back(draw), dividers=at
    )


def _with_books(draw: Draw) -> list[Part]:
    w, h, d = draw.between(0.35, 0.5), draw.between(1.0, 1.7), 0.14
    levels = board_levels(draw, 0.05, h, draw.whole(3, 4))
    parts = _case((-w, w), (0, h), (-d, d), levels, back="board")
    for low, high in itertools.pairwise(levels):
        parts += _books(draw, (-w + BOARD, w - BOARD), (low + BOARD, high), (-d, d))
    return parts


def _doors_below(draw: Draw) -> list[Part]:
    w, h, d = draw.between(0.4, 0.55), draw.between(1.6, 2.0), 0.18
    edge = h * draw.between(0.3, 0.42)
    levels = [0.08, edge, *board_levels(draw, edge + 0.35, h, draw.whole(2, 3))]
    parts = _case((-w, w), (0, h), (-d, d), levels, back="board")
    doors = [
        box("door", (0.004, w - 0.004), (0.09, edge), (-d - 0.02, -d)),
        block("knob", (0.04, edge * 0.6, -d - 0.03), (0.02, 0.08, 0.02)),
    ]
    return parts + both_sides(doors)


def _open_doors(draw: Draw) -> list[Part]:
    w, h, d = 0.45, draw.between(1.3, 1.8), 0.16
    levels = board_levels(draw, 0.04, h, draw.whole(3, 5))
    doors = both_sides([box("door", (w - BOARD, w), (0.02, h), (-d - w * 0.95, -d))])
    return _case((-w, w), (0, h), (-d, d), levels, back="board") + doors


def _library(draw: Draw) -> list[Part]:
    w, h, d = draw.between(0.8, 1.1), draw.between(1.9, 2.3), 0.17
    levels = board_levels(draw, 0.1, h - 0.1, draw.whole(4, 6))
    parts = _case((-w, w), (0, h - 0.08), (-d, d), levels, back="board", dividers=(-w / 3, w / 3))
    cornice = [
        box("cornice", (-w - 0.06, w + 0.06), (h - 0.08, h), (-d - 0.06, d + 0.012)),
        box("plinth", (-w - 0.03, w + 0.03), (0, 0.1), (-d - 0.03, d + 0.012)),
    ]
    path = [(-w * 0.5, 0, -d - 0.4), (-w * 0.5, h * 0.9, -d - 0.02)]
    steps = [tube("ladder", [(x + dx, y, z) for x, y, z in path], 0.02, 4) for dx in (-0.15, 0.15)]
    steps += [
        rod(
            "rung",
            (-w * 0.5 - 0.15, h * 0.9 * f, -d - 0.4 + 0.38 * f),
            (-w * 0.5 + 0.15, h * 0.9 * f, -d - 0.4 + 0.38 * f),
            0.012,
            sides=6,
        )
        for f in (0.15, 0.3, 0.45, 0.6, 0.75)
    ]
    return parts + cornice + (steps if draw.chance(0.6) else [])


def _drawers_below(draw: Draw) -> list[Part]:
    w, h, d, edge = draw.between(0.35, 0.5), draw.between(1.3, 1.8), 0.17, 0.42
    levels = [0.08, edge, *board_levels(draw, edge + 0.3, h, draw.whole(2, 4))]
    parts = _case((-w, w), (0.08, h), (-d, d), levels, back=_back(draw))
    parts += [
        box("drawer", (-w + BOARD, w - BOARD), (y, y + 0.15), (-d - 0.08 * i, -d + 0.02))
        for i, y in enumerate((0.11, 0.265))
    ]
    return parts + both_sides(
        [block("foot", (w - 0.05, 0.04, z), (0.06, 0.08, 0.06)) for z in (-d + 0.05, d - 0.05)]
    )


def _two_deep(draw: Draw) -> list[Part]:
    """Low case with a narrower one on top."""
    w, h, d = draw.between(0.45, 0.65), draw.between(0.6, 0.8), 0.22
    top = h + draw.between(0.6, 0.9)
    low = _case(
        (-w, w), (0, h), (-d, d), board_levels(draw, 0.06, h, 2), back="board", dividers=(0.0,)
    )
    inner = w * draw.between(0.55, 0.95)
    return low + _case(
        (-inner, inner),
        (h, top),
        (-0.02, d),
        board_levels(draw, h, top, draw.whole(2, 3)),
        back=_back(draw),
    )


def _sheets(draw: Draw) -> list[Part]:
    """A case of boards without any thickness."""
    w, h, d, rows = draw.between(0.3, 0.6), draw.between(0.9, 1.8), 0.16, draw.whole(3, 5)
    boards = [
        sheet("shelf", (-w, y, -d), (-w, y, d), (w, y, d), (w, y, -d))
        for y in np.linspace(0.04, h, rows + 1).tolist()
    ]
    sides = [sheet("side", (x, 0, -d), (x, 0, d), (x, h, d), (x, h, -d)) for x in (-w, w)]
    back = [sheet("back", (-w, 0, d), (w, 0, d), (w, h, d), (-w, h, d))]
    return boards + sides + (back if draw.chance(0.5) else [])


BOOKCASES: tuple[Callable[[Draw], list[Part]], ...] = (
    _plain,
    _grid,
    _with_books,
    _doors_below,
    _open_doors,
    _library,
    _drawers_below,
    _two_deep,
    _sheets,
)
"""Makers of bookcases."""
