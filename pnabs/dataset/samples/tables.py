"""Tables and desks."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, moved, reflected, turned
from pnabs.dataset.samples.sheets import hoop, panel, sheet
from pnabs.dataset.samples.solids import Span, block, box, circle, lathe, prism, rod, tube


def table(draw: Draw) -> list[Part]:
    """One table, its long side along x."""
    return draw.kind(KINDS)(draw)


def _size(draw: Draw) -> tuple[float, float, float]:
    return draw.between(0.45, 0.95), draw.between(0.3, 0.48), draw.between(0.68, 0.78)


def _top(draw: Draw, w: float, d: float, h: float) -> list[Part]:
    """A rectangular top: board, planks, pane without thickness, or with cut corners."""
    kind, t = draw.cycle("top", ("board", "planks", "pane", "cut corners")), 0.035
    if kind == "planks":
        count = draw.whole(4, 7)
        step = 2 * d / count
        return [block("plank", (0, h - t / 2, (i + 0.5) * step - d), (2 * w, t, step * 0.9))
                for i in range(count)]
    if kind == "pane":
        frame = panel("frame", 1, (h - t, h), (-w, w), (-d, d),
                      [(-w + 0.07, w - 0.07, -d + 0.07, d - 0.07)])
        y, a, b = h - t / 2, w - 0.07, d - 0.07
        return [frame, sheet("pane", (-a, y, -b), (-a, y, b), (a, y, b), (a, y, -b))]
    if kind == "cut corners":
        c = 0.12
        outline = [(-w + c, -d), (w - c, -d), (w, -d + c), (w, d - c), (w - c, d), (-w + c, d),
                   (-w, d - c), (-w, -d + c)]
        return [prism("top", 1, outline, (h - t, h))]
    return [box("top", (-w, w), (h - t, h), (-d, d))]


def _corners(w: float, d: float) -> list[tuple[float, float]]:
    return [(x, z) for x in (-w, w) for z in (-d, d)]


def _four_legs(draw: Draw) -> list[Part]:
    w, d, h = _size(draw)
    t = draw.between(0.05, 0.1)
    legs = [block("leg", (x, (h - 0.035) / 2, z), (t, h - 0.035, t))
            for x, z in _corners(w - t, d - t)]
    apron = [*[box("apron", (-w + t, w - t), (h - 0.13, h - 0.035), (z - 0.012, z + 0.012))
               for z in (-d + t, d - t)],
             *both_sides([box("apron", (w - t - 0.012, w - t + 0.012), (h - 0.13, h - 0.035),
                              (-d + t, d - t))])]
    return _top(draw, w, d, h) + legs + apron


def _turned_legs(draw: Draw) -> list[Part]:
    w, d, h = _size(draw)
    profile = [(0.02, 0), (0.035, 0.08), (0.022, 0.14), (0.045, h * 0.45), (0.025, h * 0.6),
               (0.04, h * 0.66), (0.04, h - 0.03)]
    legs = [lathe("leg", profile, 10, (x, 0, z)) for x, z in _corners(w - 0.07, d - 0.07)]
    return _top(draw, w, d, h) + legs


def _low_with_shelf(draw: Draw) -> list[Part]:
    w, d, h = draw.between(0.4, 0.7), draw.between(0.25, 0.4), draw.between(0.38, 0.5)
    level = h * draw.between(0.25, 0.5)
    legs = [block("leg", (x, h / 2 - 0.02, z), (0.045, h - 0.035, 0.045))
            for x, z in _corners(w - 0.03, d - 0.03)]
    return [*_top(draw, w, d, h), *legs,
            box("shelf", (-w + 0.02, w - 0.02), (level, level + 0.02), (-d + 0.02, d - 0.02))]


def _trestle(draw: Draw) -> list[Part]:
    w, d, h = _size(draw)
    x = w * 0.7
    ends = [rod("leg", (x, h - 0.03, end * 0.08), (x, 0, end * (d - 0.04)), 0.03, sides=4)
            for end in (-1, 1)]
    cross = block("cross", (x, h * 0.45, 0), (0.03, 0.06, d))
    return [*_top(draw, w, d, h), *both_sides([*ends, cross]),
            block("beam", (0, h * 0.45, 0), (2 * x, 0.05, 0.03))]


def _round_pedestal(draw: Draw) -> list[Part]:
    r, h = draw.between(0.4, 0.65), draw.between(0.68, 0.76)
    top = lathe("top", [(r, h - 0.03), (r, h)], 24)
    profile = [(r * 0.55, 0), (r * 0.55, 0.02), (0.05, 0.09), (0.035, h * 0.5), (0.06, h - 0.1),
               (0.14, h - 0.03)]
    return [top, lathe("column", profile, 14)]


def _clawed(draw: Draw) -> list[Part]:
    r, h, feet = draw.between(0.35, 0.6), draw.between(0.6, 0.74), draw.pick((3, 4))
    top = lathe("top", [(r, h - 0.025), (r, h)], draw.pick((6, 8, 20)))
    claws = []
    for a in (2 * math.pi * (i + 0.5) / feet for i in range(feet)):
        c, s = math.sin(a), math.cos(a)
        path = [(0.02 * c, 0.3, 0.02 * s), (0.4 * r * c, 0.25, 0.4 * r * s),
                (0.75 * r * c, 0.02, 0.75 * r * s), (0.9 * r * c, 0.02, 0.9 * r * s)]
        claws.append(tube("claw", path, (0.03, 0.028, 0.022, 0.018), 6))
    return [top, rod("column", (0, 0.22, 0), (0, h - 0.02, 0), 0.045, 0.03), *claws]


def _double_pedestal(draw: Draw) -> list[Part]:
    w, d, h = draw.between(0.8, 1.2), draw.between(0.4, 0.5), 0.75
    outline = circle(24) * (w, d)
    top = prism("top", 1, outline, (h - 0.04, h))
    post = [block("post", (w * 0.5, h / 2, 0), (0.1, h - 0.05, 0.18)),
            block("foot", (w * 0.5, 0.03, 0), (0.14, 0.06, 1.5 * d)),
            block("head", (w * 0.5, h - 0.06, 0), (0.12, 0.05, 1.2 * d))]
    return [top, *both_sides(post)]


def _drawers(x: Span, y: Span, z: Span, count: int) -> list[Part]:
    """A chest whose drawers stand a little open at -z."""
    t, step = 0.02, (y[1] - y[0] - 0.04) / count
    parts = [box("carcass", x, y, z, without=("-z",))]
    for i in range(count):
        low = y[0] + 0.02 + i * step
        parts += [box("drawer", (x[0] + t, x[1] - t), (low + 0.01, low + step - 0.01),
                      (z[0] - t, z[0] + 0.01)),
                  block("knob", ((x[0] + x[1]) / 2, low + step / 2, z[0] - t - 0.012),
                        (0.06, 0.015, 0.025))]
    return parts


def _desk(draw: Draw) -> list[Part]:
    w, d, h = draw.between(0.6, 0.85), draw.between(0.3, 0.4), 0.74
    inner, count = w - draw.between(0.3, 0.42), draw.whole(2, 4)
    chest = _drawers((inner, w - 0.01), (draw.pick((0.02, 0.12)), h - 0.035), (-d + 0.03, d - 0.02),
                     count)
    far: list[Part]
    if draw.chance(0.4):
        far = [block("leg", (-w + 0.04, h / 2, z), (0.05, h - 0.04, 0.05))
               for z in (-d + 0.04, d - 0.04)]
        if chest[0].vertices[:, 1].min() > 0.1:
            far += [block("leg", (x, 0.06, z), (0.04, 0.12, 0.04)) for x in (inner + 0.04, w - 0.05)
                    for z in (-d + 0.07, d - 0.07)]
    else:
        chest = _drawers((inner, w - 0.01), (0.02, h - 0.035), (-d + 0.03, d - 0.02), count)
        far = [box("side", (-w, -w + 0.03), (0, h - 0.035), (-d, d)),
               box("modesty", (-w + 0.03, inner), (h * 0.4, h - 0.035), (d - 0.05, d - 0.03))]
    return [box("top", (-w, w), (h - 0.035, h), (-d, d)), *chest, *far]


def _double_desk(draw: Draw) -> list[Part]:
    w, d, h = draw.between(0.75, 0.95), draw.between(0.35, 0.45), 0.76
    inner = w - draw.between(0.32, 0.42)
    chest = _drawers((inner, w - 0.02), (0.0, h - 0.04), (-d + 0.02, d - 0.02), draw.whole(3, 4))
    return [box("top", (-w, w), (h - 0.04, h), (-d, d)), *both_sides(chest),
            box("rear", (-inner, inner), (0.2, h - 0.04), (d - 0.05, d - 0.03))]


def _hutch(draw: Draw) -> list[Part]:
    base, high = _desk(draw), draw.between(0.45, 0.65)
    w = float(base[0].vertices[:, 0].max())
    d = float(base[0].vertices[:, 2].max())
    z, h = (d - 0.24, d), float(base[0].vertices[:, 1].max())
    shelves = [box("shelf", (-w + 0.025, w - 0.025), (h + high * f - 0.02, h + high * f), z)
               for f in (0.45, 1.0)]
    return [*base, *both_sides([box("hutch_side", (w - 0.025, w), (h, h + high), z)]), *shelves,
            block("divider", (0, h + high * 0.7, d - 0.12), (0.02, high * 0.5, 0.22))]


def _waterfall(draw: Draw) -> list[Part]:
    w, d, h = draw.between(0.4, 0.7), draw.between(0.2, 0.4), draw.between(0.4, 0.72)
    t = draw.between(0.03, 0.08)
    outline = [(-w, 0), (-w, h), (w, h), (w, 0), (w - t, 0), (w - t, h - t), (-w + t, h - t),
               (-w + t, 0)]
    return [prism("sheet", 2, outline, (-d, d))]


def _cube(draw: Draw) -> list[Part]:
    s, t = draw.between(0.2, 0.3), 0.03
    y = (0, 2 * s)
    sides = [panel("side", 2, (z, z + math.copysign(t, -z)), (-s, s), y,
                   [(-s + 0.08, s - 0.08, 0.08, 2 * s - 0.08)]) for z in (-s, s)]
    return [*sides, *both_sides([panel("side", 0, (s - t, s), y, (-s + t, s - t))]),
            box("top", (-s - 0.01, s + 0.01), (2 * s, 2 * s + 0.03), (-s - 0.01, s + 0.01))]


def _nested(draw: Draw) -> list[Part]:
    parts = []
    for i in range(draw.whole(2, 3)):
        w, d, h = 0.42 - 0.08 * i, 0.28 - 0.03 * i, 0.55 - 0.09 * i
        z = -0.13 * i
        parts += [block("top", (0, h, z), (2 * w, 0.02, 2 * d)),
                  *[block("leg", (x, h / 2, z + c), (0.025, h, 0.025))
                    for x, c in _corners(w - 0.02, d - 0.02)]]
    return parts


def _crossed(draw: Draw) -> list[Part]:
    w, d, h = _size(draw)
    x = w * draw.between(0.6, 0.85)
    legs = [rod("leg", (x, h - 0.03, end * (d - 0.05)), (x, 0, -end * (d - 0.05)), 0.035, sides=4)
            for end in (-1, 1)]
    return [*_top(draw, w, d, h), *both_sides(legs),
            rod("stretcher", (-x, h / 2 - 0.015, 0), (x, h / 2 - 0.015, 0), 0.02, sides=6)]


def _hairpin(draw: Draw) -> list[Part]:
    w, d, h = draw.between(0.4, 0.8), draw.between(0.25, 0.4), draw.between(0.4, 0.74)
    pins = []
    for end in (-1, 1):
        x, z = w - 0.08, end * (d - 0.08)
        pins.append(tube("hairpin", [(x - 0.06, h - 0.03, z), (x + 0.04, 0.008, z + end * 0.04),
                                     (x, h - 0.03, z - end * 0.06)], 0.008, 6))
    return [*_top(draw, w, d, h), *both_sides(pins)]


def _picnic(draw: Draw) -> list[Part]:
    w, h = draw.between(0.75, 1.0), 0.74
    if draw.variant("picnic", ("long", "round")) == "round":
        return _round_picnic(h)
    boards = [block("board", (0, h, (i - 2) * 0.15), (2 * w, 0.03, 0.14)) for i in range(5)]
    seats = [block("seat", (0, 0.44, z), (2 * w, 0.03, 0.25)) for z in (-0.65, 0.65)]
    frame = [*[rod("leg", (w * 0.7, h - 0.02, end * 0.2), (w * 0.7, 0, end * 0.6), 0.035, sides=4)
               for end in (-1, 1)],
             block("bearer", (w * 0.7, 0.4, 0), (0.04, 0.09, 1.5)),
             block("bearer", (w * 0.7, h - 0.05, 0), (0.04, 0.07, 0.7))]
    return boards + seats + both_sides(frame)


def _round_picnic(h: float) -> list[Part]:
    parts = [lathe("top", [(0.6, h - 0.04), (0.6, h)], 8, phase=0.5), rod("column", (0, 0, 0), (0, h, 0), 0.06)]
    for i in range(4):
        seat = [lathe("seat", [(0.2, 0.42), (0.2, 0.46)], 12, (0, 0, -0.95)),
                tube("arm", [(0, 0.3, 0), (0, 0.2, -0.6), (0, 0.42, -0.95)], 0.03, 6),
                rod("foot", (0, 0.02, 0), (0, 0.02, -0.8), 0.03, sides=4)]
        parts += [turned(part, 1, 45 + 90 * i) for part in seat]
    return parts


def _ping_pong(draw: Draw) -> list[Part]:
    w, d, h = 1.37, 0.76, 0.76
    half = box("half", (0.01, w), (h - 0.025, h), (-d, d))
    folded = draw.variant("fold", (False, True))
    halves = [reflected(half), turned(half, 2, 85, (0.01, h, 0)) if folded else half]
    net = sheet("net", (0, h, -d - 0.1), (0, h, d + 0.1), (0, h + 0.15, d + 0.1),
                (0, h + 0.15, -d - 0.1))
    far = draw.between(0.8, 1.1)
    legs = [tube("frame", [(x, h - 0.02, -d * 0.8), (x, 0.02, -d * 0.8), (x, 0.02, d * 0.8),
                           (x, h - 0.02, d * 0.8)], 0.02, 6)
            for x in ((-far, -0.25, 0.1) if folded else (-far, -0.25, 0.25, far))]
    return [*halves, net, *legs]


def _workbench(draw: Draw) -> list[Part]:
    w, d, h = draw.between(0.7, 1.0), 0.35, 0.85
    legs = [block("leg", (x, h / 2, z), (0.09, h, 0.09)) for x, z in _corners(w - 0.12, d - 0.06)]
    return [box("top", (-w, w), (h, h + 0.07), (-d, d)), *legs,
            box("shelf", (-w + 0.1, w - 0.1), (0.15, 0.18), (-d + 0.04, d - 0.04)),
            box("backboard", (-w, w), (h + 0.07, h + draw.between(0.3, 0.7)), (d - 0.03, d)),
            block("vice", (-w * 0.7, h - 0.05, -d - 0.06), (0.2, 0.12, 0.12))]


def _side_c(draw: Draw) -> list[Part]:
    w, d, h = 0.22, 0.2, draw.between(0.55, 0.68)
    post = [tube("post", [(w, h, z), (w, 0.015, z), (-w, 0.015, z)], 0.016, 6)
            for z in (-d + 0.02, d - 0.02)]
    return [box("top", (-w, w + 0.01), (h, h + 0.03), (-d, d)), *post]


def _l_desk(draw: Draw) -> list[Part]:
    w, h, side = 0.8, 0.74, draw.pick((-1, 1))
    outline = [(-w, 0.35), (w, 0.35), (w, -1.0), (w - 0.55, -1.0), (w - 0.55, -0.25), (-w, -0.25)]
    posts = [(-w + 0.05, 0.3), (-w + 0.05, -0.2), (w - 0.05, 0.3), (w - 0.05, -0.95),
             (w - 0.5, -0.95)]
    parts = [prism("top", 1, [(side * x, z) for x, z in outline], (h - 0.03, h))]
    return parts + [lathe("leg", [(0.025, 0), (0.03, h - 0.03)], 8, (side * x, 0, z))
                    for x, z in posts]


def _tripod_glass(draw: Draw) -> list[Part]:
    r, h = draw.between(0.35, 0.55), draw.between(0.4, 0.6)
    rim = hoop("rim", [(r - 0.02, h), (r, h), (r, h + 0.025), (r - 0.02, h + 0.025)], 24)
    unit = circle(24, 0.5) * (r - 0.02)
    pane = sheet("glass", *[(x, h + 0.012, z) for x, z in unit[::-1]])
    turn = draw.between(0, 1)
    legs = [rod("leg", (0.9 * r * math.sin(a), h, 0.9 * r * math.cos(a)),
                (0.7 * r * math.sin(a + 2), 0, 0.7 * r * math.cos(a + 2)), 0.014, sides=8)
            for a in (2 * math.pi * i / 3 + turn for i in range(3))]
    return [rim, pane, *legs]


def _drop_leaf(draw: Draw) -> list[Part]:
    w, d, h = 0.3, draw.between(0.35, 0.5), 0.74
    leaf = box("leaf", (w + 0.005, w + 0.025), (h - draw.between(0.3, 0.45), h), (-d, d))
    legs = both_sides([lathe("leg", [(0.02, 0), (0.03, h * 0.5), (0.03, h - 0.02)], 8,
                             (w - 0.04, 0, z)) for z in (-d + 0.05, d - 0.05)])
    return [box("top", (-w, w), (h - 0.02, h), (-d, d)), *both_sides([leaf]), *legs,
            box("apron", (-w + 0.03, w - 0.03), (h - 0.13, h - 0.02), (-d + 0.04, d - 0.04))]


def _console(draw: Draw) -> list[Part]:
    w, d, h = draw.between(0.5, 0.75), 0.17, 0.82
    arc = [(h * 0.5 - 0.03 + 0.42 * h * math.sin(a), d * 0.3 * math.cos(a))
           for a in np.linspace(math.pi / 2, -math.pi / 2, 7)]
    path = [(w - 0.04, y, -d * 0.3 - z) for y, z in arc]
    return [*_top(draw, w, d, h), *both_sides([tube("leg", path, 0.02, 6),
                                               moved(tube("leg", path, 0.02, 6), (0, 0, 2 * d * 0.6))]),
            box("shelf", (-w + 0.02, w - 0.02), (0.05, 0.075), (-d, d)),
            block("drawer", (0, h - 0.09, 0), (1.6 * w, 0.1, 1.7 * d))]


KINDS: tuple[Callable[[Draw], list[Part]], ...] = (
    _four_legs, _turned_legs, _low_with_shelf, _trestle, _round_pedestal, _clawed,
    _double_pedestal, _desk, _double_desk, _hutch, _waterfall, _cube, _nested, _crossed, _hairpin,
    _picnic, _ping_pong, _workbench, _side_c, _l_desk, _tripod_glass, _drop_leaf, _console,
)
