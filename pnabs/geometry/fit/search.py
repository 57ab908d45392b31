"""Pattern search: one box's sides, place and turn, changed while the exact score rises."""

from __future__ import annotations

import math

from pnabs.geometry.fit.box import Field, cells_beyond, outside, tally
from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import Float64

LEAST_HALF = 0.5
"""Half a cell: a thinner box would miss whole layers of cells."""

_LARGEST_TURN = 0.5

_OUT = 1e5
"""What each cell of length outside its room costs a box: more than any box is worth."""


@kernel
def worth(
    centre: Float64,
    axes: Float64,
    half: Float64,
    field: Field,
    rate: float,
    sign: int,
    folded: bool,
) -> float:
    """What the box adds: cells set right, less `rate` times the cells set wrong.

    A negative box (sign -1) sets right what it takes away from outside the shape, at the
    rate, and loses what it takes from the shape.  With the rate at the IoU reached, what
    raises this raises the IoU (Dinkelbach's method for fractions).

    Outside the grid there is no shape: a positive's cells there are wrong, whatever else is
    there, and a negative neither earns nor loses anything, what it crops of a positive included.
    """
    hits, cells = tally(centre, axes, half, field, folded)
    if sign < 0:
        return -(hits - rate * (cells - hits))
    out, leaves = outside(centre, axes, half, field.room)
    if leaves:
        cells += stray(centre, axes, half, field.low > 0 and not folded)
    return hits - rate * (cells - hits) - _OUT * out


@kernel
def stray(centre: Float64, axes: Float64, half: Float64, centred: bool) -> int:
    """Cells of a box outside the grid, as `tally` counts those inside.

    Parameters
    ----------
    centre, axes, half
        The box.
    centred : bool
        The box is its own mirror image, and the grid is folded.
    """
    return (1 if centred else 2) * cells_beyond(centre, axes, half)


@kernel
def turn(axes: Float64, about: int, angle: float) -> Float64:
    """The axes turned about one of themselves."""
    i, j = (about + 1) % 3, (about + 2) % 3
    cosine, sine = math.cos(angle), math.sin(angle)
    turned = axes.copy()
    for r in range(3):
        turned[r, i] = cosine * axes[r, i] + sine * axes[r, j]
        turned[r, j] = cosine * axes[r, j] - sine * axes[r, i]
    return turned


@kernel
def search(
    centre: Float64,
    axes: Float64,
    half: Float64,
    field: Field,
    rate: float,
    sign: int,
    step: float,
    least: float,
    turns: int,
    centred: bool,
) -> float:
    """Improve a box in place, with everything else as it is; its worth.

    Each side, the place along each axis and the turn about each axis is changed by a step, as
    often as that helps; when nothing helps the step is halved.

    Parameters
    ----------
    centre, axes, half
        The box; changed.
    field, rate, sign
        As `worth`.
    step, least : float
        The first step and the last, in cells (turns: at the box's far end).
    turns : int
        About how many of its axes it may turn, the first first.
    centred : bool
        The box's first axis is the grid's, and its centre stays where it is along it: sides
        change in pairs.  It may turn about that axis alone.
    """
    folded = field.low > 0 and not centred
    best = worth(centre, axes, half, field, rate, sign, folded)
    moved, resized = centre.copy(), half.copy()
    while step >= least:
        improved = False
        for k in range(3):
            for side in range(-1, 2):  # 0: shift without a change of size
                if centred and k == 0 and side < 1:
                    continue
                for way in range(2):
                    change = step if way == 0 else -step
                    went = False
                    while True:
                        for r in range(3):
                            moved[r], resized[r] = centre[r], half[r]
                        if side == 0 or not (centred and k == 0):
                            along = change if side == 0 else side * change / 2
                            for r in range(3):
                                moved[r] += axes[r, k] * along
                        if side != 0:
                            resized[k] += change / 2
                            if resized[k] < LEAST_HALF:
                                break
                        value = worth(moved, axes, resized, field, rate, sign, folded)
                        if value <= best + 1e-6:
                            break
                        best, went, improved = value, True, True
                        for r in range(3):
                            centre[r], half[r] = moved[r], resized[r]
                    if went:
                        break
        for k in range(turns):
            far_end = max(half[(k + 1) % 3], half[(k + 2) % 3])
            size = min(step / far_end, _LARGEST_TURN)
            for way in range(2):
                angle = size if way == 0 else -size
                went = False
                while True:
                    turned = turn(axes, k, angle)
                    value = worth(centre, turned, half, field, rate, sign, folded)
                    if value <= best + 1e-6:
                        break
                    best, went, improved = value, True, True
                    axes[:] = turned
                if went:
                    break
        if not improved:
            step *= 0.5
    return best
