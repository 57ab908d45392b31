"""The prediction network (METHOD, networks; the paper's figures 2 and 3)."""

from __future__ import annotations

import copy
import math
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from pnabs import settings
from pnabs.model import cuboids as geometry
from pnabs.model.probes import PROBES, probe, pyramid

SLOPE = 0.2
"""Of the leaky rectifiers."""

START_SIDE = 0.15
"""Full side length of a cuboid before training."""

REACH = 0.5
"""Bound of a coordinate of a predicted centre, and of one iteration's change of a number."""


def encoder(channels: tuple[int, ...]) -> nn.Sequential:
    """Five blocks of convolution, batch norm, rectifier and pooling: 32^3 to one feature vector.

    Pooling comes before the rectifier: both are monotone, so the function is the same and an
    eighth of the numbers is rectified.
    """
    blocks: list[nn.Module] = []
    width = 1
    for channel in channels:
        blocks += [
            nn.Conv3d(width, channel, 3, padding=1, bias=False),
            nn.BatchNorm3d(channel),
            nn.MaxPool3d(2),
            nn.LeakyReLU(SLOPE, inplace=True),
        ]
        width = channel
    stack = nn.Sequential(*blocks, nn.Flatten())
    return stack.to(memory_format=torch.channels_last_3d)  # type: ignore[call-overload,no-any-return]


def folded(stack: nn.Sequential) -> nn.Sequential:
    """A copy of an encoder in evaluation mode, its batch norms folded into the convolutions."""
    layers: list[nn.Module] = []
    for layer in stack:
        if isinstance(layer, nn.BatchNorm3d):
            layers[-1] = fuse_conv_bn_eval(layers[-1], layer)  # type: ignore[type-var]
        else:
            layers.append(copy.deepcopy(layer))
    return nn.Sequential(*layers).to(memory_format=torch.channels_last_3d)  # type: ignore[call-overload,no-any-return]


class Decoder(nn.Module):
    """Fully connected layers, then one linear map each for scale, rotation and translation."""

    def __init__(self, width: int, hidden: int, count: int) -> None:
        super().__init__()
        self.count = count
        self.trunk = nn.Sequential(
            nn.Linear(width, hidden),
            nn.LeakyReLU(SLOPE),
            nn.Linear(hidden, hidden),
            nn.LeakyReLU(SLOPE),
        )
        self.scale = nn.Linear(hidden, 3 * count)
        self.rotation = nn.Linear(hidden, 4 * count)
        self.translation = nn.Linear(hidden, 3 * count)

    def forward(self, feature: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Raw numbers (B, N, 3), (B, N, 4), (B, N, 3) from features (B, width)."""
        hidden = self.trunk(feature)
        return (
            self.scale(hidden).unflatten(1, (self.count, 3)),
            self.rotation(hidden).unflatten(1, (self.count, 4)),
            self.translation(hidden).unflatten(1, (self.count, 3)),
        )


class ProbeDecoder(nn.Module):
    """One decoder for all cuboids: global feature, own numbers and probes to a residual.

    Parameters
    ----------
    width : int
        Of the global feature.
    hidden : int
    count : int
        Cuboids; each has a learnt code of its own, by which they share out the work.
    """

    def __init__(self, width: int, hidden: int, count: int) -> None:
        super().__init__()
        self.shape = nn.Linear(width, hidden)
        self.own = nn.Linear(geometry.PARAMETERS + PROBES, hidden)
        self.code = nn.Parameter(torch.zeros(count, hidden))
        self.trunk = nn.Sequential(
            nn.LeakyReLU(SLOPE),
            nn.Linear(hidden, hidden),
            nn.LeakyReLU(SLOPE),
        )
        self.scale = nn.Linear(hidden, 3)
        self.rotation = nn.Linear(hidden, 4)
        self.translation = nn.Linear(hidden, 3)

    def forward(
        self, feature: Tensor, previous: Tensor, seen: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Raw numbers (B, N, 3), (B, N, 4), (B, N, 3); the translation in the cuboid's own frame.

        From the feature (B, width), the cuboids (B, N, 10) and their probes (B, N, PROBES).
        """
        own = self.own(torch.cat([previous, seen], dim=-1))
        hidden = self.trunk(self.shape(feature).unsqueeze(1) + own + self.code)
        return self.scale(hidden), self.rotation(hidden), self.translation(hidden)


class Context(NamedTuple):
    """What refinement knows of its input.

    Attributes
    ----------
    feature : (B, F)
    volumes : (B, 2, 32, 32, 32)
        The input and its blurred copy; read only where `refine_input` is `probes`.
    """

    feature: Tensor
    volumes: Tensor


class CuboidNetwork(nn.Module):
    """Voxels to N cuboids, then refined iteratively; positive and negative module alike.

    The refinement stage has an encoder of its own, which inherits the initial stage's weights
    (`inherit_encoder`) and is trained on while the initial stage stays as it is.

    Parameters
    ----------
    count : int
        Cuboids, N.
    options : settings.Network
    start : (N, 3)
        Centres that predictions start from, normalised frame.
    generator : torch.Generator, optional
        Source of the initial weights; seed 0 when left out.
    """

    start: Tensor

    def __init__(
        self,
        count: int,
        options: settings.Network,
        start: Tensor,
        generator: torch.Generator | None = None,
    ) -> None:
        super().__init__()
        if start.shape != (count, 3):
            raise ValueError(f"start is {tuple(start.shape)}, must be ({count}, 3)")
        self.count = count
        self.options = options
        feature = options.channels[-1]
        self.register_buffer("start", start.detach().clone().float())
        self.initial_encoder = encoder(options.channels)
        self.initial_decoder = Decoder(feature, options.hidden, count)
        self.refine_encoder = encoder(options.channels)
        self.refine_decoder: Decoder | ProbeDecoder
        if options.refine_input == "probes":
            self.refine_decoder = ProbeDecoder(feature, options.hidden, count)
        else:
            features = 2 if options.refine_input == "volume" else 1
            width = features * feature + geometry.PARAMETERS * count
            self.refine_decoder = Decoder(width, options.hidden, count)
        self._draw_weights(generator or torch.Generator().manual_seed(0))

    def _draw_weights(self, generator: torch.Generator) -> None:
        """Draw all weights from the generator; last layers small, so that cuboids start at rest."""
        for module in self.modules():
            if isinstance(module, nn.Conv3d | nn.Linear):
                nn.init.kaiming_uniform_(module.weight, a=SLOPE, generator=generator)
                if module.bias is not None:
                    nn.init.zeros_(module.bias)
        for decoder, gain in ((self.initial_decoder, 0.1), (self.refine_decoder, 0.01)):
            for head in (decoder.scale, decoder.rotation, decoder.translation):
                with torch.no_grad():
                    head.weight.mul_(gain)
        self.inherit_encoder()

    def inherit_encoder(self) -> None:
        """Give the refinement stage the initial stage's encoder, batch statistics included."""
        self.refine_encoder.load_state_dict(self.initial_encoder.state_dict())

    def for_inference(self) -> CuboidNetwork:
        """A copy in evaluation mode that predicts the same, but for rounding, in less time."""
        network = copy.deepcopy(self).eval()
        network.initial_encoder = folded(network.initial_encoder)
        network.refine_encoder = folded(network.refine_encoder)
        return network

    def initial(self, volume: Tensor) -> Tensor:
        """First prediction.

        Parameters
        ----------
        volume : (B, 1, 32, 32, 32)
            Occupancy, 0 or 1.

        Returns
        -------
        (B, N, 10)
            Full sides in (0, 1), unit quaternions, centres within half a unit of the origin.
        """
        scale, rotation, translation = self.initial_decoder(self.initial_encoder(volume))
        scale = torch.sigmoid(scale + math.log(START_SIDE / (1 - START_SIDE)))
        identity = torch.tensor([1.0, 0, 0, 0], device=rotation.device, dtype=rotation.dtype)
        rotation = F.normalize(rotation + identity, dim=-1)
        anchor = torch.atanh((self.start / REACH).clamp(-0.95, 0.95))
        translation = REACH * torch.tanh(translation + anchor)
        return torch.cat([scale, rotation, translation], dim=-1)

    def encode(self, volume: Tensor) -> Context:
        """What all iterations share, from the input volume (B, 1, 32, 32, 32)."""
        return Context(self.refine_encoder(volume), pyramid(volume))

    def refine(self, context: Context, previous: Tensor) -> Tensor:
        """One iteration: a residual from the input and the previous cuboids, added to them.

        Parameters
        ----------
        context : Context
            Of the input volume, from `encode`.
        previous : (B, N, 10)

        Returns
        -------
        (B, N, 10)
            Sides non-negative, quaternions unit.
        """
        raw = self._residual(context, previous)
        scale, rotation, translation = (REACH * torch.tanh(part) for part in raw)
        if self.options.refine_input == "probes":
            turn = geometry.rotation_matrices(previous)
            translation = (turn @ translation.unsqueeze(-1)).squeeze(-1)
        before = geometry.split(previous)
        return torch.cat(
            [
                (before[0] + scale).abs(),
                F.normalize(before[1] + rotation, dim=-1),
                before[2] + translation,
            ],
            dim=-1,
        )

    def _residual(self, context: Context, previous: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """The decoder's raw numbers for scale, rotation and translation."""
        feature, volumes = context
        if isinstance(self.refine_decoder, ProbeDecoder):
            return self.refine_decoder(feature, previous, probe(volumes, previous))  # type: ignore[no-any-return]
        inputs = [feature, previous.flatten(1)]
        if self.options.refine_input == "volume":
            inputs.append(self.refine_encoder(geometry.coverage(previous)))
        return self.refine_decoder(torch.cat(inputs, dim=1))  # type: ignore[no-any-return]

    def forward(self, volume: Tensor, iterations: int) -> tuple[Tensor, ...]:
        """The initial prediction and each refinement of it, iterations + 1 times (B, N, 10)."""
        steps = [self.initial(volume)]
        if iterations:
            context = self.encode(volume)
            for _ in range(iterations):
                steps.append(self.refine(context, steps[-1]))
        return tuple(steps)
