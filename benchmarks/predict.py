"""Prediction: CPU time a model of both modules, in the batches that `predict` makes, and alone.

    python -m benchmarks.predict

The shipped weights on random shapes, one core; medians over rounds.
"""

from __future__ import annotations

import click
import numpy as np
import torch

from benchmarks.training import seconds, shapes
from pnabs import settings
from pnabs.geometry.types import Bool
from pnabs.model.checkpoint import load_network
from pnabs.model.predict import predict

SHAPES = 64


def measured(module: str, iterations: int, occupancy: Bool, repeats: int) -> list[float]:
    """CPU seconds a model in batches, of one shape, and a model of the network one by one."""
    path = settings.SHIPPED_WEIGHTS / f"{module}.safetensors"
    network, plain = load_network(path), load_network(path).eval()
    volumes = torch.from_numpy(occupancy.astype(np.float32))[:, None, None]

    @torch.no_grad()
    def one_by_one() -> None:
        for volume in volumes:
            plain(volume, iterations)

    return [
        seconds(lambda: predict(network, occupancy, iterations), repeats) / len(occupancy),
        seconds(lambda: predict(network, occupancy[:1], iterations), repeats),
        seconds(one_by_one, repeats) / len(occupancy),
    ]


@click.command()
@click.option("--repeats", default=7, show_default=True)
def main(repeats: int) -> None:
    """Print the table of benchmarks/predict.md."""
    torch.set_num_threads(1)
    occupancy = shapes(SHAPES).occupancies()
    click.echo(
        "| module | iterations | CPU ms a model | one shape, CPU ms | the network one by one, "
        "times as long |\n| --- | --- | --- | --- | --- |"
    )
    for module in ("positive", "negative"):
        for iterations in (0, 3, settings.Abstract().iterations):
            batches, single, alone = measured(module, iterations, occupancy, repeats)
            click.echo(
                f"| {module} | {iterations} | {batches * 1e3:.1f} | {single * 1e3:.1f} "
                f"| {alone / batches:.1f} |"
            )


if __name__ == "__main__":
    main()
