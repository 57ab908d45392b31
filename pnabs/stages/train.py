"""train-positive and train-negative: two phases each, through Ray Train.

A phase's folder is `checkpoints/<module>-<phase>/<fingerprint>`.  While it trains,
Ray Train keeps its checkpoints there and resumes from the last one; when it is
done the folder holds the weights, the loss curves and, written last, a record.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pnabs.settings import Settings
from pnabs.stages.context import Context
from pnabs.stages.errors import InterruptedRunError, RunError
from pnabs.stages.plan import fingerprint
from pnabs.stages.training_data import TrainingModels, load_training_set
from pnabs.store.atomic import digest, file_digest, pretty_json, write_atomic
from pnabs.store.events import EventLog, read_events
from pnabs.store.run import RunFolder, Variant

WEIGHTS = "weights.safetensors"
CURVES = "curves.json"
RECORD = "record.json"
PHASES = ("initial", "refinement")
POLL_SECONDS = 0.3
CANCEL_SECONDS = 20.0
"""How long an interrupted run waits for Ray Train to end its workers on a Ray that stays."""


@dataclass(frozen=True, slots=True)
class PhasePlan:
    """One phase to be trained.

    Attributes
    ----------
    home
        The variant in whose folder it lies.
    volumes
        The variant in whose folder the difference volumes lie.
    inherits
        Weights of the initial phase that refinement starts from.
    """

    job: Settings
    home: Variant
    volumes: Variant
    module: str
    phase: str
    fingerprint: str
    models: TrainingModels
    inherits: Path | None

    @property
    def name(self) -> str:
        """Such as `positive-initial`."""
        return f"{self.module}-{self.phase}"

    @property
    def folder(self) -> Path:
        """Where its checkpoints and then its weights lie."""
        return self.home.checkpoints(self.name) / self.fingerprint


def weights_path(context: Context, variant: str, module: str) -> Path:
    """The weights a variant predicts with: trained here, or given by the job.

    Raises
    ------
    RunError
        When they aren't there yet.
    """
    job = context.variants[variant]
    if job.weights is not None:
        path = job.weights / f"{module}.safetensors"
        if not path.is_file():
            raise RunError(f"weights: there is no {path}")
        return path
    plan = phase_plans(context, variant, module)[-1]
    if not is_done(plan):
        raise RunError(
            f"the {module} module of variant {variant} isn't trained yet; "
            f"run the stage train-{module} first"
        )
    return plan.folder / WEIGHTS


def phase_plans(context: Context, variant: str, module: str) -> list[PhasePlan]:
    """The two phases of a module with what each depends on."""
    job = context.variants[variant]
    stage = f"train-{module}"
    home = context.home(stage, variant)
    volumes = context.home("difference", variant)
    models = training_models(context, variant, module)
    plans: list[PhasePlan] = []
    before = None
    for phase in PHASES:
        inputs = {"phase": phase, "models": models.digest, "before": before}
        mark = fingerprint(stage, job, inputs)
        inherits = plans[-1].folder / WEIGHTS if plans else None
        plans.append(PhasePlan(job, home, volumes, module, phase, mark, models, inherits))
        before = mark
    return plans


def training_models(context: Context, variant: str, module: str) -> TrainingModels:
    """The models that train a module: of the training split, come through so far.

    For the negative module only those whose difference volume isn't empty.
    """
    shards = []
    inputs = []
    stage = (
        "ingest"
        if module == "positive"
        else context.home("difference", variant).stage("difference")
    )
    for shard, rows in context.shards():
        split = {row["model_id"]: (row["split"], row["row"]) for row in rows}
        record = context.run.ledger.read(stage, shard)
        if record is None:
            continue
        chosen = [
            split[model.model_id][1]
            for model in record.finished
            if split[model.model_id][0] == "train" and not model.note.get("empty", False)
        ]
        if chosen:
            shards.append((shard, tuple(sorted(chosen))))
            inputs.append([shard, record.digest, sorted(chosen)])
    return TrainingModels(tuple(shards), digest(inputs))


def is_done(plan: PhasePlan) -> bool:
    """Whether the phase's record is there, with weights as it says."""
    return (plan.folder / RECORD).exists() and not damaged_files(plan)


def damaged_files(plan: PhasePlan) -> list[str]:
    """Files of a recorded phase that are missing or changed, the record itself included."""
    try:
        outputs = json.loads((plan.folder / RECORD).read_bytes())["outputs"].items()
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return [RECORD]
    return [
        name
        for name, expected in outputs
        if not (plan.folder / name).is_file() or file_digest(plan.folder / name) != expected
    ]


def run(context: Context, variant: str, module: str) -> None:
    """Train what isn't trained.

    Raises
    ------
    RunError
        When there is nothing to train on, or training failed.
    InterruptedRunError
        When the run was asked to stop; training goes on from its last checkpoint.
    """
    todo = [plan for plan in phase_plans(context, variant, module) if not is_done(plan)]
    if not todo:
        return
    context.start_ray()
    for plan in todo:
        _train(context, plan)


def _train(context: Context, plan: PhasePlan) -> None:
    import ray
    from ray.exceptions import RayError

    if not plan.models.count:
        what = "shape" if plan.module == "positive" else "shape with a difference volume"
        raise RunError(
            f"train-{plan.module}: there is no {what} in the training split; "
            "check dataset.split, or give trained weights with `weights:`"
        )
    plan.folder.mkdir(parents=True, exist_ok=True)
    epochs = plan.job.training.epochs
    context.events("phase-start", stage=f"train-{plan.module}", phase=plan.name)
    # A task of its own keeps the driver light, and can be cancelled: Ray Train then ends its
    # workers and gives back their CPUs, which killing it would not.
    fitting = ray.remote(num_cpus=0, max_retries=0)(_fit).remote(plan)
    with context.reporter.track(f"train {plan.name}", epochs, "epochs") as tracker:
        while not ray.wait([fitting], timeout=POLL_SECONDS)[0]:
            last = _last_epoch(plan)
            if last is not None:
                tracker.update(last["epoch"] + 1, f"loss={last['total']:.5f}")
            signal_number = context.interrupted()
            if signal_number is not None:
                ray.cancel(fitting, force=False, recursive=False)
                ray.wait([fitting], timeout=0 if context.owns_ray() else CANCEL_SECONDS)
                raise InterruptedRunError(
                    f"stopped in phase {plan.name}; it goes on from its last checkpoint",
                    128 + signal_number,
                )
        try:
            ray.get(fitting)
        except RayError as error:
            raise RunError(f"training {plan.name} failed: {error}") from error
        tracker.update(epochs)
    _finish(plan)
    context.events("phase-end", stage=f"train-{plan.module}", phase=plan.name)


def _fit(plan: PhasePlan) -> None:
    import ray
    from ray.train import CheckpointConfig, FailureConfig, RunConfig, ScalingConfig
    from ray.train.torch import TorchConfig, TorchTrainer

    runtime, workers = plan.job.runtime, plan.job.training.workers
    available: dict[str, float] = ray.cluster_resources()  # type: ignore[no-untyped-call]
    gpu = runtime.device == "cuda" or (
        runtime.device == "auto" and available.get("GPU", 0) >= workers
    )
    resources: dict[str, float] = {"CPU": runtime.threads}
    if gpu:
        resources["GPU"] = 1
    TorchTrainer(
        _train_loop,
        train_loop_config={"plan": plan, "gpu": gpu},
        scaling_config=ScalingConfig(
            num_workers=workers, use_gpu=gpu, resources_per_worker=resources
        ),
        torch_config=TorchConfig(backend="nccl" if gpu else "gloo"),
        run_config=RunConfig(
            name=plan.fingerprint,
            storage_path=str(plan.home.checkpoints(plan.name)),
            failure_config=FailureConfig(max_failures=2),
            checkpoint_config=CheckpointConfig(num_to_keep=2),
        ),
    ).fit()


def _finish(plan: PhasePlan) -> None:
    """Keep weights and curves, drop Ray Train's own files, and write the record last."""
    for path in plan.folder.iterdir():
        if path.name not in (WEIGHTS, CURVES):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    record = {
        "format": "pnabs/phase",
        "version": 1,
        "phase": plan.name,
        "fingerprint": plan.fingerprint,
        "models": plan.models.count,
        "epochs": plan.job.training.epochs,
        "outputs": {name: file_digest(plan.folder / name) for name in (WEIGHTS, CURVES)},
    }
    write_atomic(plan.folder / RECORD, pretty_json(record))


def _last_epoch(plan: PhasePlan) -> dict[str, Any] | None:
    last = None
    for event in read_events(plan.home.run, f"train-{plan.name}-{plan.fingerprint[:8]}-0"):
        if event["event"] == "epoch":
            last = event
    return last


def _train_loop(config: dict[str, Any]) -> None:
    """One worker's part of a phase; runs in a process of Ray Train."""
    import resource

    import ray.train
    import torch
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
    device = ray.train.torch.get_device() if config["gpu"] else torch.device("cpu")
    events = EventLog(plan.home.run, f"train-{plan.name}-{plan.fingerprint[:8]}-{rank}")
    seed = int(digest([job.seed, plan.name])[:8], 16)
    dataset = load_training_set(
        RunFolder(job.out), plan.volumes, job, plan.module, plan.models, rank=rank, world=world
    )
    events("data", phase=plan.name, models=len(dataset), bytes=dataset.nbytes)

    torch.manual_seed(seed)
    if plan.inherits is None:
        total = torch.from_numpy(dataset.mean_occupancy())
        if world > 1:
            torch.distributed.all_reduce(total)
        count = job.network.positives if plan.module == "positive" else job.network.negatives
        start = start_points(total.numpy() / world, count, job.network.start)
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
            mean = torch.tensor(list(losses.values()), dtype=torch.float64) / world
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
