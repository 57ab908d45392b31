"""Reading in place: what is read, and what never is."""

from __future__ import annotations

import errno
import multiprocessing
import os
import pickle
import struct
import zipfile
from pathlib import Path

import pytest

from pnabs.dataset import source as source_module
from pnabs.dataset.errors import DatasetError, SourceError
from pnabs.dataset.source import Dataset

from .conftest import MESH, MakeFolder

MAX = 10_000


@pytest.fixture
def inside(tmp_path: Path, make_folder: MakeFolder) -> Path:
    """A root beside a secret."""
    (tmp_path / "secret.obj").write_text("secret")
    return make_folder(tmp_path / "root", ["chair/a/model.obj"])


def test_a_file_a_zipped_file_and_a_member_of_a_zip_root(
    inside: Path, make_zip: MakeFolder
) -> None:
    archive = make_zip(inside / "lamp.zip", ["lamp/b/model.obj"])
    assert Dataset(inside).read("chair/a/model.obj", MAX) == MESH
    assert Dataset(inside).read("lamp.zip!lamp/b/model.obj", MAX) == MESH
    assert Dataset(archive).read("!lamp/b/model.obj", MAX) == MESH


def test_size_and_time(inside: Path, make_zip: MakeFolder) -> None:
    archive = make_zip(inside / "lamp.zip", ["lamp/b/model.obj"])
    os.utime(inside / "chair/a/model.obj", ns=(1, 1_234_567))
    os.utime(archive, ns=(1, 7_654_321))
    assert Dataset(inside).stat("chair/a/model.obj") == (len(MESH), 1_234_567)
    assert Dataset(inside).stat("lamp.zip!lamp/b/model.obj") == (len(MESH), 7_654_321)


def test_no_root(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"there is no .*nowhere"):
        Dataset(tmp_path / "nowhere")
    (tmp_path / "text").write_text("x")
    with pytest.raises(DatasetError, match="neither a folder nor a zip file"):
        Dataset(tmp_path / "text")


@pytest.mark.parametrize(
    "source",
    [
        "../secret.obj",
        "chair/../../secret.obj",
        "/etc/passwd",
        "chair//a/model.obj",
        "./chair/a/model.obj",
        "chair\\a\\model.obj",
        "chair/\0",
        "!chair/a/model.obj",
        "../other.zip!a.obj",
        "chair/a/none.obj",
        "chair/a/model.obj/deeper.obj",
        "chair/a",
        "",
        "none.zip!a.obj",
        "chair/" + 300 * "x",
    ],
)
def test_what_is_no_file_below_the_root_is_not_read(inside: Path, source: str) -> None:
    dataset = Dataset(inside)
    with pytest.raises(SourceError):
        dataset.read(source, MAX)
    with pytest.raises(SourceError):
        dataset.stat(source)


def test_links_stay_inside(inside: Path) -> None:
    (inside / "chair/b").symlink_to(inside / "chair/a")
    assert Dataset(inside).read("chair/b/model.obj", MAX) == MESH
    (inside / "chair/out.obj").symlink_to("../../secret.obj")
    (inside / "chair/up").symlink_to("../..")
    (inside / "chair/loop.obj").symlink_to("loop.obj")
    (inside / "chair/broken.obj").symlink_to("none.obj")
    for source, why in {
        "chair/out.obj": "leads out",
        "chair/up/secret.obj": "leads out",
        "chair/up/root/chair/out.obj": "leads out",
        "chair/loop.obj": "leads nowhere",
        "chair/broken.obj": "no such file",
    }.items():
        for look in (lambda s: Dataset(inside).read(s, MAX), Dataset(inside).stat):
            with pytest.raises(SourceError, match=why):
                look(source)
    with pytest.raises(SourceError, match="leads out"):
        Dataset(inside).list("chair/up/")


def test_a_root_beside_one_of_a_longer_name(tmp_path: Path, make_folder: MakeFolder) -> None:
    root = make_folder(tmp_path / "root", ["a/x.obj"])
    make_folder(tmp_path / "root2", ["x.obj"])
    (root / "a/link.obj").symlink_to(tmp_path / "root2/x.obj")
    with pytest.raises(SourceError, match="leads out"):
        Dataset(root).read("a/link.obj", MAX)


def test_an_archive_that_is_a_link_out(inside: Path, make_zip: MakeFolder) -> None:
    outside = make_zip(inside.parent / "outside.zip", ["a.obj"])
    (inside / "lamp.zip").symlink_to(outside)
    with pytest.raises(SourceError, match="leads out"):
        Dataset(inside).read("lamp.zip!a.obj", MAX)


def test_only_regular_files(inside: Path) -> None:
    os.mkfifo(inside / "chair/pipe.obj")
    with pytest.raises(SourceError, match="not a regular file"):
        Dataset(inside).read("chair/pipe.obj", MAX)
    os.mkfifo(inside / "pipe.zip")
    with pytest.raises(SourceError, match="not a regular file"):
        Dataset(inside).read("pipe.zip!a.obj", MAX)


def test_the_limit_is_inclusive(inside: Path, make_zip: MakeFolder) -> None:
    make_zip(inside / "lamp.zip", ["a.obj"])
    for source in ("chair/a/model.obj", "lamp.zip!a.obj"):
        assert len(Dataset(inside).read(source, len(MESH))) == len(MESH)
        with pytest.raises(SourceError, match="over the limit of"):
            Dataset(inside).read(source, len(MESH) - 1)


def test_a_disk_that_fails_is_no_verdict(inside: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> int:
        raise OSError(errno.EIO, "input/output error")

    monkeypatch.setattr(source_module.os, "open", fail)
    with pytest.raises(OSError, match="input/output error"):
        Dataset(inside).read("chair/a/model.obj", MAX)


def _patch(file: Path, at: bytes, offset: int, value: bytes) -> None:
    """Overwrite bytes behind every occurrence of a zip record's signature."""
    data = bytearray(file.read_bytes())
    position = data.find(at)
    while position >= 0:
        data[position + offset : position + offset + len(value)] = value
        position = data.find(at, position + 1)
    file.write_bytes(data)


def test_a_bomb_that_declares_too_little(tmp_path: Path) -> None:
    bomb = tmp_path / "bomb.zip"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.obj", bytes(50_000_000))
    _patch(bomb, b"PK\x01\x02", 24, struct.pack("<I", 100))
    with pytest.raises(SourceError, match="damaged in its archive"):
        Dataset(bomb).read("!a.obj", MAX)


def test_an_archive_that_declares_too_much(tmp_path: Path, make_zip: MakeFolder) -> None:
    archive = make_zip(tmp_path / "a.zip", ["a.obj"])
    _patch(archive, b"PK\x01\x02", 24, struct.pack("<I", len(MESH) + 7))
    with pytest.raises(SourceError, match="7 bytes shorter than its archive declares"):
        Dataset(archive).read("!a.obj", MAX)


def test_flipped_bits_in_an_archive(tmp_path: Path) -> None:
    archive = tmp_path / "a.zip"
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_STORED) as file:
        file.writestr("a.obj", MESH)
    archive.write_bytes(archive.read_bytes().replace(b"v 1 0 0", b"v 1 0 1"))
    with pytest.raises(SourceError, match="CRC"):
        Dataset(archive).read("!a.obj", MAX)


def test_a_truncated_archive(inside: Path, make_zip: MakeFolder) -> None:
    archive = make_zip(inside / "lamp.zip", ["a.obj"])
    archive.write_bytes(archive.read_bytes()[:-10])
    with pytest.raises(SourceError, match="not a readable zip file"):
        Dataset(inside).read("lamp.zip!a.obj", MAX)


def test_members_that_are_not_plain_files(tmp_path: Path) -> None:
    hostile = tmp_path / "hostile.zip"
    link = zipfile.ZipInfo("link.obj")
    link.external_attr = 0o120777 << 16
    with zipfile.ZipFile(hostile, "w") as archive:
        archive.writestr(link, "/etc/passwd")
        archive.writestr("../up.obj", MESH)
        archive.writestr("/absolute.obj", MESH)
        archive.writestr("a/../../up.obj", MESH)
        archive.writestr("back\\slash.obj", MESH)
        archive.mkdir("folder.obj")
        archive.writestr("bz2.obj", MESH, zipfile.ZIP_BZIP2)
        members = archive.namelist()
    dataset = Dataset(hostile)
    for member in members:
        with pytest.raises(SourceError):
            dataset.read(f"!{member}", MAX)
        with pytest.raises(SourceError):
            dataset.stat(f"!{member}")


def test_an_encrypted_member(tmp_path: Path, make_zip: MakeFolder) -> None:
    archive = make_zip(tmp_path / "a.zip", ["a.obj"])
    _patch(archive, b"PK\x01\x02", 8, struct.pack("<H", 1))
    with pytest.raises(SourceError, match="encrypted"):
        Dataset(archive).read("!a.obj", MAX)


def test_an_archive_is_opened_once_until_it_changes(
    tmp_path: Path, make_zip: MakeFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    archive = make_zip(tmp_path / "a.zip", ["a.obj", "b.obj"])
    opened = []

    class Counted(zipfile.ZipFile):
        def __init__(self, file: str) -> None:
            opened.append(file)
            super().__init__(file)

    monkeypatch.setattr(zipfile, "ZipFile", Counted)
    for member in ("!a.obj", "!b.obj", "!a.obj"):
        assert Dataset(archive).read(member, MAX) == MESH
    assert len(opened) == 1
    monkeypatch.undo()
    make_zip(tmp_path / "a.zip", ["c.obj"])
    assert Dataset(archive).read("!c.obj", MAX) == MESH


def _read_often(dataset: Dataset, source: str, times: int) -> None:
    for _ in range(times):
        if dataset.read(source, 10**7) != bytes(range(256)) * 4_000:
            os._exit(1)


def test_forked_processes_do_not_share_a_file_offset(tmp_path: Path) -> None:
    archive = tmp_path / "a.zip"
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_STORED) as file:
        file.writestr("a.obj", bytes(range(256)) * 4_000)
    dataset = Dataset(archive)
    _read_often(dataset, "!a.obj", 1)
    fork = multiprocessing.get_context("fork")
    children = [fork.Process(target=_read_often, args=(dataset, "!a.obj", 30)) for _ in range(2)]
    for child in children:
        child.start()
    for child in children:
        child.join(30)
    assert [child.exitcode for child in children] == [0, 0]


def test_a_dataset_travels_to_workers(inside: Path) -> None:
    assert pickle.loads(pickle.dumps(Dataset(inside))).read("chair/a/model.obj", MAX) == MESH


def test_siblings(inside: Path, make_zip: MakeFolder) -> None:
    (inside / "chair/my part.bin").write_bytes(b"buffer")
    read = Dataset(inside).sibling_reader("chair/a/model.gltf", MAX)
    assert read("../my part.bin") == read("../my%20part.bin") == b"buffer"
    archive = make_zip(inside / "lamp.zip", ["a/model.gltf", "b/part.bin"])
    assert Dataset(inside).sibling_reader("lamp.zip!a/model.gltf", MAX)("../b/part.bin") == MESH
    assert Dataset(archive).sibling_reader("!a/model.gltf", MAX)("../b/part.bin") == MESH


@pytest.mark.parametrize(
    "name",
    [
        "../../../secret.obj",
        "%2e%2e/%2e%2e/%2e%2e/secret.obj",
        "/etc/passwd",
        "%2fetc/passwd",
        "file:///etc/passwd",
        "http://localhost/a.bin",
        "..\\..\\secret.obj",
        "",
        "%00",
    ],
)
def test_siblings_stay_inside(inside: Path, name: str) -> None:
    with pytest.raises(SourceError):
        Dataset(inside).sibling_reader("chair/a/model.gltf", MAX)(name)


def test_siblings_share_a_limit(inside: Path) -> None:
    read = Dataset(inside).sibling_reader("chair/a/model.gltf", 2 * len(MESH) - 1)
    assert read("model.obj") == MESH
    with pytest.raises(SourceError, match="over the limit"):
        read("model.obj")


def test_members_that_lie_too_deep_cost_nothing(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "deep.zip", "w") as file:
        file.writestr("a/" * 200 + "model.obj", b"")
    with pytest.raises(SourceError, match="more than 64 folders deep"):
        Dataset(tmp_path / "deep.zip").list("!")


def test_names_that_the_system_can_t_take(inside: Path, make_zip: MakeFolder) -> None:
    archive = make_zip(inside / "lamp.zip", ["lamp/b/model.obj"])
    for name in ("\ud800.obj", "a\0b.obj"):
        with pytest.raises(SourceError, match="not a plain path"):
            Dataset(inside).read(name, MAX)
        with pytest.raises(DatasetError, match="there is no"):
            Dataset(inside / name)
    with pytest.raises(SourceError, match="names no member"):
        Dataset(archive).read("!", MAX)


def test_a_directory_that_sends_the_reader_before_the_file(
    inside: Path, make_zip: MakeFolder
) -> None:
    archive = make_zip(inside / "lamp.zip", ["lamp/b/model.obj"])
    data = bytearray(archive.read_bytes())
    struct.pack_into("<I", data, data.rfind(b"PK\5\6") + 16, 2**32 - 2)
    archive.write_bytes(data)
    with pytest.raises(SourceError, match=r"damaged|not a readable zip"):
        Dataset(inside).read("lamp.zip!lamp/b/model.obj", MAX)
