"""Charts as inline SVG: small, labelled, and coloured by the page's style sheet.

Every function gives markup to put into HTML; names are escaped.  Colours are CSS
variables, so that charts follow the page into dark mode.  Points that fall on the same
spot are drawn once, which bounds the size for any number of models.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from pnabs.geometry.types import Float64

from .text import plain

_SERIES = 7
"""Distinct line colours of the style sheet, --s1 to --s7."""

VALIDATION = "iou_32"
"""Among an epoch's losses, the IoU of validation models."""


def _svg(width: float, height: float, label: str, parts: Sequence[Markup]) -> Markup:
    head = Markup('<svg class="chart" viewBox="0 0 {:g} {:g}" role="img" aria-label="{}">')
    return head.format(width, height, plain(label)) + Markup("\n").join(parts) + Markup("</svg>")


def _text(x: float, y: float, text: str, anchor: str = "start", style: str = "") -> Markup:
    return Markup('<text x="{:.1f}" y="{:.1f}" text-anchor="{}" class="{}">{}</text>').format(
        x, y, anchor, style, plain(text)
    )


def _upright(y: float, text: str) -> Markup:
    """The label of a vertical axis, read from below."""
    frame = Markup('<text transform="translate(11 {:.1f}) rotate(-90)" {}>{}</text>')
    return frame.format(y, Markup('text-anchor="middle" class="muted"'), plain(text))


def _line(x0: float, y0: float, x1: float, y1: float, style: str = "grid") -> Markup:
    ends = (x0, y0, x1, y1)
    frame = '<line class="{}" x1="{:.1f}" y1="{:.1f}" x2="{:.1f}" y2="{:.1f}"/>'
    return Markup(frame).format(style, *ends)


def _circle(style: str, x: float, y: float, radius: float) -> Markup:
    return Markup('<circle class="{}" cx="{:.1f}" cy="{:.1f}" r="{:g}"/>').format(
        style, x, y, radius
    )


def log_ticks(low: float, high: float) -> list[float]:
    """Round values of a logarithmic axis: decades, or 1-2-5 steps where decades are few."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    steps = (1,) if math.log10(high / low) > 2.5 else (1, 2, 5)
    return [v for d in decades for s in steps if low <= (v := float(f"{s}e{d}")) <= high]


def linear_ticks(low: float, high: float, most: int = 6) -> list[float]:
    """Round values of a linear axis, at most `most` + 1 of them."""
    if high <= low:
        return [low]
    raw = (high - low) / most
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(s * power for s in (1, 2, 5, 10) if s * power >= raw * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [round(i * step, 10) + 0.0 for i in range(first, last + 1)]


@dataclass(frozen=True, slots=True)
class _Series:
    name: str
    epochs: Float64
    values: Float64


def _positive_series(records: Sequence[Mapping[str, float]]) -> tuple[list[_Series], list[str]]:
    """Series that a logarithmic axis can show, `total` last, and the names of the others."""
    names = [
        name
        for name in dict.fromkeys(key for record in records for key in record)
        if name not in ("epoch", VALIDATION)
    ]
    series, flat = [], []
    for name in sorted(names, key=lambda name: name == "total"):
        pairs = np.array(
            [(r["epoch"], r[name]) for r in records if name in r], dtype=np.float64
        ).reshape(-1, 2)
        pairs = pairs[np.isfinite(pairs).all(axis=1) & (pairs[:, 1] > 0)]
        if len(pairs):
            series.append(_Series(name, pairs[:, 0], pairs[:, 1]))
        else:
            flat.append(name)
    return series, flat


def _spread(wanted: Sequence[float], gap: float, low: float, high: float) -> list[float]:
    """Label positions near the wanted ones, at least `gap` apart, in [low, high] if they fit."""
    order = np.argsort(wanted, kind="stable")
    placed = np.array([wanted[i] for i in order], dtype=np.float64)
    for i in range(1, len(placed)):
        placed[i] = max(placed[i], placed[i - 1] + gap)
    if len(placed):
        placed[-1] = min(placed[-1], high)
    for i in range(len(placed) - 2, -1, -1):
        placed[i] = min(placed[i], placed[i + 1] - gap)
    placed += max(0.0, low - placed[0]) if len(placed) else 0.0
    result = np.empty(len(placed))
    result[order] = placed
    return [float(value) for value in result]


def loss_chart(
    title: str, records: Sequence[Mapping[str, float]], terms: Sequence[str] = ()
) -> Markup:
    """Losses of a training phase over its epochs, on a logarithmic axis.

    Parameters
    ----------
    title : str
        The phase.
    records : sequence of mappings
        One an epoch: `epoch`, and losses by name; `total` is drawn bold.  Losses that are never
        positive are named in the corner instead.
    terms : sequence of str
        Names in the order of their colours, so that a term looks the same in every phase.

    Returns
    -------
    Markup
        An `svg` element.
    """
    series, flat = _positive_series(records)
    note = f"zero: {', '.join(flat)}" if flat else ""
    order = list(dict.fromkeys([*terms, *(s.name for s in series)]))
    label = f"Losses, {title}"
    if not series:
        return _empty_chart(title, label, "no losses above zero")
    values = np.concatenate([s.values for s in series])
    low, high = float(values.min()) / 1.15, float(values.max()) * 1.15
    return _epochs_chart(title, label, series, order, _Axis("loss", low, high, True), note)


def validation_chart(
    phases: Mapping[str, Sequence[Mapping[str, float]]], variant: str = ""
) -> Markup | None:
    """IoU of validation models over the epochs of each phase, per cent.

    Parameters
    ----------
    phases : mapping of phase to records
        One record an epoch: `epoch`, and `iou_32` where validation models were measured.
    variant : str
        Named in the title.

    Returns
    -------
    Markup or None
        An `svg` element, where anything was measured.
    """
    series = []
    for name, records in phases.items():
        pairs = np.array([(r["epoch"], 100 * r[VALIDATION]) for r in records if VALIDATION in r])
        if len(pairs):
            series.append(_Series(name, pairs[:, 0], pairs[:, 1]))
    if not series:
        return None
    highest = max(float(s.values.max()) for s in series)
    axis = _Axis("IoU at 32³, %", 0.0, min(100.0, 1.1 * highest + 1), False)
    title = f"{variant}: validation models" if variant else "validation models"
    return _epochs_chart(title, f"IoU of {title}", series, list(phases), axis)


@dataclass(frozen=True, slots=True)
class _Axis:
    """A vertical axis."""

    label: str
    low: float
    high: float
    logarithmic: bool

    def height(self, value: Float64 | float) -> Float64:
        """Where a value stands, 0 at the bottom to 1 at the top."""
        if self.logarithmic:
            return np.log(np.asarray(value) / self.low) / math.log(self.high / self.low)
        return (np.asarray(value) - self.low) / (self.high - self.low)

    @property
    def ticks(self) -> list[float]:
        """Round values."""
        return (log_ticks if self.logarithmic else linear_ticks)(self.low, self.high)


_EPOCHS_SIZE = 470.0, 270.0


def _empty_chart(title: str, label: str, reason: str) -> Markup:
    width, height = _EPOCHS_SIZE
    parts = [
        _text(60.0, 15, title, style="title"),
        _text(width / 2, height / 2, reason, "middle", "muted"),
    ]
    return _svg(width, height, label, parts)


def _epochs_chart(
    title: str,
    label: str,
    series: Sequence[_Series],
    order: Sequence[str],
    axis: _Axis,
    note: str = "",
) -> Markup:
    """Lines over epochs, each named at its end; `order` gives the colours by name."""
    (width, height), left, right, top, bottom = _EPOCHS_SIZE, 60.0, 134.0, 28.0, 38.0
    parts = [_text(left, 15, title, style="title")]
    epochs = np.concatenate([s.epochs for s in series])
    first, last = float(epochs.min()), float(epochs.max())

    def at_x(epoch: Float64 | float) -> Float64:
        share = (
            (np.asarray(epoch) - first) / (last - first)
            if last > first
            else np.full(np.shape(epoch), 0.5)
        )
        return left + (width - left - right) * share

    def at_y(value: Float64 | float) -> Float64:
        return top + (height - top - bottom) * (1 - axis.height(value))

    for tick in axis.ticks:
        y = float(at_y(tick))
        parts += [_line(left, y, width - right, y), _text(left - 6, y + 3.5, f"{tick:g}", "end")]
    for tick in linear_ticks(first, last, 5):
        if tick == int(tick):
            parts.append(_text(float(at_x(tick)), height - bottom + 15, f"{tick:g}", "middle"))
    parts.append(_line(left, height - bottom, width - right, height - bottom, "axis"))
    parts.append(_text((left + width - right) / 2, height - 6, "epoch", "middle", "muted"))
    parts.append(_upright((top + height - bottom) / 2, axis.label))
    ends = [float(at_y(s.values[-1])) for s in series]
    labels = _spread(ends, 13.0, top + 4, height - bottom)
    for s, end, place in zip(series, ends, labels, strict=True):
        colour = "s-total" if s.name == "total" else f"s{order.index(s.name) % _SERIES + 1}"
        path = "M" + "L".join(
            f"{x:.1f} {y:.1f}" for x, y in zip(at_x(s.epochs), at_y(s.values), strict=True)
        )
        x = float(at_x(s.epochs[-1]))
        parts.append(Markup('<path class="line {}" d="{}"/>').format(colour, path))
        parts.append(_circle(f"dot {colour}", x, end, 2.4))
        parts.append(_text(width - right + 8, place + 3.5, s.name[:20], style=f"label {colour}"))
    if note:
        parts.append(_text(width - 4, 15, note, "end", "muted"))
    return _svg(width, height, label, parts)


@dataclass(frozen=True, slots=True, eq=False)
class Strip:
    """Shares of a category's models, per cent, (n,) float64."""

    label: str
    values: Float64


def strip_chart(title: str, axis: str, strips: Sequence[Strip]) -> Markup:
    """Every model as a tick on an axis from 0 to 100 %, by category; a large mark is the mean.

    Parameters
    ----------
    title, axis : str
        Which models, and what of them.
    strips : sequence of Strip
        One a row.
    """
    widest = max((len(plain(s.label)) for s in strips), default=0)
    left, right, row, top = min(170.0, 20.0 + 6.6 * widest), 18.0, 24.0, 34.0
    width, height = 560.0, top + row * len(strips) + 40.0

    def at(value: Float64 | float) -> Float64:
        return left + (width - left - right) * np.asarray(value) / 100

    parts = [_text(left, 15, title, style="title")]
    for tick in range(0, 101, 20):
        x = float(at(tick))
        parts += [_line(x, top - 6, x, height - 34), _text(x, height - 20, str(tick), "middle")]
    parts.append(_text(float(at(50)), height - 4, axis, "middle", "muted"))
    for i, strip in enumerate(strips):
        middle = top + row * (i + 0.5)
        parts.append(
            _text(left - 10, middle + 3.5, _shorten(plain(strip.label), 24), "end", "label")
        )
        if not len(strip.values):
            continue
        ticks = np.unique(np.round(at(strip.values) * 2) / 2)
        path = "".join(f"M{x:g} {middle - 7:g}v14" for x in ticks)
        parts.append(Markup('<path class="ticks" d="{}"/>').format(path))
        parts.append(_circle("mean", float(at(strip.values.mean())), middle, 4.5))
    return _svg(width, height, f"{title}: {axis}", parts)


def _shorten(text: str, most: int) -> str:
    return text if len(text) <= most else text[: most - 1] + "…"
