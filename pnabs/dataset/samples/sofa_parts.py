"""Seats, feet, backs and armrests of sofas."""

from __future__ import annotations

import math

import numpy as np

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, moved, turned
from pnabs.dataset.samples.sheets import panel
from pnabs.dataset.samples.solids import Span, block, box, prism, rod, tube

FEET = ("plinth", "legs", "blocks", "tall legs", "runners", "none")


class Plan:
    """Measures of one sofa, front towards -z.

    Attributes
    ----------
    half, depth : float
        Half the inner width, and depth of the seat with its back.
    floor, seat, top : float
        Heights of underside, seat and top of the back.
    arm, back : float
        Thickness of armrest and back.
    """

    def __init__(self, draw: Draw) -> None:
        self.half = draw.between(0.5, 1.05)
        self.depth = draw.between(0.75, 0.95)
        self.feet = draw.cycle("feet", FEET)
        low = {"tall legs": (0.18, 0.24), "none": (0.0, 0.0), "plinth": (0.06, 0.06)}
        self.floor = draw.between(*low.get(self.feet, (0.09, 0.13)))
        self.seat = self.floor + draw.between(0.2, 0.28)
        self.top = self.seat + draw.between(0.3, 0.5)
        self.arm = draw.between(0.1, 0.22)
        self.back = draw.between(0.12, 0.22)
        self.cushions = draw.whole(1, 3)


def sofa_seat(draw: Draw, p: Plan, x: Span) -> list[Part]:
    """Base, cushions and feet between two ends along x."""
    front, rear = -p.depth / 2, p.depth / 2
    middle = p.floor + (p.seat - p.floor) * 0.5
    parts = [box("base", x, (p.floor, middle), (front, rear))]
    step = (x[1] - x[0]) / p.cushions
    for i in range(p.cushions):
        low = x[0] + i * step
        parts.append(
            box(
                "seat_cushion",
                (low + 0.008, low + step - 0.008),
                (middle - 0.005, p.seat),
                (front - 0.015, rear - p.back),
            )
        )
    return parts + _feet(draw, p, x, (front, rear))


def _feet(draw: Draw, p: Plan, x: Span, z: Span) -> list[Part]:
    if p.feet == "none":
        return []
    if p.feet == "plinth":
        return [box("plinth", (x[0] + 0.06, x[1] - 0.06), (0, p.floor), (z[0] + 0.06, z[1] - 0.06))]
    ends = [(a, c) for a in (x[0] + 0.08, x[1] - 0.08) for c in (z[0] + 0.08, z[1] - 0.08)]
    if p.feet == "legs":
        return [
            rod("foot", (a, p.floor, c), (a * 1.02, 0, c * 1.05), 0.03, 0.015, 8) for a, c in ends
        ]
    if p.feet == "tall legs":
        return [block("leg", (a, p.floor / 2, c), (0.04, p.floor, 0.04)) for a, c in ends]
    if p.feet == "runners":
        loop = [
            (0, p.floor, z[0] + 0.05),
            (0, 0.012, z[0] + 0.05),
            (0, 0.012, z[1] - 0.05),
            (0, p.floor, z[1] - 0.05),
        ]
        return [moved(tube("runner", loop, 0.014, 6), (a, 0, 0)) for a in (x[0] + 0.1, x[1] - 0.1)]
    return [block("foot", (a, p.floor / 2, c), (0.1, p.floor, 0.1)) for a, c in ends]


def sofa_back(draw: Draw, kind: str, p: Plan) -> list[Part]:
    """The back of a straight sofa, of one of seven kinds."""
    w, rear, deep = p.half, p.depth / 2, p.back
    z = (rear - deep, rear)
    if kind == "low":
        return [box("back", (-w, w), (p.floor, p.seat + 0.16), z)]
    if kind == "camel":
        line = [
            (a, p.seat + (p.top - p.seat) * (0.6 + 0.4 * math.cos(a / w * math.pi / 2)))
            for a in np.linspace(-w, w, 13)
        ]
        return [prism("back", 2, [(-w, p.floor), (w, p.floor), *reversed(line)], z)]
    if kind == "slats":
        count = draw.whole(6, 12)
        step = 2 * w / count
        return [box("rail", (-w, w), (p.top - 0.06, p.top), (rear - 0.05, rear))] + [
            block(
                "slat",
                ((i + 0.5) * step - w, (p.floor + p.top) / 2 - 0.03, rear - 0.025),
                (step * 0.35, p.top - p.floor - 0.06, 0.03),
            )
            for i in range(count)
        ]
    if kind == "split":
        gap = 0.05
        return [
            panel("back", 2, z, (-w, w), (p.floor, p.top), [(-gap, gap, p.seat + 0.02, p.top + 1)])
        ]
    if kind == "rolled":
        return [
            box("back", (-w, w), (p.floor, p.top - 0.06), (rear - deep * 0.6, rear)),
            rod(
                "roll",
                (-w, p.top - 0.08, rear - deep * 0.3),
                (w, p.top - 0.08, rear - deep * 0.3),
                deep * 0.55,
                sides=12,
            ),
        ]
    if kind == "cushions":
        step = 2 * w / p.cushions
        lean = draw.between(8, 18)
        frame = [box("back_frame", (-w, w), (p.floor, p.top - 0.12), (rear - 0.06, rear))]
        for i in range(p.cushions):
            low = -w + i * step
            cushion = box(
                "back_cushion",
                (low + 0.01, low + step - 0.01),
                (p.seat, p.top),
                (rear - deep - 0.02, rear - 0.05),
            )
            frame.append(turned(cushion, 0, lean, (0, p.seat, rear - 0.1)))
        return frame
    return [box("back", (-w, w), (p.floor, p.top), z)]


def sofa_arms(kind: str, p: Plan) -> list[Part]:
    """Both armrests, of one of seven kinds; none for "none"."""
    w, t, front, rear = p.half, p.arm, -p.depth / 2, p.depth / 2
    rest = p.seat + (p.top - p.seat) * 0.5
    if kind == "box":
        parts = [box("arm", (w, w + t), (p.floor, rest), (front, rear))]
    elif kind == "low":
        parts = [box("arm", (w, w + t * 1.4), (p.floor, p.seat + 0.05), (front, rear))]
    elif kind == "thin":
        parts = [box("arm", (w, w + 0.05), (p.floor * 0.3, p.top * 0.92), (front, rear))]
    elif kind == "round":
        parts = [
            box("arm", (w, w + t * 0.8), (p.floor, rest), (front, rear)),
            rod(
                "arm_roll",
                (w + t * 0.5, rest, front - 0.01),
                (w + t * 0.5, rest, rear),
                t * 0.6,
                sides=12,
            ),
        ]
    elif kind == "frame":
        parts = [
            panel(
                "arm",
                0,
                (w, w + 0.05),
                (0, rest),
                (front, rear),
                [(p.floor + 0.02, rest - 0.05, front + 0.06, rear - 0.06)],
            )
        ]
    elif kind == "flared":
        outline = [
            (w, p.floor),
            (w + t * 0.5, p.floor),
            (w + t * 1.6, rest + 0.05),
            (w + t * 0.8, rest + 0.07),
        ]
        parts = [prism("arm", 2, outline, (front, rear))]
    else:
        parts = []
    return both_sides(parts)
