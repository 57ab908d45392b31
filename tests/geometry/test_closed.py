"""Which meshes have an exact solid, and why others have none."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from pnabs.geometry.closed import closed_components, closed_solid
from pnabs.geometry.types import Mesh
from pnabs.geometry.weld import weld
from tests.geometry.known_shapes import block, inverted, joined, of_blocks, turned


def solid_volume(mesh: Mesh) -> float:
    solid, why = closed_solid(weld(mesh))
    assert why == ""
    assert solid is not None
    return float(solid.volume())


def test_overlapping_parts_are_united() -> None:
    mesh = of_blocks(block(0.4, 0.4, 0.4), block(0.4, 0.4, 0.4, (0.2, 0, 0)))
    assert solid_volume(mesh) == pytest.approx(0.6 * 0.4 * 0.4)


@pytest.mark.parametrize("turn", [lambda mesh: mesh, turned])
def test_parts_that_touch_along_an_edge_stay_closed(turn: object) -> None:
    """Four faces share the edge once it is welded; it belongs to two boxes all the same."""
    mesh = of_blocks(block(0.2, 0.2, 0.2), block(0.2, 0.2, 0.2, (0.2, 0.2, 0)))
    assert solid_volume(turn(mesh)) == pytest.approx(2 * 0.2**3)


def test_many_parts_that_share_edges() -> None:
    """Boards of a tray: some faces have only edges that four faces share."""
    boards = [
        block(0.4, 0.02, 0.4, (0, 0.01, 0)),
        *(block(0.02, 0.2, 0.4, (x, 0.1, 0)) for x in (-0.19, 0.19)),
        *(block(0.4, 0.2, 0.02, (0, 0.1, z)) for z in (-0.19, 0.19)),
    ]
    expected = 0.4 * 0.4 * 0.2 - 0.36 * 0.36 * 0.18
    assert solid_volume(of_blocks(*boards)) == pytest.approx(expected)


def test_cavity_and_inward_part() -> None:
    outer, inner = block(0.6, 0.6, 0.6), block(0.2, 0.2, 0.2)
    hollow = joined(outer.mesh(), inverted(inner.mesh()))
    assert solid_volume(hollow) == pytest.approx(0.6**3 - 0.2**3)
    beside = inverted(block(0.2, 0.2, 0.2, (0.5, 0, 0)).mesh())
    assert solid_volume(joined(outer.mesh(), beside)) == pytest.approx(0.6**3 + 0.2**3)
    # half in, half out: no cavity
    across = inverted(block(0.2, 0.2, 0.2, (0.3, 0, 0)).mesh())
    assert solid_volume(joined(outer.mesh(), across)) == pytest.approx(0.6**3 + 0.2**3 / 2)


def test_all_inward_is_turned_outward() -> None:
    assert solid_volume(inverted(block(0.3, 0.3, 0.3).mesh())) == pytest.approx(0.3**3)


def test_double_sided_faces_are_dropped_before() -> None:
    box = block(0.3, 0.3, 0.3).mesh()
    assert solid_volume(joined(box, inverted(box))) == pytest.approx(0.3**3)


def test_why_there_is_none() -> None:
    box = block(0.3, 0.3, 0.3).mesh()
    assert closed_solid(Mesh(box.vertices, box.faces[1:]))[1] == "open"
    assert closed_solid(Mesh(box.vertices, box.faces[:0]))[1] == "empty"
    one_turned = box.faces.copy()
    one_turned[0] = one_turned[0, ::-1]
    assert closed_solid(Mesh(box.vertices, one_turned))[1] == "refused"
    # closed, but nothing is in it
    flat = Mesh(box.vertices * [1, 0, 1], box.faces)
    assert closed_solid(flat)[1] == "open"
    # one open part among closed ones leaves no exact volume
    assert closed_solid(joined(box, Mesh(box.vertices + 1, box.faces[1:])))[1] == "open"


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 6))
@settings(max_examples=20, deadline=None)
def test_volume_is_that_of_the_union(seed: int, count: int) -> None:
    """Against the union's cells on a fine lattice."""
    rng = np.random.default_rng(seed)
    blocks = [
        block(*rng.uniform(0.1, 0.4, 3), tuple(rng.uniform(-0.25, 0.25, 3))) for _ in range(count)
    ]
    found = solid_volume(of_blocks(*blocks))
    axis = (np.arange(120) + 0.5) / 120 - 0.5
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    inside = np.zeros(grid.shape[:3], dtype=bool)
    for one in blocks:
        inside |= np.all((grid >= one.low) & (grid <= one.high), axis=-1)
    assert found == pytest.approx(inside.mean(), abs=0.01)


def test_components_of_a_torus_and_a_ball() -> None:
    parts = [trimesh.creation.torus(0.3, 0.1), trimesh.creation.icosphere(2, 0.1)]
    mesh = joined(*(Mesh(np.array(p.vertices), np.array(p.faces)) for p in parts))
    label = closed_components(mesh.faces)
    assert label is not None
    assert np.bincount(label).tolist() == [len(part.faces) for part in parts]
