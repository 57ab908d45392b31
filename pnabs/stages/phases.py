"""The four training phases: what each depends on, where it lies, whether it is done.

A phase's folder is `checkpoints/<module>-<phase>/<fingerprint>`.  While it trains, its
last checkpoint lies there (`progress`); when it is done the folder holds the weights,
the loss curves and, written last, a record.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pnabs.settings import Settings
from pnabs.stages.context import Context
from pnabs.stages.errors import UsageError
from pnabs.stages.identity import given_weights
from pnabs.stages.job import Job
from pnabs.stages.plan import fingerprint, homes, recipe_digest, stages_of
from pnabs.stages.training_models import TrainingModels
from pnabs.store.atomic import is_as_written
from pnabs.store.events import read_events
from pnabs.store.run import RunFolder, Variant
from pnabs.store.sealed import SealError, unseal

WEIGHTS = "weights.safetensors"
CURVES = "curves.json"
RECORD = "record.json"
PHASES = ("initial", "refinement")
VALIDATION_MODELS = 64
"""Models at most whose IoU is measured after each epoch."""


@dataclass(frozen=True, slots=True, eq=False)
class PhasePlan:
    """One phase to be trained.

    Attributes
    ----------
    home
        The variant in whose folder it lies.
    volumes
        The variant in whose folder the difference volumes lie.
    validation
        Models of the validation split that are measured after each epoch; they change nothing.
    inherits
        Weights that the phase begins with: for refinement those of the initial phase, for the
        initial one those of `training.init_from`, if any.
    """

    job: Settings
    home: Variant
    volumes: Variant
    module: str
    phase: str
    fingerprint: str
    models: TrainingModels
    validation: TrainingModels
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
    if job.weights_folder is not None:
        path = job.weights_folder / f"{module}.safetensors"
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
    """The two phases of a module with what each depends on.

    Where the user kept the weights when the dataset changed, the phases are those that
    made them.
    """
    job = context.variants[variant]
    stage = f"train-{module}"
    home = context.home(stage, variant)
    volumes = context.home("difference", variant)
    recipe = recipe_digest(stage, job)
    models = training_models(context, variant, module)
    validation = training_models(context, variant, module, "val").few(VALIDATION_MODELS)
    plans: list[PhasePlan] = []
    init = job.training.init_weights(module)
    before = context.given_weights.get(f"{variant}/init_from/{module}")
    for phase in PHASES:
        inputs = {"phase": phase, "models": models.digest, "before": before}
        mark = fingerprint(recipe, inputs)
        mark = context.kept_weights.get(kept_key(recipe, phase), mark)
        inherits = plans[-1].folder / WEIGHTS if plans else init
        plans.append(
            PhasePlan(job, home, volumes, module, phase, mark, models, validation, inherits)
        )
        before = mark
    return plans


def kept_key(recipe: str, phase: str) -> str:
    """What names a phase's weights in run.json when they are kept."""
    return f"{recipe[:16]}-{phase}"


def find_weights(job: Job, run: RunFolder) -> dict[str, str]:
    """The last finished phases that were trained with a job's settings, whatever the models.

    Returns
    -------
    `kept_key` -> fingerprint of the phase.

    Raises
    ------
    UsageError
        When a module that the job trains has no finished weights of its settings.
    """
    kept = {}
    variants, weights = job.variants(), given_weights(job)
    for variant, settings in variants.items():
        trained = [stage for stage in stages_of(settings) if stage.startswith("train-")]
        for stage in trained:
            recipe = recipe_digest(stage, settings)
            home = run.variant(homes(variants, stage, weights)[variant])
            for phase in PHASES:
                name = f"{stage.removeprefix('train-')}-{phase}"
                folder = _last_finished(home.checkpoints(name), recipe)
                if folder is None:
                    raise UsageError(
                        f"--keep-weights: {name} of variant {variant} has no finished weights of "
                        "these settings in the run folder"
                    )
                kept[kept_key(recipe, phase)] = folder.name
    return kept


def _last_finished(checkpoints: Path, recipe: str) -> Path | None:
    found = []
    for path in checkpoints.glob(f"*/{RECORD}"):
        if damaged_files(path.parent) == []:
            record = unseal(path.read_bytes())
            if record["recipe"] == recipe:
                found.append((path.stat().st_mtime_ns, path.parent))
    return max(found)[1] if found else None


def training_models(
    context: Context, variant: str, module: str, split: str = "train"
) -> TrainingModels:
    """The models that train a module, or of another split: those that came through so far.

    For the negative module only those whose difference volume isn't empty.
    """
    ledger, source = context.run.ledger, source_stage(context, variant, module)
    state = ledger.generation("ingest"), ledger.generation(source)
    known = context.training.get((source, split))
    if known is None or known[0] != state:
        known = state, _training_models(context, source, split)
        context.training[source, split] = known
    return known[1]


def _training_models(context: Context, source: str, split: str) -> TrainingModels:
    ingested, last = (context.run.ledger.index(stage) for stage in ("ingest", source))
    chosen = []
    inputs = hashlib.sha256()
    for number, shard in enumerate(context.shards.names):
        first, entry = ingested.get(shard), last.get(shard)
        if first is None or entry is None:
            continue
        gone = {*dict(first.fallen), *dict(entry.fallen), *entry.empty}
        rows = context.shards.chosen(number, (split,), gone)
        if len(rows):
            chosen.append((shard, rows))
            inputs.update(f"{shard} {entry.digest} {len(rows)}\n".encode())
            inputs.update(rows.astype("<i4").tobytes())
    return TrainingModels(tuple(chosen), inputs.hexdigest())


def is_done(plan: PhasePlan) -> bool:
    """Whether the phase's record is there, with weights as it says."""
    return (plan.folder / RECORD).exists() and not damaged_files(plan.folder)


def damaged_files(folder: Path) -> list[str]:
    """Files of a recorded phase that are missing or changed, the record itself included."""
    try:
        outputs = unseal((folder / RECORD).read_bytes())["outputs"].items()
    except (OSError, SealError):
        return [RECORD]
    return [name for name, expected in outputs if not is_as_written(folder / name, expected)]


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
