from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from pnabs import settings
from pnabs.geometry.types import cell_centres, grid_points
from pnabs.model.data import Batch, TrainingSet, mirrored, turned
from pnabs.model.field import interpolate
from tests.model.shapes import training_set

TRAINING = settings.Training(
    shape_samples=40, occupancy_samples=80, mirror_augment=False, turn=0, stretch=0
)
ROWS = np.array([3, 0, 0])


def draw(data: TrainingSet, training: settings.Training = TRAINING, seed: int = 0) -> Batch:
    return data.batch(ROWS, training, torch.Generator().manual_seed(seed))


def test_shapes_and_values(five: TrainingSet) -> None:
    batch = draw(five)
    grid = (3, 1, 32, 32, 32)
    assert batch.occupancy.shape == batch.sdf.shape == grid
    assert batch.points.shape == (3, 40, 3)
    assert batch.cells.shape == (3, 80, 3)
    assert batch.inside.shape == (3, 80)
    assert batch.shape_interior is not None
    assert batch.shape_interior.shape == (3, 40, 3)
    assert torch.equal(batch.occupancy, (batch.sdf < 0).float())
    assert not torch.equal(batch.occupancy[0], batch.occupancy[1])
    assert torch.equal(batch.occupancy[1], batch.occupancy[2])
    assert not torch.equal(batch.points[1], batch.points[2])


def test_points_are_half_surface_half_interior(five: TrainingSet) -> None:
    batch = draw(five)
    signed = interpolate(batch.sdf, batch.points)
    assert signed[:, :20].abs().max() < 0.02
    assert (signed[:, 20:] < 0).all()
    assert signed[:, 20:].mean() < -0.02


def test_cells_carry_their_own_bit(five: TrainingSet) -> None:
    batch = draw(five)
    axis = cell_centres(32)
    index = [np.abs(batch.cells.numpy()[..., k, None] - axis).argmin(-1) for k in range(3)]
    for k in range(3):
        np.testing.assert_allclose(batch.cells[..., k], axis[index[k]], atol=1e-6)
    bits = batch.occupancy.numpy()[np.arange(3)[:, None], 0, index[0], index[1], index[2]]
    np.testing.assert_array_equal(batch.inside, bits)
    near = interpolate(batch.sdf, batch.cells)[:, :40].abs()
    assert near.max() < 2.7 * np.sqrt(3) * 1.1 / 32
    assert batch.cells[:, 40:].abs().max() > 0.4


def test_draws_depend_on_the_generator_alone(five: TrainingSet) -> None:
    first, again, other = draw(five), draw(five), draw(five, seed=1)
    assert torch.equal(first.points, again.points)
    assert torch.equal(first.cells, again.cells)
    assert not torch.equal(first.points, other.points)


def test_mirrored_batch_is_consistent() -> None:
    boxes = (((0.1, -0.3, 0.0), (0.4, 0.1, 0.5)),)
    data = replace(training_set([boxes] * 4), mirror=np.array([0, 1, 2, -1], dtype=np.int8))
    batch = data.batch(np.arange(4), TRAINING, torch.Generator().manual_seed(0))
    image = mirrored(batch, batch.mirror)
    for axis in range(3):
        expected = batch.occupancy[axis].flip(1 + axis)
        assert torch.equal(image.occupancy[axis], expected)
        assert not torch.equal(image.occupancy[axis], batch.occupancy[axis])
    assert torch.equal(image.sdf[3], batch.sdf[3])
    # Samples and field are mirrored alike: the field at the samples stays.
    for name in ("points", "cells", "shape_interior"):
        before = interpolate(batch.sdf, getattr(batch, name))
        after = interpolate(image.sdf, getattr(image, name))
        np.testing.assert_allclose(after, before, atol=1e-5)


def test_turned_batch_is_the_turned_box() -> None:
    low, high = np.array([-0.1, -0.3, -0.2]), np.array([0.3, 0.2, 0.0])
    data = replace(
        training_set([[(tuple(low), tuple(high))]] * 3), mirror=np.zeros(3, dtype=np.int8)
    )
    batch = data.batch(np.arange(3), TRAINING, torch.Generator().manual_seed(0))
    degrees, stretch = np.array([30.0, -20.0, 0.0]), np.array([[1, 1, 1], [0.8, 1.2, 1], [1, 1, 1]])
    found = turned(batch, torch.tensor(degrees).float(), torch.tensor(stretch).float())
    for row in range(3):
        # The farthest coordinate, here of y, stays as far.
        farthest = batch.points[row].abs().amax(dim=0).numpy()
        factor = stretch[row] * farthest.max() / (stretch[row] * farthest).max()
        angle = np.deg2rad(degrees[row])
        about_y = np.array(
            [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
        )
        forth = about_y @ np.diag(factor)
        expected = batch.points[row].numpy() @ forth.T
        np.testing.assert_allclose(found.points[row], expected, atol=1e-6)
        # A cell of the result is occupied where its place in the box as it was is.
        own = grid_points(32) @ np.linalg.inv(forth).T
        depth = np.minimum(own - low, high - own).min(axis=1)
        sure = np.abs(depth) > 0.02  # a cell's half diagonal, and nearest neighbours
        occupied = found.occupancy[row].numpy().ravel().astype(bool)
        assert (depth > 0.03).sum() > 100
        np.testing.assert_array_equal(
            occupied[np.abs(depth) > 0.04], depth[np.abs(depth) > 0.04] > 0
        )
        assert (occupied == (depth > 0))[sure].mean() > 0.99
    assert found.mirror.tolist() == [-1, -1, 0]
    assert torch.equal(found.occupancy[2], batch.occupancy[2])
    # Turns keep distances: the field at turned samples is what it was.
    before, after = (interpolate(b.sdf, b.points)[0] for b in (batch, found))
    np.testing.assert_allclose(after, before, atol=0.02)
    assert found.shape_interior is not None
    assert (interpolate(found.sdf, found.shape_interior)[0] < 0.01).all()
    index = ((found.cells / 1.1 + 0.5) * 32).long()
    bits = found.occupancy[torch.arange(3)[:, None], 0, index[..., 0], index[..., 1], index[..., 2]]
    assert torch.equal(found.inside, bits)


def test_half_of_the_shapes_are_turned(five: TrainingSet) -> None:
    training = TRAINING.model_copy(update={"turn": 15.0})
    rows = np.zeros(200, dtype=np.int64)
    plain = five.batch(rows, TRAINING, torch.Generator().manual_seed(0))
    batch = five.batch(rows, training, torch.Generator().manual_seed(0))
    kept = (batch.points == plain.points).all(dim=(1, 2))
    assert 70 < int(kept.sum()) < 130
    # Only directions change: distances to the axis +Y and heights stay.
    np.testing.assert_array_equal(batch.points[..., 1], plain.points[..., 1])
    radii = [points[..., [0, 2]].norm(dim=-1) for points in (batch.points, plain.points)]
    np.testing.assert_allclose(*radii, atol=1e-6)


def test_augmentation_mirrors_about_every_other_shape() -> None:
    boxes = (((0.1, -0.3, 0.0), (0.4, 0.1, 0.5)),)
    data = training_set([boxes])
    training = TRAINING.model_copy(update={"mirror_augment": True})
    generator = torch.Generator().manual_seed(0)
    batch = data.batch(np.zeros(200, dtype=np.int64), training, generator)
    left = batch.occupancy[:, 0, :16].sum(dim=(1, 2, 3)) > 0
    assert 70 < int(left.sum()) < 130


def test_mean_occupancy(five: TrainingSet) -> None:
    volumes = np.unpackbits(five.occupancy, axis=1).reshape(-1, 32, 32, 32)
    np.testing.assert_allclose(five.mean_occupancy(), volumes.mean(axis=0))


def test_size_is_about_100_kb_a_model() -> None:
    count = 4
    data = TrainingSet(
        occupancy=np.zeros((count, 4096), np.uint8),
        sdf=np.zeros((count, 32, 32, 32), np.float16),
        surface=np.zeros((count, 3000, 3), np.float16),
        interior=np.zeros((count, 2048, 3), np.float16),
        mirror=np.zeros(count, np.int8),
    )
    assert data.nbytes == count * (4096 + 65536 + 18000 + 12288 + 1)


def test_rows_must_agree(five: TrainingSet) -> None:
    with pytest.raises(ValueError, match="mirror has 4 rows"):
        replace(five, mirror=five.mirror[:4])


def test_batch_moves_as_a_whole(five: TrainingSet) -> None:
    moved = draw(five).to("meta")
    assert moved.points.device.type == moved.mirror.device.type == "meta"
    assert draw(replace(five, shape_interior=None)).to("meta").shape_interior is None
