"""Rows of RUN/fields.zarr as shapes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pnabs.pipeline import Shape
from pnabs.settings import Settings
from pnabs.stages.context import split_shard
from pnabs.store.boundaries import read_boundaries
from pnabs.store.run import RunFolder

NAMES = (
    *("occupancy", "occupancy_64", "occupancy_128", "occupancy_192", "sdf"),
    *("surface", "transform", "mirror", "extent"),
)


class StoredShard:
    """The shapes of one shard that came through ingest.

    Parameters
    ----------
    rows
        Their rows in the shard, ascending.

    Raises
    ------
    pnabs.store.errors.DamagedDataError
        When stored data is missing or damaged.
    """

    def __init__(self, run: RunFolder, job: Settings, shard: str, rows: list[int]) -> None:
        self.rows = rows
        self._boundaries = run.boundaries(shard)
        store = run.fields(job)
        category, number = split_shard(shard)
        count = max(rows, default=-1) + 1
        self._arrays: dict[str, NDArray[Any]] = {
            name: store.read_shard(category, number, name, count)[rows] for name in NAMES
        }

    @property
    def occupancy(self) -> NDArray[np.bool_]:
        """(n, 32, 32, 32) bool."""
        return self._arrays["occupancy"].astype(bool)

    @property
    def sdf(self) -> NDArray[np.float32]:
        """(n, 32, 32, 32) float32."""
        return self._arrays["sdf"]

    def shapes(self) -> Iterator[Shape]:
        """Each row as a shape."""
        boundaries = read_boundaries(self._boundaries, self.rows)
        for i, boundary in enumerate(boundaries):
            yield Shape(
                occupancy=self._arrays["occupancy"][i].astype(bool),
                occupancy_64=_unpacked(self._arrays["occupancy_64"][i], 64),
                occupancy_128=_unpacked(self._arrays["occupancy_128"][i], 128),
                occupancy_192=_unpacked(self._arrays["occupancy_192"][i], 192),
                sdf=self._arrays["sdf"][i],
                surface=self._arrays["surface"][i],
                transform=self._arrays["transform"][i],
                mirror=int(self._arrays["mirror"][i]),
                extent=self._arrays["extent"][i],
                boundary=boundary,
            )


def _unpacked(bits: NDArray[np.uint8], resolution: int) -> NDArray[np.bool_]:
    return np.unpackbits(bits).reshape((resolution,) * 3).astype(bool)
