"""train-positive and train-negative: two phases each, through Ray Train."""

from __future__ import annotations

import shutil
import time

from pnabs.stages import difference, ingest
from pnabs.stages.context import Context
from pnabs.stages.errors import InterruptedRunError, RunError, UsageError
from pnabs.stages.phases import (
    CURVES,
    RECORD,
    WEIGHTS,
    PhasePlan,
    is_done,
    last_epoch,
    phase_plans,
    source_stage,
)
from pnabs.stages.sharded import pending
from pnabs.stages.train_loop import train_loop
from pnabs.store.atomic import file_digest, pretty_json, write_atomic

POLL_SECONDS = 0.3
CANCEL_SECONDS = 20.0
"""How long an interrupted run waits for Ray Train to end its workers on a Ray that stays."""


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
    _check_complete(context, variant, module)
    context.start_ray()
    _check_resources(todo[0])
    for plan in todo:
        _train(context, plan)


def _check_complete(context: Context, variant: str, module: str) -> None:
    stage = source_stage(context, variant, module)
    positive = module == "positive"
    plans = ingest.plans(context) if positive else difference.plans(context, variant)
    missing = pending(context, stage, plans)
    if missing:
        raise UsageError(
            f"train-{module} takes the job's whole training split, and {len(missing)} of "
            f"{len(plans)} shards have not been through {stage.partition('@')[0]} yet: run "
            "that first, without --category. To train on some categories alone, name them in "
            "dataset.categories."
        )


def _check_resources(plan: PhasePlan) -> None:
    """Ray would wait for ever for what the cluster doesn't have."""
    import ray

    runtime, workers = plan.job.runtime, plan.job.training.workers
    available: dict[str, float] = ray.cluster_resources()  # type: ignore[no-untyped-call]
    cpus, gpus = int(available.get("CPU", 0)), int(available.get("GPU", 0))
    if workers * runtime.threads > cpus:
        raise UsageError(
            f"training.workers={workers} with runtime.threads={runtime.threads} need "
            f"{workers * runtime.threads} CPUs, and Ray has {cpus}"
        )
    if runtime.device == "cuda" and workers > gpus:
        raise UsageError(
            f"runtime.device=cuda with training.workers={workers} needs {workers} GPUs, "
            f"and Ray has {gpus}"
        )


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
    begun = time.time()
    fitting = ray.remote(num_cpus=0, max_retries=0)(_fit).remote(plan)
    with context.reporter.track(f"train {plan.name}", epochs, "epochs") as tracker:
        while not ray.wait([fitting], timeout=POLL_SECONDS)[0]:
            last = last_epoch(plan)
            if last is not None and last["time"] >= begun:
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
        train_loop,
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
