"""How badly an orientation fits along the grid's lines, and which patches would mend that."""

from __future__ import annotations

import numpy as np

from pnabs.geometry.columns import Columns
from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import GRID_SIDE, Bool, Float64, Int64, Signs

MIN_GAIN = 0.5
"""Share of the disorder on a patch's lines that turning the patch over must take away."""

MIN_GAIN_OWN = 0.1
"""And what it must take away as a share of the length of line that the patch holds: where faces
are missing there is always some disorder to be had."""

MAX_WORK = 20_000_000
"""Hits looked at, at most, in a search for better orientations."""


def disorder(columns: Columns, signs: Signs) -> float:
    """Length of line, over all lines, that is less than outside, seen from either end.

    It is 0 if the faces bound solids and all look outward, overlap as they may.

    Parameters
    ----------
    columns : Columns
    signs : (F,) int8
        -1 for faces that are taken turned over.
    """
    cost = np.empty(len(columns.starts) - 1)
    _costs(columns.starts, columns.height, columns.face, columns.front, signs, cost)
    return float(cost.sum())


def settle(columns: Columns, patch: Int64, flip: Bool) -> tuple[Bool, float]:
    """Turn patches over, one at a time, where that lessens the `disorder` by a good deal.

    Parameters
    ----------
    columns : Columns
    patch : (F,) int64
        Patch of each face.
    flip : (patches,) bool
        Patches to turn over, to begin with.

    Returns
    -------
    flip : (patches,) bool
    extent : float
        Length of line that the patches, each on its own, can be said to hold.
    """
    lines_and_one = np.int64(len(columns.starts))
    line = np.repeat(np.arange(lines_and_one - 1), np.diff(columns.starts))
    owner = patch[columns.face]
    # the patches' own hits, by patch and line, in the order of height
    key = owner * lines_and_one + line
    order = np.argsort(key, kind="stable")
    pairs, begin = np.unique(key[order], return_index=True)
    first = np.searchsorted(pairs, np.arange(len(flip) + 1) * lines_and_one)
    signs = np.where(flip, -1, 1).astype(np.int8)
    own = np.zeros(len(flip))
    _own_lengths(
        columns.height[order], columns.front[order], np.append(begin, len(key)), first, own
    )
    _settle(
        columns.starts,
        columns.height,
        owner,
        columns.front,
        first,
        pairs % lines_and_one,
        signs,
        own,
        # those on most lines first
        np.argsort(-np.diff(first), kind="stable"),
        MAX_WORK,
    )
    return signs < 0, float(own.sum())


@kernel
def _cost(
    height: Float64, owner: Int64, front: Signs, signs: Signs, low: int, high: int, flipped: int
) -> float:
    """Length of one line that is less than outside, with one more owner turned over."""
    whole = 0
    for h in range(low, high):
        sign = front[h] * signs[owner[h]]
        whole += -sign if owner[h] == flipped else sign
    cost = 0.0
    below = 0
    last = -GRID_SIDE / 2
    for h in range(low, high + 1):
        end = height[h] if h < high else GRID_SIDE / 2
        cost += (end - last) * (max(0, -below) + max(0, whole - below))
        last = end
        if h < high:
            sign = front[h] * signs[owner[h]]
            below += -sign if owner[h] == flipped else sign
    return cost


@kernel
def _costs(
    starts: Int64, height: Float64, owner: Int64, front: Signs, signs: Signs, cost: Float64
) -> None:
    for i in range(len(cost)):
        cost[i] = 0.0
        if starts[i + 1] > starts[i]:
            cost[i] = _cost(height, owner, front, signs, starts[i], starts[i + 1], -1)


@kernel
def _own_lengths(height: Float64, front: Signs, begin: Int64, first: Int64, own: Float64) -> None:
    """Disorder of each patch alone, taken the worse way round."""
    for p in range(len(own)):
        upright, turned = 0.0, 0.0
        for pair in range(first[p], first[p + 1]):
            low, high = begin[pair], begin[pair + 1]
            whole = 0
            for h in range(low, high):
                whole += front[h]
            below = 0
            last = -GRID_SIDE / 2
            for h in range(low, high + 1):
                end = height[h] if h < high else GRID_SIDE / 2
                upright += (end - last) * (max(0, -below) + max(0, whole - below))
                turned += (end - last) * (max(0, below) + max(0, below - whole))
                last = end
                if h < high:
                    below += front[h]
        own[p] = max(upright, turned)


@kernel
def _settle(
    starts: Int64,
    height: Float64,
    owner: Int64,
    front: Signs,
    first: Int64,
    lines: Int64,
    signs: Signs,
    own: Float64,
    order: Int64,
    work: int,
) -> None:
    """Coordinate descent over patches in an order."""
    cost = np.empty(len(starts) - 1)
    _costs(starts, height, owner, front, signs, cost)
    better = True
    while better and work > 0:
        better = False
        for p in order:
            change, stake = 0.0, 0.0
            for place in range(first[p], first[p + 1]):
                stake += cost[lines[place]]
            if stake <= 1e-9:
                continue
            for place in range(first[p], first[p + 1]):
                i = lines[place]
                change -= cost[i]
                change += _cost(height, owner, front, signs, starts[i], starts[i + 1], p)
                work -= starts[i + 1] - starts[i]
            if change < -max(MIN_GAIN * stake, MIN_GAIN_OWN * own[p], 1e-9):
                better = True
                signs[p] = -signs[p]
                for place in range(first[p], first[p + 1]):
                    i = lines[place]
                    cost[i] = _cost(height, owner, front, signs, starts[i], starts[i + 1], -1)
            if work <= 0:
                break
