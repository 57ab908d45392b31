"""Roots in job files: what is a path, what is a bucket's URL, and what is neither."""

from __future__ import annotations

from pathlib import Path

import pytest

from pnabs.settings import Dataset, split_s3_url
from pnabs.stages.job import JobError, load_job


def _job(folder: Path, root: str, out: str) -> Path:
    path = folder / "job.yaml"
    path.write_text(f"dataset:\n  root: {root}\nout: {out}\n")
    return path


def test_a_url_stays_as_it_is_and_a_path_is_made_absolute(tmp_path: Path) -> None:
    job = load_job(_job(tmp_path, "s3://corpus/set/", "run"))
    assert job.settings.dataset.root == "s3://corpus/set/"
    assert job.variant("main").dataset.root == "s3://corpus/set/"
    job = load_job(_job(tmp_path, "meshes", "run"))
    assert job.settings.dataset.root == Path("meshes").absolute()
    assert Dataset.model_validate(Dataset(root=Path("a")).model_dump(mode="json")).root == Path("a")


def test_bucket_and_prefix() -> None:
    assert split_s3_url("s3://corpus") == split_s3_url("s3://corpus/") == ("corpus", "")
    assert split_s3_url("s3://corpus/a b/c.zip") == ("corpus", "a b/c.zip")
    assert split_s3_url("s3://corpus/..a/b..") == ("corpus", "..a/b..")


@pytest.mark.parametrize(
    "root",
    ["s3://", "s3:/corpus", "s3://a/b", "s3://corpus//a", "s3://corpus/../a", "gs://corpus/a"],
)
def test_what_is_neither_names_the_key_and_the_line(tmp_path: Path, root: str) -> None:
    with pytest.raises(JobError, match=r"job.yaml, line 2: dataset.root: .*s3://bucket/prefix"):
        load_job(_job(tmp_path, root, "run"))


def test_a_run_folder_is_on_a_disk(tmp_path: Path) -> None:
    path = _job(tmp_path, "s3://corpus/set", "s3://corpus/run")
    with pytest.raises(JobError, match=r"job.yaml, line 3: out: .*file system"):
        load_job(path)
    with pytest.raises(JobError, match=r"--set out=.*: out: .*file system"):
        load_job(path, ["out=s3://corpus/other"])
    with pytest.raises(JobError, match=r"--out: out: .*file system"):
        load_job(path, out=Path("s3://corpus/other"))
    assert load_job(path, out=tmp_path / "run").settings.out == tmp_path / "run"
