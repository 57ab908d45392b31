"""The catalogue by shard agrees with the catalogue row by row."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pyarrow as pa
from hypothesis import given, settings
from hypothesis import strategies as st

from pnabs.dataset import catalogue as catalogues
from pnabs.stages.context import read_shard_rows
from pnabs.stages.shards import INPUTS, MODELS, Shards
from pnabs.store.atomic import digest

SPLITS = ("train", "val", "test", "none")


def table(counts: list[int], splits: list[str]) -> pa.Table:
    rows = []
    for number, count in enumerate(counts):
        for row in range(count):
            rows.append(
                {
                    "category": f"c{number // 2}",
                    "model_id": f"m{number}é{row}",
                    "split": splits[len(rows) % len(splits)],
                    "source": f"c{number // 2}/m{row}.obj" * (row % 3),
                    "shard": f"c{number // 2}-{number % 2:05d}",
                    "row": row,
                    "size": row * 7,
                    "mtime_ns": number,
                    "reason": "",
                }
            )
    return pa.Table.from_pylist(rows, schema=catalogues.SCHEMA)


@settings(deadline=None)
@given(
    st.lists(st.integers(1, 5), min_size=1, max_size=6),
    st.lists(st.sampled_from(SPLITS), min_size=1, max_size=7),
    st.sets(st.integers(0, 20), max_size=4),
)
def test_shards_are_the_rows(counts: list[int], splits: list[str], gone: set[int]) -> None:
    catalogue = table(counts, splits)
    shards = Shards.of_table(pa.concat_tables([catalogue.slice(0, 2), catalogue.slice(2)]))
    rows = catalogue.to_pylist()
    names = list(dict.fromkeys(row["shard"] for row in rows))
    assert shards.names == names
    without = {rows[place]["model_id"] for place in gone if place < len(rows)}
    for number, name in enumerate(names):
        own = [row for row in rows if row["shard"] == name]
        assert shards.models[number] == len(own)
        for chosen in (("train",), ("train", "val")):
            for left_out in (set(), without):
                kept = [row for row in own if row["model_id"] not in left_out]
                expected = [row["row"] for row in kept if row["split"] in chosen]
                assert shards.chosen(number, chosen, left_out).tolist() == expected
    assert sum(shards.counts.values()) == len(names)


def test_a_digest_changes_with_its_columns_alone() -> None:
    counts, splits = [3, 2, 4], ["train", "test"]
    before = Shards.of_table(table(counts, splits))
    changed = table(counts, splits).to_pylist()
    changed[3]["size"] += 1
    changed[4]["mtime_ns"] += 1
    after = Shards.of_table(pa.Table.from_pylist(changed, schema=catalogues.SCHEMA))
    assert [a == b for a, b in zip(before.digests(INPUTS), after.digests(INPUTS), strict=True)] == [
        *(True, False, True)
    ]
    assert before.digests(MODELS) == after.digests(MODELS)
    # Where one value ends and the next begins counts.
    moved = table([2], ["train"]).to_pylist()
    joined = [{**moved[0], "model_id": "ab"}, {**moved[1], "model_id": "c"}]
    parted = [{**moved[0], "model_id": "a"}, {**moved[1], "model_id": "bc"}]
    one, other = (
        Shards.of_table(pa.Table.from_pylist(rows, schema=catalogues.SCHEMA)).digests(MODELS)
        for rows in (joined, parted)
    )
    assert one != other


def test_a_file_and_its_index_say_the_same(tmp_path: Path) -> None:
    catalogue = table([5, 3, 4, 1], ["train", "val", "none"])
    path, index = tmp_path / "catalogue.parquet", tmp_path / "index"
    data = catalogues.to_bytes(catalogue)
    path.write_bytes(data)
    mark = digest(data)
    plain = Shards.of_table(catalogue)
    for state in ("none", "there", "another catalogue's", "damaged"):
        if state == "there":
            Shards.of_file(path, index, mark).save_index(index, mark)
        elif state == "another catalogue's":
            Shards.of_file(path, index, mark).save_index(index, "0" * 64)
        elif state == "damaged":
            body = index.read_bytes()
            index.write_bytes(body.replace(b'"models":[5', b'"models":[6'))
            assert hashlib.sha256(body).digest() != hashlib.sha256(index.read_bytes()).digest()
        shards = Shards.of_file(path, index, mark)
        assert (shards.names, shards.models, shards.counts) == (
            *(plain.names, plain.models, plain.counts),
        )
        assert shards.digests(INPUTS) == plain.digests(INPUTS)
        assert shards.digests(MODELS) == plain.digests(MODELS)
        np.testing.assert_array_equal(shards.chosen(0, ("train",)), plain.chosen(0, ("train",)))
    for number, name in enumerate(plain.names):
        rows = read_shard_rows(path, name)
        assert len(rows) == plain.models[number]
        assert {row["shard"] for row in rows} == {name}
