"""Figures of the tables against hand computation."""

from __future__ import annotations

import json

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnabs.report import build_tables
from pnabs.report.averages import bootstrap_means
from pnabs.report.measures import COLUMNS
from pnabs.report.tables import MIN_MODELS


def rng(seed=0):
    return np.random.default_rng(seed)


def test_means_by_category_their_average_and_the_mean_over_all(row, table):
    rows = [row("a", iou_64=v, iou_64_positives=v - 0.1) for v in (0.2, 0.3, 0.4, 0.5, 0.6)]
    rows += [row("b", iou_64=0.8, iou_64_positives=0.9) for _ in range(15)]
    iou = build_tables({"main": table(rows)}, rng())["iou_64"]
    assert [(c.category, c.models) for c in iou.columns] == [("a", 5), ("b", 15)]
    assert iou.row("cropped").values == pytest.approx((40, 80))
    assert iou.row("cropped").models == (5, 15)
    assert iou.row("positives").values == pytest.approx((30, 90))
    # Categories weigh the same, however many models they have; over all models they don't.
    assert iou.row("cropped").summary == pytest.approx(60)
    assert iou.row("cropped").overall == pytest.approx((5 * 40 + 15 * 80) / 20)
    assert iou.row("mesh").values == pytest.approx((45, 45))


def test_a_runs_own_positives_are_no_method_to_compare_with(row, table):
    rows = [row("a", iou_64_networks=0.3) for _ in range(6)]
    iou = build_tables({"main": table(rows)}, rng())["iou_64"]
    assert [r.label for r in iou.rows] == [
        "result",
        "its positives, not cropped",
        "as the written mesh",
        "as the networks predict",
    ]
    assert iou.row("difference") is None
    assert any("more than what negatives gain" in note for note in iou.notes)
    assert not any(flag for line in iou.best() for flag in line)


def test_rows_that_repeat_the_result_are_left_out(row, table):
    # Without negatives the positives are the result, and without a fit the prediction is.
    rows = [row("a", iou_32=v, iou_32_positives=v, iou_32_networks=v) for v in (0.4, 0.6)]
    iou = build_tables({"main": table(rows)}, rng())["iou_32"]
    assert [r.role for r in iou.rows] == ["cropped"]
    assert not any("negatives gain" in note for note in iou.notes)


def test_means_are_of_what_succeeded_and_failures_are_told_apart(row, table):
    rows = [row("a", volume_iou=0.5, cd_l1=20.0) for _ in range(4)]
    rows += [row("a", status="timeout"), row("a", status="crash"), row("a", status="timeout")]
    tables = build_tables({"main": table(rows)}, rng())
    for name, value in (("volume_iou", 50), ("cd_l1", 20)):
        assert tables[name].row("cropped").values == pytest.approx((value,))
        assert tables[name].row("cropped").models == (4,)
        assert tables[name].columns[0].models == 7
        told = "Not in the means, of 7 models: 3 failed (1 crash, 2 timeout)."
        assert told in tables[name].notes
    sound = build_tables({"main": table([row("a")])}, rng())["cd_l1"]
    assert "No model failed." in sound.notes


def test_a_result_without_a_figure_is_told_apart_from_a_failure(row, table):
    rows = [row("a", volume_iou=0.5, cd_l1=20.0) for _ in range(3)]
    rows += [row("a", volume_iou=None, cd_l1=None), row("a", status="memory")]
    tables = build_tables({"main": table(rows)}, rng())
    start = "Not in the means, of 5 models: 1 failed (1 memory), 1 with a result"
    assert f"{start} not closed." in tables["volume_iou"].notes
    assert f"{start} without this figure." in tables["cd_l1"].notes


def test_metrics_of_a_failed_model_are_not_believed(row, table):
    rows = [row("a", iou_64=0.5) for _ in range(5)]
    rows[0] = row("a", iou_64=0.9) | {"status": "error"}
    iou = build_tables({"main": table(rows)}, rng())["iou_64"]
    assert iou.row("cropped").values == pytest.approx((50,))


def mixed(row):
    """Closed and other models of two categories, and one that can't be read."""
    rows = [row("a", f"c{i}", volume_iou=0.5, iou_128=0.9) for i in range(5)]
    rows += [row("a", f"o{i}", not_exact="open", iou_128=0.3, coverage=0.6) for i in range(2)]
    rows += [row("b", "l", not_exact="large", iou_128=0.4), row("b", "r", not_exact="refused")]
    rows.append(row("b", "x", status="invalid", not_exact=None))
    return rows


def test_exact_and_grid_figures_cover_their_own_models_and_are_never_mixed(row, table):
    tables = build_tables({"main": table(mixed(row))}, rng())
    exact, grid, every = (tables[n] for n in ("volume_iou", "iou_128_not_closed", "iou_128"))
    assert [(c.category, c.models) for c in exact.columns] == [("a", 5)]
    assert exact.row("cropped").values == pytest.approx((50,))
    assert exact.row("cropped").overall == pytest.approx(50)
    assert [(c.category, c.models) for c in grid.columns] == [("a", 2), ("b", 2)]
    assert grid.row("cropped").values == pytest.approx((30, (40 + 65) / 2))
    assert [(c.category, c.models) for c in every.columns] == [("a", 7), ("b", 3)]
    assert every.row("cropped").values == pytest.approx(((5 * 90 + 2 * 30) / 7, (40 + 65) / 2))
    closed = "Closed: 5 of 10 models; not closed: 2 open, 1 refused, 1 large, "
    for table_ in (exact, grid):
        assert any(note.startswith(closed) for note in table_.notes)
    assert "closed models" in exact.title
    assert "not closed" in grid.title
    assert "all models" in every.title


def test_exact_figures_of_a_model_that_is_not_closed_are_not_believed(row, table):
    rows = [row("a", volume_iou=0.5), row("a", not_exact="open") | {"volume_iou": 0.9}]
    exact = build_tables({"main": table(rows)}, rng())["volume_iou"]
    assert exact.row("cropped").values == pytest.approx((50,))
    assert exact.columns[0].models == 1


def test_a_category_is_averaged_by_the_models_of_the_subset(row, table):
    # Six models of b are enough for a grid, its two closed ones aren't for exact volumes.
    rows = [row("a", volume_iou=0.5) for _ in range(MIN_MODELS)]
    rows += [row("b", volume_iou=0.9) for _ in range(2)]
    rows += [row("b", not_exact="open") for _ in range(4)]
    tables = build_tables({"main": table(rows)}, rng())
    assert tables["volume_iou"].row("cropped").summary == pytest.approx(50)
    assert any("left out: b (2)" in note for note in tables["volume_iou"].notes)
    assert any("Average over 2 categories" in note for note in tables["iou_128"].notes)


def test_the_headline_comes_first_and_the_papers_figures_last(row, table):
    tables = build_tables({"main": table(mixed(row))}, rng())
    assert [t.name for t in tables.tables] == [
        *("volume_iou", "covered", "excess", "iou_128_not_closed", "coverage_not_closed"),
        *("iou_128", "coverage", "out_99", "out_max", "miss_99", "miss_max", "open_space"),
        *("iou_32", "iou_64", "cd_l1", "cd_l2", "cd_surface", "counts"),
    ]


def test_lengths_are_in_per_cent_of_the_longest_side(row, table):
    tables = build_tables({"main": table([row("a", out_99=0.031)])}, rng())
    assert tables["out_99"].row("cropped").values == pytest.approx((3.1,))
    assert (tables["out_99"].unit, tables["out_99"].better) == ("% of the longest side", "lower")


def test_floor_row_stands_beside_sampled_distances_only(row, table):
    tables = build_tables({"main": table([row("a", cd_l1_floor=7.5, cd_l2_floor=0.2)])}, rng())
    assert tables["cd_l1"].row("floor").values == (7.5,)
    assert tables["cd_l2"].row("floor").values == (0.2,)
    assert tables["cd_surface"].row("floor") is None


def test_average_leaves_out_small_categories_and_says_so(row, table):
    rows = [row("a", iou_64=0.5) for _ in range(MIN_MODELS)]
    rows += [row("b", iou_64=0.9) for _ in range(MIN_MODELS - 1)]
    rows.append(row("b", status="crash"))
    names = {"b": "bus", "a": "chair"}
    iou = build_tables({"main": table(rows)}, rng(), names=names)["iou_64"]
    assert [c.label for c in iou.columns] == ["bus", "chair"]
    assert iou.row("cropped").values == pytest.approx((90, 50))
    # A failed model isn't covered, so b is too small although it has five.
    assert iou.row("cropped").summary == pytest.approx(50)
    assert "left out: bus (4)" in iou.notes[0]


def test_no_average_without_a_large_category(row, table):
    iou = build_tables({"main": table([row("a", iou_64=0.5)])}, rng())["iou_64"]
    assert (iou.row("cropped").summary, iou.row("cropped").interval) == (None, None)
    assert iou.row("cropped").overall == pytest.approx(50)
    assert "No average" in iou.notes[0]
    assert [total.label for total in iou.totals] == ["all models"]


def test_category_that_lost_all_models_has_no_figure(row, table):
    rows = [row("a", status="memory") for _ in range(5)] + [row("b", cd_l1=10.0) for _ in range(5)]
    distance = build_tables({"main": table(rows)}, rng())["cd_l1"]
    assert distance.row("cropped").values == (None, 10.0)
    assert distance.row("cropped").models == (0, 5)
    assert distance.row("cropped").summary == 10.0
    assert any("left out: a (0)" in note for note in distance.notes)


def test_only_models_of_the_split_are_covered(row, table):
    rows = [row("a", iou_64=0.5), row("a", iou_64=0.9, split="train"), row("b", split="train")]
    test = build_tables({"main": table(rows)}, rng(), split="test")["iou_64"]
    assert [c.category for c in test.columns] == ["a"]
    assert test.row("cropped").values == pytest.approx((50,))
    everything = build_tables({"main": table(rows)}, rng(), split="all")["iou_64"]
    assert everything.row("cropped").values == pytest.approx((70, 50))
    empty = build_tables({"main": table(rows)}, rng(), split="val")
    assert [t.name for t in empty.tables] == ["counts"]


def test_variants_have_their_own_rows(row, table):
    rows = {
        "main": table([row("a", "m")]),
        "plain": table([row("a", "m", iou_64=0.1), row("b", "n")]),
    }
    tables = build_tables(rows, rng())
    assert [r.label for r in tables["iou_32"].rows] == [
        "main",
        "main: its positives, not cropped",
        "plain",
        "plain: its positives, not cropped",
    ]
    assert tables["iou_64"].row("cropped", "plain").values == pytest.approx((10, 50))
    # A category that a variant doesn't have is empty there, not zero.
    assert tables["iou_64"].row("cropped", "main").values == (50.0, None)
    assert tables["counts/plain"].rows[0].values == (1, 1)


def test_an_average_over_fewer_categories_than_others_is_told(row, table):
    every = [row(c, f"{c}{i}") for c in "ab" for i in range(MIN_MODELS)]
    some = [*every[:-1], row("b", every[-1]["model_id"], status="crash")]
    iou = build_tables({"main": table(every), "plain": table(some)}, rng())["iou_64"]
    assert "Average over 2 categories with at least 5 models." in iou.notes
    assert "plain: average over a." in iou.notes
    assert "plain: not in the means, of 10 models: 1 failed (1 crash)." in iou.notes


def test_variants_stand_side_by_side_with_differences_paired_by_model(row, table):
    ids = [f"m{i}" for i in range(MIN_MODELS)]
    first = [row("a", name, volume_iou=0.5 + i / 20, cd_l1=20.0 + i) for i, name in enumerate(ids)]
    # In another order, each model 0.2 worse, whatever the spread of the models themselves.
    other = [row("a", n, volume_iou=0.3 + i / 20, cd_l1=25.0 + i) for i, n in enumerate(ids)][::-1]
    tables = build_tables({"main": table(first), "plain": table(other)}, rng())
    iou = tables["variants/volume_iou"]
    assert [r.label for r in iou.rows] == ["main", "plain", "main minus plain"]
    assert [r.summary for r in iou.rows] == pytest.approx([60, 40, 20])
    assert iou.row("difference").interval == pytest.approx((20, 20))
    assert iou.row("difference").overall_interval == pytest.approx((20, 20))
    low, high = iou.rows[0].interval
    assert low < 59 < 61 < high
    assert [flags[-1] for flags in iou.best()] == [True, False, False]
    assert tables["variants/cd_l1"].row("difference").summary == pytest.approx(-5)
    assert [flags[-1] for flags in tables["variants/cd_l1"].best()] == [True, False, False]


def test_side_by_side_a_failure_is_zero_where_that_is_known_to_be_right(row, table):
    ids = [f"m{i}" for i in range(MIN_MODELS)]
    first = [row("a", name, volume_iou=0.5, coverage=0.8, iou_128=0.5) for name in ids]
    other = [row("a", name, volume_iou=0.4, coverage=0.6, iou_128=0.4) for name in ids]
    other[4] = row("a", ids[4], status="missing")
    # A shape that nobody can read is closed for nobody; one that isn't closed has no exact volume.
    for rows in (first, other):
        rows.append(row("a", "x", status="invalid", not_exact=None))
        rows.append(row("a", "o", not_exact="open", iou_128=0.0))
    tables = build_tables({"main": table(first), "plain": table(other)}, rng())
    for name, ours, theirs, models in (
        ("volume_iou", 50, 32, 5),
        ("coverage", (5 * 80 + 85) / 7, (4 * 60 + 85) / 7, 7),
        ("iou_128", 5 * 50 / 7, 4 * 40 / 7, 7),
    ):
        found = tables[f"variants/{name}"]
        assert found.row("cropped", "main").summary == pytest.approx(ours)
        assert found.row("cropped", "plain").summary == pytest.approx(theirs)
        assert found.row("difference").summary == pytest.approx(ours - theirs)
        assert {r.models for r in found.rows} == {(models,)}
    assert "Counted as 0: plain: 1 failed (1 missing)." in tables["variants/volume_iou"].notes
    # By itself a method's mean is of what succeeded.
    assert tables["volume_iou"].row("cropped", "plain").summary is None
    assert tables["volume_iou"].row("cropped", "plain").overall == pytest.approx(40)


def test_a_variant_without_a_verdict_on_a_shape_takes_that_of_another(row, table):
    ids = [f"m{i}" for i in range(MIN_MODELS)]
    known = [row("a", name, volume_iou=0.6) for name in ids]
    # Its results are all missing, and it says nothing of the shapes.
    blind = [row("a", name, status="missing", not_exact=None) for name in ids]
    found = build_tables({"main": table(known), "other": table(blind)}, rng())
    assert found["variants/volume_iou"].row("difference").summary == pytest.approx(60)
    assert found["volume_iou"].columns[0].models == MIN_MODELS


def test_side_by_side_distances_cover_the_models_that_all_have(row, table):
    ids = [f"m{i}" for i in range(MIN_MODELS + 2)]
    first = [row("a", name, cd_l1=20.0 + i, out_99=0.01) for i, name in enumerate(ids)]
    other = [row("a", name, cd_l1=10.0 + i, out_99=0.02) for i, name in enumerate(ids)]
    third = [row("a", name, cd_l1=0.0 + i, out_99=0.02) for i, name in enumerate(ids)]
    other[6] = row("a", ids[6], status="crash")
    third[0] = row("a", ids[0], cd_l1=None, out_99=None)
    rows = {"main": table(first), "plain": table(other), "third": table(third)}
    found = build_tables(rows, rng())["variants/cd_l1"]
    # Five models have all three figures: 1 to 5.
    assert [r.models for r in found.rows[:3]] == [(5,)] * 3
    assert [r.summary for r in found.rows[:3]] == pytest.approx([23, 13, 3])
    assert [r.models for r in found.rows[3:]] == [(6,), (6,)]
    assert [r.summary for r in found.rows[3:]] == pytest.approx([10, 20])
    assert any("main minus plain 6, main minus third 6" in note for note in found.notes)


def test_results_that_lack_a_figure_altogether_stand_beside_nobody(row, table):
    ids = [f"m{i}" for i in range(MIN_MODELS)]
    boxes = table([row("a", name, iou_32=0.5) for name in ids])
    meshes = table([row("a", name) for name in ids]).drop_columns(["iou_32", "iou_32_positives"])
    tables = build_tables({"boxes": boxes, "meshes": meshes}, rng())
    assert tables.get("variants/iou_32") is None
    assert [r.variant for r in tables["iou_32"].rows if r.role == "cropped"] == ["boxes"]
    assert tables["variants/iou_64"].row("difference").summary == 0


def test_one_variant_has_nothing_to_stand_beside(row, table):
    tables = build_tables({"main": table([row("a")])}, rng())
    assert not [t.name for t in tables.tables if t.name.startswith("variants")]


def test_counts(row, table):
    rows = [
        row("a", faces=100, negatives_kept=2, check_ok=True, jitter_attempt=2, fitted_again=1),
        row("a", faces=300, negatives_kept=3, check_ok=False, beyond=0.006, not_exact="open"),
        row("a", "x", status="crash", not_exact=None),
        row("b", faces=800, negatives_kept=0, beyond=0.005, shape_pieces=5, bodies=9),
    ]
    counts = build_tables({"main": table(rows)}, rng())["counts"]
    cells = {r.label: (r.values, r.summary) for r in counts.rows}
    assert cells["models"] == ((3, 1), 4)
    assert cells["with a result"] == ((2, 1), 3)
    assert cells["failed: crash"] == ((1, 0), 1)
    assert cells["failed: memory"] == ((0, 0), 0)
    assert "failed: missing" not in cells
    assert cells["closed, with an exact volume"] == ((1, 1), 2)
    assert cells["not closed: open"] == ((1, 0), 1)
    assert cells["not closed: refused"] == ((0, 0), 0)
    assert cells["failed checks"] == ((1, 0), 1)
    assert cells["left the bounding box"] == ((1, 0), 1)
    assert cells["fitted again"] == ((1, 0), 1)
    assert cells["cropped again, jittered"] == ((1, 0), 1)
    assert cells["faces"] == ((200, 800), 400)
    assert cells["negatives kept"][0] == (2.5, 0)
    assert cells["negatives kept"][1] == pytest.approx(5 / 3)
    labels = [r.label for r in counts.rows]
    pieces = labels.index("connected pieces of the shape")
    assert labels[pieces + 1 : pieces + 3] == [
        "connected pieces of the result",
        "bodies of the written mesh",
    ]
    assert cells["connected pieces of the shape"][0] == (2, 5)
    assert cells["bodies of the written mesh"][0] == (4, 9)


def test_missing_results_are_counted_where_there_are_any(row, table):
    counts = build_tables({"main": table([row("a", status="missing"), row("a")])}, rng())["counts"]
    assert {r.label: r.summary for r in counts.rows}["failed: missing"] == 1


def test_best_is_the_better_method_in_the_measures_direction(row, table):
    first = [row("a", "m", iou_64=0.5, cd_l1=9.0), row("b", "n", iou_64=0.5)]
    other = [row("a", "m", iou_64=0.6, cd_l1=8.0), row("b", "n", iou_64=0.5)]
    tables = build_tables({"main": table(first), "plain": table(other)}, rng())
    # Two categories and the mean over all; equal figures are no one's best, nor are differences.
    assert tables["variants/iou_64"].best() == (
        (False, False, False),
        (True, False, True),
        (False, False, False),
    )
    assert [flags[0] for flags in tables["variants/cd_l1"].best()] == [False, True, False]
    # Means of what succeeded may cover other models each, so none of them is best.
    assert not any(flag for line in tables["iou_64"].best() for flag in line)
    assert not any(flag for line in tables["counts/main"].best() for flag in line)


def test_required_columns_that_are_missing_are_named(row, table):
    for names in (["split", "status"], ["model_id"]):
        with pytest.raises(ValueError, match=", ".join(names)):
            build_tables({"main": table([row("a")]).drop_columns(names)}, rng())
    with pytest.raises(ValueError, match="at least one variant"):
        build_tables({}, rng())


def test_optional_columns_may_be_missing_and_their_rows_and_tables_are_left_out(row, table):
    whole = table([row("a", f"m{i}") for i in range(6)])
    kept = ["category", "model_id", "split", "status", "not_exact", "volume_iou", "cd_l1", "faces"]
    tables = build_tables({"main": whole.select(kept)}, rng())
    assert [t.name for t in tables.tables] == ["volume_iou", "cd_l1", "counts"]
    assert [r.role for r in tables["cd_l1"].rows] == ["cropped"]
    labels = [r.label for r in tables["counts"].rows]
    assert "faces" in labels
    assert not {"failed checks", "left the bounding box", "positives"} & set(labels)
    assert tables["cd_l1"].row("cropped").summary == 20


def test_without_a_verdict_on_the_shapes_only_all_models_are_covered(row, table):
    tables = build_tables({"main": table([row("a")]).drop_columns(["not_exact"])}, rng())
    assert {t.name for t in tables.tables} >= {"iou_128", "coverage", "counts"}
    assert tables.get("volume_iou") is tables.get("iou_128_not_closed") is None
    assert not any("closed" in r.label for r in tables["counts"].rows)


def test_a_column_of_nulls_without_a_type_is_read(table):
    names = ("category", "model_id", "split", "status")
    rows = [dict.fromkeys(COLUMNS) | dict(zip(names, ("a", "m", "test", "error"), strict=True))]
    tables = build_tables({"main": pa.Table.from_pylist(rows)}, rng())
    assert [t.name for t in tables.tables] == ["counts"]
    assert {r.label: r.summary for r in tables["counts"].rows}["failed: error"] == 1


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


def test_interval_of_the_mean_over_all_models_is_that_of_their_spread(row, table):
    values = rng(1).normal(0.5, 0.1, 300)
    # In categories of one model each there is no average, but a mean with an interval.
    rows = [row(f"c{i}", iou_64=v) for i, v in enumerate(values)]
    result = build_tables({"main": table(rows)}, rng())["iou_64"].row("cropped")
    assert result.interval is None
    low, high = result.overall_interval
    assert high - low == pytest.approx(2 * 1.96 * 100 * values.std() / np.sqrt(300), rel=0.08)
    assert (low + high) / 2 == pytest.approx(100 * values.mean(), abs=0.2)


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


def test_models_without_a_figure_take_no_part_in_resampled_means():
    values = rng(3).normal(size=(12, 3))
    values[:4, 1] = np.nan
    values[1:, 2] = np.nan
    drawn = rng(4).integers(12, size=(500, 12))
    means = bootstrap_means(values, 500, rng(4))
    np.testing.assert_allclose(means[:, 0], values[drawn, 0].mean(axis=1), atol=1e-12)
    np.testing.assert_allclose(means[:, 1], np.nanmean(values[drawn, 1], axis=1), atol=1e-12)
    # Of the last quantity only the first model has a figure; it isn't always drawn.
    known = (drawn == 0).any(axis=1)
    np.testing.assert_allclose(means[known, 2], values[0, 2], atol=1e-12)
    assert np.isnan(means[~known, 2]).all()
    assert 0 < known.sum() < 500


def test_json_is_strict_sorted_by_design_and_repeatable(row, table):
    rows = [row("a", iou_64=1 / 3), row("b", status="invalid")]
    tables = build_tables({"main": table(rows)}, rng(), names={"a": "bad\u202ename"})
    text = tables.to_json()
    assert text.isascii()
    assert text.endswith("}\n")
    document = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} in tables.json"))
    assert (document["format"], document["version"]) == ("pnabs/tables", 2)
    iou = next(t for t in document["tables"] if t["name"] == "iou_64")
    assert iou["columns"][0] == {"category": "a", "label": "bad\u202ename", "models": 1}
    assert iou["rows"][0]["values"] == [33.333333, None]
    assert iou["rows"][0]["models"] == [1, 0]


def test_unknown_table_is_refused_with_the_names_there_are(row, table):
    with pytest.raises(KeyError, match="iou_64"):
        build_tables({"main": table([row("a")])}, rng())["iou_256"]
