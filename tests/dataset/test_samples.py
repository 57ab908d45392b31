"""The embedded sample collection: stable bytes, sound geometry, models that differ."""

from __future__ import annotations

import re
from collections import Counter
from functools import cache
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from pnabs.dataset.samples import CATEGORIES, SampleModel, make_model, write_collection
from pnabs.dataset.samples.draw import Draw
from pnabs.dataset.samples.flaws import FLAWS, double, flip, unweld
from pnabs.dataset.samples.objfile import obj_text
from pnabs.dataset.samples.parts import Part, both_sides, reflected, signed_volume, turned
from pnabs.dataset.samples.sheets import hoop, panel, shade, strip
from pnabs.dataset.samples.solids import box, ellipsoid, lathe, prism, rod, tube

COUNT = 30


@cache
def model(category: str, index: int) -> SampleModel:
    return make_model(category, 0, index)


def directed_edges(part: Part) -> Counter[tuple[int, int]]:
    return Counter(edge for face in part.faces for edge in pairwise((*face, face[0])))


def is_closed(part: Part) -> bool:
    edges = directed_edges(part)
    return all(n == 1 and edges[b, a] == 1 for (a, b), n in edges.items())


def triangles(parts: tuple[Part, ...]) -> NDArray[np.float64]:
    return np.concatenate(
        [
            part.vertices[[(face[0], a, b) for face in part.faces for a, b in pairwise(face[1:])]]
            for part in parts
        ]
    )


def surface_voxels(parts: tuple[Part, ...], side: int = 16) -> NDArray[np.bool_]:
    """Cells of the unit cube that dense samples of the surface fall into."""
    corners = triangles(parts)
    rng = np.random.default_rng(0)
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    chosen = corners[rng.choice(len(area), 20_000, p=area / area.sum())]
    u, v = rng.random((2, 20_000, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    points = chosen[:, 0] * (1 - u - v) + chosen[:, 1] * u + chosen[:, 2] * v
    grid = np.zeros((side,) * 3, dtype=bool)
    grid[tuple(np.clip(((points + 0.5) * side).astype(int), 0, side - 1).T)] = True
    return grid


# The collection on disk


def test_same_seed_gives_the_same_bytes_wherever_written(tmp_path: Path) -> None:
    first = write_collection(tmp_path / "a", seed=3, per_category=4)
    again = write_collection(tmp_path / "b", seed=3, per_category=4)
    assert [p.relative_to(tmp_path / "a") for p in first] == [
        p.relative_to(tmp_path / "b") for p in again
    ]
    assert [p.read_bytes() for p in first] == [p.read_bytes() for p in again]


def test_another_seed_gives_other_models(tmp_path: Path) -> None:
    first = write_collection(tmp_path / "a", seed=0, per_category=2, categories=["chair"])
    other = write_collection(tmp_path / "b", seed=1, per_category=2, categories=["chair"])
    assert not {p.parts[-3] for p in first} & {p.parts[-3] for p in other}
    assert {p.read_bytes() for p in first}.isdisjoint(p.read_bytes() for p in other)


def test_a_larger_collection_contains_the_smaller_one(tmp_path: Path) -> None:
    small = write_collection(tmp_path / "a", per_category=3, categories=["lamp", "bus"])
    large = write_collection(tmp_path / "b", per_category=5, categories=["bus", "lamp"])
    kept = {p.relative_to(tmp_path / "b"): p.read_bytes() for p in large}
    assert len(small) == 6
    assert len(large) == 10
    for path in small:
        assert kept[path.relative_to(tmp_path / "a")] == path.read_bytes()


def test_layout_is_that_of_shapenetcore_v2(tmp_path: Path) -> None:
    paths = write_collection(tmp_path, per_category=1)
    assert {p.relative_to(tmp_path).parts[0] for p in paths} == set(CATEGORIES.values())
    for path in paths:
        assert re.fullmatch(
            r"(\d{8}|animal)/[0-9a-f]{32}/models/model_normalized\.obj",
            path.relative_to(tmp_path).as_posix(),
        )
    assert sorted(p for p in tmp_path.rglob("*") if p.is_file()) == sorted(paths)


def test_ids_split_by_their_last_digits_spread_evenly() -> None:
    thirds = [int(make_model("table", 0, index).model_id, 16) % 3 for index in range(90)]
    assert all(15 <= thirds.count(k) <= 45 for k in range(3))


def test_wrong_arguments_are_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="'chairs'.*airplane"):
        write_collection(tmp_path, categories=["chairs"])
    with pytest.raises(ValueError, match="per_category is 0"):
        write_collection(tmp_path, per_category=0)
    assert list(tmp_path.iterdir()) == []


# Every model


@pytest.mark.parametrize("category", CATEGORIES)
def test_every_file_loads_with_all_its_faces(category: str, tmp_path: Path) -> None:
    for index, path in enumerate(
        write_collection(tmp_path, per_category=COUNT, categories=[category])
    ):
        mesh = trimesh.load(path, force="mesh", process=False, skip_materials=True)
        made = model(category, index)
        assert np.isfinite(mesh.vertices).all()
        assert len(mesh.faces) == len(triangles(made.parts))
        expected = triangles(made.parts)
        cross = np.cross(expected[:, 1] - expected[:, 0], expected[:, 2] - expected[:, 0])
        assert mesh.area == pytest.approx(np.linalg.norm(cross, axis=1).sum() / 2, rel=1e-3)
        assert path.stat().st_size < 300_000


@pytest.mark.parametrize("category", CATEGORIES)
def test_every_model_is_centred_with_diagonal_one(category: str) -> None:
    for index in range(COUNT):
        points = np.concatenate([part.vertices for part in model(category, index).parts])
        low, high = points.min(axis=0), points.max(axis=0)
        np.testing.assert_allclose(low + high, 0, atol=1e-12)
        assert np.linalg.norm(high - low) == pytest.approx(1)


@pytest.mark.parametrize("category", CATEGORIES)
def test_clean_models_have_sound_faces(category: str) -> None:
    """No face without area, none concave, edges used once a side, closed parts outward."""
    for index in range(COUNT):
        if model(category, index).flaws:
            continue
        for part in model(category, index).parts:
            assert max(directed_edges(part).values()) == 1, part.name
            if is_closed(part):
                assert signed_volume(part) > 0, part.name
            size = np.ptp(part.vertices, axis=0).max()
            for face in part.faces:
                corners = part.vertices[list(face)]
                ahead = np.roll(corners, -1, axis=0) - corners
                normal = np.cross(corners, corners + ahead).sum(axis=0)
                area = np.linalg.norm(normal)
                assert area > 1e-9 * size**2, part.name
                turns = np.cross(np.roll(ahead, 1, axis=0), ahead) @ normal / area
                assert turns.min() > -1e-6 * size**2, part.name


@pytest.mark.parametrize("category", CATEGORIES)
def test_models_of_a_category_clearly_differ(category: str) -> None:
    """At least 24 of 30 are pairwise apart in the voxels that their surfaces pass."""
    grids = [surface_voxels(model(category, index).parts) for index in range(COUNT)]
    near: list[int] = []
    for i, j in combinations(range(COUNT), 2):
        overlap = (grids[i] & grids[j]).sum() / (grids[i] | grids[j]).sum()
        assert overlap < 0.98, (i, j)
        if overlap > 0.85:
            near.append(j)
    assert COUNT - len(set(near)) >= 24
    assert len({model(category, index).obj for index in range(COUNT)}) == COUNT


def test_about_three_in_ten_models_have_flaws_and_all_kinds_occur() -> None:
    chosen = [model(category, index).flaws for category in CATEGORIES for index in range(COUNT)]
    assert 0.25 <= sum(map(bool, chosen)) / len(chosen) <= 0.35
    kinds = Counter(flaw for flaws in chosen for flaw in flaws)
    assert set(kinds) == set(FLAWS)
    assert min(kinds.values()) >= 20


def test_files_come_in_all_styles() -> None:
    texts = [model(category, index).obj for category in CATEGORIES for index in range(COUNT)]
    shaded = sum("\nvn " in text for text in texts) / len(texts)
    fans = sum(all(len(f.split()) == 4 for f in re.findall(r"^f .*$", t, re.M)) for t in texts)
    assert 0.2 < shaded < 0.4
    assert 0.3 < fans / len(texts) < 0.5
    assert any(text.startswith("o ") for text in texts)
    assert any(text.startswith("g ") for text in texts)
    assert all("-0.000000" not in text for text in texts)


@pytest.mark.parametrize(
    ("category", "share"),
    [("bookshelf", 0.6), ("table", 0.7), ("chair", 0.5), ("bench", 0.5), ("bus", 0.6)],
)
def test_furniture_and_buses_are_mostly_open_space(category: str, share: float) -> None:
    """Median share of the hull outside all closed parts; their volumes added bound the solid."""
    opens = []
    for index in range(COUNT):
        made = model(category, index)
        if made.flaws:
            continue
        points = np.concatenate([part.vertices for part in made.parts])
        filled = sum(signed_volume(part) for part in made.parts if is_closed(part))
        opens.append(1 - filled / ConvexHull(points).volume)
    assert len(opens) >= 20
    assert np.median(opens) > share


def test_most_models_are_symmetric_left_to_right_and_a_few_are_not() -> None:
    symmetric = []
    for category in CATEGORIES:
        for index in range(COUNT):
            points = np.concatenate([part.vertices for part in model(category, index).parts])
            rounded = {tuple(p) for p in (np.round(points, 5) + 0.0).tolist()}
            mirrored = {tuple(p) for p in (np.round(points * (-1, 1, 1), 5) + 0.0).tolist()}
            symmetric.append(len(rounded & mirrored) > 0.98 * len(rounded))
    assert 0.6 < np.mean(symmetric) < 0.98


# The part kit against formulas


def test_lathe_of_a_cone_has_the_volume_of_a_pyramid() -> None:
    cone = lathe("cone", [(2.0, 0.0), (0.0, 3.0)], sides=12)
    base = 0.5 * 12 * 4 * np.sin(2 * np.pi / 12)
    assert is_closed(cone)
    assert signed_volume(cone) == pytest.approx(base * 3 / 3)


def test_concave_prism_along_every_axis() -> None:
    outline = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2)]
    for axis in range(3):
        for points in (outline, outline[::-1]):
            solid = prism("l", axis, points, (2, -1))
            assert is_closed(solid)
            assert signed_volume(solid) == pytest.approx(4 * 3)


def test_prism_refuses_an_outline_that_crosses_itself() -> None:
    with pytest.raises(ValueError, match="'bow'.*crosses itself"):
        prism("bow", 2, [(2, 1), (0, 1), (3, 3), (0, 2), (3, 1)], (0, 1))


def test_hoop_has_the_volume_of_its_section_carried_round() -> None:
    ring = hoop("ring", [(2, 0), (3, 0), (3, 1), (2, 1)], sides=8)
    assert is_closed(ring)
    assert signed_volume(ring) == pytest.approx(0.5 * 8 * np.sin(np.pi / 4) * (9 - 4))


def test_tube_keeps_its_section_round_right_angles() -> None:
    path = [(0, 2, 0), (0, 0, 0), (0, 0, 3), (0, 2, 3), (4, 2, 3)]
    pipe = tube("pipe", path, 0.1, sides=4)
    rings = pipe.vertices.reshape(len(path), 4, 3)
    assert is_closed(pipe)
    np.testing.assert_allclose(rings.mean(axis=1), path, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(rings - np.array(path)[:, None], axis=2), 0.1)


def test_straight_rod_is_a_prism() -> None:
    bar = rod("bar", (1, 2, 3), (4, 6, 3), 0.5, sides=6)
    assert signed_volume(bar) == pytest.approx(5 * 0.5 * 6 * 0.25 * np.sin(np.pi / 3))


def test_ellipsoid_fills_most_of_the_true_one() -> None:
    ball = ellipsoid("ball", (1, 1, 1), (1, 2, 3), sides=48, rings=25)
    assert is_closed(ball)
    assert 0.97 < signed_volume(ball) / (4 / 3 * np.pi * 6) < 1


def test_open_box_lacks_the_named_sides() -> None:
    tray = box("tray", (0, 1), (0, 1), (0, 1), without=("+y", "-z"))
    assert len(tray.faces) == 4
    assert not is_closed(tray)


def test_sheet_shade_is_open_and_thick_shade_closed() -> None:
    assert not is_closed(shade("shade", 1, 0.5, (0, 1)))
    assert is_closed(shade("shade", 1, 0.5, (0, 1), thickness=0.1))
    assert (
        len(
            strip("s", [[(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 0), (1, 1, 0), (2, 1, 0)]]).faces
        )
        == 2
    )


@given(
    axis=st.integers(0, 2),
    cells=st.lists(st.booleans(), min_size=4, max_size=4),
    thick=st.floats(0.1, 2),
)
@settings(max_examples=60, deadline=None)
def test_panel_volume_is_what_its_holes_leave(axis: int, cells: list[bool], thick: float) -> None:
    holes = [(i + 0.25, i + 0.75, 0.2, 0.8) for i, cut in enumerate(cells) if cut]
    wall = panel("wall", axis, (thick, 0), (0, 4), (0, 1), holes)
    assert is_closed(wall)
    assert signed_volume(wall) == pytest.approx((4 - 0.3 * len(holes)) * thick)
    flat = panel("wall", axis, (1, 1), (0, 4), (0, 1), holes)
    assert np.all(flat.vertices[:, axis] == 1)
    assert not is_closed(flat)


def test_panel_without_anything_left_is_refused() -> None:
    with pytest.raises(ValueError, match="'gone'.*leave nothing"):
        panel("gone", 2, (0, 1), (0, 1), (0, 1), [(-1, 2, -1, 2)])


def test_reflection_keeps_parts_outward_and_turning_is_right_handed() -> None:
    part = box("b", (1, 2), (0, 1), (0, 3))
    image = both_sides([part])[1]
    assert signed_volume(image) == pytest.approx(3)
    assert image.vertices[:, 0].max() == -1
    np.testing.assert_allclose(
        turned(Part("p", np.array([[1.0, 0, 0]]), ()), 2, 90).vertices, [[0, 1, 0]], atol=1e-15
    )
    assert signed_volume(reflected(part, 2)) == pytest.approx(3)


# Draws, flaws and text


def test_cycle_holds_every_option_once_a_round() -> None:
    options = tuple("abcdefg")
    for start in (0, 7, 70):
        assert {Draw(1, "chair", start + i).cycle("x", options) for i in range(7)} == set(options)


def test_variant_goes_by_the_round_of_kinds() -> None:
    seen: dict[str, set[str]] = {}
    for index in range(9):
        draw = Draw(5, "lamp", index)
        seen.setdefault(draw.kind(("p", "q", "r")), set()).add(draw.variant("v", ("x", "y", "z")))
    assert all(variants == {"x", "y", "z"} for variants in seen.values())


@given(st.integers(0, 2**32), st.floats(-5, 5), st.floats(0, 5))
@settings(max_examples=50, deadline=None)
def test_draws_stay_inside_their_bounds(seed: int, low: float, width: float) -> None:
    draw = Draw(seed, "x", 0)
    assert low <= draw.between(low, low + width) <= low + width
    assert 2 <= draw.whole(2, 5) <= 5
    assert draw.pick("abc") in "abc"


def test_flaws_do_what_they_say() -> None:
    part = box("b", (0, 1), (0, 1), (0, 1))
    loose = unweld(part)
    assert len(loose.vertices) == 24
    assert signed_volume(loose) == pytest.approx(1)
    (flipped,) = flip([part], 0.0, Draw(0, "x", 0))
    assert sum(a != b for a, b in zip(part.faces, flipped.faces, strict=True)) == 1
    (doubled,) = double([part], 0.0, Draw(0, "x", 0))
    assert len(doubled.faces) == 7
    assert Counter(frozenset(f) for f in doubled.faces).most_common(1)[0][1] == 2


def test_obj_text_of_a_shaded_square() -> None:
    square = Part("s", np.array([[0, 0, -0.0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]), ((0, 1, 2, 3),))
    text = obj_text((square, square), keyword="o", triangles=True, shading=True)
    assert text.splitlines() == [
        "o s_1",
        *("v 0.000000 0.000000 0.000000", "v 1.000000 0.000000 0.000000"),
        *("v 1.000000 1.000000 0.000000", "v 0.000000 1.000000 0.000000"),
        *("vt 0.5000 0.5000", "vt 1.5000 0.5000", "vt 1.5000 1.5000", "vt 0.5000 1.5000"),
        "vn 0.0000 0.0000 1.0000",
        *("f 1/1/1 2/2/1 3/3/1", "f 1/1/1 3/3/1 4/4/1"),
        "o s_2",
        *("v 0.000000 0.000000 0.000000", "v 1.000000 0.000000 0.000000"),
        *("v 1.000000 1.000000 0.000000", "v 0.000000 1.000000 0.000000"),
        *("vt 0.5000 0.5000", "vt 1.5000 0.5000", "vt 1.5000 1.5000", "vt 0.5000 1.5000"),
        *("f 5/5/1 6/6/1 7/7/1", "f 5/5/1 7/7/1 8/8/1"),
    ]
