"""Grids of cells as bits, a column of 64 cells a word: whole columns in a few operations.

`Bits` is (G, G, G / 64) uint64, indexed by x, y and word; bit b of word w is the cell
(x, y, 64 w + b).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pnabs.geometry.kernel import kernel
from pnabs.geometry.types import Bool

Bits = NDArray[np.uint64]

WORD = 64
"""Cells in a word: grids have a multiple of it along each side."""


def pack(cells: Bool) -> Bits:
    """(G, G, G) bool as bits."""
    octets = np.packbits(cells, axis=2, bitorder="little")
    return np.ascontiguousarray(octets).view(np.uint64).copy()


def unpack(bits: Bits) -> Bool:
    """The inverse of `pack`."""
    octets = np.ascontiguousarray(bits).view(np.uint8)
    return np.unpackbits(octets, axis=2, bitorder="little").astype(bool)


def nothing(side: int) -> Bits:
    """No cell set, of a grid with so many along a side."""
    return np.zeros((side, side, side // WORD), dtype=np.uint64)


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
def span(first: int, last: int, word: int) -> np.uint64:
    """The cells `first` to `last`, both included, that lie in a word of their column."""
    low, high = max(first - 64 * word, 0), min(last - 64 * word, 63)
    if low > high:
        return np.uint64(0)
    every = np.uint64(0xFFFFFFFFFFFFFFFF)
    return (every >> np.uint64(63 - high + low)) << np.uint64(low)


@kernel
def eroded(bits: Bits, low: int) -> Bits:
    """The cells whose six neighbours are set too.

    Parameters
    ----------
    bits : (G, G, G / 64) uint64
        Nothing set where x < `low`.
    low : int
        G / 2 if the grid is one half of a mirrored one: the neighbour of a cell at the plane is
        then its own mirror image.  Else 0.
    """
    one, top = np.uint64(1), np.uint64(63)
    side, words = bits.shape[0], bits.shape[2]
    out = np.zeros_like(bits)
    for x in range(low, side - 1):
        before = x if x == low and low > 0 else x - 1
        if before < 0:
            continue
        for y in range(1, side - 1):
            for w in range(words):
                word = bits[x, y, w]
                if word:
                    below = word << one
                    if w > 0:
                        below |= bits[x, y, w - 1] >> top
                    above = word >> one
                    if w < words - 1:
                        above |= bits[x, y, w + 1] << top
                    word = word & below & above & bits[before, y, w] & bits[x + 1, y, w]
                    out[x, y, w] = word & bits[x, y - 1, w] & bits[x, y + 1, w]
    return out


@kernel
def cells_near(bits: Bits, centre: NDArray[np.int64], radius: int) -> NDArray[np.float64]:
    """Offsets of the set cells within a ball, (K, 3) float64."""
    side = bits.shape[0]
    found = np.empty(((2 * radius + 1) ** 3, 3))
    k = 0
    for x in range(max(0, centre[0] - radius), min(side, centre[0] + radius + 1)):
        for y in range(max(0, centre[1] - radius), min(side, centre[1] + radius + 1)):
            dx, dy = x - centre[0], y - centre[1]
            for z in range(max(0, centre[2] - radius), min(side, centre[2] + radius + 1)):
                word = bits[x, y, z >> 6]
                if not (word >> np.uint64(z & 63)) & np.uint64(1):
                    continue
                dz = z - centre[2]
                if dx * dx + dy * dy + dz * dz <= radius * radius:
                    found[k, 0], found[k, 1], found[k, 2] = dx, dy, dz
                    k += 1
    return found[:k]


def cell_at(bits: Bits, rank: int) -> NDArray[np.int64]:
    """The set cell of that rank, x slowest: (3,) int64."""
    totals = np.cumsum(np.bitwise_count(bits).ravel())
    row = int(np.searchsorted(totals, rank, side="right"))
    x, y, w = np.unravel_index(row, bits.shape)
    inside = rank - int(totals[row - 1] if row else 0)
    word = int(bits[x, y, w])
    for _ in range(inside):
        word &= word - 1
    return np.array([x, y, WORD * w + (word & -word).bit_length() - 1], dtype=np.int64)


@kernel
def tell(planes: Bits, x: int, y: int, w: int, mask: np.uint64) -> None:
    """Add one to the counts of some cells of a word.

    Parameters
    ----------
    planes : (D, G, G, G / 64) uint64
        Counts from 0 to 2^D - 1, bit by bit, the least first.
    """
    for d in range(planes.shape[0]):
        if not mask:
            return
        both = planes[d, x, y, w] & mask
        planes[d, x, y, w] ^= mask
        mask = both


@kernel
def untell(planes: Bits, x: int, y: int, w: int, mask: np.uint64) -> None:
    """Take one from the counts of some cells of a word, none of which is 0; see `tell`."""
    for d in range(planes.shape[0]):
        if not mask:
            return
        planes[d, x, y, w] ^= mask
        mask &= planes[d, x, y, w]
