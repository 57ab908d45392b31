"""train-positive and train-negative: two phases each, through Ray Train."""

from __future__ import annotations

import secrets
import shutil
import time
from typing import Any

from pnabs.stages import plans, train_state
from pnabs.stages.context import Context
from pnabs.stages.errors import InterruptedRunError, RunError, TrainingError, UsageError
from pnabs.stages.phases import (
    RECORD,
    PhasePlan,
    damaged_files,
    is_done,
    phase_plans,
    source_stage,
)
from pnabs.stages.progress import Tracker
from pnabs.stages.sharded import pending
from pnabs.stages.train_loop import train_loop
from pnabs.store.events import EventTail
from pnabs.store.run import RunFolder

POLL_SECONDS = 0.3
QUIET_SECONDS = 60.0
"""When workers have told of nothing for so long, the user is told."""

START_SECONDS = 600.0
"""What training workers may take to start on a busy cluster."""

FAILURES = 2
"""How often a lost worker makes Ray Train start the phase's workers again."""

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
    todo = []
    for plan in phase_plans(context, variant, module):
        if is_done(plan):
            # A worker killed just after it wrote the record left it behind.
            train_state.drop(plan.folder)
        else:
            todo.append(plan)
    if not todo:
        return
    _check_complete(context, variant, module)
    context.start_ray()
    _check_resources(todo[0])
    if not todo[0].models.count:
        if module == "positive":
            raise RunError(
                "train-positive: there is no shape in the training split; "
                "check dataset.split, or give trained weights with `weights:`"
            )
        raise RunError(
            "train-negative: no training shape has a difference volume, so there is nothing to "
            "learn negatives from: do without them (abstract.negatives: false), or give trained "
            "weights with `weights:`"
        )
    _train(context, todo)


def _check_complete(context: Context, variant: str, module: str) -> None:
    stage = source_stage(context, variant, module)
    positive = module == "positive"
    wanted = plans.ingest(context) if positive else plans.difference(context, variant)
    missing = pending(context, stage, wanted)
    if missing:
        raise UsageError(
            f"train-{module} takes the job's whole training split, and {len(missing)} of "
            f"{len(wanted)} shards have not been through {stage.partition('@')[0]} yet: run "
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


def _train(context: Context, todo: list[PhasePlan]) -> None:
    """Train phases one after the other in one group of workers."""
    import ray

    for plan in todo:
        _begin(context, plan)
    # Before anything is told of: the second phase begins when the driver may not be looking.
    watches = [_Watch(context, plan) for plan in todo]
    # A task of its own keeps the driver light, and can be cancelled: Ray Train then ends its
    # workers and gives back their CPUs, which killing it would not.
    fitting = ray.remote(num_cpus=0, max_retries=0)(_fit).remote(todo, context.token)
    for plan, watch in zip(todo, watches, strict=True):
        context.events("phase-start", stage=f"train-{plan.module}", phase=plan.name)
        epochs = plan.job.training.epochs
        with context.reporter.track(f"train {plan.name}", epochs, "epochs") as tracker:
            _follow(context, plan, fitting, watch, tracker)
            tracker.update(epochs)
        context.events("phase-end", stage=f"train-{plan.module}", phase=plan.name)
    # The records are there; what Ray Train does to end is waited for, but not for ever.
    if not ray.wait([fitting], timeout=CANCEL_SECONDS)[0]:
        ray.cancel(fitting, force=False, recursive=False)
        ray.wait([fitting], timeout=CANCEL_SECONDS)
    shutil.rmtree(context.run.scratch, ignore_errors=True)


def _follow(
    context: Context, plan: PhasePlan, fitting: Any, watch: _Watch, tracker: Tracker
) -> None:
    """Tell of a phase until its record is there."""
    import ray

    watch.begin()
    while not watch.ended:
        if ray.wait([fitting], timeout=POLL_SECONDS)[0]:
            _result(fitting, plan)
            if not is_done(plan):
                raise TrainingError(f"training {plan.name} ended without a record of it")
            return
        epoch = watch.look()
        if epoch is not None:
            tracker.update(epoch["epoch"] + 1, _figures(epoch))
        signal_number = context.interrupted()
        if signal_number is None and not watch.lost:
            continue
        ray.cancel(fitting, force=False, recursive=False)
        ray.wait([fitting], timeout=0 if context.owns_ray() else CANCEL_SECONDS)
        if signal_number is None:
            raise TrainingError(
                f"training {plan.name} got nowhere: {watch.words}. It goes on from its last "
                "checkpoint when the command is run again."
            )
        raise InterruptedRunError(
            f"stopped in phase {plan.name}; it goes on from its last checkpoint",
            128 + signal_number,
        )


def _figures(epoch: dict[str, Any]) -> str:
    """An epoch's loss, and the IoU of validation models where there are any."""
    iou = epoch["iou"]
    return f"loss={epoch['total']:.5f}" + ("" if iou is None else f" validation-iou={iou:.3f}")


def _result(fitting: Any, plan: PhasePlan) -> None:
    import ray
    from ray.exceptions import RayError

    try:
        ray.get(fitting)
    except RayError as error:
        raise TrainingError(
            f"training {plan.name} failed: {_cause(error)}\n"
            "It goes on from its last checkpoint when the command is run again."
        ) from error


def _begin(context: Context, plan: PhasePlan) -> None:
    """Make the phase's folder; what is damaged in it goes, and the phase begins again."""
    plan.folder.mkdir(parents=True, exist_ok=True)
    damaged = train_state.damaged_state(plan.folder)
    if (plan.folder / RECORD).exists():
        damaged += damaged_files(plan.folder)
    if damaged:
        context.reporter.say(
            f"{plan.name}: {', '.join(damaged)} is missing or damaged; the phase begins again"
        )
        shutil.rmtree(plan.folder)
        plan.folder.mkdir()
    train_state.begin(plan.folder)


class _Watch:
    """Follows a phase by its workers' events, and tells when none come."""

    def __init__(self, context: Context, plan: PhasePlan) -> None:
        self._context, self._plan = context, plan
        self._tail = EventTail(plan.home.run, f"train-{plan.name}-{plan.fingerprint[:8]}-*")
        self._moved = self._told = time.monotonic()
        self._last = "its workers have not told of anything yet"
        self.lost = self.ended = False

    def begin(self) -> None:
        """Count the time without a word from now on."""
        self._moved = self._told = time.monotonic()

    @property
    def words(self) -> str:
        """What was last heard."""
        return f"nothing has moved for {time.monotonic() - self._moved:.0f} s; {self._last}"

    def look(self) -> dict[str, Any] | None:
        """The last epoch among the new events, if any."""
        epoch = None
        now = time.monotonic()
        for event in self._tail():
            self._moved = now
            what = event.get("what") or event["event"]
            self._last = f"last heard from {event['host']} ({event['pid']}): {what}"
            if event["event"] == "epoch":
                epoch = event
            self.ended |= event["event"] == "finished"
        idle = now - self._moved
        if idle > QUIET_SECONDS and now - self._told > QUIET_SECONDS:
            self._told = now
            self._context.reporter.say(f"train {self._plan.name}: {self.words}")
            self._context.events("warning", stage=f"train-{self._plan.module}", message=self.words)
        self.lost = idle > START_SECONDS + self._plan.job.runtime.stall
        return epoch


def _cause(error: BaseException) -> str:
    """What a worker raised, rather than the frames of Ray around it."""
    cause: BaseException = error
    while (deeper := getattr(cause, "cause", None) or cause.__cause__) is not None:
        cause = deeper
    failures = getattr(cause, "worker_failures", None)
    if failures:
        rank, failure = next(iter(sorted(failures.items())))
        return f"worker {rank}: {_cause(failure)}"
    lines = [line for line in str(cause).splitlines() if line.strip()]
    return f"{type(cause).__name__}: {lines[-1] if lines else ''}"


def _fit(todo: list[PhasePlan], token: str) -> None:
    import ray
    from ray.train import FailureConfig, RunConfig, ScalingConfig
    from ray.train.torch import TorchConfig, TorchTrainer

    plan = todo[0]
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
        train_loop_config={"plans": todo, "gpu": gpu, "token": token},
        scaling_config=ScalingConfig(
            num_workers=workers, use_gpu=gpu, resources_per_worker=resources
        ),
        torch_config=TorchConfig(backend="nccl" if gpu else "gloo"),
        # A name of its own each time: what Ray Train would resume from is not ours.
        run_config=RunConfig(
            name=f"{plan.module}-{secrets.token_hex(4)}",
            storage_path=str(RunFolder(plan.home.run).scratch),
            failure_config=FailureConfig(
                max_failures=FAILURES,
                controller_failure_limit=1,  # type: ignore[call-arg]
            ),
        ),
    ).fit()
