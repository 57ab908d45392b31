"""The gallery: a model's four pictures, and what became of its negatives."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from .data import GalleryItem, ReportData
from .pictures import (
    NEUTRAL,
    PALE,
    PLAIN,
    Frame,
    View,
    connected_parts,
    encode,
    part_colours,
    render,
    rgb,
)
from .text import DASH, MINUS, plain

PICTURE = 340
"""Pixels a side of a gallery picture, shown at about 220 so that dense screens stay sharp."""


@dataclass(frozen=True, slots=True)
class Card:
    """A gallery model: caption, chips (text, style) and pictures (caption, data URI)."""

    model_id: str
    iou: str
    change: str
    change_style: str
    chips: tuple[tuple[str, str], ...]
    facts: str
    pictures: tuple[tuple[str, str], ...]


def cards_by_category(data: ReportData) -> list[tuple[str, list[Card]]]:
    """Cards by category, in the order of the items."""
    groups: dict[str, list[Card]] = {}
    for item in data.gallery:
        groups.setdefault(item.category, []).append(_card(item, data.view))
    return [
        (plain(data.names.get(category, category)), cards) for category, cards in groups.items()
    ]


def picture_row(item: GalleryItem, view: View, size: int = PICTURE) -> list[tuple[str, bytes]]:
    """The four pictures of a model in one frame, as captions and WebP bytes."""
    parts = connected_parts(item.positives) if item.positives_part is None else item.positives_part
    frame = Frame.around([item.original, item.positives, item.negatives, item.result], view)
    source = item.result_source
    result = rgb(PLAIN) if source is None else part_colours(source, PALE)
    draw = partial(render, view=view, frame=frame, size=size, supersample=2)
    drawn = (
        ("original", draw(item.original, rgb(NEUTRAL))),
        ("positives", draw(item.positives, part_colours(parts), parts=parts)),
        (
            "negatives over positives",
            draw(item.positives, rgb(PALE), parts=parts, overlay=item.negatives),
        ),
        ("result", draw(item.result, result, parts=source)),
    )
    return [(caption, encode(picture)) for caption, picture in drawn]


def _card(item: GalleryItem, view: View) -> Card:
    row = item.row
    before, after = _number(row, "iou_64_positives"), _number(row, "iou_64")
    change, style = "", ""
    if before is not None and after is not None:
        change = f"{100 * (after - before):+.1f} on {100 * before:.1f} % without negatives".replace(
            "-", MINUS
        )
        style = "gain" if after > before + 5e-4 else "loss" if after < before - 5e-4 else "same"
    chips = [(f"{_count(row, 'negatives_predicted')} predicted", "")]
    chips += [
        (f"{value:.0f} {label}", "out")
        for key, label in (
            ("discarded_deep", "too deep"),
            ("discarded_overlap", "overlapping"),
            ("discarded_gap", "apart"),
            ("discarded_idle", "idle"),
            ("suppressed", "suppressed"),
        )
        if (value := _number(row, key))
    ]
    chips.append((f"{_count(row, 'negatives_kept')} kept", "kept"))
    if _number(row, "axis_aligned") is not None:
        chips.append((f"{_count(row, 'negatives')} after the fit", "kept"))
    fitted = [f"{value:.0f} {key}" for key in ("shrunk", "grown") if (value := _number(row, key))]
    facts = [f"{_count(row, 'positives')} positives", *fitted, f"{_count(row, 'faces')} faces"]
    pieces, dropped, check = (_number(row, key) for key in ("pieces", "pieces_dropped", "check_ok"))
    if pieces is not None:
        facts.append(f"{pieces:.0f} {'piece' if pieces == 1 else 'pieces'}")
    if dropped:
        facts.append(f"{dropped:.0f} dropped")
    if check is not None:
        facts.append("check passed" if check else "check failed")
    pictures = tuple(
        (caption, "data:image/webp;base64," + base64.b64encode(content).decode("ascii"))
        for caption, content in picture_row(item, view)
    )
    iou = DASH if after is None else f"{100 * after:.1f} %"
    return Card(plain(item.model_id), iou, change, style, tuple(chips), ", ".join(facts), pictures)


def _number(row: Mapping[str, object], key: str) -> float | None:
    value = row.get(key)
    return (
        float(value) if isinstance(value, (int, float, np.generic)) and np.isfinite(value) else None
    )


def _count(row: Mapping[str, object], key: str) -> str:
    value = _number(row, key)
    return DASH if value is None else f"{value:.0f}"
