from __future__ import annotations

import numpy as np
import pytest
import torch

from pnabs import settings
from pnabs.geometry.types import grid_points
from pnabs.model.data import TrainingSet
from pnabs.model.network import CuboidNetwork
from pnabs.model.objective import Module, Objective, Phase, make_optimizer
from pnabs.model.predict import predict
from pnabs.model.start import start_points
from pnabs.model.trainer import epoch_order, train_epoch
from tests.model.shapes import box_sdf, matrix

NETWORK = settings.Network(channels=(2, 2, 4, 4, 8), hidden=16)
TRAINING = settings.Training(
    epochs=2, batch_size=2, shape_samples=20, cuboid_samples=4, occupancy_samples=20
)


def run(
    data: TrainingSet, module: Module = "positive", phase: Phase = "initial", seed: int = 0
) -> tuple[CuboidNetwork, list[dict[str, float]]]:
    network = CuboidNetwork(2, NETWORK, torch.tensor([[-0.1, 0, 0], [0.1, 0, 0]]))
    objective = Objective(network, module, phase, TRAINING)
    optimizer = make_optimizer(objective, TRAINING)
    losses = [
        train_epoch(
            objective,
            optimizer,
            data,
            epoch_order(len(data), epoch, seed),
            TRAINING,
            epoch=epoch,
            seed=seed,
        )
        for epoch in range(2)
    ]
    return network, losses


@pytest.mark.parametrize(("module", "phase"), [("positive", "initial"), ("negative", "refinement")])
def test_same_seed_same_bits(module: Module, phase: Phase, five: TrainingSet) -> None:
    (first, losses), (again, same) = (run(five, module, phase) for _ in range(2))
    assert losses == same
    states = zip(first.state_dict().values(), again.state_dict().values(), strict=True)
    assert all(torch.equal(a, b) for a, b in states)
    assert run(five, module, phase, seed=1)[1] != losses


def test_means_are_finite_and_complete(five: TrainingSet) -> None:
    _, losses = run(five, "negative", "initial")
    assert set(losses[0]) == {"fit1", "fit2", "symmetry", "separation", "occupancy", "total"}
    assert all(np.isfinite(list(epoch.values())).all() for epoch in losses)


def test_progress_and_rate_follow_the_steps(five: TrainingSet) -> None:
    """Five rows in batches of two: two steps an epoch, of three and two rows."""
    network = CuboidNetwork(2, NETWORK, torch.zeros((2, 3)))
    objective = Objective(network, "positive", "initial", TRAINING)
    optimizer = make_optimizer(objective, TRAINING)
    seen: list[tuple[int, float, float]] = []
    objective.register_forward_pre_hook(
        lambda _, args: seen.append(
            (len(args[0].occupancy), args[1], optimizer.param_groups[0]["lr"])
        )
    )
    train_epoch(objective, optimizer, five, np.arange(5), TRAINING, epoch=1, seed=0)
    assert [(rows, progress) for rows, progress, _ in seen] == [(3, 0.5), (2, 0.75)]
    assert [rate for *_, rate in seen] == pytest.approx(
        [0.001 * 0.5, 0.001 * (1 - np.sqrt(0.5)) / 2]
    )


@pytest.mark.parametrize(("count", "world"), [(10, 1), (10, 2), (11, 2), (3, 4)])
def test_epoch_order_shares_all_rows(count: int, world: int) -> None:
    shares = [epoch_order(count, 5, 0, rank, world) for rank in range(world)]
    assert len({len(share) for share in shares}) == 1
    together = np.concatenate(shares)
    assert len(together) < count + world
    assert set(together) == set(range(count))


def test_epoch_order_changes_with_epoch_and_seed() -> None:
    orders = {tuple(epoch_order(20, epoch, seed)) for epoch in range(3) for seed in range(3)}
    assert len(orders) == 9


def test_ranks_draw_different_samples(five: TrainingSet) -> None:
    def loss(rank: int) -> float:
        network = CuboidNetwork(2, NETWORK, torch.zeros((2, 3)))
        objective = Objective(network, "positive", "initial", TRAINING)
        optimizer = make_optimizer(objective, TRAINING)
        order = np.arange(4)
        options = {"epoch": 0, "seed": 0, "rank": rank, "world": 2}
        return train_epoch(objective, optimizer, five, order, TRAINING, **options)["fit2"]

    assert loss(0) == loss(0)
    assert loss(0) != loss(1)


def test_divergence_is_reported(five: TrainingSet) -> None:
    network = CuboidNetwork(2, NETWORK, torch.zeros((2, 3)))
    with torch.no_grad():
        network.initial_decoder.scale.bias.fill_(torch.nan)
    objective = Objective(network, "positive", "initial", TRAINING)
    optimizer = make_optimizer(objective, TRAINING)
    with pytest.raises(FloatingPointError, match=r"epoch 0, step 0.*learning_rate"):
        train_epoch(objective, optimizer, five, np.arange(5), TRAINING, epoch=0, seed=0)


def test_overfits_one_chair(chair: TrainingSet) -> None:
    """Both phases on one shape of four boxes: the losses fall and the volumes nearly agree."""
    training = settings.Training(
        epochs=10,
        batch_size=4,
        learning_rate=0.005,
        shape_samples=100,
        cuboid_samples=16,
        occupancy_samples=400,
        mirror_augment=False,
        turn=0,
        stretch=0,
    )
    start = start_points(chair.mean_occupancy(), 4)
    network = CuboidNetwork(4, NETWORK, start, torch.Generator().manual_seed(0))
    solid = np.unpackbits(chair.occupancy[0]).astype(bool)
    rows = np.zeros(40, dtype=np.int64)
    ious = []
    for phase in ("initial", "refinement"):
        if phase == "refinement":
            network.inherit_encoder()
        objective = Objective(network, "positive", phase, training)
        optimizer = make_optimizer(objective, training)
        totals = [
            train_epoch(objective, optimizer, chair, rows, training, epoch=epoch, seed=0)["total"]
            for epoch in range(training.epochs)
        ]
        assert totals[-1] < totals[0]
        iterations = training.iterations if phase == "refinement" else 0
        (found,) = predict(network, solid.reshape(1, 32, 32, 32), iterations)
        vectors = found.as_vector().astype(np.float64)
        inside = np.any(
            [
                box_sdf((grid_points(32) - c[7:]) @ matrix(c), -c[:3] / 2, c[:3] / 2) < 0
                for c in vectors
            ],
            axis=0,
        )
        ious.append((inside & solid).sum() / (inside | solid).sum())
    assert ious[0] > 0.9
    assert ious[1] > 0.95
