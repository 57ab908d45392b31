"""One epoch of one phase: the loop that local runs and Ray Train share."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.optim import Adam

from pnabs import settings
from pnabs.model.data import TrainingSet
from pnabs.model.objective import learning_rate_factor, set_learning_rate


def epoch_order(
    count: int, epoch: int, seed: int, rank: int = 0, world: int = 1
) -> NDArray[np.int64]:
    """The rows that one of `world` workers sees in an epoch, shuffled.

    The permutation is the same for all workers; each takes every `world`-th row of it.  Where
    the count doesn't divide, the first rows come twice, so that all workers make as many steps.
    """
    rng = np.random.default_rng([seed, epoch])
    order = np.resize(rng.permutation(count), -(-count // world) * world)
    return order[rank::world].astype(np.int64)


def train_epoch(
    objective: nn.Module,
    optimizer: Adam,
    dataset: TrainingSet,
    order: NDArray[np.int64],
    training: settings.Training,
    *,
    epoch: int,
    seed: int,
    rank: int = 0,
    world: int = 1,
    device: torch.device | str = "cpu",
    on_step: Callable[[int, int], None] | None = None,
) -> dict[str, float]:
    """Train on the rows of `order`, in order, a step for every `batch_size / world` of them.

    Deterministic in (seed, epoch, rank), the weights and the optimiser's state.  Rows left over
    are spread so that batches are as even as possible and none has a single row.

    Parameters
    ----------
    objective : Objective, or DistributedDataParallel around one
    optimizer : Adam
        From `make_optimizer`.
    dataset : TrainingSet
    order : (M,) int64
        Usually from `epoch_order`.
    training : settings.Training
    epoch : int
        Counted from 0 in this phase; with `training.epochs` it gives the progress.
    on_step : callable, optional
        Called before each step with its number and that of all.

    Returns
    -------
    dict
        Mean over the epoch's rows of every term and of `total`.

    Raises
    ------
    FloatingPointError
        If the loss isn't finite.
    """
    objective.train()
    draws = np.random.SeedSequence([seed, epoch, rank]).generate_state(2)
    data_generator = torch.Generator().manual_seed(int(draws[0]))
    loss_generator = torch.Generator(device=device).manual_seed(int(draws[1]))
    steps = max(1, round(len(order) * world / training.batch_size))
    sums: dict[str, Tensor] = {}
    for step, rows in enumerate(np.array_split(order, steps)):
        if on_step:
            on_step(step, steps)
        progress = (epoch + step / steps) / training.epochs
        set_learning_rate(optimizer, learning_rate_factor(training.schedule, progress))
        batch = dataset.batch(rows, training, data_generator).to(device)
        losses = cast("dict[str, Tensor]", objective(batch, progress, loss_generator))
        if not torch.isfinite(losses["total"]):
            named = {name: float(value.detach()) for name, value in losses.items()}
            raise FloatingPointError(
                f"training diverged in epoch {epoch}, step {step}: {named}; "
                "lower training.learning_rate"
            )
        optimizer.zero_grad(set_to_none=True)
        losses["total"].backward()  # type: ignore[no-untyped-call]
        optimizer.step()
        for name, value in losses.items():
            sums[name] = sums.get(name, torch.zeros((), device=device)) + value.detach() * len(rows)
    return {name: float(value) / len(order) for name, value in sums.items()}
