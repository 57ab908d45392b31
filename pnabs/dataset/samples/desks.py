"""Desks and workbenches."""

from __future__ import annotations

from collections.abc import Callable

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides
from pnabs.dataset.samples.solids import Span, block, box, lathe, prism


def corners(w: float, d: float) -> list[tuple[float, float]]:
    """The four corners (x, z) of a rectangle about the origin."""
    return [(x, z) for x in (-w, w) for z in (-d, d)]


def _drawers(x: Span, y: Span, z: Span, count: int) -> list[Part]:
    """A chest whose drawers stand a little open at -z."""
    t, step = 0.02, (y[1] - y[0] - 0.04) / count
    parts = [box("carcass", x, y, z, without=("-z",))]
    for i in range(count):
        low = y[0] + 0.02 + i * step
        parts += [
            box(
                "drawer",
                (x[0] + t, x[1] - t),
                (low + 0.01, low + step - 0.01),
                (z[0] - t, z[0] + 0.01),
            ),
            block(
                "knob", ((x[0] + x[1]) / 2, low + step / 2, z[0] - t - 0.012), (0.06, 0.015, 0.025)
            ),
        ]
    return parts


def _desk(draw: Draw) -> list[Part]:
    w, d, h = draw.between(0.6, 0.85), draw.between(0.3, 0.4), 0.74
    inner, count = w - draw.between(0.3, 0.42), draw.whole(2, 4)
    chest = _drawers(
        (inner, w - 0.01), (draw.pick((0.02, 0.12)), h - 0.035), (-d + 0.03, d - 0.02), count
    )
    far: list[Part]
    if draw.chance(0.4):
        far = [
            block("leg", (-w + 0.04, h / 2, z), (0.05, h - 0.04, 0.05))
            for z in (-d + 0.04, d - 0.04)
        ]
        if chest[0].vertices[:, 1].min() > 0.1:
            far += [
                block("leg", (x, 0.06, z), (0.04, 0.12, 0.04))
                for x in (inner + 0.04, w - 0.05)
                for z in (-d + 0.07, d - 0.07)
            ]
    else:
        chest = _drawers((inner, w - 0.01), (0.02, h - 0.035), (-d + 0.03, d - 0.02), count)
        far = [
            box("side", (-w, -w + 0.03), (0, h - 0.035), (-d, d)),
            box("modesty", (-w + 0.03, inner), (h * 0.4, h - 0.035), (d - 0.05, d - 0.03)),
        ]
    return [box("top", (-w, w), (h - 0.035, h), (-d, d)), *chest, *far]


def _double_desk(draw: Draw) -> list[Part]:
    w, d, h = draw.between(0.75, 0.95), draw.between(0.35, 0.45), 0.76
    inner = w - draw.between(0.32, 0.42)
    chest = _drawers((inner, w - 0.02), (0.0, h - 0.04), (-d + 0.02, d - 0.02), draw.whole(3, 4))
    return [
        box("top", (-w, w), (h - 0.04, h), (-d, d)),
        *both_sides(chest),
        box("rear", (-inner, inner), (0.2, h - 0.04), (d - 0.05, d - 0.03)),
    ]


def _hutch(draw: Draw) -> list[Part]:
    base, high = _desk(draw), draw.between(0.45, 0.65)
    w = float(base[0].vertices[:, 0].max())
    d = float(base[0].vertices[:, 2].max())
    z, h = (d - 0.24, d), float(base[0].vertices[:, 1].max())
    shelves = [
        box("shelf", (-w + 0.025, w - 0.025), (h + high * f - 0.02, h + high * f), z)
        for f in (0.45, 1.0)
    ]
    return [
        *base,
        *both_sides([box("hutch_side", (w - 0.025, w), (h, h + high), z)]),
        *shelves,
        block("divider", (0, h + high * 0.7, d - 0.12), (0.02, high * 0.5, 0.22)),
    ]


def _l_desk(draw: Draw) -> list[Part]:
    w, h, side = 0.8, 0.74, draw.pick((-1, 1))
    outline = [(-w, 0.35), (w, 0.35), (w, -1.0), (w - 0.55, -1.0), (w - 0.55, -0.25), (-w, -0.25)]
    posts = [
        (-w + 0.05, 0.3),
        (-w + 0.05, -0.2),
        (w - 0.05, 0.3),
        (w - 0.05, -0.95),
        (w - 0.5, -0.95),
    ]
    parts = [prism("top", 1, [(side * x, z) for x, z in outline], (h - 0.03, h))]
    return parts + [
        lathe("leg", [(0.025, 0), (0.03, h - 0.03)], 8, (side * x, 0, z)) for x, z in posts
    ]


def _workbench(draw: Draw) -> list[Part]:
    w, d, h = draw.between(0.7, 1.0), 0.35, 0.85
    legs = [block("leg", (x, h / 2, z), (0.09, h, 0.09)) for x, z in corners(w - 0.12, d - 0.06)]
    return [
        box("top", (-w, w), (h, h + 0.07), (-d, d)),
        *legs,
        box("shelf", (-w + 0.1, w - 0.1), (0.15, 0.18), (-d + 0.04, d - 0.04)),
        box("backboard", (-w, w), (h + 0.07, h + draw.between(0.3, 0.7)), (d - 0.03, d)),
        block("vice", (-w * 0.7, h - 0.05, -d - 0.06), (0.2, 0.12, 0.12)),
    ]


DESKS: tuple[Callable[[Draw], list[Part]], ...] = (
    _desk,
    _double_desk,
    _hutch,
    _l_desk,
    _workbench,
)
"""Makers of desks."""
