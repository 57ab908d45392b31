"""One training worker: its part of the data, epoch after epoch, checkpoints, weights."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

from pnabs.stages.phases import CURVES, RECORD, WEIGHTS, PhasePlan, is_done
from pnabs.stages.plan import recipe_digest
from pnabs.stages.train_state import drop, read_state, save_state
from pnabs.stages.training_data import load_training_set
from pnabs.store.atomic import digest, file_digest, pretty_json, write_atomic
from pnabs.store.events import EventLog
from pnabs.store.lock import check_held
from pnabs.store.run import RunFolder
from pnabs.store.sealed import seal

if TYPE_CHECKING:
    import torch

    from pnabs.model.data import TrainingSet
    from pnabs.model.network import CuboidNetwork

T = TypeVar("T")

ALIVE_SECONDS = 10.0
"""Time between a worker's signs of life."""


def train_loop(config: dict[str, Any]) -> None:
    """One worker's part of a module's phases; runs in a process of Ray Train."""
    import ray.train
    import torch
    from ray.train.torch import get_device

    from pnabs.model.memory import keep_freed_memory

    plans: list[PhasePlan] = config["plans"]
    job = plans[0].job
    worker = ray.train.get_context()
    place = _Place(
        worker.get_world_rank(),
        worker.get_world_size(),
        get_device() if config["gpu"] else torch.device("cpu"),
        config["token"],
    )
    torch.set_num_threads(job.runtime.threads)
    keep_freed_memory()
    dataset = None
    for plan in plans:
        # Where the workers were started again, the first may be done; all must see it so.
        if place.agree(is_done(plan)):
            continue
        events = EventLog(plan.home.run, f"train-{plan.name}-{plan.fingerprint[:8]}-{place.rank}")
        alive = _Alive(events, plan.name)
        if dataset is None:
            dataset = load_training_set(
                RunFolder(job.out), plan.volumes, job, plan.module, plan.models,
                rank=place.rank, world=place.world, on_shard=alive.reading,
            )  # fmt: skip
            shown = _validation_set(plan)
        events("data", phase=plan.name, models=len(dataset), bytes=dataset.nbytes)
        _train_phase(plan, dataset, shown, place, events, alive)
        events.close()


@dataclass(frozen=True, slots=True)
class _Place:
    """Which worker this is, among how many, on what device, and for which driver."""

    rank: int
    world: int
    device: torch.device
    token: str

    def agree(self, value: T) -> T:
        """What the first worker found, for all."""
        import torch

        found = [value]
        if self.world > 1:
            torch.distributed.broadcast_object_list(found, device=self.device)
        return found[0]


def _train_phase(
    plan: PhasePlan,
    dataset: TrainingSet,
    shown: torch.Tensor,
    place: _Place,
    events: EventLog,
    alive: _Alive,
) -> None:
    import resource

    import torch
    from torch.nn.parallel import DistributedDataParallel

    from pnabs.model.checkpoint import load_network, load_training
    from pnabs.model.network import CuboidNetwork
    from pnabs.model.objective import Objective, make_optimizer
    from pnabs.model.start import start_points
    from pnabs.model.trainer import epoch_order, train_epoch
    from pnabs.model.validate import validation_iou

    job, training = plan.job, plan.job.training
    rank, world, device = place.rank, place.world, place.device
    seed = int(digest([job.seed, plan.name])[:8], 16)
    torch.manual_seed(seed)
    if plan.inherits is None:
        total = torch.from_numpy(dataset.mean_occupancy()).to(device)
        if world > 1:
            torch.distributed.all_reduce(total)
        count = job.network.positives if plan.module == "positive" else job.network.negatives
        start = start_points(total.cpu().numpy() / world, count, job.network.start)
        network = CuboidNetwork(count, job.network, start)
    else:
        network = load_network(plan.inherits)
        if plan.phase == "refinement":
            network.inherit_encoder()
    objective = Objective(network.to(device), plan.module, plan.phase, training)  # type: ignore[arg-type]
    optimizer = make_optimizer(objective, training)

    first, curves = 0, []
    state = place.agree(read_state(plan.folder))
    if state is not None:
        first = load_training(plan.folder / state.file, network, optimizer)
        curves = state.curves
    wrapped = DistributedDataParallel(objective) if world > 1 else objective
    for epoch in range(first, training.epochs):
        order = epoch_order(len(dataset), epoch, seed + rank)
        losses = train_epoch(
            wrapped, optimizer, dataset, order, training,
            epoch=epoch, seed=seed, rank=rank, world=world, device=device,
            on_step=partial(alive.step, epoch),
        )  # fmt: skip
        if world > 1:
            mean = torch.tensor(list(losses.values()), dtype=torch.float64, device=device) / world
            torch.distributed.all_reduce(mean)
            losses = dict(zip(losses, mean.tolist(), strict=True))
        if len(shown):
            iterations = training.iterations if plan.phase == "refinement" else 0
            mine = shown[rank::world]
            ious = validation_iou(network, mine, iterations, job.abstract.min_side, device)
            total = ious.sum().to(device)
            if world > 1:
                torch.distributed.all_reduce(total)
            losses["iou_32"] = float(total) / len(shown)
        curves.append({"epoch": epoch, **losses})
        if rank != 0:
            continue
        told = {"total": losses["total"], "iou": losses.get("iou_32")}
        events("epoch", phase=plan.name, epoch=epoch, **told)
        last = epoch + 1 == training.epochs
        if not last and (epoch + 1) % job.runtime.checkpoint_epochs == 0:
            # One that outlived its driver must not write between its successor's files.
            check_held(plan.home.run, place.token)
            save_state(plan.folder, network, optimizer, epoch + 1, curves)
    if rank == 0:
        check_held(plan.home.run, place.token)
        _finish(plan, network, curves)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    events("end", phase=plan.name, models=len(dataset), peak_memory=peak)
    if world > 1:
        # The next phase begins from the weights that the first worker has written.
        torch.distributed.barrier()
    if rank == 0:
        events("finished", phase=plan.name)


def _validation_set(plan: PhasePlan) -> torch.Tensor:
    """Occupancies (V, 32, 32, 32) bool of the models that are measured after each epoch."""
    import torch

    if not plan.validation.count:
        return torch.zeros((0, 32, 32, 32), dtype=torch.bool)
    dataset = load_training_set(
        RunFolder(plan.job.out), plan.volumes, plan.job, plan.module, plan.validation,
        rank=0, world=1,
    )  # fmt: skip
    return torch.from_numpy(dataset.occupancies())


def _finish(plan: PhasePlan, network: CuboidNetwork, curves: list[dict[str, Any]]) -> None:
    """Write weights and curves, then the record over them; the state is needed no more."""
    from pnabs.model.checkpoint import save_network

    save_network(plan.folder / WEIGHTS, network)
    write_atomic(plan.folder / CURVES, pretty_json(curves))
    record = {
        "format": "pnabs/phase",
        "version": 2,
        "phase": plan.name,
        "fingerprint": plan.fingerprint,
        "recipe": recipe_digest(f"train-{plan.module}", plan.job),
        "models": plan.models.count,
        "epochs": plan.job.training.epochs,
        "outputs": {name: file_digest(plan.folder / name) for name in (WEIGHTS, CURVES)},
    }
    write_atomic(plan.folder / RECORD, seal(record))
    drop(plan.folder)


class _Alive:
    """Tells now and then, through the events, what a worker is at."""

    def __init__(self, events: EventLog, phase: str) -> None:
        self._events, self._phase, self._told = events, phase, 0.0

    def reading(self, shard: str) -> None:
        """Tell of a shard that is read."""
        self(f"reading {shard}")

    def step(self, epoch: int, step: int, steps: int) -> None:
        """Tell of a training step."""
        self(f"epoch {epoch}, step {step} of {steps}")

    def __call__(self, what: str) -> None:
        now = time.monotonic()
        if now - self._told >= ALIVE_SECONDS:
            self._told = now
            self._events("alive", phase=self._phase, what=what)
