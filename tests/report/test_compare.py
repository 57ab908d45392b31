"""Figures of the tables against hand computation."""

from __future__ import annotations

import json

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnabs.report import build_tables
from pnabs.report.compare import MIN_MODELS, bootstrap_means
from pnabs.report.measures import COLUMNS


def rng(seed=0):
    return np.random.default_rng(seed)


def test_means_by_category_and_their_average(row, table):
    rows = [row("a", iou_64=v, iou_64_positives=v - 0.1) for v in (0.2, 0.3, 0.4, 0.5, 0.6)]
    rows += [row("b", iou_64=0.8, iou_64_positives=0.9) for _ in range(15)]
    iou = build_tables({"main": table(rows)}, rng())["iou_64"]
    assert [(c.category, c.models) for c in iou.columns] == [("a", 5), ("b", 15)]
    assert iou.row("cropped").values == pytest.approx((40, 80))
    assert iou.row("positives").values == pytest.approx((30, 90))
    # Categories weigh the same, however many models they have; over all models they don't.
    assert iou.row("cropped").summary == pytest.approx(60)
    assert iou.row("cropped").overall == pytest.approx((5 * 40 + 15 * 80) / 20)
    assert iou.row("difference").values == pytest.approx((10, -10))
    assert iou.row("difference").summary == pytest.approx(0)
    assert iou.row("mesh").values == pytest.approx((45, 45))


def test_model_without_a_result_counts_as_iou_zero_and_is_left_out_of_distances(row, table):
    rows = [row("a", iou_64=0.5, cd_l1=20.0) for _ in range(4)] + [row("a", status="timeout")]
    tables = build_tables({"main": table(rows)}, rng())
    assert tables["iou_64"].row("cropped").values == pytest.approx((40,))
    assert tables["cd_l1"].row("cropped").values == pytest.approx((20,))
    assert tables["cd_l1"].columns[0].models == 5
    assert "Models without a figure, counted as IoU 0: 1." in tables["iou_64"].notes
    assert "Models without a figure, left out: 1." in tables["cd_l1"].notes


def test_metrics_of_a_failed_model_are_not_believed(row, table):
    rows = [row("a", iou_64=0.5) for _ in range(5)]
    rows[0] = row("a", iou_64=0.9) | {"status": "error"}
    iou = build_tables({"main": table(rows)}, rng())["iou_64"]
    assert iou.row("cropped").values == pytest.approx((40,))


def test_floor_row_stands_beside_sampled_distances_only(row, table):
    tables = build_tables({"main": table([row("a", cd_l1_floor=7.5, cd_l2_floor=0.2)])}, rng())
    assert tables["cd_l1"].row("floor").values == (7.5,)
    assert tables["cd_l2"].row("floor").values == (0.2,)
    assert tables["cd_surface"].row("floor") is None


def test_average_leaves_out_small_categories_and_says_so(row, table):
    rows = [row("a", iou_64=0.5) for _ in range(MIN_MODELS)]
    rows += [row("b", iou_64=0.9) for _ in range(MIN_MODELS - 1)]
    names = {"b": "bus", "a": "chair"}
    iou = build_tables({"main": table(rows)}, rng(), names=names)["iou_64"]
    assert [c.label for c in iou.columns] == ["bus", "chair"]
    assert iou.row("cropped").values == pytest.approx((90, 50))
    assert iou.row("cropped").summary == pytest.approx(50)
    assert "left out: bus (4)" in iou.notes[0]


def test_no_average_without_a_large_category(row, table):
    iou = build_tables({"main": table([row("a", iou_64=0.5)])}, rng())["iou_64"]
    assert (iou.row("cropped").summary, iou.row("cropped").interval) == (None, None)
    assert iou.row("cropped").overall == pytest.approx(50)
    assert "No average" in iou.notes[0]


def test_category_that_lost_all_models_has_no_distance(row, table):
    rows = [row("a", status="memory") for _ in range(5)] + [row("b", cd_l1=10.0) for _ in range(5)]
    tables = build_tables({"main": table(rows)}, rng())
    assert tables["cd_l1"].row("cropped").values == (None, 10.0)
    assert tables["cd_l1"].row("cropped").summary == 10.0
    assert any("no part in the average: a." in note for note in tables["cd_l1"].notes)
    assert tables["iou_64"].row("cropped").summary == pytest.approx(25)


def test_only_models_of_the_split_are_covered(row, table):
    rows = [row("a", iou_64=0.5), row("a", iou_64=0.9, split="train"), row("b", split="train")]
    test = build_tables({"main": table(rows)}, rng(), split="test")["iou_64"]
    assert [c.category for c in test.columns] == ["a"]
    assert test.row("cropped").values == pytest.approx((50,))
    everything = build_tables({"main": table(rows)}, rng(), split="all")["iou_64"]
    assert everything.row("cropped").values == pytest.approx((70, 50))
    empty = build_tables({"main": table(rows)}, rng(), split="val")["iou_64"]
    assert (empty.columns, empty.row("cropped").overall) == ((), None)


def test_variants_have_their_own_rows(row, table):
    rows = {"main": table([row("a")]), "plain": table([row("a", iou_64=0.1), row("b")])}
    tables = build_tables(rows, rng())
    labels = [r.label for r in tables["iou_32"].rows]
    assert labels[0] == "main: positives and negatives"
    assert labels[-1] == "plain: difference"
    assert tables["iou_64"].row("cropped", "plain").values == pytest.approx((10, 50))
    # A category that a variant doesn't have is empty there, not zero.
    assert tables["iou_64"].row("cropped", "main").values == (50.0, None)
    assert tables["counts/plain"].rows[0].values == (1, 1)


def test_variants_stand_side_by_side_with_differences_paired_by_model(row, table):
    ids = [f"m{i}" for i in range(MIN_MODELS)]
    first = [row("a", name, iou_64=0.5 + i / 20, cd_l1=20.0 + i) for i, name in enumerate(ids)]
    # In another order, each model 0.2 worse, whatever the spread of the models themselves.
    other = [row("a", n, iou_64=0.3 + i / 20, cd_l1=25.0 + i) for i, n in enumerate(ids)][::-1]
    tables = build_tables({"main": table(first), "plain": table(other)}, rng())
    iou = tables["variants/iou_64"]
    assert [r.label for r in iou.rows] == ["main", "plain", "main minus plain"]
    assert [r.summary for r in iou.rows] == pytest.approx([60, 40, 20])
    assert iou.row("difference").interval == pytest.approx((20, 20))
    low, high = iou.rows[0].interval
    assert low < 59 < 61 < high
    assert [flags[-1] for flags in iou.best()] == [True, False, False]
    assert tables["variants/cd_l1"].row("difference").summary == pytest.approx(-5)
    assert [flags[-1] for flags in tables["variants/cd_l1"].best()] == [True, False, False]


def test_a_model_that_a_variant_lost_is_iou_zero_there_and_not_paired_in_distances(row, table):
    ids = [f"m{i}" for i in range(MIN_MODELS)]
    first = [row("a", name, iou_64=0.5, cd_l1=20.0) for name in ids]
    other = [row("a", name, iou_64=0.4, cd_l1=10.0 * i) for i, name in enumerate(ids)]
    other[4] = row("a", ids[4], status="crash")
    tables = build_tables({"main": table(first), "plain": table(other)}, rng())
    assert tables["variants/iou_64"].row("cropped", "plain").summary == pytest.approx(32)
    assert tables["variants/iou_64"].row("difference").summary == pytest.approx(18)
    assert tables["variants/cd_l1"].row("cropped", "plain").summary == pytest.approx(15)
    assert tables["variants/cd_l1"].row("difference").summary == pytest.approx(5)


def test_one_variant_has_nothing_to_stand_beside(row, table):
    tables = build_tables({"main": table([row("a")])}, rng())
    assert not [t.name for t in tables.tables if t.name.startswith("variants")]


def test_counts(row, table):
    rows = [
        row("a", faces=100, negatives_kept=2, check_ok=True, jitter_attempt=2),
        row("a", faces=300, negatives_kept=3, check_ok=False),
        row("a", status="crash"),
        row("b", faces=800, negatives_kept=0),
    ]
    counts = build_tables({"main": table(rows)}, rng())["counts"]
    cells = {r.label: (r.values, r.summary) for r in counts.rows}
    assert cells["models"] == ((3, 1), 4)
    assert cells["with a result"] == ((2, 1), 3)
    assert cells["failed: crash"] == ((1, 0), 1)
    assert cells["failed: memory"] == ((0, 0), 0)
    assert cells["faces"] == ((200, 800), 400)
    assert cells["negatives kept"][0] == (2.5, 0)
    assert cells["negatives kept"][1] == pytest.approx(5 / 3)
    assert cells["failed checks"] == ((1, 0), 1)
    assert cells["cropped again, jittered"] == ((1, 0), 1)


def test_best_is_the_better_method_in_the_measure_s_direction(row, table):
    rows = [row("a", iou_64=0.5, iou_64_positives=0.6, cd_l1=9.0, cd_l1_positives=8.0)]
    rows.append(row("b", iou_64=0.5, iou_64_positives=0.5))
    tables = build_tables({"main": table(rows)}, rng())
    assert tables["iou_64"].best() == (
        (False, False, False),
        (True, False, False),
        (False, False, False),
        (False, False, False),
    )
    assert [flags[0] for flags in tables["cd_l1"].best()] == [False, True, False, False]
    assert not any(flag for line in tables["counts"].best() for flag in line)


def test_missing_columns_are_named(row, table):
    with pytest.raises(ValueError, match="cd_l1, faces"):
        build_tables({"main": table([row("a")]).drop_columns(["cd_l1", "faces"])}, rng())
    with pytest.raises(ValueError, match="at least one variant"):
        build_tables({}, rng())


def test_a_column_of_nulls_without_a_type_is_read(table):
    names = ("category", "model_id", "split", "status")
    rows = [dict.fromkeys(COLUMNS) | dict(zip(names, ("a", "m", "test", "error"), strict=True))]
    iou = build_tables({"main": pa.Table.from_pylist(rows)}, rng())["iou_64"]
    assert iou.row("cropped").values == (0.0,)


def test_intervals_depend_on_the_seed_alone(row, table):
    spread = rng(5).uniform(0.2, 0.8, 40)
    rows = {"main": table([row("ab"[i % 2], iou_64=v) for i, v in enumerate(spread)])}
    first, again, other = (build_tables(rows, rng(seed)) for seed in (1, 1, 2))
    assert first.to_json() == again.to_json()
    assert first["iou_64"].row("cropped").interval != other["iou_64"].row("cropped").interval
    assert first["iou_64"].row("cropped").summary == other["iou_64"].row("cropped").summary


def test_interval_of_an_average_follows_the_law_of_its_standard_error(row, table):
    values = {name: rng(i).normal(0.5, 0.1, 100) for i, name in enumerate("abcd")}
    rows = [row(name, iou_64=v) for name, models in values.items() for v in models]
    low, high = build_tables({"main": table(rows)}, rng())["iou_64"].row("cropped").interval
    error = 100 * np.sqrt(sum(v.var() / len(v) for v in values.values())) / len(values)
    assert high - low == pytest.approx(2 * 1.96 * error, rel=0.08)
    mean = 100 * np.mean([v.mean() for v in values.values()])
    assert (low + high) / 2 == pytest.approx(mean, abs=0.2 * error)


def test_difference_is_paired(row, table):
    # Methods that differ by a constant: each spreads, their difference doesn't.
    rows = [row("a", iou_64=v, iou_64_positives=v - 0.05) for v in np.linspace(0.1, 0.9, 20)]
    iou = build_tables({"main": table(rows)}, rng())["iou_64"]
    assert iou.row("difference").interval == (5.0, 5.0)
    low, high = iou.row("cropped").interval
    assert high - low > 10


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=30), st.integers(0, 2**31))
def test_resampled_means_stay_among_the_values(values, seed):
    column = np.array(values)[:, None]
    means = bootstrap_means(np.hstack([column, 2 * column]), 50, rng(seed))
    assert means.shape == (50, 2)
    slack = 1e-9 * (1 + np.abs(column).max())
    assert (means[:, 0] >= column.min() - slack).all()
    assert (means[:, 0] <= column.max() + slack).all()
    np.testing.assert_allclose(means[:, 1], 2 * means[:, 0], atol=slack)


def test_resampling_in_pieces_draws_the_same_models():
    values = rng(3).normal(size=(2_500, 4))
    whole = values[rng(4).integers(2_500, size=(1_000, 2_500))].mean(axis=1)
    np.testing.assert_allclose(bootstrap_means(values, 1_000, rng(4)), whole, atol=1e-12)


def test_json_is_strict_sorted_by_design_and_repeatable(row, table):
    rows = [row("a", iou_64=1 / 3), row("b", status="invalid")]
    tables = build_tables({"main": table(rows)}, rng(), names={"a": "bad\u202ename"})
    text = tables.to_json()
    assert text.isascii()
    assert text.endswith("}\n")
    document = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} in tables.json"))
    assert (document["format"], document["version"]) == ("pnabs/tables", 1)
    iou = next(t for t in document["tables"] if t["name"] == "iou_64")
    assert iou["columns"][0] == {"category": "a", "label": "bad\u202ename", "models": 1}
    assert iou["rows"][0]["values"] == [33.333333, 0.0]


def test_unknown_table_is_refused_with_the_names_there_are(row, table):
    with pytest.raises(KeyError, match="iou_64"):
        build_tables({"main": table([row("a")])}, rng())["iou_128"]
