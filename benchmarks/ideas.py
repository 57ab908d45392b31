"""Two ideas that `benchmarks.trials` tries and pnabs doesn't take: gates, and fitted targets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from scipy.optimize import linear_sum_assignment
from torch import Tensor, nn

from pnabs import settings
from pnabs.geometry.fit.build import Terms
from pnabs.geometry.fit.fit import fit
from pnabs.model import cuboids as geometry
from pnabs.model.data import Batch, TrainingSet
from pnabs.model.losses import View, box_keys
from pnabs.model.network import CuboidNetwork
from pnabs.pipeline import Shape


class GatedNetwork(CuboidNetwork):
    """Existence apart from size: a gate in (0, 1) a box, from the same features, times its sides.

    A box whose gate closes falls below the least side and is left out as a speck, whatever sides
    it was given.
    """

    def __init__(self, count: int, options: settings.Network, start: Tensor) -> None:
        super().__init__(count, options, start)
        self.initial_gate = nn.Linear(options.hidden, count)
        nn.init.zeros_(self.initial_gate.weight)
        nn.init.constant_(self.initial_gate.bias, 3.0)

    def initial(self, volume: Tensor) -> Tensor:
        """As the network's own, gated."""
        hidden: list[Tensor] = []
        trunk = self.initial_decoder.trunk
        with trunk.register_forward_hook(lambda _, __, output: hidden.append(output)):
            cuboids = super().initial(volume)
        gate = self.initial_gate(hidden[0]).sigmoid().unsqueeze(-1)
        return torch.cat([cuboids[..., :3] * gate, cuboids[..., 3:]], dim=-1)


@dataclass(frozen=True, slots=True)
class AimedBatch(Batch):
    """A batch with each shape's fitted boxes, (B, M, 10), of no side where there are fewer."""

    targets: Tensor | None = None


@dataclass(frozen=True, slots=True)
class AimedSet(TrainingSet):
    """Shapes with their fitted boxes, (n, M, 10) float32, for training without augmentation."""

    targets: np.ndarray | None = None

    def batch(
        self, indices: np.ndarray, training: settings.Training, generator: torch.Generator
    ) -> AimedBatch:
        """As any batch's, with the targets of its shapes."""
        assert self.targets is not None
        plain = super(AimedSet, self).batch(indices, training, generator)
        values = {name: getattr(plain, name) for name in Batch.__dataclass_fields__}
        return AimedBatch(**values, targets=torch.from_numpy(self.targets[indices]))


def fitted_boxes(shapes: list[Shape], boxes: int) -> np.ndarray:
    """At most so many positives that the fit finds for each shape, (n, boxes, 10) float32."""
    out = np.zeros((len(shapes), boxes, geometry.PARAMETERS), np.float32)
    out[..., 3] = 1
    terms = Terms(boxes, settings.Abstract().min_gain, negatives=0)
    for row, shape in enumerate(shapes):
        rng = np.random.default_rng(row)
        found = fit(
            shape.occupancy_64,
            shape.occupancy_192,
            shape.surface,
            shape.mirror,
            terms,
            rng,
            extent=shape.extent,
            min_side=settings.Abstract().min_side,
        ).positives
        out[row, : len(found)] = found.as_vector()
    return out


def aimed(view: View) -> Tensor:
    """Squared distance of centres and covariances' roots to the assigned target's, mean over boxes.

    The assignment is the cheapest one, one to one; boxes without a target shrink to nothing where
    they are.
    """
    assert isinstance(view.batch, AimedBatch)
    assert view.batch.targets is not None
    own, other = box_keys(view.cuboids), box_keys(view.batch.targets)
    there = view.batch.targets[..., :3].amax(dim=-1) > 0
    with torch.no_grad():
        costs = (own.unsqueeze(2) - other.unsqueeze(1)).square().sum(-1)
        nothing = own[..., 3:].square().sum(-1, keepdim=True)
        costs = torch.where(there.unsqueeze(1), costs, nothing).numpy()
        partner = torch.from_numpy(np.stack([linear_sum_assignment(cost)[1] for cost in costs]))
    goal = other.gather(1, partner.unsqueeze(-1).expand_as(own))
    stays = torch.cat([own[..., :3].detach(), torch.zeros_like(own[..., 3:])], dim=-1)
    goal = torch.where(there.gather(1, partner).unsqueeze(-1), goal, stays)
    return (own - goal).square().sum(-1).mean()
