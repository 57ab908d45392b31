from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from torch import Tensor

from pnabs import settings
from pnabs.geometry.types import THETA_D, grid_points
from pnabs.model import cuboids as geometry
from pnabs.model import losses
from pnabs.model.data import Batch
from pnabs.model.field import interpolate
from pnabs.model.losses import TERMS, View, active_terms
from tests.model.shapes import CHAIR, box_sdf, boxes_sdf, matrix, random_cuboids

TRAINING = settings.Training(cuboid_samples=2000, shape_samples=200, occupancy_samples=200)
BATCH, COUNT = 2, 3


@pytest.fixture
def batch(rng: np.random.Generator) -> Batch:
    grid = grid_points(32)
    sdf = torch.from_numpy(boxes_sdf(grid, CHAIR)).view(1, 1, 32, 32, 32).repeat(2, 1, 1, 1, 1)
    picks = rng.integers(len(grid), size=(BATCH, 200))
    cells = grid[picks]
    points = rng.uniform(-0.5, 0.5, (BATCH, 200, 3))
    return Batch(
        occupancy=(sdf < 0).double(),
        sdf=sdf,
        points=torch.from_numpy(points),
        cells=torch.from_numpy(cells),
        inside=(sdf[0].flatten()[torch.from_numpy(picks)] < 0).double(),
        mirror=torch.tensor([0, 2]),
        shape_interior=torch.from_numpy(rng.uniform(-0.3, 0.3, (BATCH, 50, 3))),
    )


@pytest.fixture
def cuboids(rng: np.random.Generator) -> Tensor:
    return random_cuboids(rng, BATCH, COUNT)


def view(batch: Batch, *steps: Tensor, progress: float = 0.5, seed: int = 0) -> View:
    return View(steps, batch, TRAINING, progress, torch.Generator().manual_seed(seed))


def distance_to(c: np.ndarray, points: np.ndarray) -> np.ndarray:
    local = (points - c[7:]) @ matrix(c)
    return box_sdf(local, -c[:3] / 2, c[:3] / 2).clip(0)


def test_fit1_is_the_mean_over_the_volume(
    batch: Batch, cuboids: Tensor, rng: np.random.Generator
) -> None:
    """Against 4,000 numpy samples drawn in proportion to the cuboids' volumes."""
    found = float(losses.fit1(view(batch, cuboids)))
    each = []
    for row in cuboids.numpy():
        share = row[:, :3].prod(axis=1)
        picks = rng.choice(COUNT, 4000, p=share / share.sum())
        unit = rng.uniform(-0.5, 0.5, (4000, 3))
        rotations = np.array([matrix(c) for c in row])[picks]
        points = np.einsum("pij,pj->pi", rotations, unit * row[picks, :3]) + row[picks, 7:]
        each.append((boxes_sdf(points, CHAIR).clip(0) ** 2).mean())
    assert found == pytest.approx(np.mean(each), rel=0.05)


def test_fit1_point_by_point(batch: Batch, rng: np.random.Generator) -> None:
    """On its own draws, so to the last digits: small shapes count as much as large ones."""
    cuboids = random_cuboids(rng, BATCH, COUNT)
    cuboids[1, :, :3] *= 0.3
    found = float(losses.fit1(view(batch, cuboids, seed=3)))
    points = geometry.sample_volume(cuboids, 2000, torch.Generator().manual_seed(3))
    signed = interpolate(batch.sdf, points.flatten(1, 2)).view(points.shape[:3]).numpy()
    squares = np.maximum(signed, 0) ** 2
    assert (squares > 0).any()
    volume = cuboids[..., :3].prod(dim=-1).numpy()
    each = (volume * squares.mean(axis=2)).sum(axis=1) / volume.sum(axis=1)
    assert found == pytest.approx(each.mean(), rel=1e-6)


def test_fit1_vanishes_inside_the_shape(batch: Batch) -> None:
    low, high = (np.array(corner) for corner in CHAIR[0])
    vector = np.concatenate([(high - low) * 0.3, [1, 0, 0, 0], (low + high) / 2])
    inside = torch.from_numpy(np.tile(vector, (BATCH, 1, 1)))
    assert float(losses.fit1(view(batch, inside))) == 0


def test_fit2_is_the_mean_squared_distance(batch: Batch, cuboids: Tensor) -> None:
    each = [
        np.min([distance_to(c, points) for c in row], axis=0) ** 2
        for row, points in zip(cuboids.numpy(), batch.points.numpy(), strict=True)
    ]
    assert float(losses.fit2(view(batch, cuboids))) == pytest.approx(np.mean(each))


def lattice_points(c: np.ndarray, flip: int | None = None) -> np.ndarray:
    axis = [-0.5, 0.0, 0.5]
    unit = np.array([[x, y, z] for x in axis for y in axis for z in axis])
    points = (unit * c[:3]) @ matrix(c).T + c[7:]
    if flip is not None:
        points[:, flip] *= -1
    return points


def chamfer(a: np.ndarray, b: np.ndarray) -> float:
    there, back = cKDTree(b).query(a)[0], cKDTree(a).query(b)[0]
    return float((there**2).mean() + (back**2).mean())


def near_mirror_pairs(rng: np.random.Generator) -> Tensor:
    """Two cuboids and slightly disturbed mirror images of them in x, shuffled, twice."""
    one = random_cuboids(rng, BATCH, 2)
    one[..., 7] = one[..., 7].abs() + 0.2
    other = one.clone()
    other[..., 5:7] *= -1
    other[..., 7] *= -1
    other += torch.from_numpy(rng.normal(0, 0.005, other.shape))
    other[..., 3:7] /= other[..., 3:7].norm(dim=-1, keepdim=True)
    return torch.cat([one, other], dim=1)[:, [2, 0, 1, 3]]


def test_symmetry_against_all_pairs(batch: Batch, rng: np.random.Generator) -> None:
    cuboids = near_mirror_pairs(rng)
    batch.mirror[:] = 0
    expected = [
        min(chamfer(lattice_points(c), lattice_points(d, flip=0)) for d in row)
        for row in cuboids.numpy()
        for c in row
    ]
    assert float(losses.symmetry(view(batch, cuboids))) == pytest.approx(np.mean(expected))


def test_symmetry_is_zero_for_mirror_twins_however_they_name_their_axes(
    batch: Batch, rng: np.random.Generator
) -> None:
    one = random_cuboids(rng, BATCH, 1)
    other = one.clone()
    other[0, :, 5:7] *= -1
    other[0, :, 7] *= -1
    other[1, :, [4, 5]] *= -1
    other[1, :, 9] *= -1
    # The same sets, with local axes in another order: a quarter turn about local z.
    turn = Rotation.from_euler("z", 90, degrees=True)
    for b in range(BATCH):
        own = Rotation.from_quat(other[b, 0, 3:7].numpy(), scalar_first=True)
        turned = (own * turn).as_quat(scalar_first=True)
        other[b, 0, 3:7] = torch.from_numpy(turned)
        other[b, 0, :2] = other[b, 0, [1, 0]]
    pair = torch.cat([one, other], dim=1)
    assert float(losses.symmetry(view(batch, pair))) < 1e-20
    batch.mirror[:] = 1
    assert float(losses.symmetry(view(batch, pair))) > 1e-4


def test_asymmetric_shapes_have_no_symmetry_loss(batch: Batch, cuboids: Tensor) -> None:
    batch.mirror[:] = -1
    assert float(losses.symmetry(view(batch, cuboids))) == 0
    assert float(losses.conditional_symmetry(view(batch, cuboids))) == 0


def test_self_overlap_of_axis_aligned_boxes() -> None:
    vectors = torch.tensor([[[0.6, 0.2, 0.2, 1, 0, 0, 0, x, 0, 0] for x in (0, 0.1, 0.2, 0.31)]])
    found = losses.self_overlap(vectors, torch.tensor([0]))
    expected = [1, 0.4 / 0.8, 0.2 / 1.0, 0]
    np.testing.assert_allclose(found[0], expected, atol=0.02)


def test_self_overlap_of_turned_boxes(batch: Batch, rng: np.random.Generator) -> None:
    """Against 20,000 uniform points of each box."""
    cuboids = random_cuboids(rng, BATCH, 10)
    cuboids[..., 7:] *= 0.3
    found = losses.self_overlap(cuboids, batch.mirror).numpy()
    assert ((found > 0.1) & (found < 0.9)).sum() > 5
    for b, n in np.ndindex(BATCH, 10):
        c = cuboids[b, n].numpy()
        points = rng.uniform(-0.5, 0.5, (20_000, 3)) * c[:3] @ matrix(c).T + c[7:]
        points[:, batch.mirror[b]] *= -1
        inside = (distance_to(c, points) == 0).mean()
        assert found[b, n] == pytest.approx(inside / (2 - inside), abs=0.06)


@pytest.mark.parametrize("alpha", [0.1, 0.3, 0.6])
@pytest.mark.parametrize("offset", [0.02, 0.0655, 0.0775, 0.11])
def test_conditional_symmetry_leaves_out_what_overlaps_more_than_alpha(
    batch: Batch, offset: float, alpha: float
) -> None:
    box = torch.tensor([[[0.25, 0.2, 0.2, 1, 0, 0, 0, offset, 0, 0]]] * BATCH, dtype=torch.float64)
    iou = (0.25 - 2 * offset) / (0.25 + 2 * offset)
    training = TRAINING.model_copy(update={"symmetry_alpha": alpha})
    seen = View((box,), batch, training, 0.5, torch.Generator())
    assert (float(losses.conditional_symmetry(seen)) > 0) == (iou <= alpha)


def test_conditional_symmetry_counts_only_cuboids_apart_from_their_image(batch: Batch) -> None:
    batch.mirror[:] = 0
    middle = torch.tensor([0.3, 0.2, 0.2, 1, 0, 0, 0, 0.02, 0, 0])
    aside = torch.tensor([0.1, 0.2, 0.2, 1, 0, 0, 0, 0.4, 0, 0])
    both = torch.stack([middle, aside]).double().repeat(BATCH, 1, 1)
    images = [lattice_points(c, flip=0) for c in both[0].numpy()]
    expected = min(chamfer(lattice_points(both[0, 1].numpy()), image) for image in images) / 2
    found = float(losses.conditional_symmetry(view(batch, both)))
    assert found == pytest.approx(expected)
    assert float(losses.symmetry(view(batch, both))) > found


def test_rotation_angle(rng: np.random.Generator) -> None:
    a, b = (Rotation.random(50, rng=rng) for _ in range(2))
    expected = (a.inv() * b).magnitude()
    quaternions = [torch.from_numpy(r.as_quat(scalar_first=True)) for r in (a, b)]
    np.testing.assert_allclose(losses.rotation_angle(*quaternions), expected, atol=1e-9)
    np.testing.assert_allclose(
        losses.rotation_angle(quaternions[0], -quaternions[1]), expected, atol=1e-9
    )


def test_regularisation_by_hand(batch: Batch) -> None:
    turn = math.radians(30)
    start = [0.2, 0.2, 0.2, 1.0, 0, 0, 0, 0, 0, 0]
    moved = [0.2, 0.2, 0.2, 1.0, 0, 0, 0, 0.03, 0.04, 0]
    grown = [0.2, 0.21, 0.2, math.cos(turn / 2), math.sin(turn / 2), 0, 0, 0.03, 0.04, 0]
    steps = [torch.tensor([[c]] * BATCH, dtype=torch.float64) for c in (start, moved, grown)]
    expected = ((0.05 - 0.02) ** 2 + math.radians(10) ** 2) / 2
    assert float(losses.regularisation(view(batch, *steps))) == pytest.approx(expected)


def test_regularisation_against_numpy(batch: Batch, rng: np.random.Generator) -> None:
    """Several cuboids and iterations, each term above its own threshold, angles from traces."""
    training = TRAINING.model_copy(
        update={"theta_scale": 0.03, "theta_translation": 0.05, "theta_rotation": 10.0}
    )
    steps = [random_cuboids(rng, BATCH, 4)]
    for _ in range(3):
        after = steps[-1] + torch.from_numpy(rng.normal(0, 0.06, (BATCH, 4, 10)))
        after[..., 3:7] /= after[..., 3:7].norm(dim=-1, keepdim=True)
        steps.append(after)
    steps[1][0, 0, 3:7] *= -1  # the same rotation
    excess = []
    for before, after in pairwise(step.numpy() for step in steps):
        for b, n in np.ndindex(BATCH, 4):
            old, new = before[b, n], after[b, n]
            cos = (np.trace(matrix(old).T @ matrix(new)) - 1) / 2
            excess.append(
                [
                    np.linalg.norm(new[:3] - old[:3]) - 0.03,
                    np.linalg.norm(new[7:] - old[7:]) - 0.05,
                    math.acos(cos) - math.radians(10),
                ]
            )
    above = np.maximum(excess, 0)
    assert (above > 0).any(axis=0).all()
    assert (above == 0).any()
    found = losses.regularisation(View(tuple(steps), batch, training, 0.5, torch.Generator()))
    assert float(found) == pytest.approx((above**2).sum(axis=1).mean())


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rotation_angle_has_a_finite_gradient_at_zero(sign: float) -> None:
    q = torch.tensor([0.5, 0.5, -0.5, 0.5])
    after = (sign * q).requires_grad_()
    angle = losses.rotation_angle(q, after)
    angle.backward()  # type: ignore[no-untyped-call]
    assert float(angle.detach()) == 0
    assert after.grad is not None
    assert torch.isfinite(after.grad).all()


def test_separation_point_by_point(batch: Batch, cuboids: Tensor) -> None:
    assert batch.shape_interior is not None
    each = [
        max(THETA_D - d, 0.0)
        for row, points in zip(cuboids.numpy(), batch.shape_interior.numpy(), strict=True)
        for c in row
        for d in distance_to(c, points)
    ]
    assert float(losses.separation(view(batch, cuboids))) == pytest.approx(np.mean(each))


def test_separation_says_what_it_needs(batch: Batch, cuboids: Tensor) -> None:
    values = {name: getattr(batch, name) for name in Batch.__dataclass_fields__}
    without = Batch(**{**values, "shape_interior": None})
    with pytest.raises(ValueError, match="shape_interior"):
        losses.separation(view(without, cuboids))


def test_occupancy_by_hand(batch: Batch, cuboids: Tensor) -> None:
    found = float(losses.occupancy(view(batch, cuboids, progress=0.0)))
    entropies, ious = [], []
    for row, cells, inside in zip(
        cuboids.numpy(), batch.cells.numpy(), batch.inside.numpy(), strict=True
    ):
        signed = np.min(
            [box_sdf((cells - c[7:]) @ matrix(c), -c[:3] / 2, c[:3] / 2) for c in row], axis=0
        )
        share = 1 / (1 + np.exp(signed / 0.03))
        right = np.where(inside > 0, share, 1 - share)
        entropies.append(-np.log(right).mean())
        ious.append((share * inside).sum() / (share + inside - share * inside).sum())
    assert found == pytest.approx(np.mean(entropies) + 1 - np.mean(ious))


def test_temperature_falls_from_warm_to_cold() -> None:
    assert losses.temperature(0) == pytest.approx(0.03)
    assert losses.temperature(0.5) == pytest.approx(0.015)
    assert losses.temperature(1) == pytest.approx(0.0075)


@pytest.mark.parametrize("name", sorted(TERMS))
def test_gradients_by_finite_differences(
    name: str, batch: Batch, cuboids: Tensor, rng: np.random.Generator
) -> None:
    quick = settings.Training(cuboid_samples=5)
    first = near_mirror_pairs(rng)[:1] if "symmetry" in name else cuboids[:1]
    second = first + torch.from_numpy(rng.normal(0, 0.1, first.shape))
    one = Batch(
        **{
            field: None if getattr(batch, field) is None else getattr(batch, field)[:1]
            for field in Batch.__dataclass_fields__
        }
    )

    def value(before: Tensor, after: Tensor) -> Tensor:
        generator = torch.Generator().manual_seed(1)
        return TERMS[name].value(View((before, after), one, quick, 0.2, generator))

    leaves = tuple(t.clone().requires_grad_() for t in (first, second))
    assert torch.autograd.gradcheck(value, leaves, atol=1e-5, rtol=1e-3)


def test_terms_of_each_phase() -> None:
    weights = settings.LossWeights(occupancy=0)
    names = {
        (module, phase): set(active_terms(module, phase, weights))
        for module in losses.MODULES
        for phase in losses.PHASES
    }
    initial = {"fit1", "fit2", "symmetry"}
    refinement = {"fit1", "fit2", "conditional_symmetry", "regularisation"}
    assert names["positive", "initial"] == initial
    assert names["positive", "refinement"] == refinement
    assert names["negative", "initial"] == initial | {"separation"}
    assert names["negative", "refinement"] == refinement | {"separation"}
    with_ours = active_terms("positive", "initial", settings.LossWeights(occupancy=0.5))
    assert with_ours["occupancy"] == 0.5


def test_every_weight_has_its_term() -> None:
    assert {term.weight for term in TERMS.values()} == set(settings.LossWeights.model_fields)
