"""Boxes on the grid against points in cuboids."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pnabs.geometry.fit import bits
from pnabs.geometry.fit.assembly import ANYWHERE, Box
from pnabs.geometry.fit.box import cells_beyond, is_aligned, outside
from pnabs.geometry.fit.search import Field, tally
from tests.geometry.fit.shapes import PLANE, contained

SEEDS = st.integers(0, 2**32 - 1)


def random_box(seed: int, *, aligned: bool = False, low: float = 0.0) -> Box:
    """Some of it may lie outside the grid."""
    rng = np.random.default_rng(seed)
    axes = (
        np.eye(3)[rng.permutation(3)] if aligned else Rotation.random(random_state=rng).as_matrix()
    )
    return Box(rng.uniform(low, 64, 3), axes, rng.uniform(0.5, 20, 3))


def beyond(box: Box) -> int:
    """Points with whole coordinates in the box and outside the grid, by their definition."""
    low, high = np.floor(box.bounds()[0]), np.ceil(box.bounds()[1])
    points = np.stack(
        np.meshgrid(*(np.arange(a, b + 1) for a, b in zip(low, high, strict=True)), indexing="ij"),
        axis=-1,
    )
    inside = np.all(np.abs((points - box.centre) @ box.axes) <= box.half + 1e-9, axis=-1)
    return int(np.sum(inside & np.any((points < 0) | (points > 63), axis=-1)))


@given(SEEDS, st.booleans(), st.booleans(), st.sampled_from([1, -1]))
@settings(deadline=None, max_examples=20)
def test_tally_counts_the_cells_of_the_box_and_its_image_once(
    seed: int, aligned: bool, folded: bool, sign: int
) -> None:
    rng = np.random.default_rng(seed)
    added, removed, near, far = (rng.random((64, 64, 64)) < 0.5 for _ in range(4))
    if not folded:
        far = near
    free = (~added if sign > 0 else added) & ~removed
    box, low = random_box(seed, aligned=aligned), 32 if folded else 0
    inside = contained(box)
    if folded:
        inside = inside | inside[::-1]
    inside[:low] = False
    shapes, others = (bits.pack(near), bits.pack(far)), (bits.pack(added), bits.pack(removed))
    field = Field(*shapes, *others, low, ANYWHERE, np.zeros((0, 3)), 0.0, 0.0)
    hits, cells = tally(box.centre, box.axes, box.half, field, sign, folded)
    inside &= free
    assert hits == np.count_nonzero(near & inside) + np.count_nonzero(far & inside)
    assert cells == 2 * np.count_nonzero(free & inside)


@given(SEEDS)
@settings(deadline=None, max_examples=20)
def test_a_mirrored_box_has_the_mirrored_cells_and_is_a_rotation(seed: int) -> None:
    box = random_box(seed)
    image = box.mirrored(PLANE)
    np.testing.assert_array_equal(contained(image), contained(box)[::-1])
    assert np.linalg.det(image.axes) == pytest.approx(1)
    np.testing.assert_allclose(image.bounds()[:, 0], 2 * PLANE - box.bounds()[::-1, 0])


def test_aligned_is_along_the_grid_in_any_order() -> None:
    assert is_aligned(np.eye(3)[[2, 0, 1]])
    assert is_aligned(np.diag([-1.0, -1.0, 1.0]))
    assert not is_aligned(Rotation.from_euler("x", 1e-3).as_matrix())


@given(SEEDS, st.booleans())
@settings(deadline=None, max_examples=20)
def test_cells_beyond_the_grid_are_counted_as_if_it_went_on(seed: int, aligned: bool) -> None:
    rng = np.random.default_rng(seed)
    box = random_box(seed, aligned=aligned)._replace(centre=rng.uniform(-25, 90, 3))
    assert cells_beyond(*box[:3], 64) == beyond(box)
    assert outside(*box[:3], ANYWHERE, 64)[1] or beyond(box) == 0


def test_a_box_beside_the_grid_has_all_its_cells_beyond() -> None:
    box = Box(np.array([-10.0, 30, 70]), np.eye(3), np.array([2.5, 1.5, 0.5]))
    assert cells_beyond(*box[:3], 64) == 5 * 3 * 1
    within = box._replace(centre=np.array([2.0, 30, 63]))
    assert cells_beyond(*within[:3], 64) == 0
    assert cells_beyond(*within._replace(centre=np.array([1.0, 30, 63]))[:3], 64) == 3


def test_a_box_stands_out_only_along_axes_that_are_not_its_own() -> None:
    turned = Rotation.from_euler("z", np.pi / 4).as_matrix()
    box = Box(np.array([PLANE + 5, PLANE, PLANE]), turned, np.array([3.0, 3.0, 8.0]))
    reach = 5 + 3 * np.sqrt(2)
    far, leaves = outside(*box[:3], (reach - 0.25, 60.0, 1.0), 64)
    assert far == pytest.approx(0.25)
    assert not leaves
    straight = box._replace(axes=np.eye(3))
    assert outside(*straight[:3], (1.0, 1.0, 1.0), 64) == (0, False)
