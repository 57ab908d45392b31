"""The largest box about a centre that points at most touch."""

from __future__ import annotations

import itertools

import numpy as np

from pnabs.geometry.types import Float64

_LEVELS = 24
"""Half-sides tried along each of two axes before the exact step."""


def largest_half_sides(points: Float64, low: Float64, high: Float64, touch: float) -> Float64:
    """Half-sides of the largest box, between `low` and `high`, with no point deeper than `touch`.

    A box of half-sides H holds a point at p no deeper than `touch` if along some axis j
    H_j <= p_j + touch.  Every face pair may stop at its own distance, so a box that meets
    the shape on one side still reaches it on the others, which one factor for all three
    axes would not.  Two half-sides are tried at evenly spaced levels, the third follows
    exactly from the points within the first two; then each half-side in turn is set to its
    exact bound given the others, which never lessens the volume.

    Parameters
    ----------
    points : (P, 3) float64
        Absolute values of the points' coordinates in the box's frame.
    low, high : (3,) float64
        Bounds of the half-sides; `low` itself must satisfy the condition.
    touch : float

    Returns
    -------
    (3,) float64
    """
    bounds = points + touch
    # Points outside the largest box never bind; those inside are few.
    bounds = bounds[np.all(bounds < high, axis=1)]
    if not len(bounds):
        return high.copy()
    best = low
    for last in range(3):
        first, second = (axis for axis in range(3) if axis != last)
        found = _scan(bounds, low, high, (first, second, last))
        if found is not None and found.prod() > best.prod():
            best = found
    for axis in itertools.chain(range(3), range(3)):
        best = best.copy()
        best[axis] = max(best[axis], _bound(bounds, best, axis, high[axis]))
    return best


def _scan(
    bounds: Float64, low: Float64, high: Float64, axes: tuple[int, int, int]
) -> Float64 | None:
    """Best box over levels of the first two axes, the third exact; None where none is feasible."""
    first, second, last = axes
    levels = [np.linspace(low[axis], high[axis], _LEVELS) for axis in (first, second)]
    # A point binds the third axis where it lies within both levels: a prefix minimum.
    table = np.full((_LEVELS, _LEVELS), high[last])
    cell = tuple(
        np.searchsorted(level, bounds[:, axis], side="right")
        for level, axis in zip(levels, (first, second), strict=True)
    )
    np.minimum.at(table, cell, bounds[:, last])
    table = np.minimum.accumulate(np.minimum.accumulate(table, axis=0), axis=1)
    volume = levels[0][:, None] * levels[1] * table
    volume[table < low[last]] = -1
    i, j = np.unravel_index(np.argmax(volume), volume.shape)
    if volume[i, j] < 0:
        return None
    box = np.empty(3)
    box[[first, second, last]] = levels[0][i], levels[1][j], table[i, j]
    return box


def _bound(bounds: Float64, box: Float64, axis: int, high: float) -> float:
    others = [other for other in range(3) if other != axis]
    within = np.all(bounds[:, others] < box[others], axis=1)
    return float(bounds[within, axis].min(initial=high))
