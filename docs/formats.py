"""Draws pages/formats.png: one abstraction in every format, each read by another program.

pip install pyvista yourdfpy mujoco-core
pnabs samples samples --per-category 200 --category chair
python docs/formats.py samples/03001627/24dfdf0883a228ac86d5e1c4347c2298/models/model_normalized.obj
"""

from __future__ import annotations

import colorsys
import subprocess
import sys
import tempfile
from pathlib import Path

import mujoco
import numpy as np
import pyvista
import trimesh
import yourdfpy

PICTURE = Path(__file__).parent / "pages" / "formats.png"
GREY = (0.75, 0.78, 0.85)
Shown = list[tuple[pyvista.DataSet, tuple[float, float, float]]]


def colour(index: int) -> tuple[float, float, float]:
    """One for each piece, apart from its neighbours'."""
    return colorsys.hsv_to_rgb((0.58 + 0.618 * index) % 1, 0.5, 0.85)


def polydata(vertices: np.ndarray, faces: np.ndarray) -> pyvista.PolyData:
    """A triangle mesh as VTK has it."""
    return pyvista.PolyData(
        np.asarray(vertices, dtype=float), np.insert(np.asarray(faces), 0, 3, axis=1).ravel()
    )


def gltf(path: Path) -> Shown:
    """Each primitive, as VTK reads it."""
    found: Shown = []

    def walk(block: pyvista.MultiBlock) -> None:
        for item in block:
            if isinstance(item, pyvista.MultiBlock):
                walk(item)
            elif item is not None:
                found.append((item, colour(len(found))))

    walk(pyvista.read(path))
    return found


def urdf(path: Path) -> Shown:
    """Each visual, as yourdfpy places it."""
    scene = yourdfpy.URDF.load(str(path)).scene
    return [(polydata(m.vertices, m.faces), colour(i)) for i, m in enumerate(scene.dump())]


def mjcf(path: Path) -> Shown:
    """Each geom, as MuJoCo places it: the convex hull that it collides with."""
    model = mujoco.MjModel.from_xml_path(str(path))
    state = mujoco.MjData(model)
    mujoco.mj_forward(model, state)
    found: Shown = []
    for geom in range(model.ngeom):
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
            mesh = trimesh.creation.box(2 * model.geom_size[geom])
        else:
            number = model.geom_dataid[geom]
            first, count = model.mesh_vertadr[number], model.mesh_vertnum[number]
            points = model.mesh_vert[first : first + count].astype(float)
            mesh = trimesh.convex.convex_hull(points)
        turn = state.geom_xmat[geom].reshape(3, 3)
        placed = mesh.vertices @ turn.T + state.geom_xpos[geom]
        found.append((polydata(placed, mesh.faces), colour(geom)))
    return found


def main(mesh: Path) -> None:
    """Abstract the mesh, and draw what other programs make of the files."""
    formats = ["glb", "parts", "obj", "ply", "stl", "urdf", "mjcf"]
    with tempfile.TemporaryDirectory() as out:
        asked = [part for name in formats for part in ("--format", name)]
        asked += ["--set", "abstract.fit=false"]  # whose negatives open more than one side
        subprocess.run(["pnabs", "abstract", mesh, "--out", out, *asked], check=True)
        file = Path(out) / mesh.stem / "abstraction"
        cells = {"the mesh": [(pyvista.read(mesh), (0.6, 0.6, 0.62))]}
        cells["glb (VTK)"] = gltf(file.with_suffix(".glb"))
        cells["parts (VTK)"] = gltf(file.with_suffix(".parts.glb"))
        for name in ("obj", "ply", "stl"):
            cells[f"{name} (VTK)"] = [(pyvista.read(file.with_suffix(f".{name}")), GREY)]
        cells["urdf (yourdfpy)"] = urdf(file.with_suffix(".urdf"))
        cells["mjcf (MuJoCo)"] = mjcf(file.with_suffix(".xml"))
        plotter = pyvista.Plotter(shape=(2, 4), off_screen=True, window_size=(1400, 760))
        for number, (title, shown) in enumerate(cells.items()):
            plotter.subplot(number // 4, number % 4)
            plotter.set_background("white")
            plotter.add_text(title, font_size=10)
            for data, look in shown:
                plotter.add_mesh(data, color=look)
            plotter.camera_position = [(2.2, 1.5, 2.6), (0, 0, 0), (0, 1, 0)]
            plotter.reset_camera()
        plotter.screenshot(PICTURE)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
