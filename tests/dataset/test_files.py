"""Meshes named one by one or by folder: their ids, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from pnabs.dataset.errors import DatasetError
from pnabs.dataset.files import find_files


def put(root: Path, *names: str) -> None:
    for name in names:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text("")


def test_a_folders_meshes_at_any_depth(tmp_path: Path) -> None:
    put(tmp_path, "b.obj", "a/c.PLY", "a/d/e.glb", "a/notes.txt", ".hidden/f.obj", "._b.obj")
    found = find_files([tmp_path], tmp_path / "out")
    assert found.root == tmp_path
    assert list(found.sources.items()) == [
        ("a/c", "a/c.PLY"),
        ("a/d/e", "a/d/e.glb"),
        ("b", "b.obj"),
    ]


def test_one_file_is_known_by_its_name(tmp_path: Path) -> None:
    put(tmp_path, "a/chair.obj", "a/table.obj")
    found = find_files([tmp_path / "a/chair.obj"], tmp_path / "out")
    assert (found.root, found.sources) == (tmp_path / "a", {"chair": "chair.obj"})


def test_ids_begin_below_what_all_have_in_common(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(tmp_path, "x/a/one.obj", "x/a/b/two.stl", "x/c/one.obj", "x/c/other.obj")
    monkeypatch.chdir(tmp_path)
    found = find_files([Path("x/a"), Path("x/c/one.obj"), Path("x/a/one.obj")], Path("out"))
    assert found.root == tmp_path / "x"
    assert found.sources == {
        "a/b/two": "a/b/two.stl",
        "a/one": "a/one.obj",
        "c/one": "c/one.obj",
    }


def test_results_are_no_input(tmp_path: Path) -> None:
    put(tmp_path, "a.obj", "out/a/abstraction.glb", "out/a/abstraction.obj", "outer/b.obj")
    found = find_files([tmp_path], tmp_path / "out")
    assert set(found.sources) == {"a", "outer/b"}


def test_linked_folders_are_not_entered(tmp_path: Path) -> None:
    put(tmp_path, "in/a.obj", "elsewhere/b.obj")
    (tmp_path / "in/link").symlink_to(tmp_path / "elsewhere")
    assert set(find_files([tmp_path / "in"], tmp_path / "out").sources) == {"a"}


@pytest.mark.parametrize(
    ("files", "given", "message"),
    [
        (["a.obj"], ["b.obj"], "there is no .*b.obj"),
        (["a.txt"], ["a.txt"], r"a.txt is no mesh that can be read: known are .obj"),
        (["a.txt"], ["."], "there is no mesh in"),
        (["a.obj", "a.ply"], ["."], r"a.obj and .*a.ply would both be a in the results"),
        (["abstraction.x/a.obj"], ["."], "taken by the results' files"),
    ],
)
def test_refused_with_the_place(
    tmp_path: Path, files: list[str], given: list[str], message: str
) -> None:
    put(tmp_path, *files)
    with pytest.raises(DatasetError, match=message):
        find_files([tmp_path / name for name in given], tmp_path / "out")
