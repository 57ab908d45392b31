"""Which result belongs to which shape."""

from __future__ import annotations

import pytest

from pnabs.evaluation.matching import Key, ShapeIndex, match
from pnabs.stages.errors import UsageError


def keys(*paths: str, trailing: int = 0, above: str = "") -> list[Key]:
    return [Key(tuple(path.split("/")), path, trailing, above) for path in paths]


def index(*shapes: str, categories: bool = True) -> ShapeIndex:
    if not categories:
        return ShapeIndex([("", shape) for shape in shapes])
    split = (shape.partition("/") for shape in shapes)
    return ShapeIndex([(category, model_id) for category, _, model_id in split])


@pytest.mark.parametrize(
    "paths",
    [
        ("b", "a"),
        ("chair/b", "bench/a"),
        ("03001627/b", "02828884/a"),
        ("some/where/chair/b", "some/where/bench/a"),
        ("b/mesh", "a/result"),
        ("chair/b/abstraction", "bench/a/abstraction"),
        ("03001627/b/models/model_normalized", "02828884/a/models/model_normalized"),
        ("boxes/b/models/model_normalized/abstraction", "boxes/a/models/model_normalized/x"),
    ],
)
def test_by_id_whatever_is_around_it(paths: tuple[str, ...]) -> None:
    found = match(index("02828884/a", "03001627/b", "03001627/c"), keys(*paths), "x")
    assert found.of_shape == {0: [1], 1: [0]}
    assert found.without == []


def test_meshes_of_a_folder_are_known_by_their_paths() -> None:
    shapes = index("chair/a", "chair/b", "bench/a", categories=False)
    found = match(shapes, keys("chair/a", "b", "bench/a", "bench/z"), "x")
    assert found.of_shape == {0: [0], 1: [1], 2: [2]}
    assert found.without == [3]


def test_a_name_that_all_meshes_have_is_no_id() -> None:
    shapes = index("a/model", "b/model", categories=False)
    assert match(shapes, keys("b", "a"), "x").of_shape == {0: [1], 1: [0]}
    assert match(shapes, keys("b/model", "a/model"), "x").of_shape == {0: [1], 1: [0]}
    alone = index("a/model", categories=False)
    assert match(alone, keys("a/model"), "x").of_shape == {0: [0]}


def test_several_files_of_one_folder_are_parts() -> None:
    found = match(index("chair/a", "chair/b"), keys("a/0", "a/1", "b/0", "c/0"), "x")
    assert found.of_shape == {0: [0, 1], 1: [2]}
    assert found.without == [3]


def test_numbered_parts_are_not_taken_for_numbered_shapes() -> None:
    shapes = index(*(f"x/{number}" for number in range(4)))
    paths = [f"{shape}/{part}" for shape in range(4) for part in range(4)]
    found = match(shapes, keys(*paths), "x")
    assert found.of_shape == {n: list(range(4 * n, 4 * n + 4)) for n in range(4)}


def test_files_that_lie_in_a_folder_named_by_the_id() -> None:
    shapes = index("chair/a", "chair/b")
    assert match(shapes, keys("0", "1", above="b"), "x").of_shape == {1: [0, 1]}
    assert match(shapes, keys("abstraction", trailing=1, above="b"), "x").of_shape == {1: [0]}


def test_one_id_in_two_categories_is_told_apart_by_category() -> None:
    shapes = index("cellphone/a", "telephone/a")
    assert match(shapes, keys("telephone/a"), "x").of_shape == {1: [0]}
    with pytest.raises(UsageError, match="a could belong to cellphone/a or to telephone/a"):
        match(shapes, keys("a"), "x")


def test_shapes_that_are_left_out_have_results_all_the_same() -> None:
    shapes = ShapeIndex([("chair", "a")], [("chair", "b"), ("bench", "a")])
    found = match(shapes, keys("a", "b", "z"), "x")
    assert (found.of_shape, found.without) == ({0: [0]}, [2])


def test_two_results_of_one_shape_are_refused() -> None:
    with pytest.raises(UsageError, match=r"both one/a and two/a have the id of chair/a"):
        match(index("chair/a", "chair/b", "chair/c"), keys("one/a", "two/a", "b", "c"), "x")


def test_no_result_with_the_id_of_a_shape_is_refused() -> None:
    with pytest.raises(UsageError, match="none of the 2 results of 'x' .* q, r; .* chair/a"):
        match(index("chair/a"), keys("q", "r"), "x")


def test_hostile_ids_match_nothing_and_are_shown_escaped() -> None:
    shapes = index("chair/a")
    found = match(shapes, keys("a", "../a/..", "/", "", "a/../..", "\x1b[2J"), "x")
    assert found.of_shape == {0: [0]}
    with pytest.raises(UsageError) as error:
        match(shapes, keys("\x1b[2J"), "x")
    assert "\x1b" not in str(error.value)
