"""Charts: ticks, positions and bounded size."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnabs.report.charts import (
    Strip,
    _spread,
    linear_ticks,
    log_ticks,
    loss_chart,
    strip_chart,
    validation_chart,
)


def parse(markup):
    return ElementTree.fromstring(str(markup))


def texts(markup):
    return ["".join(node.itertext()) for node in parse(markup).iter("text")]


@given(st.floats(1e-9, 1e6), st.floats(1.5, 1e8))
def test_log_ticks_are_round_and_within(low, ratio):
    ticks = log_ticks(low, low * ratio)
    assert all(low <= tick <= low * ratio for tick in ticks)
    assert ticks == sorted(set(ticks))
    assert all(f"{tick:.6e}"[:8] in ("1.000000", "2.000000", "5.000000") for tick in ticks)
    if ratio > 10:
        assert ticks


@given(st.floats(-1e4, 1e4), st.floats(1e-3, 1e4), st.integers(2, 10))
def test_linear_ticks_are_evenly_spaced_and_few(low, span, most):
    ticks = linear_ticks(low, low + span, most)
    assert len(ticks) <= most + 1
    assert all(low - 1e-6 * span - 1e-8 <= t <= low + span * (1 + 1e-6) + 1e-8 for t in ticks)
    if len(ticks) > 2:
        np.testing.assert_allclose(np.diff(ticks), ticks[1] - ticks[0], rtol=1e-4)


@given(st.lists(st.floats(0, 200), max_size=12))
def test_labels_keep_apart_and_inside(wanted):
    placed = _spread(wanted, 13.0, 0.0, 200.0)
    assert len(placed) == len(wanted)
    ordered = np.sort(placed)
    assert (np.diff(ordered) >= 13.0 - 1e-9).all()
    assert not placed or (ordered[0] >= -1e-9 and ordered[-1] <= 200 + 1e-9)


def test_labels_with_room_stay_where_they_are_wanted():
    assert _spread([50.0, 10.0, 90.0], 13.0, 0.0, 100.0) == [50.0, 10.0, 90.0]


def test_loss_falls_by_equal_steps_on_the_logarithmic_axis():
    records = [{"epoch": i, "total": 10.0**-i} for i in range(1, 4)]
    path = parse(loss_chart("phase", records)).find("path")
    assert "s-total" in path.get("class")
    points = np.array([[float(v) for v in p.split()] for p in path.get("d")[1:].split("L")])
    np.testing.assert_allclose(np.diff(points[:, 1]), np.diff(points[:, 1])[0], atol=0.11)
    assert (np.diff(points, axis=0) > 0).all()  # to the right and down


def test_losses_that_are_never_positive_are_named_instead():
    chart = loss_chart("phase", [{"epoch": 1, "total": 1.0, "L_R": 0.0, "bad": float("nan")}])
    assert len(parse(chart).findall("path")) == 1
    assert "zero: L_R, bad" in texts(chart)
    assert "no losses above zero" in texts(loss_chart("phase", []))


def test_a_term_has_one_colour_in_all_phases():
    terms = ["fit1", "fit2", "symmetry"]
    first = parse(loss_chart("a", [{"epoch": 1, "fit2": 1.0, "symmetry": 2.0}], terms))
    assert [p.get("class") for p in first.findall("path")] == ["line s2", "line s3"]


def test_strip_marks_models_and_their_mean():
    chart = strip_chart("Closed", "IoU", [Strip("chair", np.array([0.0, 20.0, 100.0]))])
    root = parse(chart)
    (path,) = root.findall("path")
    assert {"chair", "Closed", "IoU"} <= set(texts(chart))
    zero, some, hundred = (float(m) for m in re.findall(r"M([\d.]+) ", path.get("d")))
    assert (some - zero) / (hundred - zero) == pytest.approx(0.2, abs=0.01)
    (mean,) = root.findall("circle")
    assert float(mean.get("cx")) == pytest.approx(zero + 0.4 * (hundred - zero), abs=0.5)


def test_every_category_has_a_strip_of_its_own():
    strips = [Strip(name, np.array([value])) for name, value in (("a", 10.0), ("b", 90.0))]
    root = parse(strip_chart("title", "axis", strips))
    heights = [float(c.get("cy")) for c in root.findall("circle")]
    places = [float(c.get("cx")) for c in root.findall("circle")]
    assert heights[0] < heights[1]
    assert places[0] < places[1]
    labels = {t.text: float(t.get("y")) for t in root.iter("text") if t.text in ("a", "b")}
    assert [labels["a"], labels["b"]] == pytest.approx(heights, abs=4)


def test_size_is_bounded_for_any_number_of_models():
    many = np.random.default_rng(0).uniform(0, 100, 200_000)
    assert len(strip_chart("title", "IoU", [Strip("a", many)])) < 25_000


def test_strips_of_nothing():
    assert parse(strip_chart("title", "IoU", [])).findall("path") == []
    empty = strip_chart("title", "IoU", [Strip("a", np.zeros(0))])
    assert "a" in texts(empty)
    assert parse(empty).findall("circle") == []


def test_names_cannot_leave_their_text():
    chart = loss_chart('<script>"', [{"epoch": 1, "</svg><b>": 1.0}])
    assert "<script" not in chart
    assert "</svg><b" not in chart
    assert '<script>"' in texts(chart)


def test_validation_iou_has_a_chart_of_its_own_and_a_line_a_phase():
    records = {
        "positive-initial": [{"epoch": e, "total": 1.0, "iou_32": 0.1 * e} for e in range(4)],
        "positive-refinement": [{"epoch": e, "total": 1.0, "iou_32": 0.5} for e in range(4)],
        "negative-initial": [{"epoch": 0, "total": 1.0}],
    }
    chart = validation_chart(records)
    assert chart is not None
    assert chart.count("<path") == 2
    assert "positive-initial" in chart
    assert "negative-initial" not in chart
    assert "iou_32" not in loss_chart("positive-initial", records["positive-initial"])
    # 0 %, 10, 20 and 30 stand at equal heights above each other; 50 is level.
    lines = [
        np.array(points.replace("L", " ").split(), float)[1::2]
        for points in re.findall(r' d="M([^"]*)"', chart)
    ]
    assert np.ptp(np.diff(lines[0])) < 0.2
    assert np.ptp(lines[1]) == 0
    assert lines[1][0] < lines[0][-1] < lines[0][0]


def test_without_validation_models_there_is_no_such_chart():
    assert validation_chart({"positive-initial": [{"epoch": 0, "total": 1.0}]}) is None
