"""Flaws that meshes from modelling programs have, put in on purpose."""

from __future__ import annotations

import itertools

import numpy as np

from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.parts import Part, reversed_faces

FLAWS = ("unwelded", "flipped", "doubled")


def choose(draw: Draw) -> tuple[str, ...]:
    """The flaws of a model: none for seven of ten, else one, two or all three."""
    if not draw.cycle("flawed", (True,) * 3 + (False,) * 7):
        return ()
    first = draw.pick(FLAWS)
    return tuple(flaw for flaw in FLAWS if flaw == first or draw.chance(0.3))


def unweld(part: Part) -> Part:
    """Every face with vertices of its own."""
    order = np.array([index for face in part.faces for index in face])
    ends = np.cumsum([0, *(len(face) for face in part.faces)]).tolist()
    faces = tuple(tuple(range(a, b)) for a, b in itertools.pairwise(ends))
    return Part(part.name, part.vertices[order], faces)


def flip(parts: list[Part], share: float, draw: Draw) -> list[Part]:
    """About this share of the faces turned over, at least one."""
    sure = draw.whole(0, len(parts) - 1)
    out = []
    for place, part in enumerate(parts):
        turned = [draw.chance(share) for _ in part.faces]
        if place == sure:
            turned[0] = True
        faces = tuple(
            reversed_faces([face])[0] if turn else face
            for face, turn in zip(part.faces, turned, strict=True)
        )
        out.append(part._replace(faces=faces))
    return out


def double(parts: list[Part], share: float, draw: Draw) -> list[Part]:
    """About this share of the faces given twice, half of the twins turned over, at least one."""
    sure = draw.whole(0, len(parts) - 1)
    out = []
    for place, part in enumerate(parts):
        twins = [face for face in part.faces if draw.chance(share)]
        if place == sure and not twins:
            twins = [part.faces[0]]
        extra = tuple(reversed_faces([face])[0] if draw.chance(0.5) else face for face in twins)
        out.append(part._replace(faces=part.faces + extra))
    return out


def apply(parts: list[Part], flaws: tuple[str, ...], draw: Draw) -> list[Part]:
    """The parts with the named flaws."""
    if "doubled" in flaws:
        parts = double(parts, draw.between(0.02, 0.08), draw)
    if "flipped" in flaws:
        parts = flip(parts, draw.between(0.05, 0.3), draw)
    if "unwelded" in flaws:
        parts = [unweld(part) for part in parts]
    return parts
