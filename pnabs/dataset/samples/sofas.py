"""Sofas: straight, cornered and curved, on feet, plinths and runners."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, moved, turned
from pnabs.dataset.samples.sheets import panel
from pnabs.dataset.samples.sofa_parts import Plan, sofa_arms, sofa_back, sofa_seat
from pnabs.dataset.samples.solids import block, box, lathe, prism

LAYOUTS = (
    "straight",
    "corner left",
    "straight",
    "corner right",
    "chaise",
    "two sides",
    "curved",
    "straight",
    "daybed",
    "facing",
    "borne",
    "back to back",
    "conversation",
    "modules",
    "futon",
)


ARMS = ("box", "round", "thin", "none", "frame", "flared", "low")


BACKS = ("cushions", "solid", "camel", "slats", "low", "split", "rolled")


def sofa(draw: Draw) -> list[Part]:
    """One sofa along x, its front looking along -z."""
    plan, layout = Plan(draw), draw.kind(LAYOUTS)
    arms, back = draw.cycle("arms", ARMS), draw.cycle("back", BACKS)
    if layout in SHAPED:
        return SHAPED[layout](draw, plan)
    seat = sofa_seat(draw, plan, (-plan.half, plan.half))
    if layout == "daybed":
        ends = sofa_arms(draw.pick(("round", "flared", "frame")), plan)
        return [*seat, *(ends if draw.chance(0.5) else ends[: len(ends) // 2])]
    parts, armrests = [*seat, *sofa_back(draw, back, plan)], sofa_arms(arms, plan)
    if layout in ("corner left", "corner right"):
        side = -1 if layout == "corner left" else 1
        free = [arm for arm in armrests if float(arm.vertices[:, 0].mean()) * side < 0]
        return parts + free + _wing(plan, side, back_too=True)
    if layout == "two sides":
        return parts + _wing(plan, -1, back_too=True) + _wing(plan, 1, back_too=True)
    parts += armrests
    if layout == "chaise":
        return parts + _wing(plan, draw.pick((-1, 1)), back_too=False)
    if layout == "facing":
        table = [
            block("table", (0, 0.36, -1.0), (plan.half, 0.04, 0.5)),
            *both_sides([block("table_leg", (plan.half * 0.42, 0.17, -1.0), (0.05, 0.34, 0.4))]),
        ]
        return parts + table
    return parts


def _wing(p: Plan, side: int, *, back_too: bool) -> list[Part]:
    """A seat that runs forward on one side."""
    outer, inner = p.half, p.half - p.depth * 0.85
    x = (min(side * outer, side * inner), max(side * outer, side * inner))
    reach = -p.depth / 2 - (0.9 if back_too else 0.6)
    middle = (p.floor + p.seat) / 2
    parts = [
        box("wing_base", x, (p.floor, middle), (reach, -p.depth / 2)),
        box(
            "wing_cushion",
            (x[0] + 0.01, x[1] - 0.01),
            (middle - 0.005, p.seat),
            (reach, -p.depth / 2 - 0.02),
        ),
    ]
    if back_too:
        wall = side * (outer + p.back)
        parts.append(box("wing_back", (side * outer, wall), (p.floor, p.top), (reach, p.depth / 2)))
    if p.floor > 0:
        parts += [
            block("foot", (a, p.floor / 2, reach + 0.06), (0.05, p.floor, 0.05))
            for a in (x[0] + 0.06, x[1] - 0.06)
        ]
    return parts


def _curved(draw: Draw, p: Plan) -> list[Part]:
    """An arc of seat and back about a point in front."""
    inner, spread = draw.between(0.5, 0.9), draw.variant("arc", (0.75, 1.1, 1.5))
    angles = np.linspace(-spread, spread, 13)

    def arc(name: str, near: float, far: float, low: float, high: float) -> Part:
        line = [(far * math.sin(a), far * math.cos(a)) for a in angles]
        line += [(near * math.sin(a), near * math.cos(a)) for a in angles[::-1]]
        return prism(name, 1, line, (low, high))

    far = inner + p.depth
    parts = [
        arc("seat", inner, far - p.back, p.floor, p.seat),
        arc("back", far - p.back, far, p.floor, p.top),
    ]
    if p.floor > 0:
        parts += [
            lathe(
                "foot",
                [(0.035, 0), (0.035, p.floor)],
                8,
                ((inner + p.depth / 2) * math.sin(a), 0, (inner + p.depth / 2) * math.cos(a)),
            )
            for a in np.linspace(-spread * 0.9, spread * 0.9, 5)
        ]
    return parts


def _borne(draw: Draw, p: Plan) -> list[Part]:
    """A round seat about a middle column."""
    r, sides = draw.between(0.6, 0.8), draw.pick((8, 16))
    column = lathe(
        "back", [(r * 0.45, p.seat - 0.02), (r * 0.3, p.top), (r * 0.1, p.top + 0.05)], sides
    )
    seat = lathe("seat", [(r, p.floor), (r, p.seat - 0.05), (r - 0.05, p.seat)], sides)
    foot = [lathe("plinth", [(r * 0.85, 0), (r * 0.85, p.floor)], sides)] if p.floor > 0 else []
    return [seat, column, *foot]


def _back_to_back(draw: Draw, p: Plan) -> list[Part]:
    """Seats on both sides of one back."""
    x = (-p.half, p.half)
    near = [moved(part, (0, 0, -p.depth / 2)) for part in sofa_seat(draw, p, x)]
    back = box("back", x, (p.floor, p.top), (-p.back, p.back))
    far = [turned(part, 1, 180) for part in near]
    return [*near, *far, back]


def _conversation(draw: Draw, p: Plan) -> list[Part]:
    """Two seats side by side that look opposite ways, between them an S-shaped back."""
    w = draw.between(0.55, 0.7)
    seat = [
        box("seat", (0.04, w), (p.floor, p.seat), (-w / 2, w / 2)),
        box("back", (0.04, w + 0.1), (p.floor, p.top), (w / 2, w / 2 + 0.12)),
        box("arm", (w, w + 0.1), (p.floor, p.seat + 0.2), (-w / 2, w / 2)),
        *(
            block("foot", (x, p.floor / 2, z), (0.06, p.floor, 0.06))
            for x in (0.1, w)
            for z in (-w / 2 + 0.05, w / 2)
            if p.floor > 0
        ),
    ]
    middle = box("middle", (-0.06, 0.06), (p.floor, p.top), (-w / 2 - 0.12, w / 2 + 0.12))
    return [*seat, *(turned(part, 1, 180) for part in seat), middle]


def _modules(draw: Draw, p: Plan) -> list[Part]:
    """Upholstered cubes pushed together, not all with a back."""
    count, step = draw.whole(3, 4), 0.8
    parts = []
    for i in range(count):
        low = (i - count / 2) * step
        x, z = (low + 0.01, low + step - 0.01), (-0.4, 0.4)
        parts.append(box("module", x, (0, p.seat), z))
        if i != draw.whole(0, count - 1):
            parts.append(box("module_back", x, (p.seat, p.top), (0.18, 0.4)))
    out = draw.whole(0, count - 1)
    low = (out - count / 2) * step
    return [*parts, box("ottoman", (low + 0.01, low + step - 0.01), (0, p.seat), (-1.3, -0.5))]


def _futon(draw: Draw, p: Plan) -> list[Part]:
    """A thin mattress on an open slatted frame."""
    w, lean, count = p.half, draw.variant("futon", (20.0, 32.0, 84.0)), draw.whole(7, 12)
    step = 2 * w / count
    parts = [
        box("mattress", (-w, w), (0.3, 0.42), (-0.4, 0.4)),
        turned(box("mattress_back", (-w, w), (0.42, 0.95), (0.28, 0.4)), 0, lean, (0, 0.42, 0.34)),
    ]
    for i in range(count):
        x = (i + 0.5) * step - w
        parts += [
            block("slat", (x, 0.285, 0), (step * 0.4, 0.03, 0.8)),
            turned(
                block("slat", (x, 0.67, 0.415), (step * 0.4, 0.5, 0.03)), 0, lean, (0, 0.42, 0.34)
            ),
        ]
    frame = panel(
        "end",
        0,
        (w, w + 0.06),
        (0, 0.6),
        (-0.45, 0.5),
        [(0.08, 0.27, -0.37, 0.42), (0.33, 0.52, -0.37, 0.42)],
    )
    return [*parts, *both_sides([frame])]


SHAPED: dict[str, Callable[[Draw, Plan], list[Part]]] = {
    "curved": _curved,
    "borne": _borne,
    "back to back": _back_to_back,
    "conversation": _conversation,
    "modules": _modules,
    "futon": _futon,
}
