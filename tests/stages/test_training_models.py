from __future__ import annotations

import numpy as np
import pytest

from pnabs.stages.training_models import TrainingModels

SHARDS = (
    ("a-0", np.int32([0, 2, 3])),
    ("a-1", np.int32([1])),
    ("b-0", np.arange(6, dtype=np.int32)),
)


def pairs(models: TrainingModels) -> list[tuple[str, int]]:
    return [(shard, int(row)) for shard, rows in models.shards for row in rows]


@pytest.mark.parametrize("most", [1, 4, 9, 10, 64])
def test_few_are_some_of_all_in_order(most: int) -> None:
    every = TrainingModels(SHARDS, "")
    few = every.few(most)
    assert few.count == min(most, every.count)
    places = [pairs(every).index(pair) for pair in pairs(few)]
    assert places == sorted(set(places))
    assert all(len(rows) for _, rows in few.shards)
    # Evenly: no two gaps differ by more than rounding does.
    assert len(places) < 3 or np.ptp(np.diff(places)) <= 1


def test_few_of_none_are_none() -> None:
    assert TrainingModels((), "").few(5).count == 0
