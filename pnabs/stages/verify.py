"""verify: everything stored is read back; what is damaged is to be done again."""

from __future__ import annotations

from pathlib import Path

from pnabs.dataset.errors import DatasetError
from pnabs.stages.context import Context
from pnabs.stages.errors import UsageError
from pnabs.stages.phases import CURVES, RECORD, WEIGHTS, damaged_files
from pnabs.stages.progress import Reporter
from pnabs.stages.status import stored_context
from pnabs.stages.train_state import STATE, damaged_state, drop
from pnabs.store.atomic import write_atomic
from pnabs.store.ledger import DamagedRecordError
from pnabs.store.run import RunFolder, RunFolderError

DAMAGE_EXIT_CODE = 5


def verify(run: RunFolder, reporter: Reporter) -> list[str]:
    """Compare every file with its digest and withdraw the records of those that differ.

    Returns
    -------
    One line for each damaged file, paths relative to the run folder.

    Raises
    ------
    UsageError
        When the folder isn't a run.
    pnabs.store.ledger.LedgerError
        When a record is of another version.
    """
    found = _identity(run, reporter)
    for stage in run.ledger.stages():
        found += _records(run, stage)
    found += _phases(run)
    return found


def _identity(run: RunFolder, reporter: Reporter) -> list[str]:
    """run.json and the catalogue; with them sound, the arrays' descriptions as well."""
    if not (run.root / "run.json").exists() and not run.ledger.stages():
        raise UsageError(f"{run.root} is not a run folder: there is no run.json in it")
    try:
        context = stored_context(run, reporter)
    except (RunFolderError, DatasetError) as error:
        return [str(error)]
    return _descriptions(context)


def _records(run: RunFolder, stage: str) -> list[str]:
    """A stage's records, what they vouch for, and the list derived from them."""
    ledger = run.ledger
    found = []
    # A record that is gone leaves its shard pending.
    for shard in ledger.lost(stage):
        path = ledger.path(stage, shard).relative_to(run.root)
        found.append(f"{path} is missing: {stage} of shard {shard} is to be done again")
    for shard in ledger.shards(stage):
        path = ledger.path(stage, shard).relative_to(run.root)
        try:
            record = ledger.read(stage, shard)
        except DamagedRecordError:
            found.append(f"{path} is damaged: {stage} of shard {shard} is to be done again")
            ledger.withdraw(stage, shard)
            continue
        damaged = ledger.damaged_outputs(record) if record else []
        if damaged:
            found += [
                f"{name} is missing or damaged: {stage} of shard {shard} is to be done again"
                for name in damaged
            ]
            ledger.withdraw(stage, shard)
    quarantine = ledger.quarantine_path(stage)
    if not found and quarantine.exists():
        expected = ledger.quarantine(stage)
        if quarantine.read_bytes() != expected:
            found.append(f"{quarantine.relative_to(run.root)} was damaged; made again")
            write_atomic(quarantine, expected)
    else:
        ledger.write_quarantine(stage)
    ledger.save_index(stage)
    return found


def _phases(run: RunFolder) -> list[str]:
    found = []
    for folder in sorted(run.root.glob("variants/*/checkpoints/*/*")):
        finished = (folder / RECORD).exists()
        damaged = damaged_files(folder) if finished else _unfinished(folder)
        if damaged:
            found += [_phase_line(run, folder, name) for name in damaged]
            for name in (RECORD, WEIGHTS, CURVES):
                (folder / name).unlink(missing_ok=True)
            drop(folder)
    return found


def _unfinished(folder: Path) -> list[str]:
    damaged = damaged_state(folder)
    # Weights stand under a state until their record is written.
    lost = (folder / WEIGHTS).exists() and not (folder / STATE).exists()
    return damaged or ([RECORD] if lost else [])


def _phase_line(run: RunFolder, folder: Path, name: str) -> str:
    path = (folder / name).relative_to(run.root)
    return f"{path} is missing or damaged: {folder.parent.name} is to be trained again"


def _descriptions(context: Context) -> list[str]:
    """The arrays' descriptions, made again where they differ from what they should be."""
    stores = [context.run.fields(context.job)]
    for name, job in context.variants.items():
        stores.append(context.run.differences(context.run.variant(name), job))
    return [
        f"{path.relative_to(context.run.root)} was missing or damaged; made again"
        for store in stores
        for category, count in context.shards.counts.items()
        if (store.store / category).is_dir()
        for path in store.ensure(category, count)
    ]
