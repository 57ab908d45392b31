"""Tidying: each step does what it says, and none costs more than it may."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pnabs.geometry.fit import tidy
from pnabs.geometry.fit.assembly import Assembly, Box, Target
from pnabs.geometry.fit.bits import nothing
from pnabs.geometry.fit.box import is_aligned
from pnabs.geometry.types import Float64
from tests.geometry.fit.shapes import PLANE, painted, whole


def upright(centre: tuple[float, ...], half: tuple[float, ...], sign: int = 1) -> Box:
    return Box(np.array(centre, dtype=float), np.eye(3), np.array(half, dtype=float), sign)


def target(*boxes: Box) -> Target:
    bits = nothing(64)
    for box in boxes:
        bits |= painted(box)
    return whole(bits)


def faces(box: Box, sign: int = 1) -> tuple[Float64, Float64]:
    """Points on a box's faces, and normals."""
    grid = np.stack(np.meshgrid(*[np.linspace(-0.9, 0.9, 7)] * 2), axis=-1).reshape(-1, 2)
    points, normals = [], []
    for k in range(3):
        for side in (-1, 1):
            local = np.insert(grid, k, side, axis=1) * box.half
            points.append(box.centre + local @ box.axes.T)
            normals.append(np.tile(sign * side * box.axes[:, k], (len(grid), 1)))
    return np.concatenate(points), np.concatenate(normals)


def test_a_box_hardly_turned_is_straightened_and_one_that_needs_it_stays() -> None:
    straight = upright((30, 30, 30), (12, 6, 3))
    leaning = Box(
        np.array([20.0, 50.0, 20.0]),
        Rotation.from_euler("xyz", [0.4, 0.3, 0.5]).as_matrix(),
        np.array([9.0, 2.0, 2.0]),
    )
    crooked = straight._replace(axes=Rotation.from_euler("z", 0.04).as_matrix())
    assembly = Assembly(target(straight, leaning), [crooked, leaning])
    before = assembly.iou()
    tidy.straighten(assembly, before, 0.001 * assembly.total)
    assert np.array_equal(assembly.boxes[0].axes, np.eye(3))
    assert not is_aligned(assembly.boxes[1].axes)
    assert assembly.iou() >= before - 0.002


def test_a_box_in_another_frame_takes_it_exactly() -> None:
    frame = Rotation.from_euler("y", 0.5).as_matrix()
    large = Box(np.array([30.0, 30.0, 30.0]), frame, np.array([14.0, 3.0, 8.0]))
    small = Box(np.array([30.0, 18.0, 30.0]), frame, np.array([2.0, 10.0, 2.5]))
    off = small._replace(axes=Rotation.from_euler("y", 0.56).as_matrix()[:, [2, 0, 1]])
    off = off._replace(half=small.half[[2, 0, 1]])
    assembly = Assembly(target(large, small), [off, large])
    tidy.straighten(assembly, 0.95, 0.001 * assembly.total)
    own, other = assembly.boxes[0].axes, assembly.boxes[1].axes
    np.testing.assert_array_equal(own, other)
    assert not is_aligned(own)


def test_along_keeps_a_rotation_and_makes_one_axis_the_grids() -> None:
    axes = Rotation.from_euler("xyz", [0.2, 0.1, 0.3]).as_matrix()
    box = Box(np.full(3, 30.0), axes, np.array([3.0, 5.0, 7.0]))
    for axis in range(3):
        turned = tidy.along(box, axis)
        assert abs(turned.axes[axis, 0]) == 1
        np.testing.assert_allclose(turned.axes.T @ turned.axes, np.eye(3), atol=1e-12)
        assert np.linalg.det(turned.axes) == pytest.approx(1)
        assert sorted(turned.half) == sorted(box.half)


@pytest.mark.parametrize("sign", [1, -1])
def test_sides_settle_on_the_surface_between_the_layers(sign: int) -> None:
    true = upright((30.1, 30.05, 29.9), (12.2, 6.3, 4.15), sign)
    found = upright((30, 30, 30), (12.5, 6.5, 4.25), sign)
    block = upright((30, 30, 30), (20, 20, 20))
    if sign > 0:
        assembly = Assembly(target(true), [found])
    else:
        assembly = Assembly(whole(painted(block) & ~painted(true)), [block, found])
    points, normals = faces(true, sign)
    tidy.settle(assembly, points, normals, 0.9, 0.0)
    settled = assembly.boxes[-1]
    np.testing.assert_allclose(settled.bounds(), true.bounds(), atol=1e-9)


def test_a_thin_side_or_one_without_samples_stays() -> None:
    sheet = upright((30, 30, 30), (12.5, 0.5, 4.5))
    assembly = Assembly(target(sheet), [sheet])
    surface = upright((30, 30, 30), (12.5, 0.1, 4.5))
    points, normals = faces(surface)
    tidy.settle(assembly, points, normals, 0.9, 0.0)
    assert assembly.boxes[0].half[1] == 0.5


def test_neighbours_that_nearly_touch_overlap_and_nearly_flush_ones_become_so() -> None:
    seat = upright((30, 30, 30), (12.5, 2.5, 8.5))
    leg = upright((20.4, 17.3, 23.9), (2.0, 10.0, 2.0))  # its top is 0.2 below the seat
    beside = upright((42.6, 30.2, 30.0), (0.6, 2.6, 4.5))  # its top is 0.3 above the seat's
    assembly = Assembly(target(seat, leg, beside), [seat, leg, beside])
    before = assembly.iou()
    tidy.join(assembly, 0.9, 0.0, 0.06)
    _, joined, flush = assembly.boxes
    assert joined.bounds()[1, 1] == pytest.approx(seat.bounds()[0, 1] + 0.06)
    assert joined.bounds()[0, 1] == pytest.approx(leg.bounds()[0, 1])
    assert flush.bounds()[1, 1] == pytest.approx(seat.bounds()[1, 1])
    assert assembly.iou() >= before
    np.testing.assert_array_equal(assembly.boxes[0].half, seat.half)


def test_negatives_reach_out_of_the_opening_but_not_into_the_solid() -> None:
    block = upright((30, 30, 30), (10, 10, 10))
    hole = upright((30, 34, 30), (6, 6, 6), -1)  # open above
    assembly = Assembly(whole(painted(block) & ~painted(hole)), [block, hole])
    tidy.open_out(assembly, 0.9)
    low, high = assembly.boxes[1].bounds()
    assert high[1] >= block.bounds()[1, 1] + 0.5
    np.testing.assert_allclose([low, high[[0, 2, 0]]], [[24, 28, 24], [36, 36, 36]])
    assert assembly.iou() == 1


def test_folded_samples_lie_on_one_side() -> None:
    points = np.array([[10.0, 1, 2], [40.0, 3, 4]])
    normals = np.array([[-1.0, 0, 0], [1.0, 0, 0]])
    there, facing = tidy.folded(points, normals, PLANE)
    np.testing.assert_array_equal(there, [[2 * PLANE - 10, 1, 2], [40, 3, 4]])
    np.testing.assert_array_equal(facing, [[1, 0, 0], [1, 0, 0]])
    assert points[0, 0] == 10


def test_two_boxes_are_merged_where_one_serves_as_well() -> None:
    left, right = upright((20, 32, 32), (6, 4, 8)), upright((31.5, 32, 32), (6, 4, 8))
    apart, taller = upright((50, 32, 32), (3, 4, 8)), upright((25.5, 42, 32), (3, 9, 8))
    assembly = Assembly(target(left, right, apart, taller), [left, right, apart, taller])
    tidy.merge(assembly, 0.002)
    assert len(assembly) == 3
    assert assembly.iou() == 1
    np.testing.assert_allclose(assembly.boxes[0].bounds(), [[14, 28, 24], [37.5, 36, 40]])


def test_boxes_that_leave_too_much_between_them_stay_two() -> None:
    low, high = upright((20, 32, 32), (6, 4, 8)), upright((33.5, 32, 32), (6, 4, 8))
    assembly = Assembly(target(low, high), [low, high])
    tidy.merge(assembly, 0.002)
    assert len(assembly) == 2
    tidy.merge(assembly, 0.2)
    assert len(assembly) == 1
