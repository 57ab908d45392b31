"""Tables of boxes: what is read, and what is said of what can't be."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from pnabs.evaluation.boxes import NUMBERS, read_boxes
from pnabs.stages.errors import UsageError

HEADER = ",".join(("model_id", *NUMBERS))
BOX = "1,2,3,1,0,0,0,4,5,6"


def table(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "boxes.csv"
    path.write_text(text)
    return path


def test_a_csv_has_the_boxes_of_each_model_in_order(tmp_path: Path) -> None:
    text = f"{HEADER}\na,{BOX}\nb,9{BOX}\na,7{BOX}\n"
    found = read_boxes(table(tmp_path, text))
    assert list(found) == [("", "a"), ("", "b")]
    assert found["", "a"].positives == (
        (1, 2, 3, 1, 0, 0, 0, 4, 5, 6),
        (71, 2, 3, 1, 0, 0, 0, 4, 5, 6),
    )
    assert found["", "a"].negatives == ()


def test_columns_may_stand_in_any_order_with_sign_and_category(tmp_path: Path) -> None:
    names = ["tz", "sign", *NUMBERS[:-1], "category", "model_id"]
    text = f"{','.join(names)}\n6,-1,1,2,3,1,0,0,0,4,5,03001627,x/y\n"
    (name, boxes), *rest = read_boxes(table(tmp_path, text)).items()
    assert not rest
    # neither is taken for a number
    assert name == ("03001627", "x/y")
    assert (boxes.positives, boxes.negatives) == ((), ((1, 2, 3, 1, 0, 0, 0, 4, 5, 6),))


def test_an_npz_says_the_same(tmp_path: Path) -> None:
    path = tmp_path / "boxes.npz"
    numbers = np.array([float(part) for part in BOX.split(",")])
    np.savez(path, model_id=["a", "b", "a"], boxes=[numbers, numbers + 1, numbers], sign=[1, 1, -1])
    found = read_boxes(path)
    assert found["", "a"].positives == found["", "a"].negatives == (tuple(numbers),)
    # numbers + 1 is no unit quaternion
    assert "row 1: qw, qx, qy, qz" in found["", "b"].reason


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ("nan,2,3,1,0,0,0,4,5,6", "line 3: sx is not a finite number"),
        ("1,2,3,1,0,0,0,4,5,inf", "line 3: tz is not a finite number"),
        (",2,3,1,0,0,0,4,5,6", "line 3: sx is not a finite number"),
        ("1,-2,3,1,0,0,0,4,5,6", "line 3: a side is negative"),
        ("1,2,3,1,1,0,0,4,5,6", "line 3: qw, qx, qy, qz are no unit quaternion"),
        ("1,2,3,0,0,0,0,4,5,6", "line 3: qw, qx, qy, qz are no unit quaternion"),
    ],
)
def test_a_wrong_box_is_its_models_fault_alone(tmp_path: Path, row: str, reason: str) -> None:
    found = read_boxes(table(tmp_path, f"{HEADER}\na,{BOX}\nb,{row}\nb,{BOX}\n"))
    assert found["", "b"].reason == f"boxes.csv, {reason}"
    assert (found["", "b"].positives, found["", "a"].reason) == ((), "")


def test_a_wrong_sign_is_told(tmp_path: Path) -> None:
    found = read_boxes(table(tmp_path, f"{HEADER},sign\na,{BOX},0\n"))
    assert "sign is neither 1 nor -1" in found["", "a"].reason


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no readable csv"),
        ("a,b\n1\n", "no readable csv"),
        ("id,x\na,1\n", "missing: 'model_id', 'sx'"),
        (f"{HEADER},Sign\na,{BOX},-1\n", "unknown: 'Sign'"),
        (f"{HEADER},tz\na,{BOX},1\n", "repeated: 'tz'"),
        (f"{HEADER}\na,{BOX.replace('2', 'two')}\n", "no readable csv"),
        (f"{HEADER}\n", "has no boxes"),
        (f"{HEADER}\n,{BOX}\n", "line 2: model_id is empty"),
    ],
)
def test_a_csv_that_is_none_is_refused(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(UsageError, match=says):
        read_boxes(table(tmp_path, text))


@pytest.mark.parametrize(
    ("arrays", "says"),
    [
        ({"boxes": np.zeros((1, 10))}, "missing: 'model_id'"),
        ({"model_id": ["a"], "boxes": np.zeros((1, 9))}, r"shape \(n, 10\), not float64"),
        ({"model_id": ["a", "b"], "boxes": np.zeros((1, 10))}, r"strings of shape \(1,\)"),
        ({"model_id": [1], "boxes": np.zeros((1, 10))}, "model_id must be strings"),
        ({"model_id": ["a"], "boxes": np.zeros((1, 10)), "name": [1]}, "unknown: 'name'"),
        ({"model_id": np.array(["a"], dtype=object), "boxes": np.zeros((1, 10))}, "no readable"),
        ({"model_id": np.zeros(0, "U1"), "boxes": np.zeros((0, 10))}, "has no boxes"),
    ],
)
def test_an_npz_that_is_none_is_refused(
    tmp_path: Path, arrays: dict[str, object], says: str
) -> None:
    path = tmp_path / "boxes.npz"
    np.savez(path, allow_pickle=True, **arrays)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=says):
        read_boxes(path)


def test_a_file_that_is_no_npz_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "boxes.npz"
    path.write_bytes(b"PK\3\4 and nothing more")
    with pytest.raises(UsageError, match="no readable npz"):
        read_boxes(path)


def test_an_npz_that_unpacks_to_too_much_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "boxes.npz"
    np.savez_compressed(path, model_id=["a"] * 1000, boxes=np.zeros((1000, 10)))
    monkeypatch.setattr("pnabs.evaluation.boxes.MOST_BYTES", 10_000)
    with pytest.raises(UsageError, match="unpacks to more than 10,000 bytes"):
        read_boxes(path)


def test_numbers_are_read_exactly(tmp_path: Path) -> None:
    side = math.pi * 1e-7
    found = read_boxes(table(tmp_path, f"{HEADER}\na,{side!r},2,3,1,0,0,0,4,5,6\n"))
    assert found["", "a"].positives[0][0] == side
