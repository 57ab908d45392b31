"""verify: everything stored is read back; what is damaged is to be done again."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from pnabs.dataset.errors import DatasetError
from pnabs.stages.errors import UsageError
from pnabs.stages.folder import describe
from pnabs.stages.phases import CURVES, RECORD, WEIGHTS, damaged_files
from pnabs.stages.progress import Reporter
from pnabs.stages.status import stored_context, stored_job
from pnabs.stages.train_state import STATE, damaged_state, drop
from pnabs.store.ledger import DamagedRecordError
from pnabs.store.run import RunFolder, RunFolderError

DAMAGE_EXIT_CODE = 5


def verify(run: RunFolder, reporter: Reporter) -> Iterator[str]:
    """Compare every file with its digest and withdraw the records of those that differ.

    Yields
    ------
    One line for each damaged file, paths relative to the run folder, as they are found.

    Raises
    ------
    UsageError
        When the folder isn't a run.
    pnabs.store.ledger.LedgerError
        When a record is of another version.
    """
    if not (run.root / "run.json").exists() and not run.ledger.stages():
        raise UsageError(f"{run.root} is not a run folder: there is no run.json in it")
    try:
        context = stored_context(run, reporter)
    except (RunFolderError, DatasetError) as error:
        yield str(error)
    else:
        # The arrays' descriptions follow from both.
        for path in describe(stored_job(run), run, context.shards):
            yield f"{path.relative_to(run.root)} was missing or damaged; made again"
    for stage in run.ledger.stages():
        yield from _records(run, stage)
    yield from _phases(run)


def _records(run: RunFolder, stage: str) -> Iterator[str]:
    """A stage's records and what they vouch for."""
    ledger = run.ledger
    # A record that is gone leaves its shard pending.
    for shard in ledger.lost(stage):
        path = ledger.path(stage, shard).relative_to(run.root)
        yield f"{path} is missing: {stage} of shard {shard} is to be done again"
    for shard in ledger.shards(stage):
        path = ledger.path(stage, shard).relative_to(run.root)
        try:
            record = ledger.read(stage, shard)
        except DamagedRecordError:
            ledger.withdraw(stage, shard)
            yield f"{path} is damaged: {stage} of shard {shard} is to be done again"
            continue
        damaged = ledger.damaged_outputs(record) if record else []
        if damaged:
            ledger.withdraw(stage, shard)
        for name in damaged:
            yield f"{name} is missing or damaged: {stage} of shard {shard} is to be done again"
    ledger.save_index(stage)
    # Derived: after a kill it may be behind, which is no damage.
    ledger.write_quarantine(stage)


def _phases(run: RunFolder) -> Iterator[str]:
    for folder in sorted(run.root.glob("variants/*/checkpoints/*/*/")):
        finished = (folder / RECORD).exists()
        damaged = damaged_files(folder) if finished else _unfinished(folder)
        if damaged:
            for name in (RECORD, WEIGHTS, CURVES):
                (folder / name).unlink(missing_ok=True)
            drop(folder)
        for name in damaged:
            path = (folder / name).relative_to(run.root)
            yield f"{path} is missing or damaged: {folder.parent.name} is to be trained again"


def _unfinished(folder: Path) -> list[str]:
    damaged = damaged_state(folder)
    # Weights stand under a state until their record is written.
    lost = (folder / WEIGHTS).exists() and not (folder / STATE).exists()
    return damaged or ([RECORD] if lost else [])
