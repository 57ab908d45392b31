"""Small collections, as folders and as zip files."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

MESH = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"

MakeFolder = Callable[[Path, Iterable[str]], Path]


@pytest.fixture
def make_folder() -> MakeFolder:
    """Write a mesh at each path below a root."""

    def make(root: Path, paths: Iterable[str]) -> Path:
        for path in paths:
            file = root / path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(MESH)
        return root

    return make


@pytest.fixture
def make_zip() -> MakeFolder:
    """Write a zip file with a mesh at each member."""

    def make(file: Path, members: Iterable[str]) -> Path:
        file.parent.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            for member in members:
                archive.writestr(member, MESH)
        return file

    return make
