"""A small software rasteriser: triangles to a z-buffer, and a z-buffer to shaded pixels.

Everything is numba over plain arrays.  Images have the row index first, y pointing down.
Depth is kept as `w`, the reciprocal of the distance along the view axis: larger is nearer,
and it is an affine function of the pixel on any plane, so that planes have no second
difference and every crease or step has one.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from pnabs.geometry.types import Float64, Int64

_CREASE = 0.85
"""Neighbouring pixels whose normals have a smaller dot product are parted by an outline."""
_STEP = 2.5e-3
"""Likewise a larger second difference of w (about 0.025 of the normalised frame)."""
_DEPTH_SHADE, _DARKEST = 9.0, 0.30
"""Darkening by how much nearer (in w) the surroundings are, and its limit."""
_TIE = 1e-7
"""Depths closer than this count as equal: of coplanar faces one wins all over."""


@njit(cache=True, nogil=True)
def rasterise(corners: Float64, height: int, width: int) -> tuple[Float64, Int64]:
    """The nearest triangle at every pixel centre.

    Parameters
    ----------
    corners : (F, 3, 3) float64
        Corners of F triangles as (column, row, w) in pixels.
    height, width : int

    Returns
    -------
    w : (height, width) float64, 0 where nothing is
    face : (height, width) int64, -1 where nothing is
        Of triangles at the same depth the first one wins.
    """
    w = np.zeros((height, width))
    face = np.full((height, width), -1, dtype=np.int64)
    for f in range(len(corners)):
        x0, y0, w0 = corners[f, 0]
        x1, y1, w1 = corners[f, 1]
        x2, y2, w2 = corners[f, 2]
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        if area == 0.0:
            continue
        top = max(0, int(np.ceil(min(y0, y1, y2) - 0.5)))
        bottom = min(height - 1, int(np.floor(max(y0, y1, y2) - 0.5)))
        left = max(0, int(np.ceil(min(x0, x1, x2) - 0.5)))
        right = min(width - 1, int(np.floor(max(x0, x1, x2) - 0.5)))
        for i in range(top, bottom + 1):
            y = i + 0.5
            for j in range(left, right + 1):
                x = j + 0.5
                a = ((x1 - x) * (y2 - y) - (x2 - x) * (y1 - y)) / area
                b = ((x2 - x) * (y0 - y) - (x0 - x) * (y2 - y)) / area
                c = 1.0 - a - b
                if a >= 0.0 and b >= 0.0 and c >= 0.0:
                    depth = a * w0 + b * w1 + c * w2
                    if depth > w[i, j] + _TIE:
                        w[i, j] = depth
                        face[i, j] = f
    return w, face


@njit(cache=True, nogil=True)
def outlines(w: Float64, face: Int64, normals: Float64, parts: Int64) -> Float64:
    """Where a line is drawn: silhouettes, creases, steps in depth and borders between parts.

    Parameters
    ----------
    w : (H, W) float64
    face : (H, W) int64
    normals : (F, 3) float64
        Unit normals towards the viewer.
    parts : (F,) int64

    Returns
    -------
    (H, W) float64
        Strength: 0 none (and outside of the shape), 0.6 a crease, 1 a step, a border between
        parts or the silhouette.
    """
    height, width = face.shape
    strength = np.zeros((height, width))
    for i in range(height):
        for j in range(width):
            f = face[i, j]
            if f < 0:
                continue
            line = 0.0
            for axis in range(2):
                di = 1 - axis
                dj = axis
                for sign in (-1, 1):
                    k = i + sign * di
                    m = j + sign * dj
                    if k < 0 or m < 0 or k >= height or m >= width or face[k, m] < 0:
                        line = 1.0
                        continue
                    g = face[k, m]
                    if g == f:
                        continue
                    if parts[g] != parts[f]:
                        line = 1.0
                        continue
                    dot = 0.0
                    for axis3 in range(3):
                        dot += normals[f, axis3] * normals[g, axis3]
                    if dot < _CREASE:
                        line = max(line, 0.6)
                if 0 < i < height - 1 and 0 < j < width - 1:
                    second = w[i + di, j + dj] + w[i - di, j - dj] - 2.0 * w[i, j]
                    if abs(second) > _STEP:
                        line = 1.0
            strength[i, j] = line
    return strength


@njit(cache=True, nogil=True)
def resolve(layer: Float64, factor: int) -> Float64:
    """Premultiplied pixels averaged over blocks.

    Parameters
    ----------
    layer : (H * factor, W * factor, 4) float64
        Premultiplied colour and alpha.
    factor : int

    Returns
    -------
    (H, W, 4) float64
    """
    height, width = layer.shape[0] // factor, layer.shape[1] // factor
    out = np.zeros((height, width, 4))
    share = 1.0 / (factor * factor)
    for i in range(height * factor):
        for j in range(width * factor):
            for c in range(4):
                out[i // factor, j // factor, c] += layer[i, j, c] * share
    return out


@njit(cache=True, nogil=True)
def paint(
    w: Float64, face: Int64, colours: Float64, lines: Float64, surround: Float64, ink: Float64
) -> Float64:
    """An opaque layer: face colours, darker where surroundings are nearer, ink along the lines.

    Parameters
    ----------
    w : (H, W) float64
    face : (H, W) int64
    colours : (F, 3) float64
    lines : (H, W) float64
        Strength of the outline.
    surround : (H / k, W / k) float64
        Mean w around every block of k x k pixels.
    ink : (3,) float64

    Returns
    -------
    (H, W, 4) float64, premultiplied
    """
    height, width = face.shape
    k = height // surround.shape[0]
    out = np.zeros((height, width, 4))
    for i in range(height):
        for j in range(width):
            f = face[i, j]
            if f < 0:
                continue
            nearer = surround[i // k, j // k] - w[i, j]
            shade = 1.0 - min(max(_DEPTH_SHADE * nearer, 0.0), _DARKEST)
            t = 0.8 * lines[i, j]
            for c in range(3):
                out[i, j, c] = colours[f, c] * shade * (1.0 - t) + ink[c] * t
            out[i, j, 3] = 1.0
    return out


@njit(cache=True, nogil=True)
def glaze(
    layer: Float64,
    base_w: Float64,
    w: Float64,
    face: Int64,
    colours: Float64,
    lines: Float64,
    ink: Float64,
) -> None:
    """Lay translucent faces over a painted layer, in place.

    What lies behind the base still shows through, more faintly, and so do its outlines: most
    negatives are inside of the positives that they crop.

    Parameters
    ----------
    layer : (H, W, 4) float64, premultiplied
    base_w : (H, W) float64
        Depth of the painted layer.
    w, face, colours, lines, ink
        Of the translucent faces, as in `paint`.
    """
    height, width = face.shape
    for i in range(height):
        for j in range(width):
            f = face[i, j]
            if f < 0:
                continue
            hidden = base_w[i, j] > w[i, j] + 1e-4
            fill = 0.40 if hidden else 0.62
            line = (0.70 if hidden else 0.95) * lines[i, j]
            alpha = max(fill, line)
            t = line / alpha
            for c in range(3):
                colour = colours[f, c] * (1.0 - t) + ink[c] * t
                layer[i, j, c] = layer[i, j, c] * (1.0 - alpha) + colour * alpha
            layer[i, j, 3] = layer[i, j, 3] * (1.0 - alpha) + alpha
