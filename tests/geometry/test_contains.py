"""Points in meshes, against the exact winding number."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from pnabs.geometry.columns import inside_votes, trace
from pnabs.geometry.contains import Insides
from pnabs.geometry.inside import winding_number
from pnabs.geometry.types import Mesh, grid_points
from tests.geometry.known_shapes import block, joined, of_blocks, turned


def as_mesh(made: trimesh.Trimesh) -> Mesh:
    return Mesh(np.array(made.vertices, dtype=np.float64), np.array(made.faces, dtype=np.int64))


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_closed_meshes_by_the_winding_number(seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    matrix *= np.sign(np.linalg.det(matrix))
    mesh = turned(as_mesh(trimesh.creation.torus(0.3, rng.uniform(0.05, 0.2), 17, 13)), matrix)
    points = rng.uniform(-0.55, 0.55, (400, 3))
    expected = winding_number(mesh.triangles, points) > 0.5
    inside = Insides(mesh.vertices, mesh.faces)
    np.testing.assert_array_equal(inside.in_closed(points), expected)
    np.testing.assert_array_equal(inside.votes(points) == 6, expected)


def test_votes_are_those_of_the_grid() -> None:
    """An open shape in two parts; the grid's lines are the points' own, moved by a hair."""
    box = block(0.7, 0.5, 0.6).mesh()
    mesh = joined(Mesh(box.vertices, box.faces[2:]), block(0.3, 0.9, 0.2, (0.1, 0, 0)).mesh())
    mesh = turned(mesh)
    signs = np.ones(len(mesh.faces), dtype=np.int8)
    expected = inside_votes(trace(mesh, 24), signs).reshape(-1)
    found = Insides(mesh.vertices, mesh.faces).votes(grid_points(24))
    assert np.mean(found == expected) > 0.999


def test_points_on_edges_and_corners_are_counted_once() -> None:
    """Rays through vertices and along edges of a modelled box."""
    mesh = of_blocks(block(0.5, 0.5, 0.5))
    axis = np.array([-0.4, -0.25, 0.0, 0.25, 0.4])
    points = np.stack(np.meshgrid(axis, axis, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    inside = Insides(mesh.vertices, mesh.faces).in_closed(points)
    strictly = np.all(np.abs(points) < 0.25, axis=1)
    outside = np.any(np.abs(points) > 0.25, axis=1)
    assert inside[strictly].all()
    assert not inside[outside].any()


def test_far_points_and_no_faces() -> None:
    mesh = block(0.5, 0.5, 0.5).mesh()
    points = np.array([[9.0, 0, 0], [0, -9.0, 0], [0, 0, 9.0], [-9, -9, -9]])
    assert not Insides(mesh.vertices, mesh.faces).in_closed(points).any()
    nothing = Insides(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
    assert not nothing.in_closed(points).any()


def test_many_large_faces_get_a_coarser_lattice(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = of_blocks(*(block(0.5 + k / 100, 0.5, 0.5) for k in range(20)))
    points = np.random.default_rng(0).uniform(-0.55, 0.55, (500, 3))
    fine = Insides(mesh.vertices, mesh.faces).votes(points)
    monkeypatch.setattr("pnabs.geometry.contains._MOST", 100)
    coarse = Insides(mesh.vertices, mesh.faces).votes(points)
    np.testing.assert_array_equal(coarse, fine)
