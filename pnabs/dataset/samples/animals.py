"""Animals: quadrupeds, birds, fish and others, of tapered tubes and ellipsoids."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, moved, turned
from pnabs.dataset.samples.sheets import sheet
from pnabs.dataset.samples.solids import ellipsoid, lathe, loft, rod, tube


class Beast(NamedTuple):
    """Proportions of a quadruped; lengths in shares of its trunk's length.

    Attributes
    ----------
    girth, leg, foot : float
        Radius of the trunk, length of a leg, radius of its lower end.
    neck, rise, head : float
        Length of the neck, its angle above level in degrees, length of the head.
    tail, droop : float
        Length of the tail and its angle below level in degrees.
    extra : str
        "ears", "horns", "antlers", "trunk", "humps", "mane", "long ears", "snout", "shell", "wool".
    """

    girth: float
    leg: float
    foot: float
    neck: float
    rise: float
    head: float
    tail: float
    droop: float
    extra: str


BEASTS = {
    "horse": Beast(0.24, 0.62, 0.05, 0.5, 50, 0.36, 0.5, 70, "mane"),
    "dog": Beast(0.2, 0.5, 0.05, 0.25, 45, 0.32, 0.4, -40, "ears"),
    "dachshund": Beast(0.15, 0.2, 0.04, 0.18, 40, 0.26, 0.3, -20, "long ears"),
    "elephant": Beast(0.38, 0.55, 0.11, 0.1, 20, 0.42, 0.35, 75, "trunk"),
    "giraffe": Beast(0.26, 1.0, 0.05, 1.1, 65, 0.34, 0.4, 70, "horns"),
    "cow": Beast(0.28, 0.4, 0.06, 0.2, 20, 0.34, 0.5, 80, "horns"),
    "pig": Beast(0.28, 0.22, 0.05, 0.05, 5, 0.3, 0.15, -30, "snout"),
    "sheep": Beast(0.3, 0.35, 0.04, 0.18, 40, 0.28, 0.1, 50, "wool"),
    "deer": Beast(0.18, 0.62, 0.03, 0.45, 60, 0.28, 0.1, 10, "antlers"),
    "camel": Beast(0.24, 0.75, 0.05, 0.6, 40, 0.3, 0.3, 75, "humps"),
    "bear": Beast(0.34, 0.35, 0.1, 0.12, 15, 0.36, 0.06, 10, "ears"),
    "rabbit": Beast(0.32, 0.22, 0.07, 0.1, 50, 0.4, 0.1, -40, "long ears"),
    "rhino": Beast(0.34, 0.34, 0.1, 0.12, -5, 0.45, 0.25, 70, "snout"),
    "sauropod": Beast(0.28, 0.45, 0.1, 1.3, 40, 0.22, 1.4, 12, "none"),
    "crocodile": Beast(0.15, 0.15, 0.05, 0.1, 0, 0.5, 1.0, 8, "none"),
    "turtle": Beast(0.3, 0.15, 0.08, 0.25, 15, 0.22, 0.2, 10, "shell"),
    "cat": Beast(0.17, 0.38, 0.04, 0.12, 50, 0.26, 0.7, -60, "ears"),
}


def animal(draw: Draw) -> list[Part]:
    """One animal, its head towards -z."""
    kind = draw.kind((*BEASTS, *_OTHERS))
    return _beast(draw, BEASTS[kind]) if kind in BEASTS else _OTHERS[kind](draw)


def _ball(name: str, at: ArrayLike, radii: tuple[float, float, float], sides: int = 10) -> Part:
    return ellipsoid(name, at, radii, sides, 7)


def _beast(draw: Draw, form: Beast) -> list[Part]:
    vary = draw.between(0.9, 1.12)
    b = form._replace(girth=form.girth * vary, leg=form.leg / vary)
    y = b.leg + b.girth * 0.7
    shoulder, hip = -0.5 + b.girth * 0.4, 0.5 - b.girth * 0.4
    trunk = tube("trunk", [(0, y, -0.5), (0, y, -0.3), (0, y - 0.02, 0), (0, y, 0.3), (0, y, 0.5)],
                 [b.girth * f for f in (0.55, 0.95, 1, 0.95, 0.5)], 12, squash=draw.between(0.75, 0.9))
    stride = draw.cycle("stride", (0.0, 0.0, 0.22))
    parts = [trunk, *_legs(b, shoulder, hip, stride)]
    up = math.radians(b.rise)
    root = np.array((0, y + b.girth * 0.3, -0.45))
    poll = root + b.neck * np.array((0, math.sin(up), -math.cos(up)))
    thick = max(b.girth * 0.5, 0.09)
    if b.neck > 0.06:
        bend = (root + poll) / 2 + (0, -0.06 * b.neck, -0.04 * b.neck)
        parts.append(tube("neck", [root, bend, poll], (thick, thick * 0.75, thick * 0.62), 10))
    nose = poll + (0, -0.25 * b.head, -0.85 * b.head)
    parts += [_ball("head", poll + (0, 0, -0.2 * b.head), (0.3 * b.head, 0.34 * b.head, 0.42 * b.head)),
              tube("muzzle", [poll + (0, 0, -0.25 * b.head), nose], (0.24 * b.head, 0.14 * b.head), 8)]
    down = math.radians(b.droop)
    base = np.array((0, y + b.girth * 0.2, 0.46))
    tip = base + b.tail * np.array((0, -math.sin(down), math.cos(down)))
    reach = b.girth * 0.55 if b.tail > 0.9 else 0.035
    parts.append(tube("tail", [base, (base + tip) / 2 + (0, 0.05 * b.tail, 0), tip],
                      (reach, reach * 0.6, reach * 0.2), 8))
    return parts + _extra(b, y, root, poll, nose)


def _legs(b: Beast, shoulder: float, hip: float, stride: float) -> list[Part]:
    """Four legs; with a stride they are drawn mid-step and left differs from right."""
    parts = []
    x = b.girth * 0.5
    for z, front in ((shoulder, True), (hip, False)):
        for side in (-1, 1):
            step = stride * b.leg * side * (1 if front else -1)
            knee = (side * x, b.leg * 0.5, z + step * 0.4 + (-0.03 if front else 0.05) * b.leg)
            path = [(side * x, b.leg + b.girth * 0.5, z), knee, (side * x, 0, z + step)]
            parts.append(tube("leg", path, (max(b.girth * 0.36, b.foot), b.foot * 1.2, b.foot), 8))
    return parts


def _extra(b: Beast, y: float, root: ArrayLike, poll: ArrayLike, nose: ArrayLike) -> list[Part]:
    at, h = np.asarray(poll), b.head
    top = at + (0, 0.25 * h, -0.1 * h)
    if b.extra in ("ears", "long ears"):
        length = 0.3 if b.extra == "ears" else 0.9
        tip = top + (0.25 * h, length * h if b.droop < -30 or length < 0.5 else -0.4 * h, 0.15 * h)
        return both_sides([rod("ear", top + (0.16 * h, 0, 0), tip, 0.1 * h, 0.04 * h, 6)])
    if b.extra == "horns":
        path = [top + (0.12 * h, 0, 0), top + (0.4 * h, 0.1 * h, 0), top + (0.5 * h, 0.4 * h, -0.1 * h)]
        return both_sides([tube("horn", path, (0.06 * h, 0.05 * h, 0.01), 6)])
    if b.extra == "antlers":
        beam = [top + (0.1 * h, 0, 0), top + (0.5 * h, 0.6 * h, 0.2 * h), top + (0.45 * h, 1.3 * h, 0)]
        tines = [rod("tine", top + (0.32 * h, 0.35 * h, 0.12 * h), top + (0.35 * h, 0.6 * h, -0.35 * h),
                     0.035 * h, 0.01, 5),
                 rod("tine", beam[1], beam[1] + (0.3 * h, 0.35 * h, 0), 0.035 * h, 0.01, 5)]
        return both_sides([tube("antler", beam, (0.05 * h, 0.04 * h, 0.015), 6), *tines])
    if b.extra == "trunk":
        n = np.asarray(nose)
        path = [n + (0, 0.06, 0.1), n + (0, -0.15, -0.03), n + (0, -0.45, -0.02), n + (0, -0.6, -0.12)]
        ear = sheet("ear", at + (0.1, 0.15, 0), at + (0.4, 0.2, 0.08), at + (0.42, -0.1, 0.1),
                    at + (0.12, -0.15, 0.02))
        tusk = tube("tusk", [n + (0.07, 0, 0.08), n + (0.1, -0.15, -0.05), n + (0.1, -0.12, -0.22)],
                    (0.03, 0.025, 0.008), 6)
        return [tube("nose", path, (0.09, 0.07, 0.05, 0.035), 8), *both_sides([ear, tusk])]
    if b.extra == "humps":
        return [_ball("hump", (0, y + b.girth * 0.9, z), (0.12, 0.2, 0.14)) for z in (-0.18, 0.18)]
    if b.extra == "mane":
        r, p = np.asarray(root), at
        return [sheet("mane", r + (0, 0.1, 0.12), r + (0, 0.2, 0.1), p + (0, 0.22, 0.1), p + (0, 0.05, 0)),
                *both_sides([rod("ear", top + (0.06, 0, 0), top + (0.08, 0.12, 0), 0.03, 0.01, 5)])]
    if b.extra == "snout":
        n = np.asarray(nose)
        if b.girth > 0.3:
            return [rod("horn", n + (0, 0.02, 0.06), n + (0, 0.28, -0.1), 0.05, 0.01, 8)]
        return [rod("snout", n + (0, 0, 0.03), n + (0, 0, -0.04), 0.07, 0.06, 10),
                *both_sides([sheet("ear", top + (0.04, 0, 0), top + (0.12, 0.02, 0), top + (0.1, 0.02, -0.12))])]
    if b.extra == "shell":
        arch = [(0.62 * math.cos(a), y + 0.45 * math.sin(a)) for a in np.linspace(0, math.pi / 2, 6)]
        dome = lathe("shell", [(0.55, y - 0.06), *arch], 14)
        return [dome._replace(vertices=dome.vertices * (0.85, 1, 1))]
    if b.extra == "wool":
        return [_ball("wool", (0.12 * s, y + 0.08, z), (0.24, 0.24, 0.22), 8)
                for z in (-0.35, 0, 0.35) for s in (-1, 1)]
    return []


def _bird_body(y: float, length: float, girth: float, tilt: float) -> list[Part]:
    body = _ball("body", (0, 0, 0), (girth, girth, length / 2), 12)
    tail = sheet("tail", (-0.05, 0, length * 0.4), (0.05, 0, length * 0.4), (0.14, 0, length * 0.85),
                 (-0.14, 0, length * 0.85))
    return [moved(turned(part, 0, tilt), (0, y, 0)) for part in (body, tail)]


def _bird_head(at: tuple[float, float, float], size: float, beak: float) -> list[Part]:
    x, y, z = at
    return [_ball("head", at, (size, size, size * 1.1), 10),
            rod("beak", (x, y, z - size * 0.7), (x, y - size * 0.2, z - size - beak), size * 0.4, 0.008, 6)]


def _bird_legs(y: float, x: float, z: float, radius: float) -> list[Part]:
    foot = [rod("toe", (x, 0.015, z), (x + dx, 0.01, z - 0.1), radius * 0.8, sides=5) for dx in (-0.05, 0, 0.05)]
    return both_sides([rod("leg", (x, y, z), (x, 0.01, z), radius, sides=6), *foot])


def _folded_wings(y: float, length: float, girth: float, tilt: float) -> list[Part]:
    wing = moved(turned(_ball("wing", (girth * 0.9, 0.02, length * 0.1), (0.04, girth * 0.6, length * 0.45), 8),
                        0, tilt), (0, y, 0))
    return both_sides([wing])


def _standing_bird(draw: Draw) -> list[Part]:
    y, tilt = draw.between(0.25, 0.4), draw.between(15, 35)
    return [*_bird_body(y, 0.6, 0.17, tilt), *_folded_wings(y, 0.6, 0.17, tilt),
            *_bird_head((0, y + 0.24, -0.28), 0.11, draw.between(0.08, 0.2)), *_bird_legs(y, 0.06, 0, 0.014)]


def _flying_bird(draw: Draw) -> list[Part]:
    span, lift, sweep = draw.between(0.7, 1.2), draw.between(-0.1, 0.4), draw.between(0.0, 0.25)
    half = [sheet("wing", (0.08, 0, -0.15), (span * 0.45, lift, -0.2), (span * 0.4, lift, 0.12), (0.08, 0, 0.15)),
            sheet("wing_tip", (span * 0.45, lift, -0.2), (span, lift * 0.6, sweep), (span * 0.9, lift * 0.6,
                                                                                  sweep + 0.06),
                  (span * 0.4, lift, 0.12))]
    return [*_bird_body(0, 0.6, 0.11, 0), *_bird_head((0, 0.06, -0.34), 0.075, 0.09), *both_sides(half)]


def _duck(draw: Draw) -> list[Part]:
    neck = draw.between(0.15, 0.5)
    path = [(0, 0.05, -0.25), (0, 0.05 + neck * 0.6, -0.36), (0, 0.1 + neck, -0.3)]
    return [*_bird_body(0, 0.7, 0.2, -8), *_folded_wings(0.04, 0.6, 0.19, -8),
            tube("neck", path, (0.1, 0.06, 0.06), 8), *_bird_head((0, 0.12 + neck, -0.34), 0.09, 0.1)]


def _penguin(draw: Draw) -> list[Part]:
    flap = draw.between(5, 35)
    flipper = moved(turned(_ball("flipper", (0, -0.2, 0), (0.03, 0.22, 0.08), 8), 2, flap), (0.16, 0.62, 0))
    foot = _ball("foot", (0.08, 0.02, -0.06), (0.06, 0.03, 0.11), 8)
    profile = [(0.0, 0), (0.14, 0.05), (0.2, 0.25), (0.18, 0.5), (0.1, 0.7), (0.11, 0.8), (0.08, 0.9), (0.0, 0.93)]
    return [lathe("body", profile, 14), *both_sides([flipper, foot]),
            rod("beak", (0, 0.81, -0.08), (0, 0.79, -0.22), 0.03, 0.006, 6)]


def _wader(draw: Draw, leg: float, girth: float, neck: float) -> list[Part]:
    y = leg
    path = [(0, y + 0.05, -0.22), (0, y + 0.2 * neck, -0.4), (0, y + 0.6 * neck, -0.28), (0, y + neck, -0.36)]
    return [*_bird_body(y, 0.55, girth, 10), *_folded_wings(y, 0.5, girth, 10),
            tube("neck", path, (0.06, 0.035, 0.03, 0.03), 8),
            *_bird_head((0, y + neck, -0.4), 0.06, draw.between(0.08, 0.14)), *_bird_legs(y, 0.07, 0.02, 0.014)]


def _flamingo(draw: Draw) -> list[Part]:
    return _wader(draw, draw.between(0.7, 0.95), 0.14, draw.between(0.6, 0.8))


def _ostrich(draw: Draw) -> list[Part]:
    return _wader(draw, draw.between(0.6, 0.75), 0.26, draw.between(0.65, 0.9))


def _fish_body(length: float, high: float, wide: float, peak: float) -> Part:
    rings = []
    for f in np.linspace(0, 1, 9):
        swell = math.sin(math.pi * f**peak) if f < 0.92 else 0.16
        rings.append([(wide * swell * math.cos(a), high * max(swell, 0.0) * math.sin(a), length * (f - 0.5))
                      for a in np.linspace(0, 2 * math.pi, 12, endpoint=False)])
    return loft("body", rings)


def _fish(draw: Draw) -> list[Part]:
    high, wide = draw.between(0.16, 0.34), draw.between(0.06, 0.13)
    fork = draw.between(0.05, 0.2)
    tail = [sheet("tail_fin", (0, 0.02, 0.45), (0, 0.24, 0.72), (0, 0, 0.72 - fork)),
            sheet("tail_fin", (0, -0.02, 0.45), (0, 0, 0.72 - fork), (0, -0.24, 0.72))]
    fins = [sheet("back_fin", (0, high * 0.9, -0.15), (0, high + 0.14, 0.02), (0, high + 0.05, 0.2),
                  (0, high * 0.75, 0.18)),
            sheet("belly_fin", (0, -high * 0.85, 0), (0, -high - 0.1, 0.15), (0, -high * 0.7, 0.18))]
    side = both_sides([sheet("side_fin", (wide * 0.9, -0.03, -0.12), (wide + 0.14, -0.09, 0.02),
                             (wide * 0.9, -0.1, -0.03))])
    return [_fish_body(1.0, high, wide, draw.between(0.7, 0.9)), *tail, *fins, *side]


def _shark(draw: Draw) -> list[Part]:
    r = draw.between(0.11, 0.14)
    profile = [(0.0, -0.6), (r * 0.7, -0.45), (r, -0.2), (r * 0.85, 0.1), (r * 0.3, 0.5), (r * 0.15, 0.6)]
    body = turned(lathe("body", profile, 12), 0, 90)
    tail = [sheet("tail_fin", (0, 0.03, 0.5), (0, draw.between(0.25, 0.35), 0.78), (0, 0.0, 0.62)),
            sheet("tail_fin", (0, -0.03, 0.5), (0, 0.0, 0.62), (0, -0.16, 0.7))]
    back = sheet("back_fin", (0, r * 0.85, -0.12), (0, r + 0.18, 0.06), (0, r * 0.8, 0.08))
    fins = [sheet("side_fin", (r * 0.8, -0.05, -0.18), (r + 0.28, -0.14, 0.02), (r * 0.8, -0.06, -0.02))]
    if draw.chance(0.4):
        fins.append(_ball("hammer", (0.1, 0, -0.56), (0.14, 0.025, 0.05), 8))
    return [body, *tail, back, *both_sides(fins)]


def _ray(draw: Draw) -> list[Part]:
    span, long_tail = draw.between(0.5, 0.75), draw.between(0.6, 1.1)
    rings = [[(span * f, 0.07 * (1.05 - f) * rise + 0.1 * f * f, z * (1 - 0.85 * f) + 0.08 * f)
              for z, rise in ((-0.4, 0), (-0.1, 1), (0.35, 0.0), (-0.1, -0.6))] for f in (0, 0.35, 0.7, 1)]
    return [*both_sides([loft("wing", rings)]),
            tube("tail", [(0, 0, 0.25), (0.0, 0.03, 0.25 + long_tail * 0.5), (0, 0, 0.25 + long_tail)],
                 (0.04, 0.02, 0.005), 6)]


def _whale(draw: Draw) -> list[Part]:
    head = draw.between(0.15, 0.24)
    path = [(0, 0, -0.62), (0, 0, -0.5), (0, 0, -0.1), (0, 0.02, 0.25), (0, 0.1, 0.6)]
    body = tube("body", path, (head * 0.55, head, 0.24, 0.15, 0.035), 14)
    half = [sheet("fluke", (0, 0.1, 0.55), (0.32, 0.13, 0.72), (0.05, 0.11, 0.72), (0, 0.1, 0.68)),
            sheet("flipper", (0.18, -0.1, -0.25), (0.42, -0.22, -0.02), (0.18, -0.12, -0.12))]
    return [body, *both_sides(half)]


def _snake(draw: Draw) -> list[Part]:
    waves, swing = draw.between(1.2, 2.4), draw.between(0.12, 0.3)
    at = np.linspace(0, 1, 25)
    path = np.stack([swing * np.sin(2 * math.pi * waves * at), np.full(25, 0.04), 1.8 * at - 0.9], axis=1)
    radius = 0.05 * np.minimum(1, np.minimum(0.5 + 5 * at, 0.1 + 1.8 * (1 - at)))
    head = path[0]
    return [tube("body", path, radius.tolist(), 8), _ball("head", head + (0, 0.01, -0.05), (0.05, 0.035, 0.09), 8)]


def _coil(draw: Draw) -> list[Part]:
    turns, rise = draw.between(2.2, 3.2), draw.between(0.07, 0.1)
    at = np.linspace(0, turns * 2 * math.pi, 32)
    r = np.linspace(0.34, 0.16, 32)
    path = np.stack([r * np.cos(at), 0.05 + rise * at / (2 * math.pi), r * np.sin(at)], axis=1)
    neck = [path[-1], path[-1] + (0, 0.15, -0.02), (0, path[-1][1] + 0.3, -0.1), (0, path[-1][1] + 0.34, -0.25)]
    return [tube("body", path, 0.055, 8), tube("neck", neck, (0.055, 0.05, 0.04, 0.035), 8),
            _ball("head", np.array(neck[-1]) + (0, 0, -0.05), (0.06, 0.04, 0.09), 8)]


def _spider(draw: Draw) -> list[Part]:
    r, arch = draw.between(0.5, 0.75), draw.between(0.25, 0.45)
    legs = []
    for a in np.radians((-55, -20, 20, 55)):
        x, z = math.cos(a), math.sin(a)
        legs.append(tube("leg", [(0.08 * x, 0.2, 0.08 * z), (0.5 * r * x, 0.2 + arch, 0.5 * r * z),
                                 (r * x, 0, r * z)], (0.03, 0.022, 0.01), 6))
    return [_ball("head", (0, 0.2, -0.1), (0.12, 0.09, 0.14)), _ball("body", (0, 0.25, 0.24), (0.18, 0.17, 0.24)),
            *both_sides(legs)]


def _crab(draw: Draw) -> list[Part]:
    wide = draw.between(0.3, 0.42)
    half = []
    for z, reach in zip((-0.1, 0.02, 0.14), (0.34, 0.36, 0.3), strict=True):
        half.append(tube("leg", [(wide * 0.8, 0.16, z), (wide + reach * 0.5, 0.3, z * 1.4),
                                 (wide + reach, 0, z * 1.8)], (0.035, 0.03, 0.01), 6))
    arm = [(wide * 0.7, 0.16, -0.16), (wide + 0.12, 0.2, -0.32), (wide - 0.05, 0.2, -0.48)]
    half += [tube("arm", arm, (0.045, 0.05, 0.05), 6),
             rod("claw", (wide - 0.03, 0.2, -0.46), (wide - 0.2, 0.22, -0.68), 0.08, 0.01, 6),
             rod("claw", (wide - 0.05, 0.2, -0.46), (wide - 0.02, 0.18, -0.68), 0.06, 0.01, 6),
             rod("eye", (0.08, 0.2, -0.18), (0.09, 0.32, -0.22), 0.02, sides=6)]
    return [_ball("shell", (0, 0.17, 0), (wide, 0.1, 0.24), 14), *both_sides(half)]


def _octopus(draw: Draw) -> list[Part]:
    reach, curl = draw.between(0.55, 0.8), draw.between(0.1, 0.3)
    arms = []
    for a in np.arange(8) * math.pi / 4 + math.pi / 8:
        x, z = math.sin(a), math.cos(a)
        arms.append(tube("arm", [(0.1 * x, 0.2, 0.1 * z), (0.4 * reach * x, 0.05, 0.4 * reach * z),
                                 (0.8 * reach * x, 0.05, 0.8 * reach * z), (reach * x, curl, reach * z)],
                         (0.07, 0.05, 0.03, 0.01), 6))
    head = lathe("head", [(0.12, 0.15), (0.16, 0.3), (0.24, 0.5), (0.2, 0.68), (0.0, 0.78)], 12)
    return [head, *arms]


def _butterfly(draw: Draw) -> list[Part]:
    lift, span = draw.between(0.1, 0.6), draw.between(0.5, 0.7)

    def wing(name: str, line: Sequence[tuple[float, float]]) -> Part:
        return sheet(name, *[(x, lift * x, z) for x, z in line])

    half = [wing("fore_wing", [(0.03, -0.18), (span * 0.6, -0.5), (span, -0.42), (span * 0.85, -0.12), (0.03, 0.0)]),
            wing("hind_wing", [(0.03, 0.0), (span * 0.7, -0.02), (span * 0.75, 0.3), (span * 0.4, 0.5), (0.03, 0.16)]),
            tube("feeler", [(0.02, 0.03, -0.3), (0.08, 0.1, -0.45), (0.14, 0.12, -0.6)], 0.008, 5)]
    return [_ball("body", (0, 0, 0), (0.045, 0.045, 0.32), 8), *both_sides(half)]


def _snail(draw: Draw) -> list[Part]:
    turns = draw.between(1.6, 2.4)
    at = np.linspace(0, turns * 2 * math.pi, 26)
    r = 0.03 + 0.26 * (at / at[-1])
    end = at[-1] + math.pi * 0.6
    path = np.stack([0.1 * (1 - at / at[-1]), 0.36 + r * np.sin(at - end), 0.12 + r * np.cos(at - end)], axis=1)
    radius = (0.02 + 0.13 * at / at[-1]).tolist()
    foot = tube("foot", [(0, 0.06, -0.55), (0, 0.06, 0), (0, 0.03, 0.6)], (0.07, 0.1, 0.02), 8, squash=1.3)
    horns = both_sides([rod("horn", (0.03, 0.16, -0.5), (0.1, 0.36, -0.62), 0.018, sides=6)])
    return [tube("shell", path, radius, 8), foot, rod("neck", (0, 0.06, -0.35), (0, 0.18, -0.55), 0.08, 0.06, 8),
            *horns]


def _frog(draw: Draw) -> list[Part]:
    body = turned(_ball("body", (0, 0, 0), (0.26, 0.18, 0.36), 12), 0, -draw.between(10, 30))
    half = [_ball("eye", (0.12, 0.46, -0.3), (0.07, 0.07, 0.07), 8),
            tube("hind_leg", [(0.18, 0.22, 0.22), (0.4, 0.3, -0.02), (0.34, 0.06, 0.3), (0.45, 0.02, 0.0)],
                 (0.1, 0.08, 0.05, 0.04), 8),
            tube("fore_leg", [(0.18, 0.24, -0.16), (0.28, 0.12, -0.1), (0.26, 0.01, -0.3)], (0.06, 0.04, 0.04), 8)]
    return [moved(body, (0, 0.27, 0)), _ball("head", (0, 0.36, -0.32), (0.22, 0.13, 0.2)), *both_sides(half)]


_OTHERS: dict[str, Callable[[Draw], list[Part]]] = {
    "standing bird": _standing_bird, "flying bird": _flying_bird, "duck": _duck, "penguin": _penguin,
    "flamingo": _flamingo, "fish": _fish, "shark": _shark, "ray": _ray, "whale": _whale, "snake": _snake,
    "coil": _coil, "spider": _spider, "crab": _crab, "octopus": _octopus, "butterfly": _butterfly,
    "snail": _snail, "frog": _frog, "ostrich": _ostrich,
}
