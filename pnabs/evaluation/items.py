"""What is evaluated: where a shape and a result of it lie, as a worker is told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pydantic import TypeAdapter


@dataclass(frozen=True, slots=True)
class FileShape:
    """A shape that is a mesh file.

    Attributes
    ----------
    root, source
        Folder or archive that nothing outside of is read, and the file's place in it.
    suffix
        What the file is.
    reason
        Why it can't be taken; empty when it can.
    """

    root: str
    source: str
    suffix: str
    reason: str = ""
    kind: Literal["file"] = "file"


@dataclass(frozen=True, slots=True)
class StoredShape:
    """A shape that a run has ingested: its shard and its row there."""

    shard: str
    row: int
    reason: str = ""
    kind: Literal["stored"] = "stored"


@dataclass(frozen=True, slots=True)
class AbstractionFile:
    """An `abstraction.json`."""

    root: str
    source: str
    kind: Literal["abstraction"] = "abstraction"


@dataclass(frozen=True, slots=True)
class MeshFiles:
    """A mesh file, or several whose union is meant."""

    root: str
    sources: tuple[str, ...]
    kind: Literal["mesh"] = "mesh"


@dataclass(frozen=True, slots=True)
class BoxList:
    """Boxes from a table.

    Attributes
    ----------
    positives, negatives
        A tuple of ten numbers each: full sides, unit quaternion with w first, centre.
    reason
        What is wrong with them; empty when nothing is.
    """

    positives: tuple[tuple[float, ...], ...]
    negatives: tuple[tuple[float, ...], ...]
    reason: str = ""
    kind: Literal["boxes"] = "boxes"


ShapePlace = FileShape | StoredShape
ResultPlace = AbstractionFile | MeshFiles | BoxList


@dataclass(frozen=True, slots=True)
class Item:
    """One thing to be done: a shape looked at by itself, or a result of it measured.

    Attributes
    ----------
    fingerprint
        Of all that comes of it depends on.
    label
        How progress and messages name it.
    shape_mark
        Tells shapes apart: what is made of one serves the items after it.
    result
        None: the shape by itself.
    """

    fingerprint: str
    label: str
    shape_mark: str
    shape: ShapePlace
    result: ResultPlace | None = None


ITEM = TypeAdapter(Item)
"""Items as JSON; numbers come back as they were."""
