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


def cells(seed: int, share: float = 0.5) -> Bool:
    return np.random.default_rng(seed).random((64, 64, 64)) < share


@given(SEEDS)
@settings(deadline=None, max_examples=10)
def test_pack_and_unpack_are_inverse_and_bits_are_cells(seed: int) -> None:
    grid = cells(seed, 0.3)
    packed = bits.pack(grid)
    np.testing.assert_array_equal(bits.unpack(packed), grid)
    assert bits.count(packed) == np.count_nonzero(grid)
    x, y, z = np.argwhere(grid)[7]
    assert (int(packed[x, y]) >> int(z)) & 1


@given(st.integers(0, 2**64 - 1))
def test_ones_counts_the_bits_of_a_word(word: int) -> None:
    assert bits.ones(np.uint64(word)) == word.bit_count()


@given(st.tuples(st.integers(0, 63), st.integers(0, 63)).map(sorted))
def test_span_sets_the_bits_between_two(ends: list[int]) -> None:
    first, last = ends
    assert int(bits.span(first, last)) == sum(1 << k for k in range(first, last + 1))


def test_erosion_is_scipys_and_at_the_fold_that_of_the_whole() -> None:
    half = cells(3, 0.9)
    half[:32] = False
    whole = half | half[::-1]
    inner = ndimage.binary_erosion(whole)
    np.testing.assert_array_equal(bits.unpack(bits.eroded(bits.pack(whole), 0)), inner)
    folded = bits.unpack(bits.eroded(bits.pack(half), 32))
    np.testing.assert_array_equal(folded[32:], inner[32:])
    assert not folded[:32].any()


@pytest.mark.parametrize("share", [0.001, 0.5])
def test_cells_by_rank_are_in_the_order_of_numpy(share: float) -> None:
    grid = cells(1, share)
    packed, expected = bits.pack(grid), np.argwhere(grid)
    for rank in (0, 1, len(expected) // 2, len(expected) - 1):
        np.testing.assert_array_equal(bits.cell_at(packed, rank), expected[rank])


@pytest.mark.parametrize("centre", [(0, 0, 0), (63, 5, 31), (30, 30, 30)])
def test_cells_near_are_those_within_the_ball(centre: tuple[int, int, int]) -> None:
    grid = cells(2, 0.2)
    offsets = np.argwhere(grid) - np.array(centre)
    expected = offsets[np.linalg.norm(offsets, axis=1) <= 6]
    np.testing.assert_array_equal(bits.cells_near(bits.pack(grid), np.array(centre), 6), expected)
