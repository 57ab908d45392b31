"""Bookshelves: cases, ladders, steps, honeycombs and what stands in them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, reflected
from pnabs.dataset.samples.sheets import hoop, panel, sheet
from pnabs.dataset.samples.solids import Span, block, box, lathe, prism, rod, tube

T = 0.025
"""Thickness of boards in metres."""


def bookshelf(draw: Draw) -> list[Part]:
    """One bookshelf, its open front looking along -z."""
    return draw.kind(KINDS)(draw)


def _case(
    x: Span, y: Span, z: Span, levels: list[float], *, back: str, dividers: tuple[float, ...] = ()
) -> list[Part]:
    """Sides, boards at `levels`, uprights at `dividers` and a back: "board", "sheet", "none"."""
    parts = [box("side", (x[0], x[0] + T), y, z), box("side", (x[1] - T, x[1]), y, z)]
    parts += [box("shelf", (x[0] + T, x[1] - T), (level, level + T), z) for level in levels]
    parts += [box("divider", (at - T / 2, at + T / 2), (levels[0] + T, levels[-1]), z)
              for at in dividers]
    if back == "board":
        parts.append(box("back", x, y, (z[1], z[1] + 0.012)))
    elif back == "sheet":
        parts.append(sheet("back", (x[0], y[0], z[1]), (x[0], y[1], z[1]), (x[1], y[1], z[1]),
                           (x[1], y[0], z[1])))
    return parts


def _levels(draw: Draw, low: float, high: float, count: int) -> list[float]:
    """Heights of `count` + 1 boards, evenly or growing downward."""
    share = np.linspace(0, 1, count + 1) ** draw.pick((1.0, 1.0, 0.85))
    return [low + (high - T - low) * float(f) for f in share]


def _back(draw: Draw) -> str:
    return draw.cycle("back", ("board", "none", "sheet"))


def _books(draw: Draw, x: Span, y: Span, z: Span) -> list[Part]:
    """A row of books that ends somewhere along the shelf."""
    books, at = [], x[0] + 0.01
    end = x[0] + (x[1] - x[0]) * draw.between(0.4, 0.95)
    while at < end - 0.08:
        wide = draw.between(0.03, 0.07)
        high = (y[1] - y[0]) * draw.between(0.6, 0.9)
        books.append(box("book", (at, at + wide), (y[0], y[0] + high),
                         (z[0] + draw.between(0.02, 0.06), z[1] - 0.01)))
        at += wide + 0.004
    return books


def _plain(draw: Draw) -> list[Part]:
    w, h, d = draw.between(0.3, 0.6), draw.between(1.2, 2.1), draw.between(0.13, 0.2)
    levels = _levels(draw, 0.06, h, draw.whole(3, 6))
    return _case((-w, w), (0, h), (-d, d), levels, back=_back(draw))


def _grid(draw: Draw) -> list[Part]:
    columns, rows, cell = draw.whole(2, 5), draw.whole(2, 5), draw.between(0.3, 0.4)
    w, h, d = columns * cell / 2, rows * cell + T, 0.18
    at = tuple(-w + cell * i for i in range(1, columns))
    return _case((-w, w), (0, h), (-d, d), _levels(draw, 0, h, rows), back=_back(draw), dividers=at)


def _with_books(draw: Draw) -> list[Part]:
    w, h, d = draw.between(0.35, 0.5), draw.between(1.0, 1.7), 0.14
    levels = _levels(draw, 0.05, h, draw.whole(3, 4))
    parts = _case((-w, w), (0, h), (-d, d), levels, back="board")
    for low, high in zip(levels[:-1], levels[1:], strict=True):
        parts += _books(draw, (-w + T, w - T), (low + T, high), (-d, d))
    return parts


def _doors_below(draw: Draw) -> list[Part]:
    w, h, d = draw.between(0.4, 0.55), draw.between(1.6, 2.0), 0.18
    edge = h * draw.between(0.3, 0.42)
    levels = [0.08, edge, *_levels(draw, edge + 0.35, h, draw.whole(2, 3))]
    parts = _case((-w, w), (0, h), (-d, d), levels, back="board")
    doors = [box("door", (0.004, w - 0.004), (0.09, edge), (-d - 0.02, -d)),
             block("knob", (0.04, edge * 0.6, -d - 0.03), (0.02, 0.08, 0.02))]
    return parts + both_sides(doors)


def _open_doors(draw: Draw) -> list[Part]:
    w, h, d = 0.45, draw.between(1.3, 1.8), 0.16
    levels = _levels(draw, 0.04, h, draw.whole(3, 5))
    doors = both_sides([box("door", (w - T, w), (0.02, h), (-d - w * 0.95, -d))])
    return _case((-w, w), (0, h), (-d, d), levels, back="board") + doors


def _ladder(draw: Draw) -> list[Part]:
    w, h, foot, count = draw.between(0.3, 0.45), draw.between(1.6, 2.0), 0.25, draw.whole(4, 5)
    rails = both_sides([rod("rail", (w, 0, -foot), (w, h, 0.17), 0.025, sides=4)])
    parts = list(rails)
    for i in range(count):
        y = h * (0.12 + 0.8 * i / (count - 1))
        front = -foot + (foot + 0.17) * y / h
        parts += [box("shelf", (-w, w), (y, y + 0.02), (front, 0.2)),
                  box("lip", (-w, w), (y, y + 0.05), (0.19, 0.2))]
    return parts


def _a_frame(draw: Draw) -> list[Part]:
    w, h, reach, count = draw.between(0.3, 0.5), draw.between(1.3, 1.8), 0.32, draw.whole(3, 5)
    legs = both_sides([rod("leg", (w, 0, end * reach), (w, h, end * 0.04), 0.022, sides=4)
                       for end in (-1, 1)])
    shelves = []
    for i in range(count):
        y = h * (0.1 + 0.75 * i / (count - 1))
        deep = reach - (reach - 0.04) * y / h
        shelves.append(box("shelf", (-w, w), (y, y + 0.02), (-deep, deep)))
    return legs + shelves


def _posts(draw: Draw) -> list[Part]:
    w, h, d = draw.between(0.3, 0.5), draw.between(1.0, 1.9), draw.between(0.14, 0.22)
    posts = both_sides([rod("post", (w - 0.02, 0, end * (d - 0.02)), (w - 0.02, h, end * (d - 0.02)),
                            0.014, sides=8) for end in (-1, 1)])
    shelves = [box("shelf", (-w, w), (y, y + 0.015), (-d, d))
               for y in _levels(draw, 0.08, h - 0.02, draw.whole(3, 5))]
    if draw.chance(0.5):
        shelves.append(rod("cross", (-w + 0.02, 0.1, d - 0.02), (w - 0.02, h - 0.05, d - 0.02), 0.006,
                           sides=6))
        shelves.append(rod("cross", (w - 0.02, 0.1, d - 0.02), (-w + 0.02, h - 0.05, d - 0.02), 0.006,
                           sides=6))
    return posts + shelves


def _steps(draw: Draw) -> list[Part]:
    count, cell, side = draw.whole(3, 5), draw.between(0.3, 0.38), draw.pick((-1, 1))
    parts = []
    for i in range(count):
        x = ((i - count / 2) * cell, (i + 1 - count / 2) * cell)
        for j in range(count - i):
            y = (j * cell, (j + 1) * cell)
            frame = panel("cell", 2, (-0.17, 0.17), x, y, [(x[0] + T / 2, x[1] - T / 2,
                                                            y[0] + T / 2, y[1] - T / 2)])
            parts.append(frame)
    return parts if side > 0 else [reflected(part) for part in parts]


def _staggered(draw: Draw) -> list[Part]:
    w, rows, cell, d = draw.between(0.4, 0.6), draw.whole(3, 5), draw.between(0.28, 0.36), 0.15
    parts = [box("shelf", (-w, w), (i * cell, i * cell + T), (-d, d)) for i in range(rows + 1)]
    for i in range(rows):
        places = (-w * 0.7, w * 0.35) if i % 2 else (-w * 0.35, w * 0.7)
        parts += [block("upright", (x, (i + 0.5) * cell + T / 2, 0), (T, cell - T, 2 * d))
                  for x in places]
    return parts


def _zigzag(draw: Draw) -> list[Part]:
    w, rows, rise, d, t = draw.between(0.25, 0.4), draw.whole(4, 6), 0.3, 0.14, 0.03
    line = []
    for i in range(rows):
        line += [(-w, i * rise), (w, i * rise)] if i % 2 == 0 else [(w, i * rise), (-w, i * rise)]
    parts = []
    for (x0, y0), (x1, y1) in zip(line[:-1], line[1:], strict=True):
        parts.append(box("board", (min(x0, x1) - t / 2, max(x0, x1) + t / 2),
                         (min(y0, y1) - t / 2, max(y0, y1) + t / 2), (-d, d)))
    return parts


def _floating(draw: Draw) -> list[Part]:
    count, parts = draw.whole(3, 4), []
    for i in range(count):
        w = draw.between(0.25, 0.5)
        y = i * draw.between(0.3, 0.36)
        parts.append(box("shelf", (-w, w), (y, y + 0.03), (-0.12, 0.12)))
        parts += both_sides([prism("bracket", 0, [(y, 0.12), (y, -0.08), (y - 0.16, 0.12)],
                                   (w * 0.7, w * 0.7 + 0.02))])
    rail = both_sides([box("rail", (0.16, 0.19), (-0.2, count * 0.36), (0.12, 0.135))])
    return parts + rail


def _corner(draw: Draw) -> list[Part]:
    r, h, rows = draw.between(0.35, 0.5), draw.between(1.2, 1.8), draw.whole(4, 6)
    arc = [(r * math.cos(a), -r * math.sin(a)) for a in np.linspace(0, math.pi / 2, 8)]
    shelves = [prism("shelf", 1, [(0, 0), *arc], (y, y + 0.02)) for y in _levels(draw, 0.05, h, rows)]
    return [*shelves, box("wall", (-T, r), (0, h), (0, T)), box("wall", (-T, 0), (0, h), (-r, 0))]


def _revolving(draw: Draw) -> list[Part]:
    r, rows, rise = draw.between(0.22, 0.32), draw.whole(3, 5), draw.between(0.28, 0.34)
    plates = [lathe("plate", [(r, y), (r, y + 0.02)], draw.pick((16, 8)))
              for y in (0.1 + i * rise for i in range(rows + 1))]
    fins = [block("fin", (0, 0.11 + (i + 0.5) * rise, 0), size) for i in range(rows)
            for size in ((1.9 * r, rise - 0.02, 0.015), (0.015, rise - 0.02, 1.9 * r))]
    return [*plates, *fins, lathe("foot", [(0.8 * r, 0), (0.8 * r, 0.03), (0.06, 0.05), (0.06, 0.1)])]


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
    sides = both_sides([prism("side", 2, [(low, 0), (high, h), (high - T, h), (low - T, 0)],
                              (-0.15, 0.15))])
    shelves = []
    for y in _levels(draw, 0.04, h, rows):
        half = low + (high - low) * y / h - T / 2
        shelves.append(box("shelf", (-half, half), (y, y + 0.02), (-0.15, 0.15)))
    return sides + shelves


def _library(draw: Draw) -> list[Part]:
    w, h, d = draw.between(0.8, 1.1), draw.between(1.9, 2.3), 0.17
    levels = _levels(draw, 0.1, h - 0.1, draw.whole(4, 6))
    parts = _case((-w, w), (0, h - 0.08), (-d, d), levels, back="board", dividers=(-w / 3, w / 3))
    cornice = [box("cornice", (-w - 0.06, w + 0.06), (h - 0.08, h), (-d - 0.06, d + 0.012)),
               box("plinth", (-w - 0.03, w + 0.03), (0, 0.1), (-d - 0.03, d + 0.012))]
    path = [(-w * 0.5, 0, -d - 0.4), (-w * 0.5, h * 0.9, -d - 0.02)]
    steps = [tube("ladder", [(x + dx, y, z) for x, y, z in path], 0.02, 4) for dx in (-0.15, 0.15)]
    steps += [rod("rung", (-w * 0.5 - 0.15, h * 0.9 * f, -d - 0.4 + 0.38 * f),
                  (-w * 0.5 + 0.15, h * 0.9 * f, -d - 0.4 + 0.38 * f), 0.012, sides=6)
              for f in (0.15, 0.3, 0.45, 0.6, 0.75)]
    return parts + cornice + (steps if draw.chance(0.6) else [])


def _sheets(draw: Draw) -> list[Part]:
    """A case of boards without any thickness."""
    w, h, d, rows = draw.between(0.3, 0.6), draw.between(0.9, 1.8), 0.16, draw.whole(3, 5)
    boards = [sheet("shelf", (-w, y, -d), (-w, y, d), (w, y, d), (w, y, -d))
              for y in np.linspace(0.04, h, rows + 1).tolist()]
    sides = [sheet("side", (x, 0, -d), (x, 0, d), (x, h, d), (x, h, -d)) for x in (-w, w)]
    back = [sheet("back", (-w, 0, d), (w, 0, d), (w, h, d), (-w, h, d))]
    return boards + sides + (back if draw.chance(0.5) else [])


def _drawers_below(draw: Draw) -> list[Part]:
    w, h, d, edge = draw.between(0.35, 0.5), draw.between(1.3, 1.8), 0.17, 0.42
    levels = [0.08, edge, *_levels(draw, edge + 0.3, h, draw.whole(2, 4))]
    parts = _case((-w, w), (0.08, h), (-d, d), levels, back=_back(draw))
    parts += [box("drawer", (-w + T, w - T), (y, y + 0.15), (-d - 0.08 * i, -d + 0.02))
              for i, y in enumerate((0.11, 0.265))]
    return parts + both_sides([block("foot", (w - 0.05, 0.04, z), (0.06, 0.08, 0.06))
                               for z in (-d + 0.05, d - 0.05)])


def _two_deep(draw: Draw) -> list[Part]:
    """Low case with a narrower one on top."""
    w, h, d = draw.between(0.45, 0.65), draw.between(0.6, 0.8), 0.22
    top = h + draw.between(0.6, 0.9)
    low = _case((-w, w), (0, h), (-d, d), _levels(draw, 0.06, h, 2), back="board", dividers=(0.0,))
    inner = w * draw.between(0.55, 0.95)
    return low + _case((-inner, inner), (h, top), (-0.02, d), _levels(draw, h, top, draw.whole(2, 3)),
                       back=_back(draw))


def _room_divider(draw: Draw) -> list[Part]:
    """One thick panel with openings all through, of unlike sizes."""
    w, h, d = draw.between(0.6, 0.9), draw.between(1.2, 1.8), 0.15
    holes = []
    rows = draw.whole(3, 4)
    step = h / rows
    for j in range(rows):
        cut = -w + 2 * w * draw.between(0.3, 0.7)
        for a, b in ((-w, cut), (cut, w)):
            holes.append((a + T, b - T, j * step + T, (j + 1) * step - T))
    return [panel("body", 2, (-d, d), (-w, w), (0, h), holes)]


KINDS: tuple[Callable[[Draw], list[Part]], ...] = (
    _plain, _grid, _with_books, _doors_below, _open_doors, _ladder, _a_frame, _posts, _steps,
    _staggered, _zigzag, _floating, _corner, _revolving, _honeycomb, _tower, _library, _sheets,
    _drawers_below, _two_deep, _room_divider, _plain, _grid, _posts,
)
