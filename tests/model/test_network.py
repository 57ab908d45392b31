from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import Tensor

from pnabs import settings
from pnabs.model import network as module
from pnabs.model.network import CuboidNetwork

SMALL = settings.Network(channels=(2, 2, 4, 4, 8), hidden=16)
INPUTS = pytest.mark.parametrize("refine_input", ["vector", "volume", "probes"])


def build(refine_input: str = "probes", seed: int = 0) -> CuboidNetwork:
    options = SMALL.model_copy(update={"refine_input": refine_input})
    start = torch.linspace(-0.3, 0.4, 9).view(3, 3)
    return CuboidNetwork(3, options, start, torch.Generator().manual_seed(seed))


@pytest.fixture
def volume(generator: torch.Generator) -> Tensor:
    return (torch.rand((2, 1, 32, 32, 32), generator=generator) < 0.2).float()


def check_valid(cuboids: Tensor) -> None:
    assert cuboids.shape == (2, 3, 10)
    assert (cuboids[..., :3] >= 0).all()
    np.testing.assert_allclose(cuboids[..., 3:7].norm(dim=-1).detach(), 1, atol=1e-5)


@INPUTS
def test_cuboids_start_at_rest(refine_input: str, volume: Tensor) -> None:
    network = build(refine_input).eval()
    found = network.initial(volume)
    check_valid(found)
    assert (found[..., 7:] - network.start).abs().max() < 0.2
    assert (found[..., :3] - module.START_SIDE).abs().max() < 0.1
    refined = network.refine(network.encode(volume), found)
    check_valid(refined)
    assert (refined - found).abs().max() < 0.05


@INPUTS
def test_output_stays_valid_whatever_the_weights(refine_input: str, volume: Tensor) -> None:
    network = build(refine_input).eval()
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.mul_(20)
    for cuboids in network(volume, 3):
        check_valid(cuboids)
    assert network.initial(volume)[..., :3].max() <= 1
    assert network.initial(volume)[..., 7:].abs().max() <= 0.5


@INPUTS
def test_refinement_adds_a_residual(refine_input: str, volume: Tensor) -> None:
    """With zeroed decoders but for one bias each, the residual is known.

    Probing cuboids move in their own frame: x is theirs, after a quarter turn about y.
    """
    network = build(refine_input).eval()
    decoder = network.refine_decoder
    with torch.no_grad():
        for head in (decoder.scale, decoder.rotation, decoder.translation):
            head.weight.zero_()
        decoder.scale.bias[0] = np.arctanh(0.2)
        decoder.rotation.bias[1] = np.arctanh(0.2)
        decoder.translation.bias[2] = np.arctanh(0.2)
    half = np.sqrt(0.5)
    previous = torch.tensor([0.3, 0.2, 0.1, half, 0, half, 0, 0.1, 0.2, 0.3], dtype=torch.float32)
    refined = network.refine(network.encode(volume), previous.expand(2, 3, 10))[0, 0].detach()
    moved = [0.2, 0.2, 0.3] if refine_input == "probes" else [0.1, 0.2, 0.4]
    turned = np.array([half, 0.1, half, 0]) / np.sqrt(1.01)
    np.testing.assert_allclose(refined, [0.4, 0.2, 0.1, *turned, *moved], atol=1e-6)


@INPUTS
def test_refinement_reads_the_previous_cuboids(refine_input: str, volume: Tensor) -> None:
    network = build(refine_input).eval()
    context = network.encode(volume)
    first = network.initial(volume)
    other = first.clone()
    other[..., 7:] += 0.3
    change = network.refine(context, first) - first
    assert not torch.allclose(change, network.refine(context, other) - other, atol=1e-6)


def test_probing_cuboids_share_one_decoder_but_for_their_code(volume: Tensor) -> None:
    network = build("probes").eval()
    context, first = network.encode(volume), network.initial(volume)
    order = [2, 0, 1]
    change = network.refine(context, first)
    np.testing.assert_allclose(
        network.refine(context, first[:, order]).detach(), change[:, order].detach(), atol=1e-6
    )
    with torch.no_grad():
        network.refine_decoder.code[0] = 1.0
    coded = network.refine(context, first)
    assert not torch.equal(coded[:, 0], change[:, 0])
    assert torch.equal(coded[:, 1:], change[:, 1:])


def test_volume_input_goes_through_the_shared_encoder(volume: Tensor) -> None:
    network = build("volume").eval()
    seen: list[Tensor] = []
    network.refine_encoder.register_forward_hook(lambda _, inputs, __: seen.append(inputs[0]))
    steps = network(volume, 2)
    assert len(steps) == len(seen) == 3
    assert torch.equal(seen[0], volume)
    assert not torch.equal(seen[1], seen[2])
    for cuboids in steps:
        check_valid(cuboids)


def test_iterations(volume: Tensor) -> None:
    network = build().eval()
    steps = network(volume, 4)
    assert len(steps) == 5
    assert torch.equal(steps[0], network.initial(volume))
    assert torch.equal(network(volume, 2)[2], steps[2])
    assert len(network(volume, 0)) == 1


def test_inherited_encoder_gives_the_same_feature(volume: Tensor) -> None:
    network = build()
    network.initial_encoder(volume)  # moves the batch statistics
    network.eval()
    assert not torch.allclose(network.encode(volume).feature, network.initial_encoder(volume))
    network.inherit_encoder()
    assert torch.equal(network.encode(volume).feature, network.initial_encoder(volume))


def test_pooling_before_the_rectifier_is_the_same_function(volume: Tensor) -> None:
    encoder = module.encoder((2, 3)).eval()
    literal = volume
    for block in range(2):
        convolution, normalise, pool, rectify = encoder[4 * block : 4 * block + 4]
        literal = pool(rectify(normalise(convolution(literal)).clone()))
    found = encoder(volume)
    np.testing.assert_allclose(found.detach(), literal.flatten(1).detach(), atol=1e-6)


def test_weights_come_from_the_generator() -> None:
    def weights(seed: int) -> list[Tensor]:
        torch.manual_seed(seed)  # must not matter
        return list(build(seed=seed % 2).state_dict().values())

    assert all(torch.equal(a, b) for a, b in zip(weights(0), weights(2), strict=True))
    assert not all(torch.equal(a, b) for a, b in zip(weights(0), weights(1), strict=True))


def test_start_must_fit() -> None:
    with pytest.raises(ValueError, match=r"must be \(3, 3\)"):
        CuboidNetwork(3, SMALL, torch.zeros((2, 3)))
