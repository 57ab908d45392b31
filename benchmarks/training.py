"""A training step by its parts: data, network, each loss, and the optimiser.

    python -m benchmarks.training

CPU seconds on one core of random shapes, medians over steps.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import click
import numpy as np
import torch

from pnabs import settings
from pnabs.geometry import cuboid
from pnabs.geometry.types import Cuboids, grid_points
from pnabs.model.data import Batch, TrainingSet
from pnabs.model.losses import TERMS, View
from pnabs.model.memory import keep_freed_memory
from pnabs.model.network import CuboidNetwork
from pnabs.model.objective import Module, Objective, Phase, make_optimizer

BATCH, CUBOIDS, POINTS = 32, 20, 2000


def shapes(count: int) -> TrainingSet:
    """Unions of a few boxes, with all that training reads of a shape."""
    rng = np.random.default_rng(0)
    points = grid_points(32)
    rows: dict[str, list[np.ndarray]] = {
        name: [] for name in ("occupancy", "sdf", "surface", "interior")
    }
    for _ in range(count):
        vectors = rng.normal(size=(4, 10)) * 0.15
        vectors[:, :3] = rng.uniform(0.1, 0.5, (4, 3))
        vectors[:, 3] = 1
        boxes = Cuboids.from_vector(vectors)
        sdf = cuboid.union_sdf(points, boxes)
        inside = sdf < 0
        near = points[np.argsort(np.abs(sdf))[:4000]]
        rows["occupancy"].append(np.packbits(inside))
        rows["sdf"].append(sdf.reshape(32, 32, 32).astype(np.float16))
        rows["surface"].append(near.astype(np.float16))
        rows["interior"].append(points[rng.choice(np.flatnonzero(inside), 2048)].astype(np.float16))
    arrays = {name: np.array(values) for name, values in rows.items()}
    return TrainingSet(
        **arrays, mirror=np.zeros(count, dtype=np.int8), shape_interior=arrays["interior"]
    )


def seconds(work: Callable[[], object], repeats: int) -> float:
    """Median CPU seconds, the first left out."""
    spent = []
    for _ in range(repeats + 1):
        started = time.process_time()
        work()
        spent.append(time.process_time() - started)
    return float(np.median(spent[1:]))


def parts(module: Module, phase: Phase, dataset: TrainingSet, repeats: int) -> dict[str, float]:
    """Seconds of each part of a step."""
    training = settings.Training(
        batch_size=BATCH, shape_samples=POINTS, learning_rate=1e-6, encoder_learning_rate=1e-6
    )
    torch.manual_seed(0)
    start = torch.from_numpy(np.random.default_rng(0).uniform(-0.3, 0.3, (CUBOIDS, 3)))
    network = CuboidNetwork(CUBOIDS, settings.Network(), start.float())
    if phase == "refinement":
        network.inherit_encoder()
    objective = Objective(network, module, phase, training)
    optimizer = make_optimizer(objective, training)
    draw, generator = torch.Generator().manual_seed(0), torch.Generator().manual_seed(0)
    rows = np.arange(BATCH)

    def batch() -> Batch:
        return dataset.batch(rows, training, draw)

    fixed = batch()

    def step() -> None:
        losses = objective(batch(), 0.5, generator)
        optimizer.zero_grad(set_to_none=True)
        losses["total"].backward()
        optimizer.step()

    def predicted() -> tuple[torch.Tensor, ...]:
        if phase == "initial":
            return (network.initial(fixed.occupancy),)
        return objective.refinement_steps(fixed.occupancy, generator)

    def network_alone() -> None:
        optimizer.zero_grad(set_to_none=True)
        torch.stack([one.sum() for one in predicted()[-1:]]).sum().backward()

    leaves = [one.detach().requires_grad_() for one in predicted()]

    def loss(names: list[str]) -> Callable[[], None]:
        def work() -> None:
            view = View(tuple(leaves), fixed, training, 0.5, generator)
            torch.stack([TERMS[name].value(view) for name in names]).sum().backward()

        return work

    names = list(objective.weights)
    found = {
        "a step": seconds(step, repeats),
        "data": seconds(batch, repeats),
        "network, forward and backward": seconds(network_alone, repeats),
        "all losses, forward and backward": seconds(loss(names), repeats),
    }
    found |= {f"  {name}": seconds(loss([name]), repeats) for name in names}
    return found


@click.command()
@click.option("--repeats", default=10, show_default=True)
def main(repeats: int) -> None:
    """Print the tables of benchmarks/training.md."""
    torch.set_num_threads(1)
    keep_freed_memory()
    dataset = shapes(BATCH)
    for module in ("positive", "negative"):
        for phase in ("initial", "refinement"):
            click.echo(f"\n| {module}, {phase} | CPU s |\n| --- | --- |")
            for name, spent in parts(module, phase, dataset, repeats).items():
                click.echo(f"| {name.replace('  ', '&nbsp; ')} | {spent:.4f} |")


if __name__ == "__main__":
    main()
