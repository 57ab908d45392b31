"""verify: everything stored is read back; what is damaged is to be done again."""

from __future__ import annotations

from pnabs.stages.context import Context
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
    found = []
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
