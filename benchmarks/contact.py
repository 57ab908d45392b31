"""A contact sheet: meshes beside their solids."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from pnabs.geometry.load import parse_mesh
from pnabs.geometry.normalise import normalise
from pnabs.geometry.orient import prepare
from pnabs.geometry.solid import voxelise
from pnabs.geometry.types import GRID_SIDE, Bool, Mesh
from pnabs.report.pictures import PLAIN, Frame, View, render, rgb
from pnabs.settings import Limits

SHOWN = ("02691156", "03636649", "03001627", "04530566", "02828884", "animal")
"""Airplanes' wings, lamps' shades, chairs' legs; ships, benches, animals."""

_SOLID = "#c9a36a"
_SIZE = 190
_HEAD = 14


def solid_mesh(occupancy: Bool) -> Mesh:
    """The faces between occupied cells and others, as a mesh in the normalised frame."""
    resolution = len(occupancy)
    padded = np.pad(occupancy, 1)
    quads = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for up in (False, True):
            beside = np.roll(padded, -1 if up else 1, axis=axis)
            cells = np.argwhere(padded & ~beside) - 1
            corners = np.zeros((4, 3))
            turn = [(0, 0), (1, 0), (1, 1), (0, 1)]
            for corner, (a, b) in enumerate(turn if up else reversed(turn)):
                corners[corner, [u, v, axis]] = a, b, up
            quads.append(cells[:, None] + corners)
    vertices = np.concatenate(quads) * (GRID_SIDE / resolution) - GRID_SIDE / 2
    first = np.arange(len(vertices))[:, None] * 4
    faces = np.concatenate([first + np.array(corners) for corners in ([0, 1, 2], [0, 2, 3])])
    return Mesh(vertices.reshape(-1, 3), faces)


def contact_sheet(root: Path, file: Path, each: int = 7) -> None:
    """Write a PNG: `each` models of some categories, the mesh, its solid at 32³ and at 64³."""
    view = View()
    rows = []
    for category in SHOWN:
        paths = sorted((root / category).glob("*/models/model_normalized.obj"))
        rows.append([paths[i] for i in np.linspace(0, len(paths) - 1, each).astype(int)])
    width, height = 3 * _SIZE, _SIZE + _HEAD
    columns = 3
    tiles = [path for row in rows for path in row]
    sheet = Image.new("RGB", (columns * width, -(-len(tiles) // columns) * height), "white")
    draw = ImageDraw.Draw(sheet)
    for place, path in enumerate(tiles):
        mesh = normalise(parse_mesh(path.read_bytes(), ".obj", Limits()))[0]
        prepared = prepare(mesh)
        solids = [solid_mesh(voxelise(prepared, side)) for side in (32, 64)]
        frame = Frame.around([mesh, *solids], view)
        left, top = place % columns * width, place // columns * height
        draw.text((left + 3, top + 1), f"{path.parts[-4]}/{path.parts[-3][:10]}", fill="black")
        for index, (shown, colour) in enumerate(
            zip([mesh, *solids], [PLAIN, _SOLID, _SOLID], strict=True)
        ):
            pixels = render(shown, rgb(colour), view=view, frame=frame, size=_SIZE)
            picture = Image.fromarray(pixels, "RGBA")
            sheet.paste(picture, (left + index * _SIZE, top + _HEAD), picture)
    sheet.save(file)
