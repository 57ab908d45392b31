"""Meshes named one by one or by folder: their ids, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from pnabs.dataset.errors import DatasetError
from pnabs.dataset.files import Files, find_files


def put(root: Path, *names: str) -> None:
    for name in names:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text("")


def named(found: Files) -> dict[str, str]:
    return {model_id: file.source for model_id, file in found.files.items()}


def test_a_folders_meshes_at_any_depth(tmp_path: Path) -> None:
    put(tmp_path, "b.obj", "a/c.PLY", "a/d/e.glb", "a/notes.txt", ".hidden/f.obj", "._b.obj")
    found = find_files([tmp_path], tmp_path / "out")
    assert found.root == tmp_path
    assert list(named(found).items()) == [
        ("a/c", "a/c.PLY"),
        ("a/d/e", "a/d/e.glb"),
        ("b", "b.obj"),
    ]


def test_one_file_is_known_by_its_name(tmp_path: Path) -> None:
    put(tmp_path, "a/chair.obj", "a/table.obj")
    found = find_files([tmp_path / "a/chair.obj"], tmp_path / "out")
    assert (found.root, named(found)) == (tmp_path / "a", {"chair": "chair.obj"})


def test_ids_begin_below_what_all_have_in_common(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(tmp_path, "x/a/one.obj", "x/a/b/two.stl", "x/c/one.obj", "x/c/other.obj")
    monkeypatch.chdir(tmp_path)
    found = find_files([Path("x/a"), Path("x/c/one.obj"), Path("x/a/one.obj")], Path("out"))
    assert found.root == tmp_path / "x"
    assert named(found) == {
        "a/b/two": "a/b/two.stl",
        "a/one": "a/one.obj",
        "c/one": "c/one.obj",
    }


def test_results_are_no_input(tmp_path: Path) -> None:
    put(tmp_path, "a.obj", "out/a/abstraction.glb", "out/a/abstraction.obj", "outer/b.obj")
    found = find_files([tmp_path], tmp_path / "out")
    assert set(named(found)) == {"a", "outer/b"}


def test_linked_folders_are_not_entered_and_told(tmp_path: Path) -> None:
    put(tmp_path, "in/a.obj", "elsewhere/b.obj")
    (tmp_path / "in/link").symlink_to(tmp_path / "elsewhere")
    found = find_files([tmp_path / "in"], tmp_path / "out").files
    assert {name: file.reason for name, file in found.items()} == {
        "a": "",
        "link": "a folder that is a link, or can't be listed",
    }


def test_a_link_that_is_named_is_followed(tmp_path: Path) -> None:
    put(tmp_path, "blobs/0a1b", "snapshot/other.obj")
    (tmp_path / "snapshot/chair.obj").symlink_to("../blobs/0a1b")
    (file,) = find_files([tmp_path / "snapshot/chair.obj"], tmp_path / "out").files.values()
    assert (file.root, file.source, file.suffix) == (tmp_path / "blobs", "0a1b", ".obj")


def test_results_among_the_meshes_are_none(tmp_path: Path) -> None:
    put(tmp_path, "a.obj", "a/abstraction.json", "a/abstraction.glb", "a/abstraction.convex/0.obj")
    put(tmp_path, "b/abstraction.obj")
    for out in (tmp_path, tmp_path / "elsewhere"):
        # One that nothing vouches for is somebody's mesh of that name.
        assert set(named(find_files([tmp_path], out))) == {"a", "b/abstraction"}


def test_results_are_known_through_a_link(tmp_path: Path) -> None:
    put(tmp_path, "in/a.obj", "in/out/a.obj")
    (tmp_path / "link").symlink_to(tmp_path / "in/out")
    assert set(named(find_files([tmp_path / "in"], tmp_path / "link"))) == {"a"}


@pytest.mark.parametrize(
    ("name", "model_id", "reason"),
    [
        ("a\\b.obj", "a_b", "backslash"),
        ("abstraction.x/a.obj", "abstraction_x/a", "taken by the results' files"),
        ("quarantine.jsonl.obj", "_quarantine.jsonl", "quarantine list"),
        ("!a.obj", "!a", "zip file"),
    ],
)
def test_one_with_an_impossible_name_costs_no_other(
    tmp_path: Path, name: str, model_id: str, reason: str
) -> None:
    put(tmp_path, "good.obj", name)
    found = find_files([tmp_path], tmp_path / "out").files
    assert found["good"].reason == ""
    assert reason in found[model_id].reason


@pytest.mark.parametrize(
    ("files", "given", "message"),
    [
        (["a.obj"], ["b.obj"], "there is no .*b.obj"),
        (["a.txt"], ["a.txt"], r"a.txt is no mesh that can be read: known are .obj"),
        (["a.txt"], ["."], "there is no mesh in"),
        (["a.obj", "a.ply"], ["."], r"a.obj and .*a.ply would both be a in the results"),
        ([], ["x" * 300 + ".obj"], "can't be read: File name too long"),
        ([], ["/dev/null"], "neither a mesh file nor a folder"),
    ],
)
def test_refused_with_the_place(
    tmp_path: Path, files: list[str], given: list[str], message: str
) -> None:
    put(tmp_path, *files)
    with pytest.raises(DatasetError, match=message):
        find_files([tmp_path / name for name in given], tmp_path / "out")
