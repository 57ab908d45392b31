"""One sharded stage: what is missing is done, committed shard by shard, and counted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pnabs.batch import Outcome, ShardDone, ShardFailed, ShardWork
from pnabs.stages.context import Context, split_shard
from pnabs.stages.errors import InterruptedRunError, ShardsFailedError, TooManyFailedError
from pnabs.store.ledger import ModelVerdict, Record

FIRST_MODELS = 32
"""So many models tell whether nearly all fail."""

NEARLY_ALL = 0.9
"""Share of the first models whose failure ends a run early."""


@dataclass(frozen=True, slots=True)
class ShardPlan:
    """A shard to be seen to: its fingerprint, and how many models it has for the stage."""

    shard: str
    fingerprint: str
    models: int


def pending(context: Context, stage: str, plans: list[ShardPlan]) -> list[ShardPlan]:
    """The shards without a record of the fingerprint they should have."""
    missing = []
    for plan in plans:
        record = context.run.ledger.read(stage, plan.shard)
        if record is None or record.fingerprint != plan.fingerprint:
            missing.append(plan)
    return missing


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
    """
    ledger = context.run.ledger
    wanted = chosen(context, plans)
    todo = {plan.shard: plan for plan in pending(context, stage, wanted)}
    total = sum(plan.models for plan in wanted)
    before = total - sum(plan.models for plan in todo.values())
    failed: list[ShardFailed] = []
    if todo:
        highest: dict[str, int] = {}
        for plan in plans:
            category, number = split_shard(plan.shard)
            highest[category] = max(highest.get(category, 0), number + 1)
        prepare(highest)
        context.events("stage-start", stage=stage, shards=len(todo), models=total - before)
        seen = fallen = 0
        with context.reporter.track(stage, total, "models") as tracker:
            note = ""
            tracker.update(before)

            def progress(done: int) -> None:
                tracker.update(min(before + done, total), note)
                _stop_if_asked(context, stage)

            for result in context.executor().map(work, list(todo), progress):
                if isinstance(result, ShardFailed):
                    failed.append(result)
                    context.events(
                        "shard-failed", stage=stage, shard=result.shard, reason=result.reason
                    )
                    continue
                record = _record(stage, result, todo[result.shard].fingerprint)
                ledger.commit(record)
                seen += len(record.models)
                fallen += len(record.quarantined)
                note = f"quarantined={fallen}" if fallen else ""
                context.events(
                    "shard",
                    stage=stage,
                    shard=result.shard,
                    models=len(record.models),
                    quarantined=len(record.quarantined),
                    seconds=round(result.seconds, 3),
                    peak_memory=result.peak_memory,
                )
                if (
                    seen >= FIRST_MODELS
                    and before == 0
                    and fallen > NEARLY_ALL * seen
                    and context.max_failed < 100
                ):
                    ledger.write_quarantine(stage)
                    raise TooManyFailedError(_nearly_all(context, stage, fallen, seen))
                _stop_if_asked(context, stage)
            if not failed:
                tracker.update(total, note)
        context.events("stage-end", stage=stage)
        ledger.write_quarantine(stage)
    if failed:
        causes = "\n".join(f"  {item.shard}: {item.reason}" for item in failed)
        raise ShardsFailedError(
            f"{stage}: {len(failed)} of {len(todo)} shards could not be finished:\n{causes}\n"
            "The others are committed; the same command does just these again."
        )
    _check_failures(context, stage, plans)


def _check_failures(context: Context, stage: str, plans: list[ShardPlan]) -> None:
    models = fallen = 0
    for plan in plans:
        record = context.run.ledger.read(stage, plan.shard)
        if record is not None:
            models += len(record.models)
            fallen += len(record.quarantined)
    if models and 100 * fallen / models > context.max_failed:
        context.problems.append(
            f"{stage}: {fallen} of {models} models fell out, more than {context.max_failed:g} %; "
            f"see {context.run.root / 'quarantine' / f'{stage}.jsonl'}"
        )


def _nearly_all(context: Context, stage: str, fallen: int, seen: int) -> str:
    reasons: dict[str, int] = {}
    for shard in context.run.ledger.shards(stage):
        record = context.run.ledger.read(stage, shard)
        for model in record.quarantined if record else ():
            key = f"{model.kind}: {model.reason}"
            reasons[key] = reasons.get(key, 0) + 1
    reason, count = max(reasons.items(), key=lambda item: item[1])
    return (
        f"{stage}: {fallen} of the first {seen} models fell out, so the run stops here; "
        f"most often ({count} times): {reason}. --max-failed 100 goes on regardless."
    )


def _stop_if_asked(context: Context, stage: str) -> None:
    signal_number = context.interrupted()
    if signal_number is not None:
        raise InterruptedRunError(
            f"stopped in {stage}; every committed shard stays", 128 + signal_number
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
