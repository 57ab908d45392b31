"""What a run has done and has left to do, from its files alone: no Ray, no dataset."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import pyarrow as pa

from pnabs.dataset import catalogue as catalogues
from pnabs.settings import Settings
from pnabs.stages import abstract, difference, ingest
from pnabs.stages.context import Context
from pnabs.stages.errors import RunError, UsageError
from pnabs.stages.job import Job
from pnabs.stages.phases import PhasePlan, is_done, last_epoch, phase_plans
from pnabs.stages.plan import homes
from pnabs.stages.progress import Reporter
from pnabs.stages.sharded import ShardPlan, chosen, is_chosen
from pnabs.store.events import read_events
from pnabs.store.run import RunFolder


@dataclass(frozen=True, slots=True)
class StageStatus:
    """How far a stage is.

    Attributes
    ----------
    unit
        What `done` and `total` count: shards, or epochs of a training phase.
    models, models_total
        Models with a verdict, and all of the stage; None where that isn't known yet.
    quarantined
        Kind -> models that fell out.
    rate
        Units a second when last at work, None when nothing tells.
    seconds_left
        Estimate from that rate.
    """

    stage: str
    unit: str
    done: int
    total: int | None
    models: int
    models_total: int | None
    quarantined: dict[str, int]
    rate: float | None
    seconds_left: float | None

    def to_json(self) -> dict[str, Any]:
        """As `pnabs status --json` prints it."""
        return asdict(self)


def stored_context(run: RunFolder, reporter: Reporter) -> Context:
    """The context of a run as its files have it, for commands that only read.

    Raises
    ------
    RunError
        When the folder isn't a run.
    """
    identity = run.read_identity()
    if identity is None:
        raise UsageError(f"{run.root} is not a run folder: there is no run.json in it")
    settings = Settings.model_validate(identity["settings"])
    # The folder may have been moved since.
    settings = settings.model_copy(update={"out": run.root.absolute()})
    job = Job(settings, identity["origins"], run.root / "run.json")
    stored = run.catalogue.exists()
    catalogue = catalogues.read(run.catalogue) if stored else catalogues.SCHEMA.empty_table()
    return context_of(job, run, reporter, catalogue)


def context_of(job: Job, run: RunFolder, reporter: Reporter, catalogue: pa.Table) -> Context:
    """A context in which nothing can be run."""

    def refuse(*_: Any, **__: Any) -> Any:
        raise RunError("this command only reads")

    return Context(
        job=job.settings,
        variants=job.variants(),
        run=run,
        catalogue=catalogue,
        selected=None,
        executor=refuse,
        reporter=reporter,
        events=refuse,
        max_failed=100.0,
        interrupted=lambda: None,
        start_ray=refuse,
    )


def status(context: Context) -> list[StageStatus]:
    """Every stage of every variant, in the order a run does them."""
    rates = _rates(context.run)
    out = [_sharded(context, "ingest", partial(ingest.plans, context), rates, context.catalogue)]
    for name, job in context.variants.items():
        variant = context.run.variant(name)

        def mine(stage: str, name: str = name) -> bool:
            return homes(context.variants, stage)[name] == name

        trained = job.weights is None
        if trained and mine("train-positive"):
            out += _phases(context, name, "positive", rates)
        if trained and job.abstract.negatives and mine("difference"):
            stage = variant.stage("difference")
            out.append(_sharded(context, stage, partial(difference.plans, context, name), rates))
        if trained and job.abstract.negatives and mine("train-negative"):
            out += _phases(context, name, "negative", rates)
        if mine("abstract"):
            stage = variant.stage("abstract")
            plans = partial(abstract.plans, context, name)
            out.append(_sharded(context, stage, plans, rates, context.catalogue))
    return out


def _sharded(
    context: Context,
    stage: str,
    plan: Callable[[], list[ShardPlan]],
    rates: dict[str, float],
    catalogue: pa.Table | None = None,
) -> StageStatus:
    try:
        plans: list[ShardPlan] | None = chosen(context, plan())
    except RunError:
        # What an untrained module leaves open can't be counted yet.
        plans = None
    done = models = 0
    kinds: Counter[str] = Counter()
    for item in plans or ():
        record = context.run.ledger.read(stage, item.shard)
        if record is not None and record.fingerprint == item.fingerprint:
            done += 1
            models += len(record.models)
            kinds.update(model.kind for model in record.quarantined)
    total = None if plans is None else len(plans)
    if catalogue is not None:
        # Shards that aren't ingested yet are to be done by later stages too.
        shards = catalogue["shard"].unique().to_pylist()
        total = max(total or 0, sum(is_chosen(context, shard) for shard in shards))
    models_total = None if plans is None else sum(item.models for item in plans)
    rate = rates.get(stage)
    left = (models_total - models) / rate if rate and models_total is not None else None
    return StageStatus(stage, "shards", done, total, models, models_total, dict(kinds), rate, left)


def _phases(
    context: Context, variant: str, module: str, rates: dict[str, float]
) -> Iterator[StageStatus]:
    epochs = context.variants[variant].training.epochs
    for plan in phase_plans(context, variant, module):
        done = epochs if is_done(plan) else _epochs(plan)
        stage = f"train {plan.name}" + ("" if variant == "main" else f"@{variant}")
        rate = rates.get(plan.name)
        left = (epochs - done) / rate if rate else None
        count = plan.models.count
        yield StageStatus(stage, "epochs", done, epochs, count, count, {}, rate, left)


def _epochs(plan: PhasePlan) -> int:
    last = last_epoch(plan)
    done = 0 if last is None else int(last["epoch"]) + 1
    # A phase that ran to its end and isn't done has lost its files: it begins again.
    return done if done < plan.job.training.epochs else 0


def _rates(run: RunFolder) -> dict[str, float]:
    """Models or epochs a second of each stage and phase when last at work."""
    begun: dict[str, tuple[int, float]] = {}
    done: Counter[str] = Counter()
    rates: dict[str, float] = {}
    for event in read_events(run.root):
        kind = event["event"]
        if kind not in ("stage-start", "shard", "epoch"):
            continue
        name = event["phase"] if kind == "epoch" else event["stage"]
        if kind == "stage-start" or begun.get(name, (0, 0.0))[0] != event["pid"]:
            # Another process: what came before the pause says nothing of the rate.
            begun[name] = (event["pid"], event["time"])
            done[name] = 0
            continue
        done[name] += event["models"] if kind == "shard" else 1
        if event["time"] > begun[name][1]:
            rates[name] = done[name] / (event["time"] - begun[name][1])
    return rates


def render(stages: list[StageStatus]) -> str:
    """The status as aligned text, one line a stage."""
    header = ("stage", "done", "models", "quarantined", "rate", "left")
    rows = [header, *(_cells(item) for item in stages)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(header))]
    lines = ["  ".join(cell.ljust(widths[i]) for i, cell in enumerate(row)) for row in rows]
    return "".join(f"{line.rstrip()}\n" for line in lines)


def _cells(item: StageStatus) -> tuple[str, ...]:
    total = "?" if item.total is None else str(item.total)
    models_total = "?" if item.models_total is None else str(item.models_total)
    kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(item.quarantined.items()))
    finished = item.total is not None and item.done >= item.total
    left = "-" if item.seconds_left is None or finished else f"{item.seconds_left:.0f} s"
    unit = "models" if item.unit == "shards" else item.unit
    return (
        item.stage,
        f"{item.done}/{total} {item.unit}",
        f"{item.models}/{models_total}",
        kinds or "-",
        "-" if item.rate is None else f"{item.rate:.2f} {unit}/s",
        left,
    )
