"""One training worker's part of the data, packed, read shard by shard from the stores."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pnabs.settings import Settings
from pnabs.stages.context import split_shard
from pnabs.stages.training_models import TrainingModels
from pnabs.store.arrays import CategoryArrays
from pnabs.store.run import RunFolder, Variant

if TYPE_CHECKING:
    from pnabs.model.data import TrainingSet

SURFACE_POINTS = 2048
"""Surface points a model kept in memory; each step draws from them."""


def load_training_set(
    run: RunFolder,
    home: Variant,
    job: Settings,
    module: str,
    models: TrainingModels,
    *,
    rank: int,
    world: int,
    on_shard: Callable[[str], None] = lambda _: None,
) -> TrainingSet:
    """Read what a module's phases use, and nothing else, about 100 kB a model.

    Parameters
    ----------
    home
        The variant whose difference volumes train the negative module.
    on_shard
        Called with each shard's name before it is read.

    Raises
    ------
    pnabs.store.errors.DamagedDataError
        When stored data is missing or damaged.
    """
    from pnabs.model.data import TrainingSet

    fields = run.fields(job)
    volumes = fields if module == "positive" else run.differences(home, job)
    parts: dict[str, list[NDArray[Any]]] = {}
    for shard, rows in models.part(rank, world):
        on_shard(shard)
        occupancy = _read(volumes, shard, "occupancy", rows)
        surface = _read(volumes, shard, "surface", rows)
        # Samples lie in the order of the faces they are on: a stride keeps them even.
        step = max(1, surface.shape[1] // SURFACE_POINTS)
        part: dict[str, NDArray[Any]] = {
            "occupancy": np.packbits(occupancy.reshape(len(rows), -1), axis=1),
            "sdf": _read(volumes, shard, "sdf", rows).astype(np.float16),
            "surface": surface[:, ::step, :3].astype(np.float16),
            "interior": _read(volumes, shard, "interior", rows).astype(np.float16),
            "mirror": _read(fields, shard, "mirror", rows),
        }
        if module == "negative":
            part["shape_interior"] = _read(fields, shard, "interior", rows).astype(np.float16)
        for name, value in part.items():
            parts.setdefault(name, []).append(value)
    return TrainingSet(**{name: np.concatenate(values) for name, values in parts.items()})


def _read(store: CategoryArrays, shard: str, name: str, rows: NDArray[np.int32]) -> NDArray[Any]:
    category, number = split_shard(shard)
    values: NDArray[Any] = store.read_shard(category, number, name, int(max(rows)) + 1)[rows]
    return values
