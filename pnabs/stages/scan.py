"""scan: the dataset's models, listed once and only ever added to."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from pnabs.dataset import catalogue
from pnabs.dataset.errors import DatasetError
from pnabs.settings import Settings
from pnabs.stages.errors import RefusedError
from pnabs.stages.progress import Reporter
from pnabs.store.run import RunFolder


def scan(
    job: Settings, run: RunFolder, reporter: Reporter, *, accept: bool, write: bool = True
) -> pa.Table:
    """The run's catalogue: made on the first run, compared with the dataset on later ones.

    Parameters
    ----------
    accept
        Take changed and added models into the catalogue.
    write
        Leave the folder as it is when False (`--dry-run`).

    Raises
    ------
    RefusedError
        When models were added or changed and `accept` is False; says which.
    pnabs.dataset.errors.DatasetError
        When the dataset can't be listed and there is no catalogue to go on with.
    """
    old = catalogue.read(run.catalogue) if run.catalogue.exists() else None
    try:
        found = catalogue.scan(job.dataset, Path.cwd())
    except DatasetError as error:
        if old is None:
            raise
        reporter.say(f"the dataset can't be listed ({error}); going on with the catalogue")
        return old
    if old is None:
        if write:
            catalogue.write(found, run.catalogue)
        return found
    merged = catalogue.extend(old, found, job.dataset.shard_size)
    differences = _differences(old, merged)
    if not differences:
        return old
    if not accept:
        raise RefusedError(
            "the dataset has changed since this run began:\n"
            + "\n".join(f"  {line}" for line in differences)
            + "\n--accept-changes takes it as it is now: added models get shards of their own, "
            "changed models' shards are redone, and training with them."
        )
    if write:
        catalogue.write(merged, run.catalogue)
    return merged


def _differences(old: pa.Table, new: pa.Table) -> list[str]:
    lines = []
    before = dict(zip(_keys(old), range(len(old)), strict=True))
    rows = [before.get(key, -1) for key in _keys(new)]
    known = pa.array([row >= 0 for row in rows], pa.bool_())
    added = new.filter(pc.invert(known))
    if len(added):
        counts = pc.value_counts(added["category"]).to_pylist()
        parts = ", ".join(f"{item['counts']} in {item['values']}" for item in counts)
        lines.append(f"added: {len(added)} models ({parts})")
    now = new.filter(known)
    then = old.take(pa.array([row for row in rows if row >= 0], pa.int64()))
    for column in ("source", "size", "split", "reason"):
        changed = then.filter(pc.not_equal(then[column], now[column]))
        if len(changed):
            names = _keys(changed.slice(0, 3))
            more = ", ..." if len(changed) > 3 else ""
            lines.append(f"{column} changed: {len(changed)} models ({', '.join(names)}{more})")
    return lines


def _keys(table: pa.Table) -> list[str]:
    keys: list[str] = pc.binary_join_element_wise(
        table["category"], table["model_id"], "/"
    ).to_pylist()
    return keys
