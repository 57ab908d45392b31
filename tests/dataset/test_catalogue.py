"""The catalogue: order, shards, splits, growth, and its file."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnabs import settings
from pnabs.dataset import catalogue
from pnabs.dataset.errors import DatasetError
from pnabs.dataset.source import Dataset

from .conftest import MakeFolder


def _scan(root: Path, **more: object) -> pa.Table:
    job = {"root": root, "layout": "shapenet-v1", "shard_size": 3} | more
    return catalogue.scan(settings.Dataset.model_validate(job), root)


def _paths(category: str, ids: list[str]) -> list[str]:
    return [f"{category}/{model_id}/model.obj" for model_id in ids]


@pytest.fixture
def root(tmp_path: Path, make_folder: MakeFolder) -> Path:
    """Seven chairs and two lamps, written in no order."""
    chairs = _paths("03001627", ["f", "b", "a", "g", "c", "e", "d"])
    return make_folder(tmp_path / "root", chairs + _paths("lamp", ["y", "x"]))


def test_rows_shards_and_columns(root: Path) -> None:
    table = _scan(root)
    assert table.schema.equals(catalogue.SCHEMA)
    assert table["model_id"].to_pylist() == list("abcdefgxy")
    assert table["shard"].to_pylist() == (
        3 * ["03001627-00000"] + 3 * ["03001627-00001"] + ["03001627-00002"] + 2 * ["lamp-00000"]
    )
    assert table["row"].to_pylist() == [0, 1, 2, 0, 1, 2, 0, 0, 1]
    status = os.stat(root / "lamp/x/model.obj")
    x = table.slice(7, 1).to_pylist()[0]
    assert (x["source"], x["size"], x["mtime_ns"]) == (
        "lamp/x/model.obj",
        status.st_size,
        status.st_mtime_ns,
    )


def test_the_order_of_the_disk_does_not_show(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = _scan(root)
    listed = Dataset.list
    monkeypatch.setattr(Dataset, "list", lambda *a: sorted(listed(*a), reverse=True))
    assert _scan(root).equals(before)
    monkeypatch.setattr(Dataset, "list", lambda *a: sorted(listed(*a)))
    assert _scan(root).equals(before)


def test_the_root_counts_from_the_job_file(root: Path) -> None:
    job = settings.Dataset(root=Path("root"), layout="shapenet-v1")
    assert len(catalogue.scan(job, root.parent)) == 9


def test_categories_by_name_and_in_any_order(root: Path) -> None:
    both = _scan(root, categories=["lamp", "chair"])
    assert both.equals(_scan(root))
    assert set(_scan(root, categories=["chair", "03001627"])["category"].to_pylist()) == {
        "03001627"
    }
    with pytest.raises(DatasetError, match="did you mean chair"):
        _scan(root, categories=["chairs"])


def test_the_first_of_each_category(root: Path) -> None:
    assert _scan(root, limit=2)["model_id"].to_pylist() == ["a", "b", "x", "y"]


def test_nothing_readable(tmp_path: Path, make_folder: MakeFolder) -> None:
    make_folder(tmp_path, ["chair/a/texture.png"])
    with pytest.raises(DatasetError, match=r"chair/a/model\.obj: no such file"):
        _scan(tmp_path)


def test_a_damaged_archive_is_named(tmp_path: Path, make_zip: MakeFolder) -> None:
    archive = make_zip(tmp_path / "chair.zip", ["a/model.obj"])
    archive.write_bytes(archive.read_bytes()[:-8])
    with pytest.raises(DatasetError, match=r"chair\.zip: not a readable zip file"):
        _scan(tmp_path)


def test_a_split_by_hash_stays_when_models_are_added(root: Path, make_folder: MakeFolder) -> None:
    ids = [f"{i:04x}" for i in range(60)]
    make_folder(root, _paths("03001627", ids[::2]))
    before = _scan(root, val_share=0.2)
    make_folder(root, _paths("03001627", ids))
    after = _scan(root, val_share=0.2)

    def splits(table: pa.Table) -> set[tuple[str, str]]:
        return set(zip(table["model_id"].to_pylist(), table["split"].to_pylist(), strict=True))

    assert splits(before) < splits(after)
    assert set(after["split"].to_pylist()) == {"train", "val", "test"}


def test_a_split_from_a_csv(root: Path) -> None:
    (root / "all.csv").write_text(
        "id,synsetId,subSynsetId,modelId,split\n0,03001627,,a,test\n1,03001627,,b,train\n"
        "2,03636649,,x,val\n3,03636649,,gone,val\n"
    )
    table = _scan(root, split="all.csv")
    split = dict(zip(table["model_id"].to_pylist(), table["split"].to_pylist(), strict=True))
    # The folder `lamp` is meant by its synset; what the csv lacks is in no split.
    assert split == {"a": "test", "b": "train", "x": "val"} | dict.fromkeys("cdefgy", "none")


def test_a_csv_of_another_dataset(root: Path) -> None:
    (root / "all.csv").write_text("id,synsetId,subSynsetId,modelId,split\n0,1,,a,test\n")
    with pytest.raises(DatasetError, match=r"has none of the 9 models.*03001627/a"):
        _scan(root, split="all.csv")


def test_growth_keeps_shards_and_takes_new_facts(root: Path, make_folder: MakeFolder) -> None:
    old = _scan(root)
    make_folder(root, _paths("03001627", ["a0", "z", "b0", "c0"]) + _paths("bus", ["m"]))
    (root / "lamp/x/model.obj").write_bytes(b"changed")
    (root / "lamp/y/model.obj").unlink()
    (root / "03001627/d/model.obj").unlink()
    (root / "03001627/d").rmdir()
    grown = catalogue.extend(old, _scan(root), 3)
    assert grown.schema.equals(catalogue.SCHEMA)
    where = [
        (row["model_id"], row["shard"][-5:], row["row"], row["category"])
        for row in grown.to_pylist()
    ]
    chair = "03001627"
    assert where == [
        ("a", "00000", 0, chair),
        ("b", "00000", 1, chair),
        ("c", "00000", 2, chair),
        ("d", "00001", 0, chair),
        ("e", "00001", 1, chair),
        ("f", "00001", 2, chair),
        ("g", "00002", 0, chair),
        ("a0", "00003", 0, chair),
        ("b0", "00003", 1, chair),
        ("c0", "00003", 2, chair),
        ("z", "00004", 0, chair),
        ("m", "00000", 0, "bus"),
        ("x", "00000", 0, "lamp"),
        ("y", "00000", 1, "lamp"),
    ]
    rows = {row["model_id"]: row for row in grown.to_pylist()}
    assert rows["x"]["size"] == len(b"changed")
    assert "no such file" in rows["y"]["reason"]
    assert rows["d"] == old.filter(pc.equal(old["model_id"], "d")).to_pylist()[0]


models = st.dictionaries(
    st.tuples(st.sampled_from(["a", "a-00001", "b"]), st.text("xyz~/", min_size=1, max_size=3)),
    st.integers(0, 9),
    max_size=30,
)


def _table(sizes: dict[tuple[str, str], int], shard_size: int) -> pa.Table:
    """A catalogue as a scan would number it, written out row by row."""
    rows: list[dict[str, object]] = []
    seen: dict[str, int] = {}
    for (category, model_id), size in sorted(sizes.items()):
        shard, row = divmod(seen.get(category, 0), shard_size)
        seen[category] = seen.get(category, 0) + 1
        rows.append(
            {
                "category": category,
                "model_id": model_id,
                "split": "train",
                "source": f"{category}/{model_id}.obj",
                "shard": f"{category}-{shard:05d}",
                "row": row,
                "size": size,
                "mtime_ns": 0,
                "reason": "",
            }
        )
    return pa.Table.from_pylist(rows, schema=catalogue.SCHEMA)


@given(models, models, models, st.integers(1, 5))
def test_growth_obeys_its_laws(
    first: dict[tuple[str, str], int],
    second: dict[tuple[str, str], int],
    third: dict[tuple[str, str], int],
    shard_size: int,
) -> None:
    table = _table(first, shard_size)
    assert catalogue.extend(table, table, shard_size).equals(table)
    sizes = first
    for scan in (second, third):
        old, new = table.to_pylist(), _table(scan, shard_size)
        table = catalogue.extend(table, new, shard_size)
        rows, sizes = table.to_pylist(), sizes | scan
        place = {(r["category"], r["model_id"]): (r["shard"], r["row"]) for r in rows}
        assert {(r["category"], r["model_id"]): r["size"] for r in rows} == sizes
        assert all(place[r["category"], r["model_id"]] == (r["shard"], r["row"]) for r in old)
        known = {r["shard"] for r in old}
        old_models = {(r["category"], r["model_id"]) for r in old}
        assert all((place[m][0] in known) == (m in old_models) for m in place)
        for shard in {r["shard"] for r in rows}:
            held = [r["row"] for r in rows if r["shard"] == shard]
            assert held == list(range(len(held)))
            assert len(held) <= shard_size
        # Growing by the same scan again changes nothing.
        assert catalogue.extend(table, new, shard_size).equals(table)


def test_a_shard_number_beyond_five_digits_still_sorts(tmp_path: Path) -> None:
    ids = [f"{i:06d}" for i in range(100_002)]
    old = _table({("a", model_id): 0 for model_id in ids}, 1)
    grown = catalogue.extend(old, _table({("a", "x"): 0}, 1), 1)
    assert grown["shard"].to_pylist()[-3:] == ["a-100000", "a-100001", "a-100002"]
    assert grown.slice(0, len(old)).equals(old)


def test_the_file_is_the_table_and_the_same_bytes(root: Path, tmp_path: Path) -> None:
    table = _scan(root)
    (tmp_path / "a.parquet").write_bytes(catalogue.to_bytes(table))
    pieces = pa.concat_tables([table.slice(0, 4), table.slice(4)])
    (tmp_path / "b.parquet").write_bytes(catalogue.to_bytes(pieces))
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()
    assert catalogue.read(tmp_path / "a.parquet").equals(table)
    assert {path.name for path in tmp_path.iterdir()} == {"root", "a.parquet", "b.parquet"}


def test_files_that_are_no_catalogue(tmp_path: Path, root: Path) -> None:
    with pytest.raises(DatasetError, match="none"):
        catalogue.read(tmp_path / "none.parquet")
    (tmp_path / "text.parquet").write_text("text")
    with pytest.raises(DatasetError, match="isn't a readable catalogue"):
        catalogue.read(tmp_path / "text.parquet")
    (tmp_path / "other.parquet").write_bytes(
        catalogue.to_bytes(_scan(root).drop_columns(["reason"]))
    )
    with pytest.raises(DatasetError, match="isn't a catalogue: its columns"):
        catalogue.read(tmp_path / "other.parquet")


def test_the_fingerprint_is_of_the_content(root: Path, tmp_path: Path) -> None:
    table = _scan(root)
    same = catalogue.fingerprint(table)
    (tmp_path / "c.parquet").write_bytes(catalogue.to_bytes(table))
    assert catalogue.fingerprint(catalogue.read(tmp_path / "c.parquet")) == same
    pieces = pa.concat_tables([table.slice(0, 0), table.slice(0, 4), table.slice(4)])
    assert catalogue.fingerprint(pieces) == same
    assert catalogue.fingerprint(pa.concat_tables([table, table]).slice(9)) == same

    changed = [table.slice(1), table.slice(0, 8)]
    for name in table.column_names:
        at, column = table.column_names.index(name), table[name].to_pylist()
        column[4] = column[4] + ("x" if isinstance(column[4], str) else 1)
        field = catalogue.SCHEMA.field(name)
        changed.append(table.set_column(at, field, pa.array(column, field.type)))
    # The same characters, parted differently.
    moved = table["source"].to_pylist()
    moved[0], moved[1] = moved[0] + moved[1][0], moved[1][1:]
    changed.append(table.set_column(3, catalogue.SCHEMA.field("source"), pa.array(moved)))
    assert len({same, *map(catalogue.fingerprint, changed)}) == len(changed) + 1


def test_the_same_models_from_folder_and_archive(root: Path, tmp_path: Path) -> None:
    archive = tmp_path / "all.zip"
    with zipfile.ZipFile(archive, "w") as file:
        for path in sorted(root.rglob("*")):
            file.write(path, path.relative_to(root))
    folder, zipped = _scan(root), _scan(archive)
    place = ["source", "mtime_ns"]
    assert zipped.drop_columns(place).equals(folder.drop_columns(place))


@pytest.mark.skipif("PNABS_DEV_CORPUS" not in os.environ, reason="PNABS_DEV_CORPUS is not set")
def test_the_dev_corpus() -> None:
    corpus = Path(os.environ["PNABS_DEV_CORPUS"])
    table = catalogue.scan(settings.Dataset(root=corpus, layout="shapenet-v2"), Path("/"))
    meshes = len(list(corpus.glob("*/*/models/model_normalized.obj")))
    assert pc.sum(pc.equal(table["reason"], "")).as_py() == meshes
    test = np.mean(pc.equal(table["split"], "test").to_numpy())
    assert abs(test - 1 / 3) < 4 * np.sqrt(2 / 9 / len(table))
