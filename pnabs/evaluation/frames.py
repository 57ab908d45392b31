"""Whether a result stands in another frame than its shape: scaled, shifted or turned.

Nothing is corrected by it: it says what to look at when figures are bad.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from pnabs.geometry.metrics import iou
from pnabs.geometry.reference import Reference
from pnabs.geometry.score import Result
from pnabs.geometry.types import Bool, Float64, Int64

RESOLUTION = 32
"""Grid on which frames are compared."""

GOOD = 0.75
"""From this IoU on a result stands where it should."""

GAIN = 0.15
"""IoU that another frame must gain to be spoken of."""

ALIKE = 0.05
"""IoUs that differ by less tell nothing apart; symmetric shapes look alike when turned."""

SIZE_SLACK = 0.03
SHIFT_SLACK = 0.03
"""Change of size (as a share) and shift (in longest sides) that bad results have anyway."""


def _turns() -> Int64:
    """The 24 rotations that take axes to axes, (24, 3, 3), smaller angles first.

    Of those that a symmetric shape doesn't tell apart the first is named: one that takes an
    upright y to z, or back.
    """
    found: list[Int64] = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1, -1), repeat=3):
            matrix = np.zeros((3, 3), dtype=np.int64)
            matrix[range(3), order] = signs
            if round(np.linalg.det(matrix)) == 1:
                found.append(matrix)

    ranks = [(-int(np.trace(turn)), turn[2, 1] != 1, turn[1, 2] != 1) for turn in found]
    return np.stack([found[i] for i in sorted(range(len(found)), key=ranks.__getitem__)])


TURNS = _turns()
"""The first one changes nothing."""


def turned(cells: Bool, turn: Int64) -> Bool:
    """A grid (G, G, G) about the origin, turned by a rotation that takes axes to axes."""
    order = np.argmax(np.abs(turn), axis=1)
    flipped = tuple(axis for axis in range(3) if turn[axis, order[axis]] < 0)
    return np.asarray(np.flip(cells.transpose(order), flipped), dtype=bool)


def compare(
    reference: Reference, result: Result, plain: float, other: Float64 | None
) -> dict[str, Any]:
    """How a result would agree with its shape in other frames; empty where it agrees as it is.

    Parameters
    ----------
    reference : Reference
    result : Result
        As it was given, in the shape's normalised frame.
    plain : float
        Its IoU at 32^3 there.
    other : (4, 4) float64, optional
        From the result's place here to where it would be if it was given in the other of the
        frames that results may be given in.

    Returns
    -------
    dict
        `frame_size`: the longest side of its bounding box; `frame_shift`: how far the box's
        centre is from the shape's; `frame_turns`: with both corrected, the IoU at 32^3 when turned
        back by each of `TURNS`; `frame_other`: the IoU in the other frame.
    """
    if plain >= GOOD or result.is_empty:
        return {}
    used = result.vertices[result.faces.ravel()]
    low, high = used.min(axis=0), used.max(axis=0)
    size, centre = float((high - low).max()), (low + high) / 2
    if not size > 0:
        return {}
    upright = np.eye(4)
    upright[:3, :3] /= size
    upright[:3, 3] = -centre / size
    cells = _moved(result, upright).occupancy(RESOLUTION)
    found: dict[str, Any] = {
        "frame_size": size,
        "frame_shift": float(np.linalg.norm(centre)),
        # turned back: by the inverse, which is the transpose
        "frame_turns": [iou(turned(cells, turn.T), reference.occupancy) for turn in TURNS],
    }
    if other is not None:
        there = _moved(result, other).occupancy(RESOLUTION)
        found["frame_other"] = iou(there, reference.occupancy)
    return found


def _moved(result: Result, matrix: Float64) -> Result:
    # As a mesh: thin boxes count as the mesh's surface does.
    return Result(result.vertices @ matrix[:3, :3].T + matrix[:3, 3], result.faces)


def notice(name: str, rows: Iterable[Mapping[str, Any]], frame: str) -> str:
    """What is to be said of the frame of some results; empty when nothing is.

    Parameters
    ----------
    name : str
        Of the results.
    rows : iterable of mapping
        A row for each result that was measured, with `iou_32` and what `compare` found.
    frame : str
        In which they were taken to be: `input` or `normalised`.
    """
    rows = list(rows)
    strange = [row for row in rows if _gain(row) >= GAIN]
    if not strange:
        return ""
    there = [row for row in strange if _fits_elsewhere(row)]
    turn = _common_turn(strange)
    alike = [row for row in strange if row["frame_turns"][turn] >= _best(row) - ALIKE]
    said = [f"turned by {describe(TURNS[turn])}"] if turn else []
    said += _sizes([row["frame_size"] for row in alike])
    if np.median([row["frame_shift"] for row in alike]) > SHIFT_SLACK:
        said.append("shifted")
    if not said:
        return ""
    text = f"results of {name!r}: {len(alike)} of {len(rows)} look {_listed(said)}"
    if 2 * len(there) > len(strange):
        elsewhere = "normalised" if frame == "input" else "input"
        word = "normalised frame" if frame == "input" else "input's frame"
        text += f"; are they in the {word}? try --frame {elsewhere}"
    return text


def _best(row: Mapping[str, Any]) -> float:
    return float(max(row["frame_turns"]))


def _gain(row: Mapping[str, Any]) -> float:
    if row.get("frame_turns") is None:
        return 0.0
    best = max(_best(row), row.get("frame_other") or 0.0)
    return best - float(row["iou_32"])


def _fits_elsewhere(row: Mapping[str, Any]) -> bool:
    other = row.get("frame_other") or 0.0
    return other - float(row["iou_32"]) >= GAIN and other >= _best(row) - ALIKE


def _common_turn(rows: Sequence[Mapping[str, Any]]) -> int:
    """The rotation that suits most of the results, the smaller of those that suit alike."""
    means = np.mean([row["frame_turns"] for row in rows], axis=0)
    return int(np.argmax(means >= means.max() - ALIKE / 2))


def _sizes(sizes: Sequence[float]) -> list[str]:
    middle = float(np.median(sizes))
    if abs(middle - 1) <= SIZE_SLACK:
        return []
    low, high = min(sizes), max(sizes)
    if high <= low * 1.1:
        return [f"scaled by {middle:.3g}"]
    return [f"scaled by {low:.3g} to {high:.3g}"]


def _listed(parts: Sequence[str]) -> str:
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


def describe(turn: Int64) -> str:
    """A rotation in words: `90 degrees about x (z up?)`."""
    angle = round(float(np.degrees(np.arccos((np.trace(turn) - 1) / 2))))
    # Of a half turn the axis is what stays; of others, what the antisymmetric part tells.
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    if angle == 180:
        symmetric = turn + np.eye(3, dtype=np.int64)
        axis = symmetric[:, int(np.argmax(np.abs(symmetric).sum(axis=0)))]
    axis = np.sign(axis)
    if np.count_nonzero(axis) == 1:
        if axis.sum() < 0:
            angle = 360 - angle
        about = "xyz"[int(np.argmax(np.abs(axis)))]
    else:
        about = f"({', '.join(str(part) for part in axis.tolist())})"
    hint = ""
    if turn[2, 1] == 1:
        hint = " (z up?)"
    elif turn[1, 2] == 1:
        hint = " (y up?)"
    return f"{angle} degrees about {about}{hint}"
