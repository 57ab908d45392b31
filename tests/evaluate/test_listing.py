"""What there is of shapes and results in a path."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

import pytest

from pnabs.dataset.errors import DatasetError
from pnabs.dataset.splits import hash_split
from pnabs.evaluation.items import (
    ITEM,
    AbstractionFile,
    BoxList,
    FileShape,
    Item,
    MeshFiles,
)
from pnabs.evaluation.matching import ShapeIndex
from pnabs.evaluation.names import named
from pnabs.evaluation.results import Results, find_results
from pnabs.evaluation.shapes import Choice, Shapes, find_shapes
from pnabs.stages.errors import UsageError
from tests.evaluate.solids import box, write

NOWHERE = Path("/nowhere/out")


def make(root: Path, *paths: str) -> Path:
    for path in paths:
        write(root / path, box())
    return root


def shapes(root: Path, **choice: object) -> Shapes:
    return find_shapes(root, Choice(**choice), NOWHERE)  # type: ignore[arg-type]


def labels(found: Shapes) -> list[str]:
    return [entry.label for entry in found.entries]


def test_a_folder_of_meshes_and_a_mesh(tmp_path: Path) -> None:
    make(tmp_path, "a.obj", "deep/b.obj")
    found = shapes(tmp_path)
    assert labels(found) == ["a", "deep/b"]
    assert not found.single
    assert {entry.category for entry in found.entries} == {""}
    alone = shapes(tmp_path / "a.obj")
    assert (labels(alone), alone.single) == (["a"], True)


@pytest.mark.parametrize(
    ("layout", "mesh"),
    [("shapenet-v1", "model.obj"), ("shapenet-v2", "models/model_normalized.obj")],
)
def test_shapenets_layouts_are_known_by_their_names(tmp_path: Path, layout: str, mesh: str) -> None:
    make(tmp_path / "data", f"03001627/a/{mesh}", f"02828884/b/{mesh}")
    found = shapes(tmp_path / "data")
    assert (found.layout, labels(found)) == (layout, ["02828884/b", "03001627/a"])
    assert labels(shapes(tmp_path / "data", categories=("chair",))) == ["03001627/a"]
    archive = tmp_path / "data.zip"
    with zipfile.ZipFile(archive, "w") as file:
        for path in sorted((tmp_path / "data").rglob("*.obj")):
            file.write(path, path.relative_to(tmp_path / "data").as_posix())
    zipped = shapes(archive)
    assert (zipped.layout, labels(zipped)) == (layout, labels(found))


def test_categories_of_a_folder_are_asked_for_by_its_layout(tmp_path: Path) -> None:
    make(tmp_path, "chair/a.obj", "bench/b.obj")
    assert labels(shapes(tmp_path, layout="folder")) == ["bench/b", "chair/a"]
    with pytest.raises(DatasetError, match="no models"):
        shapes(tmp_path, layout="shapenet-v1")


def test_splits(tmp_path: Path) -> None:
    root = make(tmp_path / "m", *(f"chair/{name}.obj" for name in "abcdefgh"))
    table = tmp_path / "split.csv"
    table.write_text("synsetId,modelId,split\nchair,a,test\nchair,b,train\n")
    for layout in (None, "folder"):
        found = shapes(root, layout=layout, split=table, only="test")
        assert labels(found) == ["chair/a"]
        assert ("chair/b" if layout is None else "b") in {name for _, name in found.others}
    hashed = shapes(root, layout="folder", only="test")
    expected = [name for name in "abcdefgh" if hash_split(name, 1 / 3, 0) == "test"]
    assert [entry.model_id for entry in hashed.entries] == expected
    with pytest.raises(UsageError, match="--only val: no shape .* there are none, test, train"):
        shapes(root, split=table, only="val")


def test_no_shapes_are_told(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for path in (tmp_path / "none", tmp_path / "empty"):
        with pytest.raises(DatasetError, match=r"there is no"):
            shapes(path)


def test_a_shapes_mark_changes_with_it_alone(tmp_path: Path) -> None:
    make(tmp_path, "a.obj", "b.obj")
    before = shapes(tmp_path).entries
    assert before == shapes(tmp_path).entries
    assert before[0].mark != before[1].mark
    os.utime(tmp_path / "a.obj", ns=(0, 0))
    after = shapes(tmp_path).entries
    assert [one.mark == other.mark for one, other in zip(before, after, strict=True)] == [
        False,
        True,
    ]


INDEX = ShapeIndex([("chair", "a"), ("chair", "b")])


def results(path: Path, index: ShapeIndex = INDEX, *, single: bool = False) -> Results:
    return find_results(path, "x", index, single, NOWHERE)


def sources(found: Results) -> dict[int, tuple[str, ...]]:
    return {
        shape: one.place.sources
        for shape, one in found.of_shape.items()
        if isinstance(one.place, MeshFiles)
    }


def test_meshes_and_parts_of_meshes(tmp_path: Path) -> None:
    assert sources(results(make(tmp_path / "1", "a.obj", "chair/b.obj", "z.obj"))) == {
        0: ("a.obj",),
        1: ("chair/b.obj",),
    }
    found = results(make(tmp_path / "2", "a/p1.obj", "a/p0.obj", "b/only.obj"))
    assert sources(found) == {0: ("a/p0.obj", "a/p1.obj"), 1: ("b/only.obj",)}


def test_one_file_of_those_that_are_the_same(tmp_path: Path) -> None:
    make(tmp_path, "a.obj", "b/abstraction.obj", "b/abstraction.convex/0.obj")
    for name in ("a.ply", "a.stl", "b/abstraction.glb", "b/abstraction.level4.obj"):
        (tmp_path / name).write_bytes(b"")
    (tmp_path / ".hidden.obj").write_bytes(b"")
    assert sources(results(tmp_path / "b", ShapeIndex([("", "b")]))) == {0: ("abstraction.obj",)}
    (tmp_path / "b" / "abstraction.obj").unlink()
    (tmp_path / "b" / "abstraction.glb").unlink()
    # what follows from a result stands for it where that isn't there
    convex = sources(results(tmp_path / "b/abstraction.convex", ShapeIndex([("", "0")])))
    assert convex == {0: ("0.obj",)}
    assert sources(results(tmp_path, ShapeIndex([("", "a")]))) == {0: ("a.obj",)}


def test_records_stand_for_all_that_lies_beside_them(tmp_path: Path) -> None:
    make(tmp_path, "a/abstraction.obj", "b/abstraction.obj")
    for name in "ab":
        (tmp_path / name / "abstraction.json").write_text("{}")
    found = results(tmp_path)
    assert {
        shape: one.place.source
        for shape, one in found.of_shape.items()
        if isinstance(one.place, AbstractionFile)
    } == {0: "a/abstraction.json", 1: "b/abstraction.json"}


def test_a_runs_results_are_its_main_variants(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(UsageError, match="has no results yet"):
        results(tmp_path)
    for variant in ("main", "other"):
        folder = tmp_path / "variants" / variant / "abstractions/chair/a"
        folder.mkdir(parents=True)
        (folder / "abstraction.json").write_text("{}")
    found = results(tmp_path)
    place = found.of_shape[0].place
    assert isinstance(place, AbstractionFile)
    assert place.root == str(tmp_path / "variants/main")
    assert results(tmp_path / "variants/other").of_shape.keys() == {0}


def test_a_zip_of_results_is_read_in_place(tmp_path: Path) -> None:
    make(tmp_path, "a.obj")
    with zipfile.ZipFile(tmp_path / "r.zip", "w") as file:
        file.write(tmp_path / "a.obj", "in/a.obj")
    assert sources(results(tmp_path / "r.zip")) == {0: ("!in/a.obj",)}


def test_tables_of_boxes(tmp_path: Path) -> None:
    path = tmp_path / "boxes.csv"
    path.write_text("model_id,sx,sy,sz,qw,qx,qy,qz,tx,ty,tz\na,1,1,1,1,0,0,0,0,0,0\n")
    found = results(path)
    assert isinstance(found.of_shape[0].place, BoxList)


def test_a_lone_result_is_that_of_the_mesh_that_was_named(tmp_path: Path) -> None:
    make(tmp_path, "result.obj")
    one = ShapeIndex([("", "chair")])
    assert results(tmp_path / "result.obj", one, single=True).of_shape.keys() == {0}
    with pytest.raises(UsageError, match="has the id of a shape"):
        results(tmp_path / "result.obj", one)
    make(tmp_path, "other.obj")
    with pytest.raises(UsageError, match="has the id of a shape"):
        results(tmp_path, one, single=True)


def test_what_lies_in_the_evaluations_own_folder_is_no_result(tmp_path: Path) -> None:
    make(tmp_path, "a.obj", "out/a.obj")
    found = find_results(tmp_path, "x", INDEX, False, tmp_path / "out")
    assert sources(found) == {0: ("a.obj",)}


def test_links_are_not_followed_out(tmp_path: Path) -> None:
    make(tmp_path, "elsewhere/b.obj", "r/a.obj")
    (tmp_path / "r/out").symlink_to(tmp_path / "elsewhere")
    assert sources(results(tmp_path / "r")) == {0: ("a.obj",)}


@pytest.mark.parametrize("name", ["none", "empty", "text.txt"])
def test_no_results_are_told(tmp_path: Path, name: str) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.txt").write_text("a")
    with pytest.raises(UsageError, match=name):
        results(tmp_path / name)


def test_a_gltf_is_known_by_what_lies_beside_it_too(tmp_path: Path) -> None:
    for name in ("a.gltf", "a.bin"):
        (tmp_path / name).write_text("a")
    before = results(tmp_path).of_shape[0].mark
    os.utime(tmp_path / "a.bin", ns=(0, 0))
    assert results(tmp_path).of_shape[0].mark != before


def test_names(tmp_path: Path) -> None:
    (tmp_path / "folder.v2").mkdir()
    paths = [tmp_path / "folder.v2", tmp_path / "boxes.csv"]
    assert [name for name, _ in named(paths, [])] == ["folder.v2", "boxes"]
    assert [name for name, _ in named(paths, ["x", "y"])] == ["x", "y"]
    with pytest.raises(UsageError, match="1 names for 2 sets"):
        named(paths, ["x"])
    with pytest.raises(UsageError, match="empty"):
        named(paths, ["x", ""])


def test_names_that_can_not_be_written_are_shapes_with_a_reason(tmp_path: Path) -> None:
    make(tmp_path, "a.obj")
    (tmp_path / "bad!.zip!x.obj").write_bytes(b"")
    (tmp_path / os.fsdecode(b"\xff.obj")).write_bytes(b"")
    places = [entry.place for entry in shapes(tmp_path).entries]
    bad = [place for place in places if isinstance(place, FileShape) and place.reason]
    assert (len(places), len(bad)) == (3, 2)
    for place in places:
        item = Item("f", "label", "mark", place)
        assert ITEM.validate_json(ITEM.dump_json(item)) == item


def test_numbers_of_boxes_travel_exactly() -> None:
    boxes = BoxList(((1 / 3, 1e-300, 0.1, 1, 0, 0, 0, -2.5e17, 5e-324, 3),), ())
    item = Item("f", "label", "mark", FileShape("/r", "a.obj", ".obj"), boxes)
    assert ITEM.validate_json(ITEM.dump_json(item)) == item
