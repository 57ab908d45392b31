"""The same models, however they are laid out."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import pytest

from pnabs import settings
from pnabs.dataset.catalogue import scan
from pnabs.dataset.errors import DatasetError
from pnabs.dataset.layouts import LAYOUTS
from pnabs.dataset.source import Dataset

from .conftest import MESH, MakeFolder

MODELS = [("02691156", "a1"), ("02691156", "b2"), ("03001627", "c3")]
MESHES = {
    "shapenet-v1": "{0}/{1}/model.obj",
    "shapenet-v2": "{0}/{1}/models/model_normalized.obj",
    "folder": "{0}/{1}.ply",
}
BESIDE = ["taxonomy.json", ".git/config", "__MACOSX/02691156/a1/model.obj", "02691156/notes.txt"]


def _scanned(root: Path, layout: str, **more: object) -> list[dict[str, object]]:
    job = settings.Dataset.model_validate({"root": root, "layout": layout, **more})
    rows: list[dict[str, object]] = scan(job, Path("/")).to_pylist()
    for row in rows:
        if row["reason"] == "":
            assert Dataset(root).read(str(row["source"]), 10_000) == MESH
    return rows


def _models(rows: list[dict[str, object]]) -> list[tuple[object, object]]:
    return [(row["category"], row["model_id"]) for row in rows]


def test_every_layout_of_the_settings_is_registered() -> None:
    assert set(LAYOUTS) == set(get_args(settings.Layout))


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_folder(layout: str, tmp_path: Path, make_folder: MakeFolder) -> None:
    root = make_folder(tmp_path / "root", [MESHES[layout].format(*m) for m in MODELS] + BESIDE)
    assert _models(_scanned(root, layout)) == MODELS


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_zip_file_for_each_category(
    layout: str, tmp_path: Path, make_zip: MakeFolder, make_folder: MakeFolder
) -> None:
    root = make_folder(tmp_path / "root", BESIDE[:3])
    make_zip(root / "02691156.zip", [MESHES[layout].format(*m) for m in MODELS[:2]])
    make_zip(root / "03001627.ZIP", ["deep/" + MESHES[layout].format(*MODELS[2])])
    rows = _scanned(root, layout)
    assert _models(rows) == MODELS
    assert rows[0]["source"] == "02691156.zip!" + MESHES[layout].format(*MODELS[0])


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_zip_file_of_a_category_without_its_folder(
    layout: str, tmp_path: Path, make_zip: MakeFolder
) -> None:
    members = [MESHES[layout].format(*m).partition("/")[2] for m in MODELS[:2]]
    make_zip(tmp_path / "02691156.zip", members)
    assert _models(_scanned(tmp_path, layout)) == MODELS[:2]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("top", ["", "ShapeNetCore.v2/"])
def test_one_zip_file(layout: str, top: str, tmp_path: Path, make_zip: MakeFolder) -> None:
    members = [top + MESHES[layout].format(*m) for m in MODELS]
    members += [top + "taxonomy.json", "__MACOSX/x/model.obj"]
    root = make_zip(tmp_path / "ShapeNetCore.v2.zip", members)
    assert _models(_scanned(root, layout)) == MODELS


@pytest.mark.parametrize("layout", ["shapenet-v1", "shapenet-v2"])
def test_a_top_folder(layout: str, tmp_path: Path, make_folder: MakeFolder) -> None:
    members = [f"outer/inner/{MESHES[layout].format(*m)}" for m in MODELS]
    make_folder(tmp_path / "root", members)
    assert _models(_scanned(tmp_path / "root", layout)) == MODELS


def test_one_category_is_no_top_folder(tmp_path: Path, make_folder: MakeFolder) -> None:
    make_folder(tmp_path, ["chair/a/model.obj"])
    assert _models(_scanned(tmp_path, "shapenet-v1")) == [("chair", "a")]


def test_a_folder_goes_before_an_archive_of_its_name(
    tmp_path: Path, make_zip: MakeFolder, make_folder: MakeFolder
) -> None:
    make_folder(tmp_path, ["chair/a/model.obj"])
    make_zip(tmp_path / "chair.zip", ["chair/b/model.obj"])
    assert _models(_scanned(tmp_path, "shapenet-v1")) == [("chair", "a")]


def test_a_model_without_its_mesh_keeps_its_row(tmp_path: Path, make_folder: MakeFolder) -> None:
    make_folder(tmp_path, ["chair/a/model.obj", "chair/b/model.mtl", "chair/c/model.obj"])
    rows = _scanned(tmp_path, "shapenet-v1")
    assert _models(rows) == [("chair", "a"), ("chair", "b"), ("chair", "c")]
    assert rows[1]["source"] == "chair/b/model.obj"
    assert rows[1]["reason"] == "chair/b/model.obj: no such file"
    assert (rows[1]["size"], rows[1]["mtime_ns"]) == (0, 0)


def test_ids_of_a_plain_folder(tmp_path: Path, make_folder: MakeFolder) -> None:
    files = [
        "a.obj",
        "a.STL",
        "a.glb",
        "a.stl.obj",
        "deep/er/b.off",
        "c.d.gltf",
        "readme.md",
        ".x.obj",
    ]
    make_folder(tmp_path, [f"chair/{file}" for file in files])
    rows = _scanned(tmp_path, "folder")
    assert {row["model_id"]: row["source"] for row in rows} == {
        "a": "chair/a.obj",
        "a.STL": "chair/a.STL",
        "a.glb": "chair/a.glb",
        "a.stl": "chair/a.stl.obj",
        "deep/er/b": "chair/deep/er/b.off",
        "c.d": "chair/c.d.gltf",
    }


def test_an_id_with_a_suffix_that_another_has_already(
    tmp_path: Path, make_folder: MakeFolder
) -> None:
    make_folder(tmp_path, ["chair/a.obj", "chair/a.stl", "chair/a.stl.obj"])
    rows = _scanned(tmp_path, "folder")
    assert {row["model_id"]: row["source"] for row in rows} == {
        "a": "chair/a.obj",
        "a.stl": "chair/a.stl.obj",
        "a.stl~": "chair/a.stl",
    }


def test_linked_folders_are_listed_but_not_entered(tmp_path: Path, make_folder: MakeFolder) -> None:
    root = make_folder(tmp_path / "root", ["chair/a.obj"])
    make_folder(tmp_path / "outside", ["b.obj"])
    (root / "chair/loop").symlink_to("..")
    (root / "chair/out").symlink_to(tmp_path / "outside")
    (root / "chair/out.obj").symlink_to(tmp_path / "outside/b.obj")
    (root / "chair/notes.txt").symlink_to(tmp_path / "outside/b.obj")
    reasons = {row["source"]: row["reason"] for row in _scanned(root, "folder")}
    assert set(reasons) == {"chair/a.obj", "chair/loop", "chair/out", "chair/out.obj"}
    assert "not a regular file" in str(reasons["chair/loop"])
    assert "leads out" in str(reasons["chair/out"])
    assert "leads out" in str(reasons["chair/out.obj"])


def test_a_category_that_is_a_link_out(tmp_path: Path, make_folder: MakeFolder) -> None:
    root = make_folder(tmp_path / "root", ["chair/a.obj"])
    make_folder(tmp_path / "outside", ["b.obj"])
    (root / "lamp").symlink_to(tmp_path / "outside")
    assert _models(_scanned(root, "folder", categories=["chair"])) == [("chair", "a")]
    with pytest.raises(DatasetError, match="lamp: a link leads out of the dataset's root"):
        _scanned(root, "folder")


@pytest.mark.parametrize("layout", LAYOUTS)
def test_hostile_members_are_listed_with_their_reason(
    layout: str, tmp_path: Path, make_zip: MakeFolder
) -> None:
    good = MESHES[layout].format("chair", "a")
    up = "../a" if layout == "folder" else ".."
    bad = [MESHES[layout].format("chair", up), MESHES[layout].format("chair", "b\\c")]
    outside = [MESHES[layout].format("..", "a"), "/" + good]
    root = make_zip(tmp_path / "all.zip", [good, *bad, *outside])
    rows = _scanned(root, layout)
    assert [row["source"] for row in rows if row["reason"] == ""] == [f"!{good}"]
    assert {row["source"] for row in rows if row["reason"] != ""} == {f"!{path}" for path in bad}
    assert all(".." not in str(row["model_id"]).split("/") for row in rows)


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("a\nb", "control characters"),
        ("a\udcffb", "isn't UTF-8"),
        ("x" * 240, "more than 200 bytes"),
        ("abstraction.json", "taken"),
    ],
)
def test_names_that_cannot_name_a_result(
    name: str, why: str, tmp_path: Path, make_folder: MakeFolder
) -> None:
    make_folder(tmp_path, ["chair/good/model.obj", f"chair/{name}/model.obj"])
    rows = [row for row in _scanned(tmp_path, "shapenet-v1") if row["model_id"] != "good"]
    assert len(rows) == 1
    assert why in str(rows[0]["reason"])
    assert str(rows[0]["model_id"]).isprintable()


def test_stand_ins_are_told_apart(tmp_path: Path, make_folder: MakeFolder) -> None:
    ids = ["a_bc", "a_b", "a\nb", "a\tb", "a\rb"]
    make_folder(tmp_path, [f"chair/{i}/model.obj" for i in ids])
    rows = _scanned(tmp_path, "shapenet-v1")
    assert [row["model_id"] for row in rows] == sorted({row["model_id"] for row in rows})
    assert len(rows) == 5


@pytest.mark.parametrize(
    ("laid_out", "asked"),
    [("shapenet-v1", "shapenet-v2"), ("shapenet-v2", "shapenet-v1"), ("folder", "shapenet-v2")],
)
def test_the_wrong_layout(
    laid_out: str, asked: str, tmp_path: Path, make_folder: MakeFolder
) -> None:
    make_folder(tmp_path, [MESHES[laid_out].format(*m) for m in MODELS])
    with pytest.raises(DatasetError) as error:
        _scanned(tmp_path, asked)
    assert f"looks like {laid_out}: use layout: {laid_out}" in str(error.value)
    assert "there is 02691156, 03001627" in str(error.value)


def test_an_empty_root(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="and there is nothing"):
        _scanned(tmp_path, "folder")


def test_a_root_full_of_other_things(tmp_path: Path, make_folder: MakeFolder) -> None:
    make_folder(tmp_path, ["a/b/c.txt"])
    with pytest.raises(DatasetError, match=r"looks for <category>.*there is a$"):
        _scanned(tmp_path, "folder")


def test_an_asked_for_category_without_models(tmp_path: Path, make_folder: MakeFolder) -> None:
    make_folder(tmp_path, ["chair/a.obj", "lamp/readme.txt"])
    assert _models(_scanned(tmp_path, "folder")) == [("chair", "a")]
    with pytest.raises(DatasetError, match="none in category lamp"):
        _scanned(tmp_path, "folder", categories=["chair", "lamp"])


def test_meshes_outside_any_category_are_no_models(tmp_path: Path, make_folder: MakeFolder) -> None:
    make_folder(tmp_path, ["loose.obj"])
    with pytest.raises(DatasetError, match=r"<category>/.*there is loose\.obj$"):
        _scanned(tmp_path, "folder")
    make_folder(tmp_path, ["chair/a.obj"])
    assert _models(_scanned(tmp_path, "folder")) == [("chair", "a")]


@pytest.mark.parametrize("name", ["a!b", "_x", "-x", "a:b", "zarr.json", "x" * 101, "a\nb", "x."])
def test_categories_that_cannot_name_a_group(
    name: str, tmp_path: Path, make_folder: MakeFolder
) -> None:
    make_folder(tmp_path, ["chair/a.obj", f"{name}/a.obj"])
    assert _models(_scanned(tmp_path, "folder", categories=["chair"])) == [("chair", "a")]
    with pytest.raises(DatasetError, match="can't be used as a folder's name"):
        _scanned(tmp_path, "folder")


@pytest.mark.parametrize("name", ["file cabinet", "椅子", "night_stand", "v1.2-b", "3d"])
def test_categories_of_other_scripts_and_words(
    name: str, tmp_path: Path, make_folder: MakeFolder
) -> None:
    make_folder(tmp_path, [f"{name}/a.obj"])
    assert _models(_scanned(tmp_path, "folder")) == [(name, "a")]
