"""The rasteriser and the pictures against exact geometry."""

from __future__ import annotations

import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from scipy.spatial import ConvexHull

from pnabs.geometry.types import Mesh
from pnabs.report import View, empty_mesh
from pnabs.report.pictures import (
    PALETTE,
    Frame,
    connected_parts,
    encode,
    part_colours,
    render,
    rgb,
)
from pnabs.report.raster import outlines, rasterise

GREY = np.array([0.6, 0.6, 0.6])


def depth(mesh, view, frame, size):
    return rasterise(frame.to_pixels(view.project(mesh.triangles), size), size, size)


def test_box_silhouette_has_the_area_of_its_projected_hull(box_mesh):
    mesh, view, size = box_mesh(((-0.5, -0.2, -0.3), (0.5, 0.2, 0.3))), View(), 400
    frame = Frame.around([mesh], view)
    _, face = depth(mesh, view, frame, size)
    hull = ConvexHull(frame.to_pixels(view.project(mesh.vertices), size)[:, :2])
    # A pixel centre is in or out, so the count errs by less than the outline's length.
    assert abs((face >= 0).sum() - hull.volume) < 0.5 * hull.area


@given(st.lists(st.floats(1, 39), min_size=6, max_size=6), st.permutations([0, 1, 2]))
def test_triangle_covers_just_the_pixel_centres_inside_of_it(flat, order):
    corners = np.array(flat).reshape(3, 2)
    area = np.linalg.det(np.column_stack([corners, np.ones(3)]))
    if abs(area) < 1e-3:
        return
    w, face = rasterise(np.column_stack([corners, np.ones(3)])[None, list(order)], 40, 40)
    centre = np.stack(np.meshgrid(np.arange(40) + 0.5, np.arange(40) + 0.5), axis=-1)
    signs = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        edge, rest = corners[b] - corners[a], centre - corners[a]
        signs.append((edge[0] * rest[..., 1] - edge[1] * rest[..., 0]) * np.sign(area))
    inside = np.min(signs, axis=0)
    np.testing.assert_array_equal(face[inside > 1e-6], 0)
    np.testing.assert_array_equal(face[inside < -1e-6], -1)
    np.testing.assert_allclose(w[inside > 1e-6], 1)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_nearer_triangle_hides_the_farther_in_any_order(order):
    near = np.array([[2, 2, 0.5], [30, 2, 0.5], [2, 30, 0.5]])
    far = np.array([[0, 0, 0.2], [40, 0, 0.2], [0, 40, 0.2]])
    w, face = rasterise(np.stack([near, far])[list(order)], 40, 40)
    assert face[5, 5] == order.index(0)
    assert w[5, 5] == pytest.approx(0.5)
    assert face[1, 30] == order.index(1)


def test_crossing_triangles_meet_where_their_depths_do():
    level = np.array([[0, 0, 0.5], [80, 0, 0.5], [0, 80, 0.5]])
    slope = np.array([[0, 0, 0.25], [80, 0, 1.05], [0, 80, 0.25]])  # w = 0.25 + column / 100
    _, face = rasterise(np.stack([level, slope]), 20, 40)
    np.testing.assert_array_equal(face[3], np.arange(40) >= 25)


def test_of_coplanar_faces_one_wins_everywhere(box_mesh):
    a, b = ((-0.5, -0.5, -0.5), (0.1, 0.5, 0.5)), ((-0.1, -0.5, -0.5), (0.5, 0.5, 0.5))
    mesh, view = box_mesh(a, b), View(azimuth=0, elevation=0)
    _, face = depth(mesh, view, Frame.around([mesh], view), 60)
    box = np.where(face >= 0, face // 12, -1)
    assert all(len(np.unique(column[column >= 0])) <= 1 for column in box.T)


def test_triangles_without_area_or_outside_of_the_picture_draw_nothing():
    flat = np.array([[1, 1, 1], [5, 5, 1], [9, 9, 1]], dtype=np.float64)
    outside = np.array([[100, 1, 1], [105, 1, 1], [100, 9, 1]], dtype=np.float64)
    _, face = rasterise(np.stack([flat, outside]), 20, 20)
    assert (face == -1).all()


def test_camera_looks_from_the_front_above_and_sees_the_front(box_mesh):
    view = View()
    assert view.axes() @ view.axes().T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(view.axes()) == pytest.approx(1)
    front, back, top, bottom = view.project(
        np.array([[0, 0, -0.5], [0, 0, 0.5], [0, 0.5, 0], [0, -0.5, 0]])
    )
    assert front[2] > back[2]
    assert top[1] > bottom[1]
    assert top[2] > bottom[2]
    straight = View(azimuth=0, elevation=0)
    # Seen from the front, a model's +X side is to the left.
    assert straight.project(np.array([0.5, 0, 0]))[0] < 0


def test_frame_holds_all_meshes(box_mesh):
    view = View()
    meshes = [box_mesh(((-0.5, -0.1, -0.1), (0, 0.1, 0.1))), box_mesh(((0, 0, 0), (1, 2, 0.5)))]
    frame = Frame.around(meshes, view)
    for mesh in meshes:
        pixels = frame.to_pixels(view.project(mesh.vertices), 100)[:, :2]
        assert pixels.min() >= 0
        assert pixels.max() <= 100


def test_outline_strengths_of_a_box(box_mesh):
    mesh, view = box_mesh(((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))), View(azimuth=45, elevation=0)
    w, face = depth(mesh, view, Frame.around([mesh], view), 401)
    normals = np.repeat(np.eye(3)[[0, 0, 1, 1, 2, 2]], 2, axis=0)  # as the faces of `boxes`
    lines = outlines(w, face, np.ascontiguousarray(normals), np.zeros(12, dtype=np.int64))
    shape = np.flatnonzero(face[200] >= 0)
    left, crease = shape[0], np.flatnonzero(np.diff(face[200] // 2) != 0)[1]
    assert lines[200, left] == 1  # silhouette
    assert lines[200, shape[-1]] == 1
    assert lines[200, crease] == pytest.approx(0.6)  # between the two sides
    # Nothing within a side, the diagonals of its triangles included.
    assert lines[100:300, left + 5 : crease - 5].max() == 0


def test_render_is_transparent_around_and_opaque_inside(box_mesh):
    picture = render(box_mesh(((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))), GREY, size=64)
    assert picture.shape == (64, 64, 4)
    assert picture.dtype == np.uint8
    assert picture[0, 0, 3] == 0
    assert picture[30, 32, 3] == 255


def test_top_of_a_box_is_lighter_than_its_sides(box_mesh):
    picture = render(box_mesh(((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))), GREY, size=120)
    grey = picture[:, 60, :3].astype(int).sum(axis=1)[picture[:, 60, 3] == 255]
    assert grey[len(grey) // 8] > grey[len(grey) // 2] + 40


def test_winding_of_faces_does_not_matter(box_mesh):
    mesh = box_mesh(((-0.5, -0.2, -0.3), (0.5, 0.2, 0.3)))
    flipped = Mesh(mesh.vertices, np.ascontiguousarray(mesh.faces[:, ::-1]))
    same = np.abs(render(mesh, GREY, size=60).astype(int) - render(flipped, GREY, size=60)) <= 1
    assert same.mean() > 0.999


def test_faces_have_the_colours_of_their_parts(box_mesh):
    mesh = box_mesh(((-0.5, -0.2, -0.2), (-0.1, 0.2, 0.2)), ((0.1, -0.2, -0.2), (0.5, 0.2, 0.2)))
    parts = connected_parts(mesh)
    np.testing.assert_array_equal(parts, np.repeat([0, 1], 12))
    colours = np.array([[1.0, 0, 0], [0, 1.0, 0]])[parts]
    picture = render(mesh, colours, parts=parts, view=View(azimuth=0), size=90).astype(int)
    assert picture[45, 70, 0] > picture[45, 70, 1] + 100  # -X is to the right from the front
    assert picture[45, 20, 1] > picture[45, 20, 0] + 100


def test_parts_are_numbered_by_their_first_face(box_mesh):
    mesh = box_mesh(*[((i, 0, 0), (i + 0.5, 1, 1)) for i in range(3)])
    turned = Mesh(mesh.vertices, mesh.faces[::-1].copy())
    np.testing.assert_array_equal(connected_parts(turned), np.repeat([0, 1, 2], 12))
    assert len(connected_parts(empty_mesh())) == 0


def test_part_colours_cycle_and_have_a_plain_one():
    colours = part_colours(np.array([0, len(PALETTE), 1, -1]), "#ff0000")
    np.testing.assert_array_equal(colours[0], colours[1])
    np.testing.assert_array_equal(colours[3], [1, 0, 0])
    assert (colours[0] != colours[2]).any()
    assert rgb("#0080ff") == pytest.approx([0, 128 / 255, 1])


def test_negatives_redden_what_they_cover_inside_of_the_positives_too(box_mesh):
    mesh = box_mesh(((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)))
    inside = box_mesh(((-0.2, -0.2, -0.2), (0.2, 0.2, 0.2)))
    view = View()
    frame = Frame.around([mesh], view)
    plain = render(mesh, GREY, view=view, frame=frame, size=90).astype(int)
    crossed = render(mesh, GREY, overlay=inside, view=view, frame=frame, size=90).astype(int)
    redness = (crossed - plain)[..., 0] - (crossed - plain)[..., 1]
    assert redness[45, 45] > 30
    _, face = depth(inside, view, frame, 90)
    ring = np.zeros((90, 90), dtype=bool)
    rows, columns = np.nonzero(face >= 0)
    ring[rows.min() - 2 : rows.max() + 3, columns.min() - 2 : columns.max() + 3] = True
    np.testing.assert_array_equal(plain[~ring], crossed[~ring])


def test_hidden_parts_of_negatives_are_fainter(box_mesh):
    mesh = box_mesh(((-0.5, -0.5, -0.1), (0.5, 0.5, 0.5)))
    view = View(azimuth=0, elevation=0)
    frame = Frame.around([mesh], view)
    shown = []
    for z in ((-0.3, -0.2), (0.1, 0.2)):
        negative = box_mesh(((-0.2, -0.2, z[0]), (0.2, 0.2, z[1])))
        picture = render(mesh, GREY, overlay=negative, view=view, frame=frame, size=80)
        shown.append(int(picture[40, 40, 0]) - int(picture[40, 40, 1]))
    assert shown[0] > shown[1] > 0


def test_empty_and_broken_meshes_give_pictures(box_mesh):
    nothing = render(empty_mesh(), GREY, overlay=empty_mesh(), size=32)
    assert not nothing.any()
    mesh = box_mesh(((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)))
    broken = Mesh(
        np.vstack([mesh.vertices, [np.nan] * 3, [np.inf] * 3]), np.vstack([mesh.faces, [0, 8, 9]])
    )
    np.testing.assert_array_equal(render(mesh, GREY, size=40), render(broken, GREY, size=40))


def test_a_point_beyond_the_camera_does_no_harm():
    mesh = Mesh(np.array([[0, 0, 0], [0, 1, 0], [0, 0, -1e6]]), np.array([[0, 1, 2]]))
    assert render(mesh, GREY, size=24).shape == (24, 24, 4)


def test_the_same_mesh_gives_the_same_bytes(box_mesh):
    mesh = box_mesh(((-0.5, -0.2, -0.3), (0.5, 0.2, 0.3)))
    for form in ("png", "webp"):
        assert encode(render(mesh, GREY, size=48), form) == encode(
            render(mesh, GREY, size=48), form
        )


def test_png_keeps_pixels_and_webp_comes_near(box_mesh):
    picture = render(box_mesh(((-0.5, -0.2, -0.3), (0.5, 0.2, 0.3))), GREY, size=64)
    back = np.asarray(Image.open(io.BytesIO(encode(picture, "png"))))
    np.testing.assert_array_equal(back, picture)
    lossy = np.asarray(Image.open(io.BytesIO(encode(picture, "webp")))).astype(int)
    assert lossy.shape == picture.shape
    assert np.abs(lossy - picture)[picture[..., 3] == 255].mean() < 6
