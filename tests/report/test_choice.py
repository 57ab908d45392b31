"""Which models are pictured: best to worst, by kind, the worst always among them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnabs.report import pictured


def closed(name, value):
    return {"model_id": name, "not_exact": "", "volume_iou": value, "iou_128": 1.0}


def other(name, value, reason="open"):
    return {"model_id": name, "not_exact": reason, "volume_iou": None, "iou_128": value}


def names(rows, count):
    return [rows[i]["model_id"] for i in pictured(rows, count)]


def test_closed_models_go_by_exact_volume_and_others_by_the_grid():
    rows = [closed("c-mid", 0.5), other("o-low", 0.1), closed("c-top", 0.9), other("o-top", 0.95)]
    rows.append(closed("c-low", 0.2))
    assert names(rows, 9) == ["c-top", "c-mid", "c-low", "o-top", "o-low"]


def test_the_spread_is_even_and_has_both_ends():
    rows = [closed(f"{i:02d}", i / 100) for i in range(21)]
    assert names(rows, 5) == ["20", "15", "10", "05", "00"]


def test_one_picture_shows_the_worst_of_the_larger_kind():
    rows = [other("o1", 0.9), other("o2", 0.4), closed("c", 0.1)]
    assert names(rows, 1) == ["o2"]
    assert names(rows, 0) == []


def test_the_smaller_kind_has_its_worst_shown_too():
    rows = [closed(f"{i}", i / 10) for i in range(1, 9)] + [other("o1", 0.8), other("o2", 0.7)]
    assert names(rows, 3) == ["8", "1", "o2"]


def test_what_has_no_figure_is_the_worst():
    rows = [closed("a", 0.5), closed("none", None), closed("nan", float("nan")), closed("b", 0.6)]
    assert names(rows, 4) == ["b", "a", "nan", "none"]


def test_equal_models_go_by_their_ids():
    rows = [closed(name, 0.5) for name in "cab"]
    assert names(rows, 3) == ["a", "b", "c"]


@given(
    st.lists(st.tuples(st.booleans(), st.floats(0, 1)), max_size=30),
    st.integers(0, 12),
)
def test_as_many_as_wanted_without_repeats_and_with_each_kinds_worst(models, count):
    rows = [
        closed(str(i), value) if is_closed else other(str(i), value)
        for i, (is_closed, value) in enumerate(models)
    ]
    chosen = pictured(rows, count)
    assert len(set(chosen)) == len(chosen) == min(count, len(rows))
    if count >= 2:
        for is_closed, column in ((True, "volume_iou"), (False, "iou_128")):
            kind = [i for i, row in enumerate(rows) if (row["not_exact"] == "") is is_closed]
            if kind:
                worst = min(rows[i][column] for i in kind)
                assert worst in [rows[i][column] for i in chosen if i in kind]


@pytest.mark.parametrize("reason", ["open", "refused", "large", "empty", None])
def test_every_reason_counts_as_not_closed(reason):
    rows = [closed("c", 0.1), other("o", 0.9, reason)]
    assert names(rows, 2) == ["c", "o"]
