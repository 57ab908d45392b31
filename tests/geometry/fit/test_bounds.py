"""Fits stay inside the shape's bounding box, with the sides that the shape has there."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pnabs.geometry import quaternion
from pnabs.geometry.cuboid import corners, to_mesh
from pnabs.geometry.fields import compute_fields
from pnabs.geometry.fit import tidy
from pnabs.geometry.fit.assembly import Assembly, Box
from pnabs.geometry.fit.build import Terms
from pnabs.geometry.fit.contain import Bounds
from pnabs.geometry.fit.fit import STANDS_OUT, Fitted, fit
from pnabs.geometry.metrics import iou, predicted_occupancy
from pnabs.geometry.normalise import normalise
from pnabs.geometry.types import Cuboids, Float64, Mesh
from pnabs.settings import Ingest
from tests.geometry.boxes import random_cuboids
from tests.geometry.fit.shapes import CELL, PLANE, TABLE, occupied, surface, upright
from tests.geometry.fit.test_tidy import target
from tests.geometry.fit.test_tidy import upright as upright_box

MIN_SIDE = 2e-3
TURN = Rotation.from_euler("xyz", [0.4, 0.3, 0.5])


def sides_of(positives: Cuboids) -> Float64:
    """Sides of the box about the origin that just holds them."""
    return np.asarray(2 * np.abs(corners(positives)).max(axis=(0, 1)))


def stands_out(positives: Cuboids, sides: Float64) -> float:
    """How far they leave a box about the origin of those sides."""
    return float((np.abs(corners(positives)) - sides / 2).max())


def block(sides: tuple[float, float, float], turn: Float64 | None = None) -> Mesh:
    """A block as a mesh in its own units, as files hold it."""
    mesh = to_mesh(Cuboids.from_vector(np.array([[*sides, 1, 0, 0, 0, 0, 0, 0]], dtype=float)))
    return Mesh(mesh.vertices @ (np.eye(3) if turn is None else turn).T, mesh.faces)


def fitted_mesh(mesh: Mesh, *, strict: bool = False) -> tuple[Fitted, Float64, float]:
    """A mesh's fit, the sides of its bounding box, and its longest side in its own units."""
    fields = compute_fields(mesh, Ingest(), "folder", np.random.default_rng(0))
    vertices = normalise(mesh)[0].vertices
    sides = vertices.max(axis=0) - vertices.min(axis=0)
    found = fit(
        fields.occupancy_64,
        fields.occupancy_192,
        fields.surface,
        fields.mirror,
        Terms(20, 0.004),
        np.random.default_rng(0),
        extent=sides,
        min_side=MIN_SIDE,
        sizes=(1,),
        strict=strict,
    )
    return found, sides, float(fields.transform[0, 0])


@pytest.mark.parametrize(
    "sides",
    [(600, 400, 2), (2, 600, 400), (400, 3, 600), (500, 500, 12)],
)
def test_a_plate_has_its_sides_though_it_is_thinner_than_a_cell(
    sides: tuple[float, float, float],
) -> None:
    found, _, unit = fitted_mesh(block(sides))
    for boxes in (found, found.coarser[1]):
        assert (len(boxes.positives), len(boxes.negatives)) == (1, 0)
        np.testing.assert_allclose(boxes.positives.scale[0] * unit, sides, rtol=1e-6)
        np.testing.assert_allclose(boxes.positives.translation[0], 0, atol=1e-7)


def test_a_sheet_without_thickness_gets_the_least() -> None:
    sheet = block((600, 400, 2))
    found, _, unit = fitted_mesh(Mesh(sheet.vertices * np.array([1, 1, 0]), sheet.faces))
    assert len(found.positives) == 1
    np.testing.assert_allclose(found.positives.scale[0] * unit, [600, 400, 1.2], rtol=1e-6)
    np.testing.assert_allclose(found.positives.translation[0], 0, atol=1e-7)


@pytest.mark.parametrize("strict", [False, True])
def test_a_turned_plate_stays_inside(strict: bool) -> None:
    found, sides, unit = fitted_mesh(block((600, 400, 60), TURN.as_matrix()), strict=strict)
    assert (len(found.positives), len(found.negatives)) == (1, 0)
    most = (0 if strict else STANDS_OUT) + 1e-6
    for boxes in (found, found.coarser[1]):
        assert stands_out(boxes.positives, sides) <= most
    np.testing.assert_allclose(
        np.sort(found.positives.scale[0] * unit), [60, 400, 600], atol=CELL * unit
    )


def test_a_turned_post_ends_at_the_floor_exactly() -> None:
    turn = Rotation.from_euler("y", 0.5).as_matrix()
    found, sides, _ = fitted_mesh(block((200, 615, 120), turn))
    assert found.aligned == 0
    heights = corners(found.positives)[0, :, 1]
    np.testing.assert_allclose(
        [heights.min(), heights.max()], [-sides[1] / 2, sides[1] / 2], atol=1e-6
    )


def test_boards_at_the_edge_end_where_the_shape_does() -> None:
    rows = [[600, 3, 400, 1, 0, 0, 0, 0, -148.5, 0], [3, 300, 400, 1, 0, 0, 0, -298.5, 0, 0]]
    found, sides, _ = fitted_mesh(to_mesh(Cuboids.from_vector(np.array(rows, dtype=float))))
    assert len(found.positives) == 2
    ends = corners(found.positives).reshape(-1, 3)
    np.testing.assert_allclose(ends.max(axis=0), sides / 2, atol=1e-6)
    np.testing.assert_allclose(ends.min(axis=0), -sides / 2, atol=1e-6)


@pytest.mark.parametrize("mirror", [-1, 0])
@pytest.mark.parametrize("strict", [False, True])
def test_boxes_to_begin_with_that_lie_far_outside_leave_no_trace(mirror: int, strict: bool) -> None:
    far = upright(
        ((20, 20, 20), (0, -52, 0)), ((12, 8, 60), (52, 0, 0)), ((9, 9, 9), (-52, 52, 52))
    )
    lean = np.tile(TURN.as_quat(scalar_first=True).astype(np.float32), (3, 1))
    turned = Cuboids(far.scale, lean, far.translation)
    shape, sides = occupied(TABLE), sides_of(TABLE)
    found = fit(
        shape,
        occupied(TABLE, side=192),
        surface(TABLE),
        mirror,
        Terms(20, 0.004),
        np.random.default_rng(0),
        extent=sides,
        min_side=MIN_SIDE,
        start=(TABLE.joined(far).joined(turned), turned),
        scattered=False,
        sizes=(2, 4),
        strict=strict,
    )
    cells = predicted_occupancy(found.positives, found.negatives, 64, MIN_SIDE)
    assert iou(cells, shape) == 1
    for boxes in (found, *found.coarser.values()):
        assert stands_out(boxes.positives, sides) <= STANDS_OUT + 1e-6


@given(st.integers(0, 2**32 - 1), st.sampled_from([-1, 0, 2]), st.booleans())
@settings(deadline=None, max_examples=4)
def test_any_fit_and_its_levels_stay_inside(seed: int, mirror: int, strict: bool) -> None:
    one = random_cuboids(seed, 2, spread=0.15)
    shape = one
    if mirror >= 0:
        image = Cuboids(one.scale, quaternion.mirror(one.rotation, mirror), one.translation.copy())
        image.translation[:, mirror] *= -1
        shape = one.joined(image)
    sides = sides_of(shape)
    found = fit(
        occupied(shape),
        occupied(shape, side=192),
        surface(shape),
        mirror,
        Terms(8, 0.004),
        np.random.default_rng(0),
        extent=sides,
        min_side=MIN_SIDE,
        sizes=(2, 4),
        strict=strict,
    )
    finest = len(found.positives) + len(found.negatives)
    for boxes in (found, *found.coarser.values()):
        assert stands_out(boxes.positives, sides) <= (0 if strict else STANDS_OUT) + 1e-6
        assert (boxes.positives.scale >= MIN_SIDE).all()
    for level in found.coarser.values():
        assert len(level.origins) == len(level.positives) + len(level.negatives)
        assert all(0 <= index < finest for origin in level.origins for index in origin)


def test_what_stands_out_is_held_inside_and_fitted_again() -> None:
    turned = Rotation.from_euler("z", 0.6).as_matrix()
    shape = Box(np.array([PLANE, PLANE, 30.0]), turned, np.array([12.0, 4.0, 6.0]))
    bounds = Bounds(np.append(shape.bounds()[1, :2] - PLANE, 20.0), 0.12, 0.1, PLANE)
    assembly = Assembly(target(shape), [shape._replace(half=np.array([15.0, 4.0, 6.0]))])
    tidy.hold(assembly, bounds, 0.0)
    held = assembly.boxes[0].bounds()[:, :2] - PLANE
    assert np.all(np.abs(held) <= bounds.half[:2] + 0.1 + 1e-6)
    assert assembly.iou() > 0.97


def test_boxes_within_the_bounds_or_a_cell_beyond_along_the_grid_stay_when_held() -> None:
    turned = Rotation.from_euler("y", 0.6).as_matrix()
    # in y, an axis of its own, it is as thick as a cell, and the bounds have nothing
    sheet = Box(np.array([PLANE, 32.0, PLANE]), turned, np.array([12.0, 0.5, 6.0]))
    straight = upright_box((10, 32, 10), (4, 0.5, 4))
    assembly = Assembly(target(sheet, straight), [sheet, straight])
    tidy.hold(assembly, Bounds(np.array([29.0, 0.0, 29.0]), 0.12, 0.1, PLANE), 0.0)
    assert assembly.boxes[0] is sheet
    assert assembly.boxes[1] is straight
