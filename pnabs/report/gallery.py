"""The gallery: a model's four pictures, how well they agree, and what became of its negatives."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

from pnabs.geometry.check import BEYOND, faults

from .data import GalleryItem, ReportData, number
from .measures import REASONS
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
from .text import DASH, plain

PICTURE = 340
"""Pixels a side of a gallery picture, shown at about 220 so that dense screens stay sharp."""

SOUND = "closed, two-manifold, within bounds"
"""What a mesh is with which nothing is wrong."""


@dataclass(frozen=True, slots=True)
class Card:
    """A gallery model.

    Attributes
    ----------
    model_id : str
    headline : tuple of (value, name)
        Exact volume IoU of a closed model, IoU at 128^3 and coverage of another.
    lines : tuple of str
        How far result and shape are from each other, and why the model isn't closed.
    verdict : str
        What the check of the mesh found.
    sound : bool
        Whether it found nothing wrong.
    chips : tuple of (text, style)
        What became of the networks' negatives.
    facts : str
        Numbers of boxes, pieces and faces.
    pictures : tuple of (caption, data URI)
    """

    model_id: str
    headline: tuple[tuple[str, str], ...]
    lines: tuple[str, ...]
    verdict: str
    sound: bool
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
    verdict = _verdict(row, item.check)
    return Card(
        plain(item.model_id),
        _headline(row),
        _distances(row),
        verdict,
        verdict == SOUND,
        _fates(row),
        _facts(row),
        tuple(
            (caption, "data:image/webp;base64," + base64.b64encode(content).decode("ascii"))
            for caption, content in picture_row(item, view)
        ),
    )


def _percent(row: Mapping[str, object], key: str) -> str:
    value = number(row, key)
    return DASH if value is None else f"{100 * value:.1f} %"


def _headline(row: Mapping[str, object]) -> tuple[tuple[str, str], ...]:
    """Exact where there is an exact solid, else what a grid and the outer surface tell."""
    if row.get("not_exact") == "":
        return ((_percent(row, "volume_iou"), "exact volume IoU"),)
    return (
        (_percent(row, "iou_128"), "IoU at 128³"),
        (_percent(row, "coverage"), "coverage"),
    )


def _distances(row: Mapping[str, object]) -> tuple[str, ...]:
    lines = [f"out {_percent(row, 'out_99')}, miss {_percent(row, 'miss_99')}"]
    reason = row.get("not_exact")
    if reason:
        lines.append(f"original {REASONS.get(str(reason), plain(str(reason)))}")
    return tuple(lines)


def _verdict(row: Mapping[str, object], check: Mapping[str, bool | int] | None) -> str:
    """What the check of the mesh means, or what failed by name; empty where it wasn't checked."""
    ok, beyond = number(row, "check_ok"), number(row, "beyond")
    found = faults(check) if check is not None else []
    if not found and beyond is not None and beyond > BEYOND:
        found = [f"leaves the bounding box of its input by {100 * beyond:.1f} %"]
    if found or ok is None:
        return ", ".join(found)
    return SOUND if ok else "failed its check"


def _fates(row: Mapping[str, object]) -> tuple[tuple[str, str], ...]:
    """What became of the networks' negatives; nothing where there were no networks."""
    predicted = number(row, "negatives_predicted")
    if predicted is None:
        return ()
    chips = [(f"{predicted:.0f} predicted", "")]
    chips += [
        (f"{value:.0f} {label}", "out")
        for key, label in (
            ("discarded_deep", "too deep"),
            ("discarded_overlap", "overlapping"),
            ("discarded_gap", "apart"),
            ("discarded_idle", "idle"),
            ("suppressed", "suppressed"),
        )
        if (value := number(row, key))
    ]
    chips.append((f"{_count(row, 'negatives_kept')} kept", "kept"))
    if number(row, "axis_aligned") is not None:
        chips.append((f"{_count(row, 'negatives')} after the fit", "kept"))
    return tuple(chips)


def _facts(row: Mapping[str, object]) -> str:
    facts = [
        f"{value:.0f} {name}"
        for key, name in (("positives", "positives"), ("negatives", "negatives"))
        if (value := number(row, key)) is not None
    ]
    shape, result = number(row, "shape_pieces"), number(row, "result_pieces")
    if shape is not None and result is not None:
        facts.append(f"connected pieces: {shape:.0f} of the shape, {result:.0f} of the result")
    facts += [
        f"{value:.0f} {one if value == 1 else many}"
        for key, one, many in (
            ("bodies", "body", "bodies"),
            ("faces", "face", "faces"),
            ("pieces_dropped", "piece dropped", "pieces dropped"),
        )
        if (value := number(row, key))
    ]
    return ", ".join(facts)


def _count(row: Mapping[str, object], key: str) -> str:
    value = number(row, key)
    return DASH if value is None else f"{value:.0f}"
