from __future__ import annotations

import numpy as np
import pytest
import torch

from pnabs import settings
from pnabs.model.network import CuboidNetwork
from pnabs.model.predict import predict


@pytest.fixture
def network() -> CuboidNetwork:
    network = CuboidNetwork(4, settings.Network(hidden=64), torch.full((4, 3), 0.1))
    with torch.no_grad():
        for head in (network.initial_decoder.scale, network.initial_decoder.translation):
            head.weight.mul_(20)
    return network


def test_a_shape_s_cuboids_are_the_same_bits_whatever_its_mates(
    network: CuboidNetwork, rng: np.random.Generator
) -> None:
    solids = rng.random((7, 32, 32, 32)) < rng.uniform(0.01, 0.5, (7, 1, 1, 1))
    together = predict(network, solids, 2)
    for order in ([3], [5, 3], [3, 3, 0, 1, 2, 4, 6]):
        for place, cuboids in zip(order, predict(network, solids[order], 2), strict=True):
            expected = together[place].as_vector()
            assert cuboids.as_vector().tobytes() == expected.tobytes()
    assert together[0].as_vector().tobytes() != together[1].as_vector().tobytes()


def test_follows_the_network(network: CuboidNetwork, rng: np.random.Generator) -> None:
    solids = rng.random((3, 32, 32, 32)) < 0.2
    with torch.no_grad():  # batch norms that have seen something
        network(torch.from_numpy(rng.random((8, 1, 32, 32, 32))).float(), 1)
    found = predict(network, solids, 3)
    assert network.training
    network.eval()
    with torch.no_grad():
        steps = network(torch.from_numpy(solids).float().unsqueeze(1), 3)
    for cuboids, expected in zip(found, steps[-1], strict=True):
        np.testing.assert_allclose(cuboids.as_vector(), expected, atol=3e-5)
        np.testing.assert_allclose(np.linalg.norm(cuboids.rotation, axis=1), 1, atol=1e-6)
        assert (cuboids.scale >= 0).all()
    (initial,) = predict(network, solids[:1], 0)
    np.testing.assert_allclose(initial.as_vector(), steps[0][0], atol=3e-5)


def test_nothing_to_predict(network: CuboidNetwork) -> None:
    assert predict(network, np.zeros((0, 32, 32, 32), dtype=bool), 3) == []
