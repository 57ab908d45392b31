"""Zarr shards: what is written comes back, and damage never reads as zeros."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pnabs.store.arrays import ArraySpec, CategoryArrays
from pnabs.store.errors import DamagedDataError

SPECS = (ArraySpec("bits", (16,), "u1"), ArraySpec("points", (5, 3), "f4"))
SIZE = 16


@pytest.fixture
def store(tmp_path: Path) -> CategoryArrays:
    arrays = CategoryArrays(tmp_path / "s.zarr", tmp_path, SPECS, SIZE)
    arrays.ensure("chair", 2)
    return arrays


def rows(count: int, seed: int = 0) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {
        "bits": rng.integers(0, 255, (count, 16)).astype("u1"),
        "points": rng.random((count, 5, 3)).astype("f4"),
    }


def test_round_trip_and_digests(store: CategoryArrays) -> None:
    written = rows(16), rows(7, 1)
    for shard, values in enumerate(written):
        outputs = store.write_shard("chair", shard, values)
        assert set(outputs) == {
            f"s.zarr/chair/bits/c/{shard}/0",
            f"s.zarr/chair/points/c/{shard}/0/0",
        }
    for shard, values in enumerate(written):
        for name, value in values.items():
            back = store.read_shard("chair", shard, name, len(value))
            np.testing.assert_array_equal(back, value)


def test_same_rows_same_bytes(store: CategoryArrays, tmp_path: Path) -> None:
    other = CategoryArrays(tmp_path / "t.zarr", tmp_path, SPECS, SIZE)
    other.ensure("chair", 1)
    first = store.write_shard("chair", 0, rows(9))
    second = other.write_shard("chair", 0, rows(9))
    assert list(first.values()) == list(second.values())


def test_growing_leaves_shards_alone(store: CategoryArrays) -> None:
    store.write_shard("chair", 0, rows(16))
    before = store.shard_path("chair", "points", 0).read_bytes()
    store.ensure("chair", 5)
    store.write_shard("chair", 4, rows(3, 2))
    assert store.shard_path("chair", "points", 0).read_bytes() == before
    np.testing.assert_array_equal(store.read_shard("chair", 4, "bits", 3), rows(3, 2)["bits"])


def test_what_has_another_shape_is_never_read_as_the_new(
    store: CategoryArrays, tmp_path: Path
) -> None:
    store.write_shard("chair", 0, rows(16))
    specs = (SPECS[0], ArraySpec("points", (7, 3), "f4"))
    wider = CategoryArrays(tmp_path / "s.zarr", tmp_path, specs, SIZE)
    wider.ensure("chair", 2)
    np.testing.assert_array_equal(wider.read_shard("chair", 0, "bits", 16), rows(16)["bits"])
    with pytest.raises(DamagedDataError, match="damaged"):
        wider.read_shard("chair", 0, "points", 16)
    new = {"bits": rows(16)["bits"], "points": np.ones((16, 7, 3), np.float32)}
    wider.write_shard("chair", 0, new)
    np.testing.assert_array_equal(wider.read_shard("chair", 0, "points", 16), new["points"])


def test_a_shard_of_zeros_is_stored(store: CategoryArrays) -> None:
    nothing = {name: np.zeros_like(value) for name, value in rows(4).items()}
    store.write_shard("chair", 0, nothing)
    assert not store.read_shard("chair", 0, "points", 4).any()


@pytest.mark.parametrize("damage", ["flip", "truncate", "empty", "delete"])
def test_damage_is_noticed(store: CategoryArrays, damage: str) -> None:
    store.write_shard("chair", 0, rows(16))
    path = store.shard_path("chair", "points", 0)
    data = bytearray(path.read_bytes())
    if damage == "flip":
        data[len(data) // 3] ^= 4
        path.write_bytes(data)
    elif damage == "truncate":
        path.write_bytes(data[:-5])
    elif damage == "empty":
        path.write_bytes(b"")
    else:
        path.unlink()
    with pytest.raises(DamagedDataError, match="points"):
        store.read_shard("chair", 0, "points", 16)


@pytest.mark.parametrize("damage", ["delete", "garble"])
def test_a_lost_description_is_mended_and_shards_stay(store: CategoryArrays, damage: str) -> None:
    store.write_shard("chair", 0, rows(16))
    path = store.store / "chair" / "points" / "zarr.json"
    before = path.read_bytes()
    assert store.ensure("chair", 2) == []
    path.unlink() if damage == "delete" else path.write_bytes(before[:-20])
    assert store.ensure("chair", 2) == [path]
    assert path.read_bytes() == before
    np.testing.assert_array_equal(store.read_shard("chair", 0, "points", 16), rows(16)["points"])


def test_writers_of_two_shards_leave_each_other_alone(tmp_path: Path) -> None:
    """Also where an array has one number a model, and its shards lie in one folder."""
    specs = (*SPECS, ArraySpec("valid", (), "u1"))
    store = CategoryArrays(tmp_path / "s.zarr", tmp_path, specs, SIZE)
    store.ensure("chair", 2)
    beside = store.shard_path("chair", "valid", 1).with_name("1.0a1b.partial")
    own = store.shard_path("chair", "valid", 0).with_name("0.0a1b.partial")
    for path in (beside, own):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"half")
    store.write_shard("chair", 0, {**rows(SIZE), "valid": np.ones(SIZE, np.uint8)})
    assert beside.exists()
    assert not own.exists()
