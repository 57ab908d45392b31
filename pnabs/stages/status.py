"""What a run has done and has left to do, from its files alone: no Ray, no dataset."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any, Literal

from pydantic import ValidationError

from pnabs.dataset import catalogue as catalogues
from pnabs.settings import Settings
from pnabs.stages import plans, train_state
from pnabs.stages.context import Context
from pnabs.stages.errors import RefusedError, RunError, UsageError
from pnabs.stages.job import Job
from pnabs.stages.phases import PhasePlan, is_done, last_epoch, phase_plans
from pnabs.stages.progress import Reporter
from pnabs.stages.sharded import ShardPlan, chosen, is_chosen
from pnabs.stages.shards import Shards
from pnabs.store.events import read_events
from pnabs.store.lock import Holder, holder
from pnabs.store.run import RunFolder

STATES = ("done", "running", "failed", "pending")


@dataclass(frozen=True, slots=True)
class ShardState:
    """One shard of one stage.

    Attributes
    ----------
    state
        `done`; `running`: a worker has it now; `failed`: for a cause that is no model's; else
        `pending`.
    detail
        Of a running shard its worker's host and process, of a failed one the cause.
    """

    shard: str
    state: Literal["done", "running", "failed", "pending"]
    detail: str = ""


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
    shards
        The stage's shards in the catalogue's order; empty for training.
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
    shards: list[ShardState] = field(default_factory=list)

    def of(self, state: str) -> list[ShardState]:
        """The shards in a state."""
        return [shard for shard in self.shards if shard.state == state]

    def to_json(self, *, shards: bool = False) -> dict[str, Any]:
        """As `pnabs status --json` prints it.

        Parameters
        ----------
        shards
            List every shard; else only those that run or failed.
        """
        out = {name: getattr(self, name) for name in self.__slots__}
        listed = [item for item in self.shards if shards or item.state in ("running", "failed")]
        counts: Counter[str] = Counter(item.state for item in self.shards)
        out["states"] = {name: counts[name] for name in STATES} if self.unit == "shards" else {}
        out["shards"] = [asdict(item) for item in listed]
        return out


def stored_context(run: RunFolder, reporter: Reporter) -> Context:
    """The context of a run as its files have it, for commands that only read.

    Raises
    ------
    RunError
        When the folder isn't a run.
    """
    identity = _identity(run)
    job = _job(run, identity)
    if run.catalogue.exists() or run.ledger.stages():
        mark = run.check_catalogue(identity)
        shards = Shards.of_file(run.catalogue, run.catalogue_index, mark)
    else:
        shards = Shards.of_table(catalogues.SCHEMA.empty_table())
    given, kept = identity["weights"], identity["kept_weights"]
    return context_of(job, run, reporter, shards, given=given, kept=kept)


def stored_job(run: RunFolder) -> Job:
    """The job that a run was last made with.

    Raises
    ------
    RunError
        When the folder isn't a run.
    """
    return _job(run, _identity(run))


def _identity(run: RunFolder) -> dict[str, Any]:
    identity = run.read_identity()
    if identity is None:
        raise UsageError(f"{run.root} is not a run folder: there is no run.json in it")
    return identity


def _job(run: RunFolder, identity: dict[str, Any]) -> Job:
    try:
        settings = Settings.model_validate(identity["settings"])
    except ValidationError as error:
        raise RefusedError(
            f"{run.root / 'run.json'} has settings that this pnabs doesn't know ({error}): use the "
            "pnabs that made it"
        ) from None
    # The folder may have been moved since.
    settings = settings.model_copy(update={"out": run.root.absolute()})
    job = Job(settings, identity["origins"], run.root / "run.json")
    return job.in_order_of(identity)


def context_of(
    job: Job,
    run: RunFolder,
    reporter: Reporter,
    shards: Shards,
    *,
    given: Mapping[str, str],
    kept: dict[str, str],
) -> Context:
    """A context in which nothing can be run.

    Parameters
    ----------
    given, kept
        `Context.given_weights` and `Context.kept_weights`.
    """

    def refuse(*_: Any, **__: Any) -> Any:
        raise RunError("this command only reads")

    return Context(
        job=job.settings,
        variants=job.variants(),
        run=run,
        shards=shards,
        selected=None,
        executor=refuse,
        reporter=reporter,
        events=refuse,
        max_failed=100.0,
        interrupted=lambda: None,
        start_ray=refuse,
        given_weights=given,
        kept_weights=kept,
    )


def status(context: Context) -> list[StageStatus]:
    """Every stage of every variant, in the order a run does them."""
    past = read_history(context.run)
    out = [_sharded(context, "ingest", partial(plans.ingest, context), past, every=True)]
    for name, job in context.variants.items():
        variant = context.run.variant(name)

        def mine(stage: str, name: str = name) -> bool:
            return context.homes(stage)[name] == name

        trained = job.weights is None
        if trained and mine("train-positive"):
            out += _phases(context, name, "positive", past)
        if trained and job.abstract.negatives and mine("difference"):
            stage = variant.stage("difference")
            out.append(_sharded(context, stage, partial(plans.difference, context, name), past))
        if trained and job.abstract.negatives and mine("train-negative"):
            out += _phases(context, name, "negative", past)
        if mine("abstract"):
            stage = variant.stage("abstract")
            plan = partial(plans.abstract, context, name)
            out.append(_sharded(context, stage, plan, past, every=True))
    return out


def _sharded(
    context: Context,
    stage: str,
    plan: Callable[[], list[ShardPlan]],
    past: History,
    *,
    every: bool = False,
) -> StageStatus:
    """A sharded stage.

    Parameters
    ----------
    every
        Whether every shard of the catalogue is to go through it.
    """
    try:
        wanted: list[ShardPlan] | None = chosen(context, plan())
    except RunError:
        # What an untrained module leaves open can't be counted yet.
        wanted = None
    entries = context.run.ledger.index(stage)
    models = 0
    kinds: Counter[str] = Counter()
    states: dict[str, ShardState] = {}
    for item in wanted or ():
        entry = entries.get(item.shard)
        if entry is not None and entry.fingerprint == item.fingerprint:
            models += entry.models
            kinds.update(kind for _, kind in entry.fallen)
            states[item.shard] = ShardState(item.shard, "done")
        else:
            states[item.shard] = past.state(stage, item.shard)
    if every:
        # Shards that aren't ingested yet are to be done by later stages too.
        names = [name for name in context.shards.names if is_chosen(context, name)]
        states = {name: states.get(name) or ShardState(name, "pending") for name in names}
    done = sum(item.state == "done" for item in states.values())
    total = None if wanted is None and not every else len(states)
    models_total = None if wanted is None else sum(item.models for item in wanted)
    rate = past.rates.get(stage)
    left = (models_total - models) / rate if rate and models_total is not None else None
    shards = list(states.values())
    return StageStatus(
        stage, "shards", done, total, models, models_total, dict(kinds), rate, left, shards
    )


def _phases(context: Context, variant: str, module: str, past: History) -> Iterator[StageStatus]:
    epochs = context.variants[variant].training.epochs
    for plan in phase_plans(context, variant, module):
        running = past.driver is not None
        done = epochs if is_done(plan) else _epochs(plan, running=running)
        stage = f"train {plan.name}" + ("" if variant == "main" else f"@{variant}")
        rate = past.rates.get(plan.name)
        left = (epochs - done) / rate if rate else None
        count = plan.models.count
        yield StageStatus(stage, "epochs", done, epochs, count, count, {}, rate, left)


def _epochs(plan: PhasePlan, *, running: bool) -> int:
    # A phase that isn't under way goes on from its checkpoint, whatever it had done since.
    state = train_state.read_state(plan.folder)
    done = 0 if state is None else state.epoch
    last = last_epoch(plan) if running else None
    return done if last is None else max(done, int(last["epoch"]) + 1)


@dataclass(slots=True)
class History:
    """What the events tell.

    Attributes
    ----------
    rates
        Stage or phase -> models or epochs a second when last at work.
    last
        (stage, shard) -> last event of the shard.
    driver
        Who is at work, or None.
    """

    rates: dict[str, float]
    last: dict[tuple[str, str], dict[str, Any]]
    driver: Holder | None

    def state(self, stage: str, shard: str) -> ShardState:
        """The state of a shard that isn't done."""
        event = self.last.get((stage, shard), {})
        if event.get("event") == "shard-failed":
            return ShardState(shard, "failed", event.get("reason", ""))
        driver = self.driver
        mine = driver is not None and event.get("time", 0) >= driver.since
        mine = mine and (event.get("host"), event.get("pid")) == (driver.host, driver.pid)  # type: ignore[union-attr]
        if event.get("event") == "shard-start" and mine:
            return ShardState(shard, "running", event.get("where", ""))
        return ShardState(shard, "pending")


def read_history(run: RunFolder) -> History:
    """Go through all events once."""
    begun: dict[str, tuple[int, float]] = {}
    done: Counter[str] = Counter()
    past = History({}, {}, holder(run.root))
    for event in read_events(run.root):
        kind = event["event"]
        if kind in ("shard-start", "shard", "shard-failed"):
            past.last[event.get("stage", ""), event.get("shard", "")] = event
        if kind not in ("stage-start", "shard", "epoch"):
            continue
        name = event.get("phase" if kind == "epoch" else "stage", "")
        if kind == "stage-start" or begun.get(name, (0, 0.0))[0] != event["pid"]:
            # Another process: what came before the pause says nothing of the rate.
            begun[name] = (event["pid"], event["time"])
            done[name] = 0
            continue
        done[name] += event.get("models", 0) if kind == "shard" else 1
        if event["time"] > begun[name][1]:
            past.rates[name] = done[name] / (event["time"] - begun[name][1])
    return past


def render(stages: list[StageStatus], *, shards: bool = False) -> str:
    """The status as text: a line a stage, then the shards that run or failed.

    Parameters
    ----------
    shards
        List every shard.
    """
    header = ("stage", "done", "running", "failed", "pending", "models", "quarantined", "rate",
              "left")  # fmt: skip
    text = _table([header, *(_cells(item) for item in stages)])
    listed = [
        (stage.stage, item.shard, item.state, item.detail)
        for stage in stages
        for item in stage.shards
        if shards or item.state in ("running", "failed")
    ]
    return text + ("\n" + _table(listed) if listed else "")


def _table(rows: Sequence[tuple[str, ...]]) -> str:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]) - 1)] + [0]
    lines = ["  ".join(cell.ljust(widths[i]) for i, cell in enumerate(row)) for row in rows]
    return "".join(f"{line.rstrip()}\n" for line in lines)


def _cells(item: StageStatus) -> tuple[str, ...]:
    total = "?" if item.total is None else str(item.total)
    models_total = "?" if item.models_total is None else str(item.models_total)
    kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(item.quarantined.items()))
    finished = item.total is not None and item.done >= item.total
    left = "-" if item.seconds_left is None or finished else f"{item.seconds_left:.0f} s"
    sharded = item.unit == "shards"
    counts = [str(len(item.of(state))) if sharded else "-" for state in STATES[1:]]
    if item.total is None:
        counts[-1] = "?"
    unit = "models" if sharded else item.unit
    return (
        item.stage,
        f"{item.done}/{total} {item.unit}",
        *counts,
        f"{item.models}/{models_total}",
        kinds or "-",
        "-" if item.rate is None else f"{item.rate:.2f} {unit}/s",
        left,
    )
