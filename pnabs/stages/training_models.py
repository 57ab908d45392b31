"""Which models train a module."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class TrainingModels:
    """The models that train a module: rows of shards, and a digest of what they are.

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
