"""Splits by hash and by csv."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnabs.dataset.errors import DatasetError
from pnabs.dataset.splits import hash_split, read_split


def test_known_ids_keep_their_split() -> None:
    # Changing any of these would move models between training and test in existing runs.
    known = {
        "1a04e3eab45ca15dd86060f189eb133": "train",
        "chair_0001": "train",
        "stühle/ä": "test",
        "3": "test",
        "0": "val",
        "": "train",
    }
    assert {model_id: hash_split(model_id, 1 / 3, 0.1) for model_id in known} == known


def test_shares_and_uniformity() -> None:
    drawn = np.array([hash_split(f"{i:x}", 1 / 3, 0.1) for i in range(30_000)])
    for name, share in {"test": 1 / 3, "val": 0.1, "train": 1 - 1 / 3 - 0.1}.items():
        deviation = np.sqrt(share * (1 - share) / len(drawn))
        assert abs((drawn == name).mean() - share) < 4 * deviation


@given(st.text(max_size=20), st.floats(0, 0.5), st.floats(0, 0.5))
def test_validation_is_taken_from_training_alone(model_id: str, test: float, val: float) -> None:
    without, held_out = hash_split(model_id, test, 0), hash_split(model_id, test, val)
    assert (without == "test") == (held_out == "test")


@pytest.mark.parametrize(("test", "val", "split"), [(1, 0, "test"), (0, 1, "val"), (0, 0, "train")])
def test_whole_shares(test: float, val: float, split: str) -> None:
    assert {hash_split(str(i), test, val) for i in range(100)} == {split}


def test_shares_over_one() -> None:
    with pytest.raises(DatasetError, match="add up to more than 1"):
        hash_split("a", 0.7, 0.4)


HEADER = "id,synsetId,subSynsetId,modelId,split\n"


def _csv(folder: Path, text: str) -> Path:
    path = folder / "all.csv"
    path.write_text(text)
    return path


def test_a_csv_as_shapenet_has_it(tmp_path: Path) -> None:
    text = (
        HEADER + "0,02691156,02690373,0012,train\n1,03001627,03001627,1e5,val\n2,animal,,x,test\n"
    )
    assert read_split(_csv(tmp_path, text)) == {
        ("02691156", "0012"): "train",
        ("03001627", "1e5"): "val",
        ("animal", "x"): "test",
    }


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("id,synsetId,modelId\n0,a,b\n", "split"),
        ("", "columns"),
        (HEADER + "0,a,a,b\n", "columns"),
        (HEADER + "0,a,a,b,dev\n", "puts a/b into 'dev'.*1 such"),
        (HEADER + "0,a,a,b,\n", "puts a/b into ''"),
        (HEADER + "0,a,a,b,test\n1,a,a,b,train\n", "has a/b twice, in test and in train"),
    ],
)
def test_a_csv_that_is_wrong(tmp_path: Path, text: str, why: str) -> None:
    with pytest.raises(DatasetError, match=why):
        read_split(_csv(tmp_path, text))


def test_no_csv(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"none\.csv"):
        read_split(tmp_path / "none.csv")
