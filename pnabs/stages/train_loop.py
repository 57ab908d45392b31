"""One training worker: its part of the data, epoch after epoch, checkpoints, weights."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

from pnabs.stages.phases import CURVES, WEIGHTS, PhasePlan
from pnabs.stages.train_state import read_state, save_state
from pnabs.stages.training_data import load_training_set
from pnabs.store.atomic import digest, pretty_json, write_atomic
from pnabs.store.events import EventLog
from pnabs.store.lock import check_held
from pnabs.store.run import RunFolder

ALIVE_SECONDS = 10.0
"""Time between a worker's signs of life."""


def train_loop(config: dict[str, Any]) -> None:
    """One worker's part of a phase; runs in a process of Ray Train."""
    import resource

    import ray.train
    import torch
    from ray.train.torch import get_device
    from torch.nn.parallel import DistributedDataParallel

    from pnabs.model.checkpoint import load_network, load_training, save_network
    from pnabs.model.network import CuboidNetwork
    from pnabs.model.objective import Objective, make_optimizer
    from pnabs.model.start import start_points
    from pnabs.model.trainer import epoch_order, train_epoch

    plan: PhasePlan = config["plan"]
    job, training = plan.job, plan.job.training
    worker = ray.train.get_context()
    rank, world = worker.get_world_rank(), worker.get_world_size()
    torch.set_num_threads(job.runtime.threads)
    device = get_device() if config["gpu"] else torch.device("cpu")
    events = EventLog(plan.home.run, f"train-{plan.name}-{plan.fingerprint[:8]}-{rank}")
    seed = int(digest([job.seed, plan.name])[:8], 16)
    alive = _Alive(events, plan.name)
    dataset = load_training_set(
        RunFolder(job.out), plan.volumes, job, plan.module, plan.models,
        rank=rank, world=world, on_shard=lambda shard: alive(f"reading {shard}"),
    )  # fmt: skip
    events("data", phase=plan.name, models=len(dataset), bytes=dataset.nbytes)

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
        network.inherit_encoder()
    objective = Objective(network.to(device), plan.module, plan.phase, training)  # type: ignore[arg-type]
    optimizer = make_optimizer(objective, training)

    # What one worker finds, all take: they must begin at the same epoch.
    found = [read_state(plan.folder) if rank == 0 else None]
    if world > 1:
        torch.distributed.broadcast_object_list(found, device=device)
    first, curves = 0, []
    if found[0] is not None:
        first = load_training(plan.folder / found[0].file, network, optimizer)
        curves = found[0].curves
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
        curves.append({"epoch": epoch, **losses})
        if rank != 0:
            continue
        events("epoch", phase=plan.name, epoch=epoch, total=losses["total"])
        last = epoch + 1 == training.epochs
        if not last and (epoch + 1) % job.runtime.checkpoint_epochs == 0:
            # One that outlived its driver must not write between its successor's files.
            check_held(plan.home.run, config["token"])
            save_state(plan.folder, network, optimizer, epoch + 1, curves)
    if rank == 0:
        check_held(plan.home.run, config["token"])
        save_network(plan.folder / WEIGHTS, network)
        write_atomic(plan.folder / CURVES, pretty_json(curves))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    events("end", phase=plan.name, models=len(dataset), peak_memory=peak)
    events.close()


class _Alive:
    """Tells now and then, through the events, what a worker is at."""

    def __init__(self, events: EventLog, phase: str) -> None:
        self._events, self._phase, self._told = events, phase, 0.0

    def step(self, epoch: int, step: int, steps: int) -> None:
        """Tell of a training step."""
        self(f"epoch {epoch}, step {step} of {steps}")

    def __call__(self, what: str) -> None:
        now = time.monotonic()
        if now - self._told >= ALIVE_SECONDS:
            self._told = now
            self._events("alive", phase=self._phase, what=what)
