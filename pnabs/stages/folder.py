"""The run folder before the first stage: held, compared with the job, brought up to date."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from pnabs.dataset import catalogue as catalogues
from pnabs.stages.errors import RefusedError, UsageError
from pnabs.stages.identity import check_identity, given_weights
from pnabs.stages.interrupts import Interrupts
from pnabs.stages.job import Job
from pnabs.stages.options import Options
from pnabs.stages.phases import find_weights
from pnabs.stages.plan import VERSIONS
from pnabs.stages.progress import Reporter
from pnabs.stages.scan import scan
from pnabs.stages.shards import Shards
from pnabs.store.atomic import digest, write_atomic
from pnabs.store.lock import LockedError, run_lock
from pnabs.store.run import RunFolder


@contextmanager
def held(run: Path) -> Iterator[str]:
    """Hold the run folder while the body runs; yields the token that its workers know it by.

    Raises
    ------
    RefusedError
        When another driver holds it.
    UsageError
        When it can't be written.
    """
    with ExitStack() as stack:
        try:
            token = stack.enter_context(run_lock(run))
        except LockedError as error:
            raise RefusedError(str(error)) from None
        except OSError as error:
            raise UsageError(f"can't write {run}: {error.strerror}") from None
        yield token


def open_folder(
    run: RunFolder, job: Job, options: Options, reporter: Reporter, interrupts: Interrupts
) -> tuple[Job, Shards, dict[str, str]]:
    """List the dataset, and write what the folder is from now on: run.json, then the catalogue.

    Returns
    -------
    The job with its variants in the folder's order, the catalogue by shard, and the phases whose
    weights the user kept (run.json).

    Raises
    ------
    RefusedError
        When settings, versions or the dataset differ from the folder's and that isn't accepted.
    """
    # A folder in which nothing is done yet has nothing that could be redone.
    accept = options.accept or not run.ledger.stages()
    identity = run.read_identity(anew=accept)
    check_identity(identity, job.settings, accept=accept)
    job = job.in_order_of(identity)
    with interrupts.at_once("listing the dataset"):
        found = scan(job.settings, run, identity, reporter, accept=accept)
    kept = kept_weights(job, run, identity, options)
    run.sweep()
    # Before the catalogue, which takes edited files' new times, is written.
    _withdraw(run, found.edited, options)
    content = catalogues.to_bytes(found.catalogue)
    mark = digest(content)
    run.write_identity(
        job.settings,
        variants=list(job.variants()),
        origins=job.origins,
        stage_versions=VERSIONS,
        dataset_fingerprint=catalogues.fingerprint(found.catalogue),
        catalogue=content,
        weights=given_weights(job),
        kept_weights=kept,
        command=options.command,
    )
    if not run.catalogue.exists() or run.catalogue.read_bytes() != content:
        write_atomic(run.catalogue, content)
    # Read from its file, so that nobody holds the models one by one any more.
    shards = Shards.of_file(run.catalogue, run.catalogue_index, mark)
    shards.save_index(run.catalogue_index, mark)
    if accept:
        describe(job, run, shards)
    return job, shards, kept


def describe(job: Job, run: RunFolder, shards: Shards) -> list[Path]:
    """Bring the descriptions of the arrays that are there up to date; returns those changed."""
    variants = job.variants()
    stores = [run.fields(job.settings)]
    stores += [run.differences(run.variant(name), one) for name, one in variants.items()]
    return [
        path
        for store in stores
        for category, count in shards.counts.items()
        if (store.store / category).is_dir()
        for path in store.ensure(category, count)
    ]


def _withdraw(run: RunFolder, edited: frozenset[str], options: Options) -> None:
    """Take back the records of what is to be done again though its fingerprint stays."""
    ledger = run.ledger
    chosen = {("ingest", shard) for shard in edited}
    if options.retry is not None:
        chosen |= {
            (stage, shard)
            for stage in ledger.stages()
            if options.retry.stage in (None, stage)
            for shard, entry in ledger.index(stage).items()
            if any(options.retry.kind in (None, kind) for _, kind in entry.fallen)
        }
    for stage, shard in chosen:
        ledger.withdraw(stage, shard)
    for stage in {stage for stage, _ in chosen}:
        ledger.save_index(stage)
        ledger.write_quarantine(stage)


def kept_weights(
    job: Job, run: RunFolder, identity: dict[str, Any] | None, options: Options
) -> dict[str, str]:
    """The phases whose weights stay whatever the dataset is now, for run.json."""
    if options.keep_weights:
        return find_weights(job, run)
    # A change that is accepted without it trains again.
    return {} if options.accept or identity is None else dict(identity["kept_weights"])
