"""Joining what belongs together: boxes that end a hair before the next are made to reach it."""

from __future__ import annotations

import numpy as np
from scipy.sparse.csgraph import connected_components

from pnabs.geometry.fit.assembly import Assembly, Box
from pnabs.geometry.fit.bits import WORD
from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import Bool, Float64

_FURTHEST = 1.25
"""A gap so wide is closed, in cells of a grid of 64^3."""

_STEPS = 5
_SLACK = 1e-9


def bridge(assembly: Assembly, rate: float, fee: float, overlap: float) -> None:
    """Extend positives of one group of touching boxes to those of another, if that costs little.

    Parameters
    ----------
    assembly : Assembly
    rate : float
        See `pnabs.geometry.fit.search.worth`.
    fee : float
        What closing a gap may cost, in doubled cells.
    overlap : float
        By how much boxes that touch overlap, in cells.
    """
    far = _FURTHEST * assembly.target.side / WORD
    for index in sorted(range(len(assembly)), key=lambda at: assembly.boxes[at].half.prod()):
        if assembly.boxes[index].sign < 0:
            continue
        group = groups(assembly)
        others = [
            box
            for at, box in enumerate(assembly.boxes)
            if box.sign > 0 and group[at] != group[index]
        ]
        if not others:
            return
        best: tuple[float, Box] | None = None
        before = assembly.gain(index, rate)
        for longer in _extended(assembly.boxes[index], others, far, overlap):
            old = assembly.boxes[index]
            assembly.replace(index, longer)
            loss = before - assembly.gain(index, rate)
            assembly.replace(index, old)
            if loss <= (best[0] if best else fee):
                best = loss, longer
        if best:
            assembly.replace(index, best[1])


def groups(assembly: Assembly) -> list[int]:
    """For each box the number of its group of positives that overlap; negatives have their own."""
    boxes = assembly.boxes
    touch = np.zeros((len(boxes), len(boxes)), dtype=bool)
    for i, one in enumerate(boxes):
        if one.sign > 0:
            near = [j for j in range(i) if boxes[j].sign > 0]
            touch[i, near] = overlapping(one, [boxes[j] for j in near])
            if assembly.target.low and not one.centred:
                images = [boxes[j].mirrored(assembly.target.plane) for j in near]
                touch[i, near] |= overlapping(one, images)
    return [int(label) for label in connected_components(touch, directed=False)[1]]


def _extended(box: Box, others: list[Box], far: float, overlap: float) -> list[Box]:
    """The box with one side moved out until it meets one of the others, for each side that does."""
    found = []
    for k in range(3):
        for side in (-1, 1):
            if box.centred and k == 0:
                continue
            for step in np.arange(1, _STEPS + 1) * (far / _STEPS):
                half = box.half.copy()
                half[k] += step / 2
                longer = box._replace(
                    centre=box.centre + side * step / 2 * box.axes[:, k], half=half
                )
                if overlapping(longer, others).any():
                    half = half.copy()
                    half[k] += overlap / 2
                    centre = longer.centre + side * overlap / 2 * box.axes[:, k]
                    found.append(box._replace(centre=centre, half=half))
                    break
    return found


def overlapping(box: Box, others: list[Box]) -> Bool:
    """Whether a box has points inside in common with each of some others, (N,) bool.

    By the separating axis test: three axes of each, and their nine products.
    """
    one = box.contiguous()
    return np.array(
        [_overlap(*one[:3], *other.contiguous()[:3]) for other in others], dtype=np.bool_
    )


@kernel
def _overlap(
    centre: Float64, axes: Float64, half: Float64, middle: Float64, frame: Float64, reach: Float64
) -> bool:
    """Whether two boxes overlap."""
    apart = middle - centre
    tests = np.empty((15, 3))
    for i in range(3):
        for r in range(3):
            tests[i, r], tests[3 + i, r] = axes[r, i], frame[r, i]
        for j in range(3):
            for r in range(3):
                s, t = (r + 1) % 3, (r + 2) % 3
                tests[6 + 3 * i + j, r] = axes[s, i] * frame[t, j] - axes[t, i] * frame[s, j]
    for n in range(15):
        gap, size = 0.0, _SLACK
        for r in range(3):
            gap += tests[n, r] * apart[r]
        for k in range(3):
            one, two = 0.0, 0.0
            for r in range(3):
                one += tests[n, r] * axes[r, k]
                two += tests[n, r] * frame[r, k]
            size += abs(one) * half[k] + abs(two) * reach[k]
        if abs(gap) >= size:
            return False
    return True
