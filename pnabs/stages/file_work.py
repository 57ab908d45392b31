"""The work of `pnabs abstract`: one mesh file to the files of its abstraction."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import pnabs
from pnabs import batch
from pnabs.batch.work import Committed
from pnabs.formats import Abstraction, from_json, written
from pnabs.pipeline import Abstractor
from pnabs.settings import Settings
from pnabs.stages.file_state import Item, mark_of, result_fingerprint
from pnabs.stages.head_start import PRELOAD
from pnabs.stages.reach import check_dataset, check_run
from pnabs.stages.reading import blamed, read_mesh
from pnabs.stages.writing import clear_partials, write_files
from pnabs.store.atomic import write_atomic

HIDDEN = ".pnabs"
"""Folder of the lock, below the results; no mesh below a hidden folder is ever taken."""


@dataclass(slots=True)
class FileTask:
    """One mesh, in the isolated child: from its file to the files of its abstraction."""

    job: Settings
    recipe: str
    _abstractor: Abstractor | None = field(default=None, repr=False)

    def __call__(self, item: Item) -> dict[str, bytes]:
        """File name -> content, the record last."""
        if item.known is not None:
            return written(from_json(item.known), item.formats)
        abstraction = self._abstract(item)
        files = written(abstraction, [name for name in item.formats if name != "json"])
        return files | written(abstraction, ["json"])

    def _abstract(self, item: Item) -> Abstraction:
        file = item.file
        if file.reason:
            raise batch.InvalidInput(f"{file.source}: {file.reason}")
        with blamed(file.root, file.source):
            read = read_mesh(file.root, file.source, self.job.ingest.limits, file.suffix)
            provenance: dict[str, Any] = {
                "pnabs": pnabs.__version__,
                "seed": self.job.seed,
                "source_sha256": read.sha256,
                "fingerprint": result_fingerprint(self.recipe, read.sha256, read.siblings),
            }
            if read.siblings:
                provenance["siblings"] = sorted(read.siblings)
            return self._loaded()(
                read.mesh, category="", model_id=item.model_id, provenance=provenance
            )

    def _loaded(self) -> Abstractor:
        """The networks; what is wrong with them is no mesh's fault."""
        if self._abstractor is None:
            try:
                self._abstractor = Abstractor(self.job)
            except Exception as error:
                text = f"the networks can't be loaded: {error}"
                raise batch.Unavailable(text) from error
        return self._abstractor


@dataclass
class FileWork:
    """Meshes to results, each a shard of its own."""

    job: Settings
    recipe: str
    token: str
    items: dict[str, Item]
    preload: tuple[str, ...] = PRELOAD

    @property
    def task(self) -> FileTask:
        """What the child runs."""
        return FileTask(self.job, self.recipe)

    def check(self) -> None:
        """See the meshes' and the results' folder."""
        check_dataset(self.job.dataset.root)
        check_run(self.job.out / HIDDEN, self.token)

    def mark(self, model_id: str) -> str:
        """What the verdict on a mesh depends on."""
        return mark_of(self.job, self.recipe, self.items[model_id].file, ())

    def setup(self) -> None:
        """Nothing: all work is the child's."""

    def payloads(self, shard: str) -> Iterable[tuple[str, Item]]:
        """The one mesh."""
        yield shard, self.items[shard]

    def commit(self, shard: str, outcomes: Sequence[batch.Outcome]) -> Committed:
        """Write the results of the one mesh; of one that fell out, remove what is there."""
        (outcome,) = outcomes
        folder, item = self.job.out / shard, self.items[shard]
        if outcome.kind == "ok" and item.known is not None:
            clear_partials(folder)
            for name, data in outcome.value.items():
                write_atomic(folder / name, data)
        elif outcome.kind == "ok" or folder.is_dir():
            write_files(folder, outcome.value or {})
        return Committed({}, {})
