"""Small boxes about a large triangle: what a loop over cells should look at."""

from __future__ import annotations

import numpy as np

from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import Float64

MOST_PIECES = 4096
"""Boxes about one triangle; a triangle that would need more gets one box about all of it."""

_CELLS = 8
_DEPTH = 24


@kernel
def boxes(a: Float64, b: Float64, c: Float64, cell: float, out: Float64) -> int:
    """Boxes that together hold a triangle, each of few cells; how many there are.

    A long diagonal sliver fills little of its own bounding box, so it is halved along its
    longest edge until its pieces fill theirs.

    Parameters
    ----------
    a, b, c : (3,) float64
    cell : float
        Side of a cell.
    out : (MOST_PIECES, 2, 3) float64
        Filled with lower and upper corners.
    """
    stack = np.empty((_DEPTH + 1, 3, 3))
    depth = np.zeros(_DEPTH + 1, dtype=np.int64)
    stack[0, 0], stack[0, 1], stack[0, 2] = a, b, c
    left, count = 1, 0
    while left > 0:
        left -= 1
        t = stack[left].copy()
        level = depth[left]
        cells = 1.0
        for axis in range(3):
            low = min(t[0, axis], t[1, axis], t[2, axis])
            high = max(t[0, axis], t[1, axis], t[2, axis])
            out[count, 0, axis], out[count, 1, axis] = low, high
            cells *= (high - low) / cell + 1
        if cells <= _CELLS**3 or level == _DEPTH:
            count += 1
            if count == MOST_PIECES and left > 0:
                for axis in range(3):
                    out[0, 0, axis] = min(a[axis], b[axis], c[axis])
                    out[0, 1, axis] = max(a[axis], b[axis], c[axis])
                return 1
            continue
        longest, edge = -1.0, 0
        for e in range(3):
            f = (e + 1) % 3
            length = (t[e, 0] - t[f, 0]) ** 2 + (t[e, 1] - t[f, 1]) ** 2 + (t[e, 2] - t[f, 2]) ** 2
            if length > longest:
                longest, edge = length, e
        following = (edge + 1) % 3
        middle = (t[edge] + t[following]) / 2
        for half in range(2):
            stack[left] = t
            stack[left, edge if half == 0 else following] = middle
            depth[left] = level + 1
            left += 1
    return count
