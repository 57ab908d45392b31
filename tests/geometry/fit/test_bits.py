"""Grids of bits against plain boolean arrays."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from pnabs.geometry.fit import bits
from pnabs.geometry.types import Bool

SEEDS = st.integers(0, 2**32 - 1)
SIDES = st.sampled_from([64, 128])


def cells(seed: int, share: float = 0.5, side: int = 64) -> Bool:
    return np.random.default_rng(seed).random((side, side, side)) < share


@given(SEEDS, SIDES)
@settings(deadline=None, max_examples=10)
def test_pack_and_unpack_are_inverse_and_bits_are_cells(seed: int, side: int) -> None:
    grid = cells(seed, 0.3, side)
    packed = bits.pack(grid)
    np.testing.assert_array_equal(bits.unpack(packed), grid)
    assert bits.count(packed) == np.count_nonzero(grid)
    x, y, z = np.argwhere(grid)[7]
    assert (int(packed[x, y, z // 64]) >> int(z % 64)) & 1


@given(st.integers(0, 2**64 - 1))
def test_ones_counts_the_bits_of_a_word(word: int) -> None:
    assert bits.ones(np.uint64(word)) == word.bit_count()


@given(st.tuples(st.integers(0, 191), st.integers(0, 191)).map(sorted))
def test_span_sets_the_bits_between_two(ends: list[int]) -> None:
    first, last = ends
    column = sum(int(bits.span(first, last, word)) << (64 * word) for word in range(3))
    assert column == sum(1 << k for k in range(first, last + 1))
    assert all(bits.span(last + 1, first, word) == 0 for word in range(3))


@pytest.mark.parametrize(("first", "last"), [(0, 63), (64, 64), (63, 64), (127, 128), (0, 191)])
def test_span_reaches_over_the_ends_of_words(first: int, last: int) -> None:
    column = sum(int(bits.span(first, last, word)) << (64 * word) for word in range(3))
    assert column == (1 << (last + 1)) - (1 << first)


@given(SEEDS)
@settings(deadline=None, max_examples=10)
def test_counts_go_up_and_down_cell_by_cell(seed: int) -> None:
    rng = np.random.default_rng(seed)
    planes = np.zeros((4, 2, 3, 2), dtype=np.uint64)
    counts = np.zeros((2, 3, 128), dtype=np.int64)
    for _ in range(300):
        x, y, w = int(rng.integers(2)), int(rng.integers(3)), int(rng.integers(2))
        some, add = rng.random(64) < 0.5, bool(rng.random() < 0.8)
        here = counts[x, y, 64 * w : 64 * w + 64]
        some &= here < 15 if add else here > 0
        mask = np.packbits(some, bitorder="little").view(np.uint64)[0]
        (bits.tell if add else bits.untell)(planes, x, y, w, mask)
        here += some if add else -some.astype(np.int64)
    digits = np.unpackbits(planes.view(np.uint8), axis=3, bitorder="little")
    np.testing.assert_array_equal(np.tensordot([1, 2, 4, 8], digits, axes=1), counts)
    assert counts.max() > 8


@pytest.mark.parametrize("side", [64, 128, 192])
def test_erosion_is_scipys_and_at_the_fold_that_of_the_whole(side: int) -> None:
    low = side // 2
    half = cells(3, 0.9, side)
    half[:low] = False
    whole = half | half[::-1]
    inner = ndimage.binary_erosion(whole)
    np.testing.assert_array_equal(bits.unpack(bits.eroded(bits.pack(whole), 0)), inner)
    folded = bits.unpack(bits.eroded(bits.pack(half), low))
    np.testing.assert_array_equal(folded[low:], inner[low:])
    assert not folded[:low].any()


@pytest.mark.parametrize("side", [64, 128])
@pytest.mark.parametrize("share", [0.001, 0.5])
def test_cells_by_rank_are_in_the_order_of_numpy(share: float, side: int) -> None:
    grid = cells(1, share, side)
    packed, expected = bits.pack(grid), np.argwhere(grid)
    for rank in (0, 1, len(expected) // 2, len(expected) - 1):
        np.testing.assert_array_equal(bits.cell_at(packed, rank), expected[rank])


@pytest.mark.parametrize("centre", [(0, 0, 0), (127, 5, 31), (30, 30, 65)])
def test_cells_near_are_those_within_the_ball(centre: tuple[int, int, int]) -> None:
    grid = cells(2, 0.2, 128)
    offsets = np.argwhere(grid) - np.array(centre)
    expected = offsets[np.linalg.norm(offsets, axis=1) <= 6]
    np.testing.assert_array_equal(bits.cells_near(bits.pack(grid), np.array(centre), 6), expected)
