from __future__ import annotations

import numpy as np
import torch

from pnabs import settings
from pnabs.geometry.metrics import iou, predicted_occupancy
from pnabs.geometry.types import Cuboids
from pnabs.model.network import CuboidNetwork
from pnabs.model.validate import validation_iou
from pnabs.pipeline import thickened

MIN_SIDE = 2e-3


class Fixed(CuboidNetwork):
    """Says the same cuboids of every shape, in evaluation mode alone."""

    def __init__(self, vectors: np.ndarray) -> None:
        super().__init__(len(vectors), settings.Network(), torch.zeros((len(vectors), 3)))
        self.vectors = torch.from_numpy(vectors).float()

    def forward(self, volume: torch.Tensor, iterations: int) -> tuple[torch.Tensor, ...]:
        assert not self.training
        return (self.vectors.expand(len(volume), -1, -1),) * (iterations + 1)


def test_is_the_metric_of_the_report(rng: np.random.Generator) -> None:
    # More shapes than a batch; boxes thick, thinner than a cell, and a speck, which is left out.
    solids = rng.random((35, 32, 32, 32)) < rng.uniform(0, 1, (35, 1, 1, 1))
    vectors = rng.normal(size=(5, 10))
    vectors[:, :3] = [[0.3, 0.4, 0.5], [0.4, 0.4, 1e-3], [0.2, 1e-3, 1e-3], [1e-3] * 3, [0.5] * 3]
    vectors[:, 3:7] /= np.linalg.norm(vectors[:, 3:7], axis=1, keepdims=True)
    vectors[:, 7:] *= 0.1
    found = validation_iou(Fixed(vectors), torch.from_numpy(solids), 2, MIN_SIDE)
    boxes = thickened(Cuboids.from_vector(vectors), MIN_SIDE)
    predicted = predicted_occupancy(boxes, Cuboids.empty(), 32, MIN_SIDE)
    expected = [iou(solid, predicted) for solid in solids]
    # A centre on a face may round either way.
    np.testing.assert_allclose(found.numpy(), expected, atol=2e-3)


def test_without_models_there_is_nothing() -> None:
    network = CuboidNetwork(4, settings.Network(), torch.zeros((4, 3)))
    none = torch.zeros((0, 32, 32, 32), dtype=torch.bool)
    assert validation_iou(network, none, 2, MIN_SIDE).shape == (0,)


def test_weights_and_random_numbers_stay(rng: np.random.Generator) -> None:
    network = CuboidNetwork(4, settings.Network(), torch.zeros((4, 3)))
    network.train()
    before = {name: value.clone() for name, value in network.state_dict().items()}
    state = torch.get_rng_state()
    validation_iou(network, torch.from_numpy(rng.random((3, 32, 32, 32)) < 0.1), 2, MIN_SIDE)
    assert torch.equal(state, torch.get_rng_state())
    for name, value in network.state_dict().items():
        assert torch.equal(value, before[name]), name
