"""Boundaries of a shard: what is read is what was written, and damage is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pnabs.geometry.reference import Boundary
from pnabs.store.boundaries import read_boundaries, read_reasons, write_boundaries
from pnabs.store.errors import DamagedDataError


def boundary(count: int, why: str = "") -> Boundary:
    rng = np.random.default_rng(count)
    return Boundary(
        rng.normal(size=(count + 2, 3)).astype(np.float32),
        rng.integers(0, count + 2, (count, 3)).astype(np.int32),
        rng.random(count) < 0.5,
        0.005,
        why,
    )


ROWS = [boundary(12), None, boundary(0, "large"), boundary(1001, "open")]


def test_round_trip_of_some_rows(tmp_path: Path) -> None:
    path = tmp_path / "boundaries" / "chair-00000.parquet"
    outputs = write_boundaries(tmp_path, path, ROWS)
    assert list(outputs) == ["boundaries/chair-00000.parquet"]
    for row, found in zip((0, 2, 3), read_boundaries(path, [0, 2, 3]), strict=True):
        expected = ROWS[row]
        assert expected is not None
        for name in ("vertices", "faces", "sheet"):
            a, b = getattr(found, name), getattr(expected, name)
            assert a.dtype == b.dtype
            np.testing.assert_array_equal(a, b)
        assert (found.thickness, found.not_exact) == (0.005, expected.not_exact)
    assert read_reasons(path) == ["", None, "large", "open"]


def test_same_rows_same_bytes(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("a.parquet", "b.parquet")]
    for path in paths:
        write_boundaries(tmp_path, path, ROWS)
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_a_model_that_failed_has_none(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    write_boundaries(tmp_path, path, ROWS)
    with pytest.raises(DamagedDataError, match="a.parquet"):
        list(read_boundaries(path, [1]))


def test_damage_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    write_boundaries(tmp_path, path, ROWS)
    data = bytearray(path.read_bytes())
    data[len(data) // 3] ^= 1
    path.write_bytes(data)
    with pytest.raises(DamagedDataError, match="verify"):
        list(read_boundaries(path, [0, 2, 3]))
    path.unlink()
    with pytest.raises(DamagedDataError, match="missing"):
        list(read_boundaries(path, [0]))
    with pytest.raises(DamagedDataError, match="missing"):
        read_reasons(path)
