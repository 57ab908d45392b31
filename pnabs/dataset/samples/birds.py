"""Birds, standing, flying and swimming."""

from __future__ import annotations

from collections.abc import Callable

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, both_sides, moved, turned
from pnabs.dataset.samples.quadrupeds import ball
from pnabs.dataset.samples.sheets import sheet
from pnabs.dataset.samples.solids import lathe, rod, tube


def _bird_body(y: float, length: float, girth: float, tilt: float) -> list[Part]:
    body = ball("body", (0, 0, 0), (girth, girth, length / 2), 12)
    tail = sheet(
        "tail",
        (-0.05, 0, length * 0.4),
        (0.05, 0, length * 0.4),
        (0.14, 0, length * 0.85),
        (-0.14, 0, length * 0.85),
    )
    return [moved(turned(part, 0, tilt), (0, y, 0)) for part in (body, tail)]


def _bird_head(at: tuple[float, float, float], size: float, beak: float) -> list[Part]:
    x, y, z = at
    return [
        ball("head", at, (size, size, size * 1.1), 10),
        rod(
            "beak",
            (x, y, z - size * 0.7),
            (x, y - size * 0.2, z - size - beak),
            size * 0.4,
            0.008,
            6,
        ),
    ]


def _bird_legs(y: float, x: float, z: float, radius: float) -> list[Part]:
    foot = [
        rod("toe", (x, 0.015, z), (x + dx, 0.01, z - 0.1), radius * 0.8, sides=5)
        for dx in (-0.05, 0, 0.05)
    ]
    return both_sides([rod("leg", (x, y, z), (x, 0.01, z), radius, sides=6), *foot])


def _folded_wings(y: float, length: float, girth: float, tilt: float) -> list[Part]:
    wing = moved(
        turned(
            ball("wing", (girth * 0.9, 0.02, length * 0.1), (0.04, girth * 0.6, length * 0.45), 8),
            0,
            tilt,
        ),
        (0, y, 0),
    )
    return both_sides([wing])


def _standing_bird(draw: Draw) -> list[Part]:
    y, tilt = draw.between(0.25, 0.4), draw.between(15, 35)
    return [
        *_bird_body(y, 0.6, 0.17, tilt),
        *_folded_wings(y, 0.6, 0.17, tilt),
        *_bird_head((0, y + 0.24, -0.28), 0.11, draw.between(0.08, 0.2)),
        *_bird_legs(y, 0.06, 0, 0.014),
    ]


def _flying_bird(draw: Draw) -> list[Part]:
    span, lift, sweep = draw.between(0.7, 1.2), draw.between(-0.1, 0.4), draw.between(0.0, 0.25)
    half = [
        sheet(
            "wing",
            (0.08, 0, -0.15),
            (span * 0.45, lift, -0.2),
            (span * 0.4, lift, 0.12),
            (0.08, 0, 0.15),
        ),
        sheet(
            "wing_tip",
            (span * 0.45, lift, -0.2),
            (span, lift * 0.6, sweep),
            (span * 0.9, lift * 0.6, sweep + 0.06),
            (span * 0.4, lift, 0.12),
        ),
    ]
    return [
        *_bird_body(0, 0.6, 0.11, 0),
        *_bird_head((0, 0.06, -0.34), 0.075, 0.09),
        *both_sides(half),
    ]


def _duck(draw: Draw) -> list[Part]:
    neck = draw.between(0.15, 0.5)
    path = [(0, 0.05, -0.25), (0, 0.05 + neck * 0.6, -0.36), (0, 0.1 + neck, -0.3)]
    return [
        *_bird_body(0, 0.7, 0.2, -8),
        *_folded_wings(0.04, 0.6, 0.19, -8),
        tube("neck", path, (0.1, 0.06, 0.06), 8),
        *_bird_head((0, 0.12 + neck, -0.34), 0.09, 0.1),
    ]


def _penguin(draw: Draw) -> list[Part]:
    flap = draw.between(5, 35)
    flipper = moved(
        turned(ball("flipper", (0, -0.2, 0), (0.03, 0.22, 0.08), 8), 2, flap), (0.16, 0.62, 0)
    )
    foot = ball("foot", (0.08, 0.02, -0.06), (0.06, 0.03, 0.11), 8)
    profile = [
        (0.0, 0),
        (0.14, 0.05),
        (0.2, 0.25),
        (0.18, 0.5),
        (0.1, 0.7),
        (0.11, 0.8),
        (0.08, 0.9),
        (0.0, 0.93),
    ]
    return [
        lathe("body", profile, 14),
        *both_sides([flipper, foot]),
        rod("beak", (0, 0.81, -0.08), (0, 0.79, -0.22), 0.03, 0.006, 6),
    ]


def _wader(draw: Draw, leg: float, girth: float, neck: float) -> list[Part]:
    y = leg
    path = [
        (0, y + 0.05, -0.22),
        (0, y + 0.2 * neck, -0.4),
        (0, y + 0.6 * neck, -0.28),
        (0, y + neck, -0.36),
    ]
    return [
        *_bird_body(y, 0.55, girth, 10),
        *_folded_wings(y, 0.5, girth, 10),
        tube("neck", path, (0.06, 0.035, 0.03, 0.03), 8),
        *_bird_head((0, y + neck, -0.4), 0.06, draw.between(0.08, 0.14)),
        *_bird_legs(y, 0.07, 0.02, 0.014),
    ]


def _flamingo(draw: Draw) -> list[Part]:
    return _wader(draw, draw.between(0.7, 0.95), 0.14, draw.between(0.6, 0.8))


def _ostrich(draw: Draw) -> list[Part]:
    return _wader(draw, draw.between(0.6, 0.75), 0.26, draw.between(0.65, 0.9))


BIRDS: dict[str, Callable[[Draw], list[Part]]] = {
    "standing bird": _standing_bird,
    "flying bird": _flying_bird,
    "duck": _duck,
    "penguin": _penguin,
    "flamingo": _flamingo,
    "ostrich": _ostrich,
}
"""Makers of birds by kind."""
