"""One training worker: its part of the data, epoch after epoch, checkpoints, weights."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

from pnabs.stages.phases import CURVES, WEIGHTS, PhasePlan
from pnabs.stages.training_data import load_training_set
from pnabs.store.atomic import digest, pretty_json, write_atomic
from pnabs.store.events import EventLog
from pnabs.store.run import RunFolder


def train_loop(config: dict[str, Any]) -> None:
    """One worker's part of a phase; runs in a process of Ray Train."""
    import resource

    import ray.train
    import torch
    from ray.train.torch import get_device
    from torch.nn.parallel import DistributedDataParallel

    from pnabs.model.checkpoint import load_network, load_training, save_network, save_training
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
    dataset = load_training_set(
        RunFolder(job.out), plan.volumes, job, plan.module, plan.models, rank=rank, world=world
    )
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

    first, curves = 0, []
    checkpoint = ray.train.get_checkpoint()
    if checkpoint is not None:
        with checkpoint.as_directory() as folder:
            first = load_training(Path(folder) / "training.safetensors", network, optimizer)
            curves = json.loads((Path(folder) / CURVES).read_bytes())
    wrapped = DistributedDataParallel(objective) if world > 1 else objective
    for epoch in range(first, training.epochs):
        order = epoch_order(len(dataset), epoch, seed + rank)
        losses = train_epoch(
            wrapped, optimizer, dataset, order, training,
            epoch=epoch, seed=seed, rank=rank, world=world, device=device,
        )  # fmt: skip
        if world > 1:
            mean = torch.tensor(list(losses.values()), dtype=torch.float64, device=device) / world
            torch.distributed.all_reduce(mean)
            losses = dict(zip(losses, mean.tolist(), strict=True))
        curves.append({"epoch": epoch, **losses})
        if rank == 0:
            events("epoch", phase=plan.name, epoch=epoch, total=losses["total"])
        last = epoch + 1 == training.epochs
        if not last and (epoch + 1) % job.runtime.checkpoint_epochs == 0:
            with tempfile.TemporaryDirectory() as folder:
                saved = None
                if rank == 0:
                    path = Path(folder)
                    save_training(path / "training.safetensors", network, optimizer, epoch + 1)
                    (path / CURVES).write_bytes(pretty_json(curves))
                    saved = ray.train.Checkpoint.from_directory(folder)
                ray.train.report(losses, checkpoint=saved)
    if rank == 0:
        save_network(plan.folder / WEIGHTS, network)
        write_atomic(plan.folder / CURVES, pretty_json(curves))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    events("end", phase=plan.name, models=len(dataset), peak_memory=peak)
    events.close()
