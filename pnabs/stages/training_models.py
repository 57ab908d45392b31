"""Which models train a module, and which show how well it does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class TrainingModels:
    """Models of one split: rows of shards, and a digest of what they are.

    Attributes
    ----------
    shards
        (shard, (n,) rows in it) in the catalogue's order.
    """

    shards: tuple[tuple[str, NDArray[np.int32]], ...]
    digest: str

    @property
    def count(self) -> int:
        """Models in all."""
        return sum(len(rows) for _, rows in self.shards)

    def few(self, most: int) -> TrainingModels:
        """At most so many of them, evenly chosen; the digest stays that of all."""
        chosen = np.unique(np.linspace(0, self.count - 1, min(most, self.count)).round())
        shards, first = [], 0
        for shard, rows in self.shards:
            here = chosen[(chosen >= first) & (chosen < first + len(rows))] - first
            if len(here):
                shards.append((shard, rows[here.astype(np.int64)]))
            first += len(rows)
        return TrainingModels(tuple(shards), self.digest)

    def part(self, rank: int, world: int) -> list[tuple[str, NDArray[np.int32]]]:
        """The rows one of `world` workers holds: every `world`-th, as many for each.

        Where the count doesn't divide, the first models come twice, so that all
        workers make as many steps.
        """
        rows = np.concatenate([rows for _, rows in self.shards])
        shard = np.repeat(np.arange(len(self.shards)), [len(rows) for _, rows in self.shards])
        mine = np.arange(rank, len(rows) + -len(rows) % world, world) % len(rows)
        cuts = np.flatnonzero(np.diff(shard[mine])) + 1
        return [(self.shards[shard[places[0]]][0], rows[places]) for places in np.split(mine, cuts)]
