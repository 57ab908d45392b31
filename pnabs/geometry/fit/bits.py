"""Grids of 64^3 cells as 64 x 64 words, a bit a cell: whole columns in one operation.

`Bits` is (64, 64) uint64, indexed by x and y; bit z of a word is the cell (x, y, z).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import Bool

Bits = NDArray[np.uint64]

SIDE = 64
"""Cells along a side: the bits of a word."""


def pack(cells: Bool) -> Bits:
    """(64, 64, 64) bool as bits."""
    octets = np.packbits(cells, axis=2, bitorder="little")
    return np.ascontiguousarray(octets).view(np.uint64)[..., 0].copy()


def unpack(bits: Bits) -> Bool:
    """The inverse of `pack`."""
    octets = np.ascontiguousarray(bits)[..., None].view(np.uint8)
    return np.unpackbits(octets, axis=2, bitorder="little").astype(bool)


def nothing() -> Bits:
    """No cell set."""
    return np.zeros((SIDE, SIDE), dtype=np.uint64)


def count(bits: Bits) -> int:
    """How many cells are set."""
    return int(np.bitwise_count(bits).sum())


@kernel
def ones(word: np.uint64) -> int:
    """How many bits of a word are set; compiled to one instruction."""
    two, four = np.uint64(0x3333333333333333), np.uint64(0x0F0F0F0F0F0F0F0F)
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & two) + ((word >> np.uint64(2)) & two)
    word = (word + (word >> np.uint64(4))) & four
    return int((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@kernel
def span(first: int, last: int) -> np.uint64:
    """The bits `first` to `last`, both included; 0 <= first <= last < 64."""
    every = np.uint64(0xFFFFFFFFFFFFFFFF)
    return (every >> np.uint64(63 - last + first)) << np.uint64(first)


@kernel
def eroded(bits: Bits, low: int) -> Bits:
    """The cells whose six neighbours are set too.

    Parameters
    ----------
    bits : (64, 64) uint64
        Nothing set where x < `low`.
    low : int
        32 if the grid is one half of a mirrored one: the neighbour of a cell at the plane is
        then its own mirror image.  Else 0.
    """
    one = np.uint64(1)
    out = np.zeros_like(bits)
    for x in range(low, 63):
        before = x if x == low and low > 0 else x - 1
        if before < 0:
            continue
        for y in range(1, 63):
            word = bits[x, y]
            if word:
                word = word & (word << one) & (word >> one)
                word = word & bits[before, y] & bits[x + 1, y]
                out[x, y] = word & bits[x, y - 1] & bits[x, y + 1]
    return out


@kernel
def cells_near(bits: Bits, centre: NDArray[np.int64], radius: int) -> NDArray[np.float64]:
    """Offsets of the set cells within a ball, (K, 3) float64."""
    found = np.empty(((2 * radius + 1) ** 3, 3))
    k = 0
    for x in range(max(0, centre[0] - radius), min(64, centre[0] + radius + 1)):
        for y in range(max(0, centre[1] - radius), min(64, centre[1] + radius + 1)):
            word = bits[x, y]
            if not word:
                continue
            dx, dy = x - centre[0], y - centre[1]
            for z in range(max(0, centre[2] - radius), min(64, centre[2] + radius + 1)):
                dz = z - centre[2]
                if (word >> np.uint64(z)) & np.uint64(1) and (
                    dx * dx + dy * dy + dz * dz <= radius * radius
                ):
                    found[k, 0], found[k, 1], found[k, 2] = dx, dy, dz
                    k += 1
    return found[:k]


def cell_at(bits: Bits, rank: int) -> NDArray[np.int64]:
    """The set cell of that rank, x slowest: (3,) int64."""
    totals = np.cumsum(np.bitwise_count(bits).ravel())
    row = int(np.searchsorted(totals, rank, side="right"))
    x, y = divmod(row, SIDE)
    inside = rank - int(totals[row - 1] if row else 0)
    word = int(bits[x, y])
    for _ in range(inside):
        word &= word - 1
    return np.array([x, y, (word & -word).bit_length() - 1], dtype=np.int64)
