"""The four training phases: what each depends on, where it lies, whether it is done.

A phase's folder is `checkpoints/<module>-<phase>/<fingerprint>`.  While it trains,
Ray Train keeps its checkpoints there and resumes from the last one; when it is
done the folder holds the weights, the loss curves and, written last, a record.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pnabs.settings import Settings
from pnabs.stages.context import Context
from pnabs.stages.errors import UsageError
from pnabs.stages.plan import fingerprint
from pnabs.stages.training_data import TrainingModels
from pnabs.store.atomic import digest, file_digest
from pnabs.store.events import read_events
from pnabs.store.run import Variant

WEIGHTS = "weights.safetensors"
CURVES = "curves.json"
RECORD = "record.json"
PHASES = ("initial", "refinement")


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
            raise UsageError(f"weights: there is no {path}")
        return path
    plan = phase_plans(context, variant, module)[-1]
    if not is_done(plan):
        raise UsageError(
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
    stage = source_stage(context, variant, module)
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


def source_stage(context: Context, variant: str, module: str) -> str:
    """The stage whose records name the models that train a module."""
    if module == "positive":
        return "ingest"
    return context.home("difference", variant).stage("difference")


def last_epoch(plan: PhasePlan) -> dict[str, Any] | None:
    """The last epoch event of a phase that is under way, or None."""
    last = None
    for event in read_events(plan.home.run, f"train-{plan.name}-{plan.fingerprint[:8]}-0"):
        if event["event"] == "epoch":
            last = event
    return last
