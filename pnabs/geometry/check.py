"""The final check of a result: closed, two-manifold, within the input's bounds.

METHOD, "Abstraction" step 5.  What is checked is exactly what is written: the vertices
rounded to float32 (on unrounded ones the test for self-intersections raises false alarms at
coplanar neighbours).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pnabs.geometry.types import Float32, Float64

APART = 1e-8
"""Vertices that no coordinate tells apart by more are one to programs that weld by rounded place.
Float32 tells them apart near 0, where mirrored boxes meet."""

BEYOND = 0.005
"""A result may leave the input's bounding box by this share of the longest side."""


@dataclass(frozen=True, slots=True)
class CheckReport:
    """The verdict on a mesh.

    Attributes
    ----------
    closed : bool
        No edge with one face alone.
    two_manifold : bool
        Every edge and every vertex has the neighbourhood of a surface.
    self_intersections : int
        Faces that meet others elsewhere than along common edges and vertices.
    duplicate_vertices : int
        Vertices at the place of another, or within `APART` of one in every coordinate.
    unreferenced_vertices : int
        Vertices without a face.
    degenerate_faces : int
        Faces without area.
    components : int
        Connected surfaces; a sealed void counts as one.
    within_bounds : bool or None
        Whether it leaves the input's bounding box by `BEYOND` at most; None where that box isn't
        known.
    """

    closed: bool
    two_manifold: bool
    self_intersections: int
    duplicate_vertices: int
    unreferenced_vertices: int
    degenerate_faces: int
    components: int
    within_bounds: bool | None = None

    @property
    def is_sound(self) -> bool:
        """Whether there is a mesh and nothing is wrong with it, wherever it lies."""
        return not _unsound(asdict(self))

    @property
    def ok(self) -> bool:
        """Whether there is a mesh, nothing is wrong with it, and it stays in its bounds."""
        return not faults(asdict(self))

    def as_dict(self) -> dict[str, bool | int]:
        """All findings, `ok` among them; what isn't known is left out."""
        known = {name: value for name, value in asdict(self).items() if value is not None}
        return {**known, "ok": self.ok}


def faults(check: Mapping[str, bool | int]) -> list[str]:
    """What a check found wrong, in words; empty where nothing is.

    Parameters
    ----------
    check
        As `CheckReport.as_dict` gives it, and abstraction.json holds it.
    """
    found = _unsound(check)
    if check.get("within_bounds") is False:
        found.append("leaves the bounding box of its input")
    return found


def _unsound(check: Mapping[str, bool | int]) -> list[str]:
    found = []
    if not check.get("components"):
        found.append("empty")
    if not check.get("closed"):
        found.append("not closed")
    if not check.get("two_manifold"):
        found.append("not two-manifold")
    counted = (
        *("self_intersections", "duplicate_vertices", "unreferenced_vertices"),
        "degenerate_faces",
    )
    found += [f"{check[name]} {name.replace('_', ' ')}" for name in counted if check.get(name)]
    return found


def check(
    vertices: Float32, faces: NDArray[np.integer], extent: Float64 | None = None
) -> CheckReport:
    """Check a mesh as it is written.

    Parameters
    ----------
    vertices : (V, 3) float32
    faces : (F, 3) int
    extent : (3,) float64, optional
        Sides of the input's bounding box, about the origin.

    Returns
    -------
    CheckReport
        An empty mesh is not ok: it has no components.

    Raises
    ------
    ValueError
        The vertices are not float32 (they would be rounded after the check) or not finite,
        or a face names a vertex that does not exist.
    """
    if vertices.dtype != np.float32 or not np.isfinite(vertices).all():
        raise ValueError("check needs the vertices as they are written: finite and float32")
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise ValueError(f"a face names a vertex outside 0..{len(vertices) - 1}")
    within = None
    if extent is not None:
        within = bool(np.all(np.abs(vertices.astype(np.float64)) <= extent / 2 + BEYOND))
    if not len(faces):
        return CheckReport(True, True, 0, 0, len(vertices), 0, 0, within)

    # It takes a second to load and 80 MB; most of the package does without.
    import pymeshlab

    exact = vertices.astype(np.float64)
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(exact, faces.astype(np.int32)))
    topology = meshes.get_topological_measures()
    meshes.compute_selection_by_self_intersections_per_face()
    crossing = meshes.current_mesh().selected_face_number()
    a, b, c = (exact[faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    close = cKDTree(exact).query_pairs(APART, p=np.inf, output_type="ndarray")
    return CheckReport(
        closed=topology["boundary_edges"] == 0,
        two_manifold=bool(topology["is_mesh_two_manifold"]),
        self_intersections=int(crossing),
        duplicate_vertices=len(np.unique(close[:, 1])),
        unreferenced_vertices=int(topology["unreferenced_vertices"]),
        degenerate_faces=int(np.count_nonzero(area == 0)),
        components=int(topology["connected_components_number"]),
        within_bounds=within,
    )
