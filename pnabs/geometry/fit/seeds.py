"""Where another box would help: boxes grown from cells that are wrong so far."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from pnabs.geometry.fit.assembly import Assembly, Box, Target
from pnabs.geometry.fit.bits import WORD, Bits, cell_at, cells_near, count, eroded
from pnabs.geometry.fit.box import is_aligned
from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import Float64, Int64

_STEP, _LEAST = 4.0, 1.0
"""First and last step of the growth, in cells of a grid of 64^3."""
_FEW = 4
"""With fewer cells around a seed there is no direction to take."""


def proposal(
    assembly: Assembly,
    sign: int,
    rate: float,
    fee: float,
    turning_fee: float,
    room: int,
    tries: int,
    rng: np.random.Generator,
) -> tuple[Box, float] | None:
    """The best of some boxes that could be added, with its worth less its fee.

    Parameters
    ----------
    assembly : Assembly
    sign : int
        1 for a positive where the shape is missing, -1 for a negative where there is too much.
    rate : float
        See `pnabs.geometry.fit.search.worth`.
    fee, turning_fee : float
        What a box must earn, and what more if it isn't along the grid, in doubled cells.
    room : int
        How many boxes it may stand for.
    tries : int
        Seeds; the first lies where the wrong cells are thickest.
    rng : numpy.random.Generator
        Draws the other seeds.

    Returns
    -------
    (Box, float) or None
        None if no box is worth its fee.
    """
    target = assembly.target
    scale = target.side / WORD
    occupied = assembly.occupied()
    if sign > 0:
        wrong = (target.near | target.far) & ~occupied
    else:
        wrong = occupied & ~(target.near & target.far)
    if not count(wrong):
        return None
    best: tuple[Box, float] | None = None
    starts = [
        start
        for cell, depth in _seeds(wrong, target.low, tries, rng)
        for start in _starts(wrong, cell, depth, sign, target)
    ]
    for start in starts:
        if assembly.cost(start) > room:
            continue
        straight = is_aligned(start.axes)
        box, value = assembly.searched(
            start, rate, _STEP * scale, _LEAST * scale, turns=0 if straight else 3
        )
        value -= fee * assembly.cost(box) + (0 if straight else turning_fee)
        if value > (best[1] if best else 0.0):
            best = box, value
    return best


def _seeds(
    wrong: Bits, low: int, tries: int, rng: np.random.Generator
) -> Iterator[tuple[Int64, int]]:
    """Cells to start from, and how deep each lies among the wrong cells at least."""
    layers = [wrong]
    while count(inner := eroded(layers[-1], low)):
        layers.append(inner)
    deepest = len(layers) - 1
    for attempt in range(tries):
        depth = deepest if attempt % 2 == 0 else max(deepest - 1, 0) if attempt % 4 == 1 else 0
        number = count(layers[depth])
        rank = number // 2 if attempt == 0 else int(rng.integers(number))
        yield cell_at(layers[depth], rank), depth


def _starts(wrong: Bits, cell: Int64, depth: int, sign: int, target: Target) -> Iterator[Box]:
    """Boxes to grow at a cell: along the grid, and along what lies around it."""
    centre = cell.astype(np.float64)
    half = np.full(3, depth + 0.5)
    yield Box(centre, np.eye(3), half, sign)
    offsets = cells_near(wrong, cell, 5 * target.side // WORD + 2 * depth)
    if target.low:
        middle = np.array([target.plane, centre[1], centre[2]])
        wide = np.array([centre[0] - target.plane + half[0], half[1], half[2]])
        yield Box(middle, np.eye(3), wide, sign, centred=True)
    if len(offsets) >= _FEW:
        mean, axes, half = _principal(offsets)
        yield Box(centre + mean, axes, half, sign)


@kernel
def _principal(offsets: Float64) -> tuple[Float64, Float64, Float64]:
    """Mean and principal axes of some points, as a rotation, and half-sides of their extent."""
    mean = np.zeros(3)
    for row in range(len(offsets)):
        mean += offsets[row]
    mean /= len(offsets)
    around = offsets - mean
    spread, axes = np.linalg.eigh(around.T @ around / len(offsets))
    half = np.empty(3)
    for k in range(3):
        half[k] = max(1.2 * math.sqrt(max(spread[k], 0.0)), 0.5)
        # eigenvectors come with either sign, by library and machine
        if axes[np.argmax(np.abs(axes[:, k])), k] < 0:
            axes[:, k] = -axes[:, k]
    for r in range(3):
        i, j = (r + 1) % 3, (r + 2) % 3
        axes[r, 0] = axes[i, 1] * axes[j, 2] - axes[j, 1] * axes[i, 2]
    return mean, axes, half
