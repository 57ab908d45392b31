"""One sharded stage: what is missing is done, committed shard by shard, and counted."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from pnabs.batch import Outcome, ShardDone, ShardFailed, ShardWork, Unavailable, Watcher
from pnabs.stages.context import Context, split_shard
from pnabs.stages.errors import (
    InterruptedRunError,
    RefusedError,
    ShardsFailedError,
    TooManyFailedError,
)
from pnabs.stages.progress import Tracker
from pnabs.store.ledger import DamagedRecordError, ModelVerdict, Record
from pnabs.store.lock import NotHeldError, check_held

FIRST_MODELS = 32
"""So many models tell whether nearly all fail."""

NEARLY_ALL = 0.9
"""Share of the first models whose failure ends a run early."""

FAILURES_TOLD = 20
"""Failed shards whose causes a message tells one by one."""


@dataclass(frozen=True, slots=True)
class ShardPlan:
    """A shard to be seen to: its fingerprint, and how many models it has for the stage."""

    shard: str
    fingerprint: str
    models: int


def pending(context: Context, stage: str, plans: list[ShardPlan]) -> list[ShardPlan]:
    """The shards without a record of the fingerprint they should have."""
    entries = context.run.ledger.index(stage)
    return [
        plan
        for plan in plans
        if (entry := entries.get(plan.shard)) is None or entry.fingerprint != plan.fingerprint
    ]


def is_chosen(context: Context, shard: str) -> bool:
    """Whether `--category` leaves a shard in."""
    return context.selected is None or split_shard(shard)[0] in context.selected


def chosen(context: Context, plans: list[ShardPlan]) -> list[ShardPlan]:
    """The shards that `--category` leaves in."""
    return [plan for plan in plans if is_chosen(context, plan.shard)]


def run_sharded(
    context: Context,
    stage: str,
    work: ShardWork,
    plans: list[ShardPlan],
    prepare: Callable[[dict[str, int]], None],
) -> None:
    """Do a stage's missing shards.

    Parameters
    ----------
    stage
        Name of the stage's records.
    plans
        Every shard of the stage; those committed with the same fingerprint are passed over.
    prepare
        Makes room in the stores: is given category -> number of shards.

    Raises
    ------
    TooManyFailedError
        When nearly all of the first models fell out.  More than allowed in all is
        noted in `context.problems`, and the run goes on.
    ShardsFailedError
        When shards failed for causes that are no model's.
    InterruptedRunError
        When the run was asked to stop.
    OSError
        When the driver itself can't write any more.
    """
    ledger = context.run.ledger
    wanted = chosen(context, plans)
    todo = {plan.shard: plan for plan in pending(context, stage, wanted)}
    if todo:
        _withdraw_stale(context, stage, todo)
        present = {split_shard(plan.shard)[0] for plan in plans}
        counts = context.shards.counts.items()
        prepare({category: count for category, count in counts if category in present})
        total = sum(plan.models for plan in wanted)
        left = sum(plan.models for plan in todo.values())
        context.events("stage-start", stage=stage, shards=len(todo), models=left)
        with context.reporter.track(stage, total, "models") as tracker, _derived(context, stage):
            progress = _Progress(context, stage, tracker, total, total - left)
            progress.progress(0)
            try:
                for result in context.executor().map(work, list(todo), progress):
                    if isinstance(result, ShardFailed):
                        progress.failed(result)
                    else:
                        record = _record(stage, result, todo[result.shard].fingerprint)
                        _check_held(context)
                        ledger.commit(record)
                        progress.done(result, record)
                        progress.stop_if_hopeless()
                    progress.stop_if_asked()
            except Unavailable as error:
                raise ShardsFailedError(_failures(progress, len(todo), str(error))) from None
        context.events("stage-end", stage=stage)
        if progress.failures:
            raise ShardsFailedError(_failures(progress, len(todo), ""))
    else:
        # A driver killed after its last commit left them behind.
        _derive(context, stage)
    _check_failures(context, stage, plans)


def _withdraw_stale(context: Context, stage: str, shards: Iterable[str]) -> None:
    """Take back the records of other settings or inputs, before their data is written over.

    Else a shard that is cut short, by settings that are then set back, would count as done.
    """
    ledger = context.run.ledger
    stale = [shard for shard in shards if shard in ledger.index(stage)]
    for shard in stale:
        ledger.withdraw(stage, shard)
    if stale:
        _derive(context, stage)
    else:
        ledger.save_index(stage)


def _check_held(context: Context) -> None:
    """End a driver that slept so long that another has taken the run folder over."""
    try:
        check_held(context.run.root, context.token)
    except NotHeldError as error:
        raise RefusedError(f"{error}. This driver ends; the other goes on.") from None


@contextlib.contextmanager
def _derived(context: Context, stage: str) -> Iterator[None]:
    """However a stage ends, bring what is derived from its records up to date."""
    try:
        yield
    except BaseException:
        # A disk that is full must not hide why the stage ends.
        with contextlib.suppress(OSError):
            _derive(context, stage)
        raise
    _derive(context, stage)


def _derive(context: Context, stage: str) -> None:
    context.run.ledger.save_index(stage)
    context.run.ledger.write_quarantine(stage)


@dataclass(slots=True)
class _Progress(Watcher):
    """Counts what is committed, tells of it, and ends the stage when asked to."""

    context: Context
    stage: str
    tracker: Tracker
    total: int
    before: int
    seen: int = 0
    fallen: int = 0
    shards: int = 0
    failures: list[ShardFailed] = field(default_factory=list)

    def started(self, shard: str, where: str) -> None:
        self.context.events("shard-start", stage=self.stage, shard=shard, where=where)

    def progress(self, models: int) -> None:
        note = f"quarantined={self.fallen}" if self.fallen else ""
        if self.failures:
            note += f" shards-failed={len(self.failures)}"
        done = min(self.before + self.seen + models, self.total)
        self.tracker.update(done, note.strip())
        self.stop_if_asked()

    def warn(self, message: str) -> None:
        self.context.reporter.say(f"{self.stage}: {message}")
        self.context.events("warning", stage=self.stage, message=message)

    def done(self, done: ShardDone, record: Record) -> None:
        """Count a shard that is committed."""
        self.shards += 1
        self.seen += len(record.models)
        self.fallen += len(record.quarantined)
        self.context.events(
            "shard",
            stage=self.stage,
            shard=done.shard,
            models=len(record.models),
            quarantined=len(record.quarantined),
            seconds=round(done.seconds, 3),
            peak_memory=done.peak_memory,
        )

    def failed(self, failure: ShardFailed) -> None:
        self.failures.append(failure)
        self.context.events(
            "shard-failed", stage=self.stage, shard=failure.shard, reason=failure.reason
        )
        self.context.reporter.say(f"{self.stage}: shard {failure.shard} failed: {failure.reason}")

    def stop_if_hopeless(self) -> None:
        """End a run whose first models nearly all fall out."""
        first = self.seen >= FIRST_MODELS and self.before == 0
        if first and self.fallen > NEARLY_ALL * self.seen and self.context.max_failed < 100:
            raise TooManyFailedError(_nearly_all(self.context, self.stage, self.fallen, self.seen))

    def stop_if_asked(self) -> None:
        signal_number = self.context.interrupted()
        if signal_number is not None:
            raise InterruptedRunError(
                f"stopped in {self.stage}: {self.before + self.seen} of {self.total} models are "
                "committed, and stay; what was in flight is dropped",
                128 + signal_number,
            )


def _failures(progress: _Progress, shards: int, hopeless: str) -> str:
    failures = progress.failures
    causes = "".join(f"\n  {item.shard}: {item.reason}" for item in failures[:FAILURES_TOLD])
    if len(failures) > FAILURES_TOLD:
        causes += f"\n  ... (`pnabs status {progress.context.run.root} --shards` lists all)"
    text = f"{progress.stage}: {len(failures)} of {shards} shards could not be finished:{causes}"
    if hopeless:
        left = shards - len(failures) - progress.shards
        text = (
            f"{progress.stage} ends here, because no shard could be finished any more: {hopeless}"
            + (f"\n{len(failures)} shards failed:{causes}" if failures else "")
            + (f"\n{left} shards were not begun." if left else "")
        )
    return f"{text}\nWhat is committed stays; the same command does just the others."


def _check_failures(context: Context, stage: str, plans: list[ShardPlan]) -> None:
    entries = context.run.ledger.index(stage)
    found = [entry for plan in plans if (entry := entries.get(plan.shard)) is not None]
    models = sum(entry.models for entry in found)
    fallen = sum(len(entry.fallen) for entry in found)
    if models and 100 * fallen / models > context.max_failed:
        context.problems.append(
            f"{stage}: {fallen} of {models} models fell out, more than {context.max_failed:g} %; "
            f"see {context.run.root / 'quarantine' / f'{stage}.jsonl'}"
        )


def _nearly_all(context: Context, stage: str, fallen: int, seen: int) -> str:
    reasons: dict[str, int] = {}
    for shard, entry in context.run.ledger.index(stage).items():
        try:
            record = context.run.ledger.read(stage, shard) if entry.fallen else None
        except DamagedRecordError:
            continue
        for model in record.quarantined if record else ():
            key = f"{model.kind}: {model.reason}"
            reasons[key] = reasons.get(key, 0) + 1
    reason, count = max(reasons.items(), key=lambda item: item[1])
    return (
        f"{stage}: {fallen} of the first {seen} models fell out, so the run stops here; "
        f"most often ({count} times): {reason}. --max-failed 100 goes on regardless."
    )


def _record(stage: str, done: ShardDone, fingerprint: str) -> Record:
    verdicts = tuple(_verdict(outcome, done.notes) for outcome in done.outcomes)
    return Record(stage, done.shard, fingerprint, verdicts, done.outputs)


def _verdict(outcome: Outcome, notes: dict[str, dict[str, object]]) -> ModelVerdict:
    return ModelVerdict(
        outcome.model_id,
        outcome.kind,
        outcome.reason,
        outcome.attempts,
        outcome.traceback,
        notes.get(outcome.model_id, {}),
    )
