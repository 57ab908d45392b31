"""What there is to be done, in batches, and the file that workers read their batch's items from."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import pnabs
from pnabs.evaluation.items import ITEM, Item
from pnabs.evaluation.results import Results
from pnabs.evaluation.shapes import ShapeEntry
from pnabs.evaluation.task import Measuring
from pnabs.store.atomic import digest, write_atomic

VERSION = 1
"""Raised when rows change for the same settings, shapes and results."""

BATCH_SHAPES = 32
"""Shapes at most whose items are committed together."""

BATCHES_EACH = 4
"""Batches that there should be for each worker."""


def recipe(measuring: Measuring) -> str:
    """Of all that every row depends on."""
    values: dict[str, Any] = asdict(measuring) | {"ingest": measuring.ingest.model_dump()}
    return digest({"version": VERSION, "pnabs": pnabs.__version__, "measuring": values})


@dataclass(frozen=True, slots=True)
class Plan:
    """The items of an evaluation.

    Attributes
    ----------
    shapes
        The item of each shape by itself.
    results
        For each set of results, number of a shape -> the item of its result.
    """

    shapes: list[Item]
    results: list[dict[int, Item]]

    @classmethod
    def of(
        cls, shapes: Sequence[ShapeEntry], results: Sequence[Results], measuring: Measuring
    ) -> Plan:
        """What there would be to do if nothing was done yet."""
        made = recipe(measuring)
        alone = [
            Item(digest([made, shape.mark]), shape.label, shape.mark, shape.place)
            for shape in shapes
        ]
        return cls(alone, [dict(_items(shapes, one, made)) for one in results])

    @property
    def items(self) -> int:
        """How many there are."""
        return len(self.shapes) + sum(len(one) for one in self.results)

    def by_shape(self) -> Iterator[list[Item]]:
        """The items of each shape, itself first."""
        for number, shape in enumerate(self.shapes):
            yield [shape, *(one[number] for one in self.results if number in one)]

    def fingerprints(self) -> Iterator[str]:
        """Of every item, in order."""
        for items in self.by_shape():
            yield from (item.fingerprint for item in items)


def _items(shapes: Sequence[ShapeEntry], results: Results, made: str) -> Iterator[tuple[int, Item]]:
    for number, found in results.of_shape.items():
        shape = shapes[number]
        yield (
            number,
            Item(
                digest([made, shape.mark, found.mark]),
                f"{results.name}: {shape.label}",
                shape.mark,
                shape.place,
                found.place,
            ),
        )


def batches(plan: Plan, done: Iterable[str], workers: int) -> dict[str, list[Item]]:
    """What is to be done, by the name of its batch; the same items make the same batch.

    Parameters
    ----------
    done
        Fingerprints of items whose rows are there.
    workers
        That share the work.
    """
    seen = set(done)
    left = []
    for own in plan.by_shape():
        # Two sets may hold one result.
        fresh = {item.fingerprint: item for item in own if item.fingerprint not in seen}
        seen.update(fresh)
        if fresh:
            left.append(list(fresh.values()))
    size = min(BATCH_SHAPES, -(-len(left) // (BATCHES_EACH * workers)))
    groups = [list(chain(*left[i : i + size])) for i in range(0, len(left), max(size, 1))]
    return {digest([item.fingerprint for item in items])[:24]: items for items in groups}


class Todo:
    """The items of some batches in one file, of which a worker reads its own.

    Parameters
    ----------
    path
        The file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._places: dict[str, tuple[int, int]] = {}

    def write(self, given: dict[str, list[Item]]) -> None:
        """Write the items of batches; a file of before is replaced."""
        data = bytearray()
        for name, items in given.items():
            start = len(data)
            for item in items:
                data += ITEM.dump_json(item) + b"\n"
            self._places[name] = start, len(data) - start
        write_atomic(self.path, bytes(data))

    def read(self, name: str) -> list[Item]:
        """The items of a batch."""
        start, length = self._places[name]
        descriptor = os.open(self.path, os.O_RDONLY)
        try:
            data = os.pread(descriptor, length, start)
        finally:
            os.close(descriptor)
        return [ITEM.validate_json(line) for line in data.splitlines()]
