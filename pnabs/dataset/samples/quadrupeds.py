# ruff: noqa: RUF005
"""Animals on four legs, by their proportions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides
from pnabs.dataset.samples.sheets import sheet
from pnabs.dataset.samples.solids import ellipsoid, lathe, rod, tube


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


def ball(name: str, at: ArrayLike, radii: tuple[float, float, float], sides: int = 10) -> Part:
    """A coarse ellipsoid."""
    return ellipsoid(name, at, radii, sides, 7)


def beast(draw: Draw, form: Beast) -> list[Part]:
    """One quadruped of the given proportions, a little varied, standing or mid-step."""
    vary = draw.between(0.9, 1.12)
    b = form._replace(girth=form.girth * vary, leg=form.leg / vary)
    y = b.leg + b.girth * 0.7
    shoulder, hip = -0.5 + b.girth * 0.4, 0.5 - b.girth * 0.4
    trunk = tube(
        "trunk",
        [(0, y, -0.5), (0, y, -0.3), (0, y - 0.02, 0), (0, y, 0.3), (0, y, 0.5)],
        [b.girth * f for f in (0.55, 0.95, 1, 0.95, 0.5)],
        12,
        squash=draw.between(0.75, 0.9),
    )
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
    parts += [
        ball("head", poll + (0, 0, -0.2 * b.head), (0.3 * b.head, 0.34 * b.head, 0.42 * b.head)),
        tube("muzzle", [poll + (0, 0, -0.25 * b.head), nose], (0.24 * b.head, 0.14 * b.head), 8),
    ]
    down = math.radians(b.droop)
    base = np.array((0, y + b.girth * 0.2, 0.46))
    tip = base + b.tail * np.array((0, -math.sin(down), math.cos(down)))
    reach = b.girth * 0.55 if b.tail > 0.9 else 0.035
    parts.append(
        tube(
            "tail",
            [base, (base + tip) / 2 + (0, 0.05 * b.tail, 0), tip],
            (reach, reach * 0.6, reach * 0.2),
            8,
        )
    )
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
        path = [
            top + (0.12 * h, 0, 0),
            top + (0.4 * h, 0.1 * h, 0),
            top + (0.5 * h, 0.4 * h, -0.1 * h),
        ]
        return both_sides([tube("horn", path, (0.06 * h, 0.05 * h, 0.01), 6)])
    if b.extra == "antlers":
        beam = [
            top + (0.1 * h, 0, 0),
            top + (0.5 * h, 0.6 * h, 0.2 * h),
            top + (0.45 * h, 1.3 * h, 0),
        ]
        tines = [
            rod(
                "tine",
                top + (0.32 * h, 0.35 * h, 0.12 * h),
                top + (0.35 * h, 0.6 * h, -0.35 * h),
                0.035 * h,
                0.01,
                5,
            ),
            rod("tine", beam[1], beam[1] + (0.3 * h, 0.35 * h, 0), 0.035 * h, 0.01, 5),
        ]
        return both_sides([tube("antler", beam, (0.05 * h, 0.04 * h, 0.015), 6), *tines])
    if b.extra == "trunk":
        n = np.asarray(nose)
        path = [
            n + (0, 0.06, 0.1),
            n + (0, -0.15, -0.03),
            n + (0, -0.45, -0.02),
            n + (0, -0.6, -0.12),
        ]
        ear = sheet(
            "ear",
            at + (0.1, 0.15, 0),
            at + (0.4, 0.2, 0.08),
            at + (0.42, -0.1, 0.1),
            at + (0.12, -0.15, 0.02),
        )
        tusk = tube(
            "tusk",
            [n + (0.07, 0, 0.08), n + (0.1, -0.15, -0.05), n + (0.1, -0.12, -0.22)],
            (0.03, 0.025, 0.008),
            6,
        )
        return [tube("nose", path, (0.09, 0.07, 0.05, 0.035), 8), *both_sides([ear, tusk])]
    if b.extra == "humps":
        return [ball("hump", (0, y + b.girth * 0.9, z), (0.12, 0.2, 0.14)) for z in (-0.18, 0.18)]
    if b.extra == "mane":
        r, p = np.asarray(root), at
        return [
            sheet(
                "mane", r + (0, 0.1, 0.12), r + (0, 0.2, 0.1), p + (0, 0.22, 0.1), p + (0, 0.05, 0)
            ),
            *both_sides([rod("ear", top + (0.06, 0, 0), top + (0.08, 0.12, 0), 0.03, 0.01, 5)]),
        ]
    if b.extra == "snout":
        n = np.asarray(nose)
        if b.girth > 0.3:
            return [rod("horn", n + (0, 0.02, 0.06), n + (0, 0.28, -0.1), 0.05, 0.01, 8)]
        return [
            rod("snout", n + (0, 0, 0.03), n + (0, 0, -0.04), 0.07, 0.06, 10),
            *both_sides(
                [sheet("ear", top + (0.04, 0, 0), top + (0.12, 0.02, 0), top + (0.1, 0.02, -0.12))]
            ),
        ]
    if b.extra == "shell":
        arch = [
            (0.62 * math.cos(a), y + 0.45 * math.sin(a)) for a in np.linspace(0, math.pi / 2, 6)
        ]
        dome = lathe("shell", [(0.55, y - 0.06), *arch], 14)
        return [dome._replace(vertices=dome.vertices * (0.85, 1, 1))]
    if b.extra == "wool":
        return [
            ball("wool", (0.12 * s, y + 0.08, z), (0.24, 0.24, 0.22), 8)
            for z in (-0.35, 0, 0.35)
            for s in (-1, 1)
        ]
    return []
