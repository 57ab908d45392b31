"""What a training phase minimises, as one module that DistributedDataParallel can wrap."""

from __future__ import annotations

import math
from typing import Literal

import torch
from torch import Tensor, nn
from torch.optim import Adam

from pnabs import settings
from pnabs.model.data import Batch
from pnabs.model.losses import MODULES, PHASES, TERMS, View, active_terms
from pnabs.model.network import CuboidNetwork

Phase = Literal["initial", "refinement"]
Module = Literal["positive", "negative"]


class Objective(nn.Module):
    """A network in one of the four phases (METHOD, training).

    What the phase doesn't train is frozen: its parameters need no gradient and its batch
    statistics don't move.  So each parameter that needs a gradient takes part in every step.

    Parameters
    ----------
    network : CuboidNetwork
        For refinement its encoder must have been inherited (`CuboidNetwork.inherit_encoder`).
    module, phase : str
        "positive" or "negative", "initial" or "refinement".
    training : settings.Training
    """

    def __init__(
        self, network: CuboidNetwork, module: Module, phase: Phase, training: settings.Training
    ) -> None:
        super().__init__()
        if module not in MODULES or phase not in PHASES:
            raise ValueError(f"no phase {module}-{phase}; modules {MODULES}, phases {PHASES}")
        self.network = network
        self.phase = phase
        self.training_options = training
        self.weights = active_terms(module, phase, training.losses)
        trained = ("initial_" if phase == "initial" else "refine_",)
        for name, parameter in network.named_parameters():
            parameter.requires_grad_(name.startswith(trained))
        self.train()

    def train(self, mode: bool = True) -> Objective:
        """Training mode for what the phase trains; the rest stays in evaluation mode."""
        super().train(mode)
        frozen = "refine_" if self.phase == "initial" else "initial_"
        for name, child in self.network.named_children():
            if name.startswith(frozen):
                child.eval()
        return self

    def forward(
        self, batch: Batch, progress: float, generator: torch.Generator
    ) -> dict[str, Tensor]:
        """Each active term's value, unweighted, and their weighted sum `total`.

        Parameters
        ----------
        batch : Batch
        progress : float
            How much of the phase is done, 0 to 1.
        generator : torch.Generator
            Source of the terms' random samples, on the batch's device.
        """
        if self.phase == "initial":
            steps: tuple[Tensor, ...] = (self.network.initial(batch.occupancy),)
        else:
            steps = self.refinement_steps(batch.occupancy, generator)
        view = View(steps, batch, self.training_options, progress, generator)
        values = {name: TERMS[name].value(view) for name in self.weights}
        values["total"] = torch.stack(
            [weight * values[name] for name, weight in self.weights.items()]
        ).sum()
        return values

    def refinement_steps(self, volume: Tensor, generator: torch.Generator) -> tuple[Tensor, ...]:
        """The cuboids to start from and each trained iteration's."""
        options = self.training_options
        context = self.network.encode(volume)
        skipped = torch.randint(
            options.burn_in + 1, (), generator=generator, device=generator.device
        )
        with torch.no_grad():
            cuboids = self.network.initial(volume)
            for _ in range(int(skipped)):
                cuboids = self.network.refine(context, cuboids)
        steps = [cuboids]
        for _ in range(options.iterations):
            steps.append(self.network.refine(context, steps[-1]))
        return tuple(steps)


def make_optimizer(objective: Objective, training: settings.Training) -> Adam:
    """Adam over what the phase trains; in refinement the inherited encoder has its own rate.

    Each group keeps its full rate as `initial_lr`; `set_learning_rate` scales from there.
    """
    groups: dict[float, list[Tensor]] = {}
    for name, parameter in objective.network.named_parameters():
        if parameter.requires_grad:
            inherited = name.startswith("refine_encoder")
            rate = training.encoder_learning_rate if inherited else training.learning_rate
            groups.setdefault(rate, []).append(parameter)
    return Adam(
        [{"params": group, "lr": rate, "initial_lr": rate} for rate, group in groups.items()],
        betas=training.betas,
    )


def learning_rate_factor(schedule: Literal["constant", "cosine"], progress: float) -> float:
    """Share of the full learning rate at `progress` (0 to 1) of a phase."""
    if schedule == "constant":
        return 1.0
    return 0.5 * (1 + math.cos(math.pi * min(max(progress, 0.0), 1.0)))


def set_learning_rate(optimizer: Adam, factor: float) -> None:
    """Scale every group's full rate."""
    for group in optimizer.param_groups:
        group["lr"] = group["initial_lr"] * factor
