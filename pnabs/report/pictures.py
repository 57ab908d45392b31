"""Pictures of meshes: flat-shaded, outlined, on a transparent background.

One fixed camera looks from the front, above and to a side; all pictures of a model
share one frame, so that they compare.  The same input gives the same bytes.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter, uniform_filter
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pnabs.geometry.types import Float64, Int64, Mesh

from .raster import glaze, outlines, paint, rasterise, resolve

RGBA = NDArray[np.uint8]

PALETTE = (
    "#6da9e7",
    "#deb866",
    "#68b986",
    "#ceacf7",
    "#35b9c0",
    "#f2ad73",
    "#909fe9",
    "#b4c875",
    "#49b3d8",
    "#eaa3da",
    "#43bba7",
    "#cec068",
)
"""Colours of positives, of even lightness and without the red that negatives have."""

NEUTRAL = "#cbced3"
"""Colour of original meshes."""
PLAIN = "#7fa6cf"
"""Colour of a result whose faces don't say which positive they come from."""
PALE = "#d5d9df"
"""Colour of positives beneath negatives."""
NEGATIVE = "#ff5a4a"
"""Colour of negatives."""

_INK = np.array([0.13, 0.15, 0.19])
_NEGATIVE_INK = np.array([0.72, 0.07, 0.06])
_MARGIN = 0.04


@dataclass(frozen=True, slots=True)
class View:
    """A camera that looks at the origin of the normalised frame, with +Y up.

    Attributes
    ----------
    azimuth : float
        Degrees about +Y, from the front (-Z, as in ShapeNetCore.v2) towards -X; ShapeNetCore.v1,
        whose models face +X, wants 90 degrees less.
    elevation : float
        Degrees above the horizon.
    distance : float
        From the origin, in normalised units; it sets how strong the perspective is.
    """

    azimuth: float = 35.0
    elevation: float = 22.0
    distance: float = 3.4

    def axes(self) -> Float64:
        """Right, up and towards the camera, as rows, (3, 3) float64."""
        azimuth, elevation = np.radians([self.azimuth, self.elevation])
        towards = np.array(
            [
                -np.cos(elevation) * np.sin(azimuth),
                np.sin(elevation),
                -np.cos(elevation) * np.cos(azimuth),
            ]
        )
        right = np.cross([0.0, 1.0, 0.0], towards)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(towards, right), towards])

    def project(self, points: Float64) -> Float64:
        """Points (..., 3) to image-plane x (right), y (up) and w = 1 / distance along the axis."""
        local = points @ self.axes().T
        w = 1.0 / np.maximum(self.distance - local[..., 2], 0.2)
        return np.stack([local[..., 0] * w, local[..., 1] * w, w], axis=-1)


@dataclass(frozen=True, slots=True)
class Frame:
    """The part of the image plane that fills a square picture: its centre and its side."""

    x: float
    y: float
    side: float

    @classmethod
    def around(cls, meshes: Sequence[Mesh], view: View) -> Frame:
        """The smallest frame about the meshes and their shadows."""
        corners = [mesh.triangles.reshape(-1, 3) for mesh in meshes]
        points = np.concatenate([*corners, np.zeros((0, 3))])
        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            return cls(0.0, 0.0, 0.5)
        floor = points * [1.0, 0.0, 1.0] + [0.0, points[:, 1].min(), 0.0]
        flat = view.project(np.concatenate([points, floor]))[:, :2]
        lower, upper = flat.min(axis=0), flat.max(axis=0)
        x, y = (lower + upper) / 2
        side = max(float((upper - lower).max()), 1e-6) * (1 + 2 * _MARGIN)
        return cls(float(x), float(y), side)

    def to_pixels(self, projected: Float64, size: int) -> Float64:
        """Image-plane points (..., 3) to (column, row, w) of a picture `size` pixels wide."""
        scale = size / self.side
        column = (projected[..., 0] - self.x) * scale + size / 2
        row = (self.y - projected[..., 1]) * scale + size / 2
        return np.stack([column, row, projected[..., 2]], axis=-1)


def rgb(colour: str) -> Float64:
    """A colour `#rrggbb` as shares, (3,) float64."""
    return np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255


def part_colours(parts: Int64, plain: str = PLAIN) -> Float64:
    """A palette colour for each part, `plain` for negative indices.

    Parameters
    ----------
    parts : (F,) int64

    Returns
    -------
    (F, 3) float64
    """
    palette = np.array([rgb(colour) for colour in PALETTE])
    parts = np.asarray(parts, dtype=np.int64)
    return np.where((parts >= 0)[:, None], palette[parts % len(palette)], rgb(plain))


def connected_parts(mesh: Mesh) -> Int64:
    """The connected piece of each face, (F,) int64, numbered by their first faces."""
    n = len(mesh.vertices)
    if not len(mesh.faces):
        return np.zeros(0, dtype=np.int64)
    start, end = mesh.faces.ravel(), np.roll(mesh.faces, 1, axis=1).ravel()
    graph = coo_matrix((np.ones(len(start), dtype=np.int8), (start, end)), shape=(n, n))
    labels = connected_components(graph, directed=False)[1][mesh.faces[:, 0]]
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[inverse]


@dataclass(frozen=True, slots=True, eq=False)
class _Layer:
    """Visible faces of a mesh: depth, face index, lit colours, outlines."""

    w: Float64
    face: Int64
    colours: Float64
    lines: Float64


def render(
    mesh: Mesh,
    colours: Float64,
    *,
    parts: Int64 | None = None,
    overlay: Mesh | None = None,
    view: View | None = None,
    frame: Frame | None = None,
    size: int = 240,
    supersample: int = 3,
) -> RGBA:
    """A picture of a mesh, and of translucent red negatives over it.

    Parameters
    ----------
    mesh : Mesh
        In the normalised frame.  Faces with coordinates that aren't finite are left out.
    colours : (3,) or (F, 3) float64
        One colour, or one a face; shares of red, green and blue.
    parts : (F,) int64, optional
        Faces of different parts are parted by an outline.
    overlay : Mesh, optional
        Negatives: red, translucent, faintly visible inside of the mesh too.
    view : View, optional
    frame : Frame, optional
        Shared by pictures that are to be compared; fitted to the meshes when left out.
    size : int
        Pixels a side.
    supersample : int
        Samples a pixel and axis.

    Returns
    -------
    (size, size, 4) uint8
        Straight (not premultiplied) alpha.
    """
    view = view or View()
    frame = frame or Frame.around([mesh] if overlay is None else [mesh, overlay], view)
    fine = size * supersample
    colours = np.broadcast_to(colours, (len(mesh.faces), 3))
    base = _layer(mesh, colours, parts, view, frame, fine)
    surround = _surround(base.w, supersample)
    picture = paint(base.w, base.face, base.colours, base.lines, surround, _INK)
    if overlay is not None:
        red = np.broadcast_to(rgb(NEGATIVE), (len(overlay.faces), 3))
        top = _layer(overlay, red, connected_parts(overlay), view, frame, fine)
        glaze(picture, base.w, top.w, top.face, top.colours, top.lines, _NEGATIVE_INK)
    small = resolve(picture, supersample)
    shadow = _shadow(mesh, view, frame, size)
    alpha = small[..., 3:] + shadow[..., None] * (1 - small[..., 3:])
    straight = small[..., :3] / np.maximum(alpha, 1e-9)
    pixels: RGBA = np.rint(np.clip(np.concatenate([straight, alpha], axis=-1), 0, 1) * 255).astype(
        np.uint8
    )
    return pixels


def encode(picture: RGBA, form: Literal["png", "webp"] = "webp") -> bytes:
    """A picture as the bytes of a PNG (lossless) or a small WebP file."""
    buffer = io.BytesIO()
    image = Image.fromarray(picture)
    if form == "png":
        image.save(buffer, "PNG", optimize=True)
    else:
        image.save(buffer, "WEBP", quality=82, alpha_quality=90, method=4)
    return buffer.getvalue()


def _layer(
    mesh: Mesh, colours: Float64, parts: Int64 | None, view: View, frame: Frame, fine: int
) -> _Layer:
    triangles = np.asarray(mesh.triangles, dtype=np.float64)
    sound = np.isfinite(triangles).all(axis=(1, 2))
    triangles = np.ascontiguousarray(triangles[sound])
    corners = frame.to_pixels(view.project(triangles), fine)
    w, face = rasterise(corners, fine, fine)
    normals = _facing_normals(triangles, view)
    ids = (
        np.zeros(len(triangles), dtype=np.int64)
        if parts is None
        else np.asarray(parts, dtype=np.int64)[sound]
    )
    return _Layer(w, face, _light(colours[sound], normals, view), outlines(w, face, normals, ids))


def _facing_normals(triangles: Float64, view: View) -> Float64:
    """Unit normals turned to the viewer, as polygon soups know no outside, (F, 3) float64."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    sight = view.axes()[2] * view.distance - triangles.mean(axis=1)
    return np.where((normals * sight).sum(axis=1, keepdims=True) < 0, -normals, normals)


def _light(colours: Float64, normals: Float64, view: View) -> Float64:
    """Colours under a key light from above left, a fill light from the right, and a bright sky."""
    axes = view.axes()
    key = np.array([-0.55, 0.55, 0.63]) @ axes
    fill = np.array([0.80, 0.10, 0.59]) @ axes
    light = (
        0.52
        + 0.44 * np.maximum(normals @ key, 0)
        + 0.12 * np.maximum(normals @ fill, 0)
        + 0.14 * np.maximum(normals[:, 1], 0)
    )
    return np.clip(colours * light[:, None], 0, 1)


def _surround(w: Float64, supersample: int) -> Float64:
    """Mean depth around each picture pixel, the background taking no part, (size, size) float64.

    Darkening what lies behind its surroundings looks like light that doesn't reach a corner (Luft,
    Colditz and Deussen 2006).  The blur is wide, so one sample a pixel is enough for it.
    """
    coarse = w[supersample // 2 :: supersample, supersample // 2 :: supersample]
    width = max(3, len(coarse) // 14)
    weight = uniform_filter((coarse > 0).astype(np.float64), width)
    return uniform_filter(coarse, width) / np.maximum(weight, 1e-9)


def _shadow(mesh: Mesh, view: View, frame: Frame, size: int) -> Float64:
    """Alpha of a soft shadow on the ground below a mesh, (size, size) float64."""
    triangles = np.asarray(mesh.triangles, dtype=np.float64)
    triangles = triangles[np.isfinite(triangles).all(axis=(1, 2))]
    if not len(triangles):
        return np.zeros((size, size))
    flat = triangles.copy()
    flat[..., 1] = triangles[..., 1].min()
    covered = rasterise(frame.to_pixels(view.project(flat), size), size, size)[1] >= 0
    return 0.26 * gaussian_filter(covered.astype(np.float64), size / 60)
