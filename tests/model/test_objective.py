from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from pnabs import settings
from pnabs.model.data import TrainingSet
from pnabs.model.network import CuboidNetwork
from pnabs.model.objective import (
    Module,
    Objective,
    Phase,
    learning_rate_factor,
    make_optimizer,
    set_learning_rate,
)

NETWORK = settings.Network(channels=(2, 2, 4, 4, 8), hidden=16)
TRAINING = settings.Training(
    shape_samples=20, cuboid_samples=4, occupancy_samples=20, mirror_augment=False
)


def build(module: Module, phase: Phase, training: settings.Training = TRAINING) -> Objective:
    network = CuboidNetwork(3, NETWORK, torch.linspace(-0.3, 0.3, 9).view(3, 3))
    return Objective(network, module, phase, training)


def forward(objective: Objective, data: TrainingSet) -> dict[str, torch.Tensor]:
    batch = data.batch(np.arange(4), TRAINING, torch.Generator().manual_seed(0))
    return objective(batch, 0.5, torch.Generator().manual_seed(1))  # type: ignore[no-any-return]


@pytest.mark.parametrize("module", ["positive", "negative"])
@pytest.mark.parametrize("phase", ["initial", "refinement"])
def test_every_trained_parameter_takes_part(
    module: Module, phase: Phase, five: TrainingSet
) -> None:
    objective = build(module, phase)
    forward(objective, five)["total"].backward()
    prefix = "refine_" if phase == "refinement" else "initial_"
    for name, parameter in objective.network.named_parameters():
        assert parameter.requires_grad == name.startswith(prefix), name
        assert (parameter.grad is not None) == parameter.requires_grad, name


@pytest.mark.parametrize("phase", ["initial", "refinement"])
def test_a_step_moves_only_what_the_phase_trains(phase: Phase, five: TrainingSet) -> None:
    objective = build("positive", phase)
    before = {k: v.clone() for k, v in objective.network.state_dict().items()}
    optimizer = make_optimizer(objective, TRAINING)
    forward(objective, five)["total"].backward()
    optimizer.step()
    prefix = "refine_" if phase == "refinement" else "initial_"
    for name, value in objective.network.state_dict().items():
        if name.startswith(prefix) and "trunk" not in name:
            assert not torch.equal(value, before[name]), name
        elif not name.startswith(prefix):
            assert torch.equal(value, before[name]), name


def test_total_is_the_weighted_sum(five: TrainingSet) -> None:
    weights = settings.LossWeights(fit1=2, fit2=3, symmetry=0, separation=5, occupancy=0.5)
    objective = build("negative", "initial", TRAINING.model_copy(update={"losses": weights}))
    values = {name: float(value.detach()) for name, value in forward(objective, five).items()}
    assert set(values) == {"fit1", "fit2", "separation", "occupancy", "total"}
    expected = (
        2 * values["fit1"]
        + 3 * values["fit2"]
        + 5 * values["separation"]
        + 0.5 * values["occupancy"]
    )
    assert values["total"] == pytest.approx(expected)


def test_samples_come_from_the_generator(five: TrainingSet) -> None:
    objective = build("positive", "refinement").eval()
    first, again = forward(objective, five), forward(objective, five)
    assert all(torch.equal(first[name], again[name]) for name in first)


def test_learning_rates_by_phase() -> None:
    optimizer = make_optimizer(build("positive", "initial"), TRAINING)
    assert [group["lr"] for group in optimizer.param_groups] == [0.001]
    objective = build("positive", "refinement")
    optimizer = make_optimizer(objective, TRAINING)
    rates = {
        id(parameter): group["lr"]
        for group in optimizer.param_groups
        for parameter in group["params"]
    }
    for name, parameter in objective.network.named_parameters():
        expected = {"refine_encoder": 1e-4, "refine_decoder": 1e-3}.get(name.split(".")[0])
        assert rates.get(id(parameter)) == expected
    set_learning_rate(optimizer, 0.5)
    assert sorted(group["lr"] for group in optimizer.param_groups) == [0.5e-4, 0.5e-3]
    set_learning_rate(optimizer, 1.0)
    assert sorted(group["lr"] for group in optimizer.param_groups) == [1e-4, 1e-3]
    assert optimizer.param_groups[0]["betas"] == (0.9, 0.999)


def test_schedules() -> None:
    assert {learning_rate_factor("constant", p) for p in (0, 0.3, 1)} == {1.0}
    cosine = [learning_rate_factor("cosine", p) for p in (0, 0.25, 0.5, 1)]
    assert cosine == pytest.approx([1, 0.5 + np.sqrt(0.125), 0.5, 0])


def test_unknown_phase() -> None:
    with pytest.raises(ValueError, match="no phase positive-second"):
        build("positive", "second")  # type: ignore[arg-type]


@pytest.mark.parametrize("phase", ["initial", "refinement"])
def test_distributed_wrapper_changes_nothing(
    phase: Phase, five: TrainingSet, tmp_path: Path
) -> None:
    """Two steps: the second fails in DistributedDataParallel if a parameter had no gradient."""
    store = torch.distributed.FileStore(str(tmp_path / "store"), 1)
    torch.distributed.init_process_group("gloo", store=store, rank=0, world_size=1)
    try:
        plain, inner = build("negative", phase), build("negative", phase)
        wrapped = torch.nn.parallel.DistributedDataParallel(inner)
        for _ in range(2):
            batch = five.batch(np.arange(4), TRAINING, torch.Generator().manual_seed(0))
            for objective in (plain, wrapped):
                losses = objective(batch, 0.5, torch.Generator().manual_seed(1))
                losses["total"].backward()
        for (name, a), b in zip(plain.named_parameters(), inner.parameters(), strict=True):
            assert (a.grad is None) == (b.grad is None), name
            if a.grad is not None:
                assert torch.equal(a.grad, b.grad), name
    finally:
        torch.distributed.destroy_process_group()


def test_burn_in_precedes_the_trained_iterations(five: TrainingSet) -> None:
    """Trained iterations start where a random number of untrained ones ended."""
    training = TRAINING.model_copy(update={"burn_in": 2})
    objective = build("positive", "refinement", training).eval()
    volume = five.batch(np.arange(4), training, torch.Generator().manual_seed(0)).occupancy
    expected = [step.detach() for step in objective.network(volume, 5)]
    skips = set()
    for seed in range(20):
        steps = objective.refinement_steps(volume, torch.Generator().manual_seed(seed))
        assert len(steps) == 1 + training.iterations
        (skip,) = [k for k in range(3) if torch.equal(steps[0], expected[k])]
        assert not steps[0].requires_grad
        assert all(torch.equal(steps[i], expected[skip + i]) for i in range(len(steps)))
        skips.add(skip)
    assert skips == {0, 1, 2}
