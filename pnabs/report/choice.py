"""Which models of a category are pictured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from .data import number


def pictured(rows: Sequence[Mapping[str, object]], count: int) -> list[int]:
    """Models from best to worst by the headline measure, evenly spread, the worst among them.

    Closed models come first, by exact volume IoU, then the others, by IoU at 128³: the two
    measures aren't compared.  Each kind has its share of the pictures, and at least one where
    `count` allows.  A model whose result has no figure comes last of its kind.

    Parameters
    ----------
    rows : sequence of mappings
        Of a category's models with a result, their columns `model_id`, `not_exact`, `volume_iou`
        and `iou_128`; those but the first may be missing or None.
    count : int
        Pictures wanted.

    Returns
    -------
    list of int
        Indices into `rows`, at most `count`.
    """
    closed = [i for i, row in enumerate(rows) if row.get("not_exact") == ""]
    others = [i for i, row in enumerate(rows) if row.get("not_exact") != ""]
    share = _share(len(closed), len(others), min(count, len(rows)))
    return [
        ranked[place]
        for ranked, number in (
            (_ranked(rows, closed, "volume_iou"), share),
            (_ranked(rows, others, "iou_128"), min(count, len(rows)) - share),
        )
        for place in _spread(len(ranked), number)
    ]


def _share(closed: int, others: int, count: int) -> int:
    """How many of `count` pictures, at most all there are, show closed models."""
    if count < 2:
        return count if closed >= others else 0
    share = round(count * closed / (closed + others))
    return min(max(share, min(closed, 1)), count - min(others, 1))


def _ranked(rows: Sequence[Mapping[str, object]], indices: Sequence[int], column: str) -> list[int]:
    """From best to worst; ids decide between equal ones."""

    def key(i: int) -> tuple[float, str]:
        value = number(rows[i], column)
        return (np.inf if value is None else -value), str(rows[i]["model_id"])

    return sorted(indices, key=key)


def _spread(number: int, count: int) -> list[int]:
    """`count` of `number` places, from the first to the last; a single one is the last."""
    if count == 1:
        return [number - 1]
    return [round(float(place)) for place in np.linspace(0, number - 1, count)] if count else []
