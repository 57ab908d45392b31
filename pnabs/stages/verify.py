"""verify: everything stored is read back; what is damaged is to be done again."""

from __future__ import annotations

from pnabs.dataset import catalogue as catalogues
from pnabs.stages.context import Context, split_shard
from pnabs.stages.phases import RECORD, damaged_files, phase_plans
from pnabs.store.ledger import LedgerError

DAMAGE_EXIT_CODE = 5


def verify(context: Context) -> list[str]:
    """Compare every file with its digest and withdraw the records of those that differ.

    Returns
    -------
    One line for each damaged file or record.
    """
    ledger = context.run.ledger
    found = _catalogue(context) + _descriptions(context)
    for stage in ledger.stages():
        for shard in ledger.shards(stage):
            try:
                record = ledger.read(stage, shard)
            except LedgerError as error:
                found.append(str(error))
                ledger.withdraw(stage, shard)
                continue
            damaged = ledger.damaged_outputs(record) if record else []
            if damaged:
                found += [f"{stage} {shard}: {name} is missing or damaged" for name in damaged]
                ledger.withdraw(stage, shard)
    for variant, job in context.variants.items():
        if job.weights is not None:
            continue
        for module in ("positive", "negative") if job.abstract.negatives else ("positive",):
            for plan in phase_plans(context, variant, module):
                damaged = damaged_files(plan) if (plan.folder / RECORD).exists() else []
                if damaged:
                    found += [f"{plan.name}: {name} is missing or damaged" for name in damaged]
                    (plan.folder / RECORD).unlink()
    return found


def _catalogue(context: Context) -> list[str]:
    identity = context.run.read_identity() or {}
    if catalogues.fingerprint(context.catalogue) == identity.get("dataset_fingerprint"):
        return []
    return [
        f"{context.run.catalogue} is missing or damaged: restore it from a copy, or begin a new "
        "run folder; models would be counted in another order"
    ]


def _descriptions(context: Context) -> list[str]:
    """The arrays' descriptions, made again where they can't be read."""
    shards: dict[str, int] = {}
    for shard, _ in context.shards():
        category, number = split_shard(shard)
        shards[category] = max(shards.get(category, 0), number + 1)
    stores = [context.run.fields(context.job)]
    for name, job in context.variants.items():
        stores.append(context.run.differences(context.run.variant(name), job))
    return [
        f"{path.relative_to(context.run.root)} was missing or damaged; made again"
        for store in stores
        for category, count in shards.items()
        if (store.store / category).is_dir()
        for path in store.mend(category, count)
    ]
