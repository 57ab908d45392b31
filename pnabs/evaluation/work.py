"""A batch of items to a file of rows: what workers do."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from pnabs import batch
from pnabs.batch.work import Committed
from pnabs.evaluation.items import Item, StoredShape
from pnabs.evaluation.plan import Todo
from pnabs.evaluation.rows import METRICS, Rows
from pnabs.evaluation.task import EvaluateTask, Measuring
from pnabs.pipeline import Shape
from pnabs.settings import Settings
from pnabs.stages.reach import check_dataset, check_run
from pnabs.stages.stored import StoredShard
from pnabs.store.run import RunFolder

PRELOAD = ("pnabs.evaluation.warm",)

LONGEST_REASON = 2000


@dataclass
class EvaluateWork:
    """Batches of items.

    Attributes
    ----------
    folder
        Of the rows, held by the driver.
    token
        By which workers know that it still is.
    measuring
        What rows depend on.
    todo
        The items.
    roots
        What shapes and results are read from.
    run
        The settings of the run that stored the shapes; None where they are meshes.
    """

    folder: Path
    token: str
    measuring: Measuring
    todo: Todo
    roots: tuple[str, ...]
    run: Settings | None
    preload: tuple[str, ...] = PRELOAD

    @property
    def task(self) -> EvaluateTask:
        """What the child runs."""
        return EvaluateTask(self.measuring)

    def check(self) -> None:
        """See the evaluation's folder, the shapes and the results."""
        check_run(self.folder, self.token)
        for root in self.roots:
            check_dataset(root)

    def setup(self) -> None:
        """Nothing: all work is the child's."""

    def payloads(self, shard: str) -> Iterable[tuple[str, tuple[Item, Shape | None]]]:
        """The batch's items, each with its shape where a run has stored it."""
        items = self.todo.read(shard)
        stored = self._stored(items)
        for item in items:
            yield item.label, (item, stored.get(item.shape_mark))

    def _stored(self, items: Sequence[Item]) -> dict[str, Shape]:
        if self.run is None:
            return {}
        rows: dict[str, dict[int, str]] = defaultdict(dict)
        for item in items:
            if isinstance(item.shape, StoredShape) and not item.shape.reason:
                rows[item.shape.shard][item.shape.row] = item.shape_mark
        found: dict[str, Shape] = {}
        for shard, marks in rows.items():
            wanted = sorted(marks)
            stored = StoredShard(RunFolder(self.run.out), self.run, shard, wanted)
            found |= {marks[row]: shape for row, shape in zip(wanted, stored.shapes(), strict=True)}
        return found

    def commit(self, shard: str, outcomes: Sequence[batch.Outcome]) -> Committed:
        """Write the rows of a batch: of each item what was found, or why nothing was."""
        rows = []
        for item, outcome in zip(self.todo.read(shard), outcomes, strict=True):
            row = {
                "fingerprint": item.fingerprint,
                "status": str(outcome.kind),
                "reason": outcome.reason[:LONGEST_REASON],
                "attempts": outcome.attempts,
                "traceback": outcome.traceback,
            }
            if outcome.kind == "ok":
                known = {"not_exact", "not_closed", *METRICS}
                row |= {
                    name: value
                    for name, value in outcome.value.items()
                    if name in known or name.startswith("frame_")
                }
            rows.append(row)
        return Committed(Rows(self.folder).write(shard, rows), {})
