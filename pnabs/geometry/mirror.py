"""Which axis a shape is mirrored along."""

from __future__ import annotations

import numpy as np

from pnabs.geometry.types import Bool
from pnabs.settings import Solid

NO_MIRROR = -1
"""The mirror axis of an asymmetric shape."""

LAYOUT_AXES = {"shapenet-v1": 2, "shapenet-v2": 0}
"""Left-right axis where a collection has one convention; elsewhere it is found."""

_FIXED = {"x": 0, "y": 1, "z": 2, "none": NO_MIRROR}


def detect_mirror(occupancy: Bool, settings: Solid, layout: str) -> int:
    """The axis along which a shape is its own mirror image: 0 x, 1 y, 2 z, -1 none.

    With `mirror: auto`, x or z, whichever has the higher mirror IoU (the layout's own axis
    if equal), or none below `mirror_threshold`.  With `mirror: layout` the layout's
    convention; layouts without one are treated as `auto`.

    Parameters
    ----------
    occupancy : (G, G, G) bool
        The solid in the normalised frame: its mirror plane passes through the origin.
    settings : Solid
    layout : str
        Layout of the collection, such as "shapenet-v2".
    """
    if settings.mirror in _FIXED:
        return _FIXED[settings.mirror]
    convention = LAYOUT_AXES.get(layout)
    if settings.mirror == "layout" and convention is not None:
        return convention
    axes = (2, 0) if convention == 2 else (0, 2)
    score = {axis: mirror_iou(occupancy, axis) for axis in axes}
    best = max(axes, key=score.__getitem__)
    return best if score[best] >= settings.mirror_threshold else NO_MIRROR


def mirror_iou(occupancy: Bool, axis: int) -> float:
    """IoU of a solid with its mirror image along an axis; 0 for an empty grid."""
    mirrored = np.flip(occupancy, axis)
    union = np.count_nonzero(occupancy | mirrored)
    return np.count_nonzero(occupancy & mirrored) / union if union else 0.0
