"""OBJ text: numbers, polygons, and what is wrong in which line."""

from __future__ import annotations

import io

import numpy as np
import pytest
import trimesh
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pnabs.dataset.samples.collection import make_model
from pnabs.geometry.obj import ObjError, parse_obj
from pnabs.geometry.polygon import LONGEST_EXACT, PolygonError, TooManyFacesError
from pnabs.geometry.types import Float64, Mesh

CORNERS = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def parsed(text: str, max_faces: int = 10**6) -> Mesh:
    return parse_obj(text.encode(), max_faces)


def area(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def polygon(points: Float64) -> str:
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    return "\n".join([*lines, "f " + " ".join(str(i + 1) for i in range(len(points)))])


@settings(deadline=None)
@given(st.floats(-1e300, 1e300))
@example(5e-324)
@example(-0.1)
@example(123456789012345678901234567890.0)
def test_numbers_are_read_to_the_last_places(value: float) -> None:
    for text in (repr(value), f"{value:e}", f"{value:.30g}", f"+{abs(value)}"):
        found = parsed(f"v {text} 0 0\n").vertices[0, 0]
        expected = float(text)
        # a denormal has no last places to be right in
        assert found == pytest.approx(expected, rel=1e-14, abs=5e-323)


@pytest.mark.parametrize("text", ["nan", "-nan", "NaN", "inf", "-Infinity"])
def test_words_that_are_no_numbers_but_spell_one(text: str) -> None:
    assert np.isnan(parsed(f"v {text} 0 0\n").vertices[0, 0])


@pytest.mark.parametrize("text", ["x", "1,5", "0x10", "1e", "1e+", "--1", ".", "1.2.3", "1_0"])
def test_what_is_no_number_is_an_error(text: str) -> None:
    with pytest.raises(ObjError, match="line 2: not a number"):
        parsed(f"v 0 0 0\nv 0 {text} 0\n")


def test_every_way_of_writing_a_face() -> None:
    ways = ["f 1 2 3", "f 1/1 2/2 3/3", "f 1//1 2//2 3//3", "f 1/1/1 2/2/2 3/3/3", "f -4 -3 -2"]
    ways += ["  f\t1  2\t3  ", "f 1 2 3 # a comment", "f 1 2 \\\n3", "f 1 2 \\\r\n3", "f +1 +2 +3"]
    for way in ways:
        found = parsed(CORNERS + way + "\n")
        assert found.faces.tolist() == [[0, 1, 2]], way


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_line_ends(end: str) -> None:
    found = parsed((CORNERS + "f 1 2 3\nf 1 3 4").replace("\n", end))
    assert found.vertices.shape == (4, 3)
    assert found.faces.shape == (2, 3)


def test_all_else_is_passed_over() -> None:
    text = (
        "# v 9 9 9\nmtllib ../x.mtl\no v\nvn 0 0 1\nvt 0 0\nvp 1\ng f 1 2\ns 1\nusemtl f\nl 1 2\n"
    )
    found = parsed(text + "v 0 0 0 1 0.5 0.5\nv 1 0 0\nv 0 1 0\nfoo\nf 1 2\nf 1 2 3\n")
    assert found.vertices[0].tolist() == [0, 0, 0]
    assert found.faces.tolist() == [[0, 1, 2]]


def test_negative_numbers_count_from_the_last_vertex_so_far() -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 5 5\nv 6 5 5\nv 5 6 5\nf -3 -2 -1\nf 7 1 2\n"
    assert parsed(text + "v 7 7 7\n").faces.tolist() == [[0, 1, 2], [3, 4, 5], [6, 0, 1]]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("f 1 2 5", "names vertex 5, but there are 4"),
        ("f 1 2 99999999999999999999", "names vertex"),
        ("f 1 -5 2", "before the first"),
        ("f 0 1 2", "index 0"),
        ("f 1 2 00", "index 0"),
        ("f 1 2 x", "not a vertex number"),
        ("f 1 2 /3", "not a vertex number"),
        ("f 1 2 2.5", "not a vertex number"),
        ("v 1 2", "fewer than three"),
        ("v ", "fewer than three"),
    ],
)
def test_errors_name_the_line(line: str, said: str) -> None:
    with pytest.raises(ObjError, match=f"line 5: .*{said}"):
        parsed(CORNERS + line + "\nf 1 2 3\n")


def test_reading_stops_at_the_limit() -> None:
    assert len(parsed(CORNERS + "f 1 2 3 4\n", max_faces=2).faces) == 2
    with pytest.raises(TooManyFacesError):
        parsed(CORNERS + "f 1 2 3 4\nf 1 2 3\nf nonsense\n", max_faces=2)


def test_a_quad_is_cut_along_the_diagonal_inside() -> None:
    arrow = np.array([[0.0, 0, 0], [2, 0.2, 0], [0.5, 0.5, 0], [0.2, 2, 0]])
    for start in range(4):
        mesh = parsed(polygon(np.roll(arrow, start, axis=0)))
        assert area(mesh) == pytest.approx(0.9)
    assert parsed(CORNERS + "f 1 2 3 4\n").faces.tolist() == [[0, 1, 2], [0, 2, 3]]


@settings(deadline=None)
@given(st.integers(5, 40), st.integers(0, 10**6), st.integers(0, 39))
def test_polygons_have_the_area_of_their_outline(corners: int, seed: int, start: int) -> None:
    rng = np.random.default_rng(seed)
    # seen from the origin, every corner is farther round: no two edges cross
    angle = (np.arange(corners) + rng.uniform(0.1, 0.9, corners)) * (2 * np.pi / corners)
    radius = rng.uniform(0.2, 1.0, corners)
    flat = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    mesh = parsed(polygon(np.roll(flat, start, axis=0) @ turn.T))
    x, y = flat[:, 0], flat[:, 1]
    outline = abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2
    assert area(mesh) == pytest.approx(outline, rel=1e-9)
    assert len(mesh.faces) == corners - 2


def test_a_very_long_polygon_is_a_fan() -> None:
    count = 20 * LONGEST_EXACT
    angle = np.arange(count) * (2 * np.pi / count)
    mesh = parsed(polygon(np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)))
    assert area(mesh) == pytest.approx(np.pi, rel=1e-3)


def test_a_long_polygon_that_isn_t_convex_is_cut_in_its_plane() -> None:
    for count in (40, 1000):
        angle = np.arange(count) * (2 * np.pi / count)
        radius = np.where(np.arange(count) % 2, 1.0, 0.4)
        flat = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)
        turn = np.linalg.qr(np.random.default_rng(count).normal(size=(3, 3)))[0]
        mesh = parsed(polygon(flat @ turn.T))
        assert area(mesh) == pytest.approx(count / 2 * 0.4 * np.sin(2 * np.pi / count))
    comb = np.stack([np.arange(20_002), np.arange(20_002) % 2, np.zeros(20_002)], axis=1)
    comb[-1] = [10_000, -5, 0]
    with pytest.raises(PolygonError, match="20,002 corners"):
        parsed(polygon(comb))


@pytest.mark.parametrize("category", ["chair", "airplane", "lamp", "ship"])
def test_models_read_as_a_library_reads_them(category: str) -> None:
    data = make_model(category, 3, 1).obj.encode()
    ours = parse_obj(data, 10**6)
    theirs = trimesh.load(
        io.BytesIO(data), file_type="obj", force="mesh", process=False, skip_materials=True
    )
    assert len(ours.faces) == len(theirs.faces)
    assert area(ours) <= theirs.area * (1 + 1e-9)
    np.testing.assert_allclose(
        [ours.triangles.min(axis=(0, 1)), ours.triangles.max(axis=(0, 1))], theirs.bounds
    )
