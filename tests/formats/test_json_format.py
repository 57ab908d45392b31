"""abstraction.json: exact round trips, and clear refusals."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from pnabs.formats import Abstraction, FormatError, from_json, to_json
from pnabs.geometry.types import Cuboids

LIMIT = 2.0**100
numbers = st.floats(-LIMIT, LIMIT, width=32)
plain = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.floats(-LIMIT, LIMIT) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=6,
)


@st.composite
def cuboid_sets(draw: st.DrawFn) -> Cuboids:
    n = draw(st.integers(0, 3))
    values = draw(hnp.arrays(np.float32, (n, 10), elements=numbers))
    with np.errstate(over="ignore"):
        rotation = values[:, 3:7].astype(np.float64)
        norm = np.linalg.norm(rotation, axis=1, keepdims=True)
        unit = np.where(norm > 0, rotation / np.where(norm > 0, norm, 1), [1, 0, 0, 0])
    return Cuboids(np.abs(values[:, :3]), unit.astype(np.float32), values[:, 7:])


@st.composite
def abstractions(draw: st.DrawFn) -> Abstraction:
    transform = np.eye(4)
    transform[:3] = draw(hnp.arrays(np.float64, (3, 4), elements=st.floats(-LIMIT, LIMIT)))
    positive = st.floats(0, 1)
    piece = st.fixed_dictionaries({"area": positive, "share": positive, "volume": positive})
    return Abstraction(
        category=draw(st.text(max_size=5)),
        model_id=draw(st.text(max_size=5)),
        positives=draw(cuboid_sets()),
        negatives=draw(cuboid_sets()),
        transform=transform,
        crop={
            "min_side": draw(positive),
            "jitter": draw(positive),
            "jitter_seed": draw(st.integers(0, 2**32 - 1)),
            "jitter_attempt": draw(st.integers(0, 3)),
        },
        debris={"threshold": draw(positive), "dropped": draw(st.lists(piece, max_size=2))},
        metrics=draw(
            st.dictionaries(st.text(), st.integers(0, 10**6) | st.floats(-LIMIT, LIMIT), max_size=4)
        ),
        check={"ok": draw(st.booleans()), "components": draw(st.integers(0, 9))},
        provenance=draw(st.dictionaries(st.text(), plain, max_size=3)),
    )


def simple(**changes: Any) -> Abstraction:
    values: dict[str, Any] = {
        "category": "03001627",
        "model_id": "a/b",
        "positives": Cuboids.from_vector(np.array([[0.1, 0.2, 0.3, 1, 0, 0, 0, 0.25, -0.1, 1e-7]])),
        "negatives": Cuboids.empty(),
        "transform": np.eye(4),
        "crop": {"min_side": 2e-3, "jitter": 1e-4, "jitter_seed": 7, "jitter_attempt": 0},
        "debris": {"threshold": 0.01, "dropped": []},
        "metrics": {"iou_32": 0.5, "faces": 12},
        "check": {"ok": True, "components": 1},
        "provenance": {"pnabs": "0"},
    }
    return Abstraction(**{**values, **changes})


def assert_same(a: Abstraction, b: Abstraction) -> None:
    for name in ("positives", "negatives"):
        for part in ("scale", "rotation", "translation"):
            one, other = getattr(getattr(a, name), part), getattr(getattr(b, name), part)
            assert one.dtype == other.dtype == np.float32
            assert one.tobytes() == other.tobytes()
    assert a.transform.tobytes() == b.transform.tobytes()
    for name in ("category", "model_id", "crop", "debris", "metrics", "check", "provenance"):
        assert getattr(a, name) == getattr(b, name)
    assert a.origins == b.origins
    assert list(a.levels) == list(b.levels)
    for size, level in a.levels.items():
        assert_same(level, b.levels[size])


@settings(deadline=None, max_examples=80)
@given(abstractions())
def test_round_trip_is_exact(abstraction: Abstraction) -> None:
    written = to_json(abstraction)
    read = from_json(written)
    assert_same(abstraction, read)
    assert to_json(read) == written


@settings(deadline=None, max_examples=20)
@given(abstractions(), abstractions())
def test_levels_go_along(finest: Abstraction, other: Abstraction) -> None:
    shared = {name: getattr(finest, name) for name in ("category", "model_id", "transform")}
    count = len(other.positives) + len(other.negatives)
    some = len(finest.positives) + len(finest.negatives) > 0
    level = replace(
        other, **shared, provenance=finest.provenance, origins=[[0] if some else []] * count
    )
    whole = replace(finest, levels={8: level, 4: level})
    read = from_json(to_json(whole))
    assert_same(whole, read)
    assert to_json(read) == to_json(whole)


@pytest.mark.parametrize(
    ("levels", "says"),
    [
        ({8: []}, "level 8: a cuboid each needs its origins"),
        ({8: [[1]]}, "level 8: an origin isn't there"),
    ],
)
def test_levels_that_make_no_sense_are_refused(
    levels: dict[int, list[list[int]]], says: str
) -> None:
    coarser = {size: simple(origins=origins) for size, origins in levels.items()}
    with pytest.raises(FormatError, match=says):
        from_json(to_json(simple(levels=coarser)))
    document = json.loads(to_json(simple(levels={8: simple(origins=[[0]])})))
    document["levels"] *= 2
    with pytest.raises(FormatError, match="two levels have the same number"):
        from_json(json.dumps(document).encode())


def test_text_is_readable_and_stable() -> None:
    assert to_json(simple()).decode() == (
        "{\n"
        ' "format": "pnabs/abstraction",\n'
        ' "version": 1,\n'
        ' "category": "03001627",\n'
        ' "model_id": "a/b",\n'
        ' "positives": [\n'
        '  {"rotation": [1.0, 0.0, 0.0, 0.0], "scale": [0.1, 0.2, 0.3],'
        ' "translation": [0.25, -0.1, 1e-07]}\n'
        " ],\n"
        ' "negatives": [],\n'
        ' "transform": [\n'
        "  [1.0, 0.0, 0.0, 0.0],\n"
        "  [0.0, 1.0, 0.0, 0.0],\n"
        "  [0.0, 0.0, 1.0, 0.0],\n"
        "  [0.0, 0.0, 0.0, 1.0]\n"
        " ],\n"
        ' "crop": {"jitter": 0.0001, "jitter_attempt": 0, "jitter_seed": 7, "min_side": 0.002},\n'
        ' "debris": {"dropped": [], "threshold": 0.01},\n'
        ' "metrics": {"faces": 12, "iou_32": 0.5},\n'
        ' "check": {"components": 1, "ok": true},\n'
        ' "provenance": {"pnabs": "0"}\n'
        "}\n"
    )


def test_numpy_numbers_and_undefined_metrics() -> None:
    odd = simple(metrics={"cd_l1": math.nan, "faces": np.int64(3), "iou_32": np.float64(0.25)})
    document = json.loads(to_json(odd))
    assert document["metrics"] == {"cd_l1": None, "faces": 3, "iou_32": 0.25}
    assert math.isnan(from_json(to_json(odd)).metrics["cd_l1"])


def test_what_json_cannot_hold_is_not_written() -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        to_json(simple(transform=np.full((4, 4), np.nan)))
    with pytest.raises(TypeError, match="no place in abstraction.json"):
        to_json(simple(provenance={"when": object()}))


def change(key: str, value: object) -> Callable[[dict[str, Any]], None]:
    def apply(document: dict[str, Any]) -> None:
        *path, last = key.split(".")
        for part in path:
            document = document[int(part) if part.isdigit() else part]
        document[last] = value

    return apply


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("format", "other", '"format" must be'),
        ("version", 2, "version 2 of the format"),
        ("version", None, "version None"),
        ("colour", "red", "colour: Extra inputs"),
        ("positives.0.size", [1, 1, 1], "positives.0.size: Extra inputs"),
        ("positives.0.scale", [1, 1], "positives.0.scale"),
        ("positives.0.scale", [1, 1, -1], "positives.0.scale.2"),
        ("positives.0.scale", [1, 1, "1"], "positives.0.scale.2"),
        ("positives.0.translation", [1e39, 0, 0], "positives.0.translation.0"),
        ("positives.0.rotation", [1, 1, 0, 0], "unit quaternion"),
        ("positives", {}, "positives: "),
        ("transform", [[1, 0, 0, 0]] * 4, "affine"),
        ("transform", [[1, 0, 0, 0]] * 3, "transform: "),
        ("crop.jitter_seed", -1, "crop.jitter_seed"),
        ("crop.jitter_seed", 1.5, "crop.jitter_seed"),
        ("debris.threshold", 2, "debris.threshold"),
        ("metrics.iou_32", "high", "metrics.iou_32"),
        ("category", 3, "category"),
    ],
)
def test_ill_documents_are_refused_with_the_place(key: str, value: object, message: str) -> None:
    document = json.loads(to_json(simple()))
    change(key, value)(document)
    with pytest.raises(FormatError) as error:
        from_json(json.dumps(document).encode())
    assert message in str(error.value)


@pytest.mark.parametrize("key", ["category", "positives", "crop", "check", "provenance"])
def test_missing_keys_are_named(key: str) -> None:
    document = json.loads(to_json(simple()))
    del document[key]
    with pytest.raises(FormatError, match=key):
        from_json(json.dumps(document).encode())


@pytest.mark.parametrize(
    "data",
    [b"", b"[]", b"{", b"null", b"\xff\xfe\x00", b'{"format": NaN}', b"[" * 100_000],
)
def test_what_is_not_json_is_refused(data: bytes) -> None:
    with pytest.raises(FormatError, match="not an abstraction"):
        from_json(data)


def test_repeated_keys_are_refused() -> None:
    text = to_json(simple()).decode().replace('"version": 1,', '"version": 1, "version": 1,')
    with pytest.raises(FormatError, match="twice"):
        from_json(text.encode())
