"""`abstraction.json`: the parametric result, public and versioned.

Numbers read back exactly: cuboid parameters are the shortest decimals that give the same
float32, all others the shortest that give the same float64.  Metrics that are not defined
(the Chamfer distance of an empty result) are null.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Annotated, Any, Literal, NoReturn

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    ValidationError,
    ValidationInfo,
    field_validator,
)

from pnabs.formats.abstraction import Abstraction, FormatError
from pnabs.geometry.types import Cuboids, Float32

FORMAT = "pnabs/abstraction"
VERSION = 1

_FLOAT32_MAX = float(np.finfo(np.float32).max)
_Float32 = Annotated[FiniteFloat, Field(ge=-_FLOAT32_MAX, le=_FLOAT32_MAX)]
_Side = Annotated[FiniteFloat, Field(ge=0, le=_FLOAT32_MAX)]
_NonNegative = Annotated[FiniteFloat, Field(ge=0)]
_Count = Annotated[int, Field(ge=0)]
_Row = Annotated[list[FiniteFloat], Field(min_length=4, max_length=4)]


class _Strict(BaseModel):
    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, use_attribute_docstrings=True
    )


class Cuboid(_Strict):
    """A point u of [-1/2, 1/2]^3 goes to R(rotation) (scale * u) + translation."""

    scale: Annotated[list[_Side], Field(min_length=3, max_length=3)]
    """Full side lengths along the cuboid's own axes."""
    rotation: _Row
    """Unit quaternion, w first."""
    translation: Annotated[list[_Float32], Field(min_length=3, max_length=3)]
    """The centre."""

    @field_validator("rotation")
    @classmethod
    def _unit(cls, rotation: list[float]) -> list[float]:
        if abs(math.hypot(*rotation) - 1) > 1e-3:
            raise ValueError("must be a unit quaternion [w, x, y, z]")
        return rotation


class Crop(_Strict):
    """How the mesh is made from the cuboids."""

    min_side: _NonNegative
    """Cuboids with a shorter side take no part."""
    jitter: _NonNegative
    """Size of the random change of each cuboid."""
    jitter_seed: _Count
    """Seed of the random change."""
    jitter_attempt: _Count
    """Number of the random change; 0 changes nothing."""


class Piece(_Strict):
    """A connected piece that was left out, in normalised units."""

    area: FiniteFloat
    """Of its surface."""
    share: FiniteFloat
    """Of the area of all pieces."""
    volume: FiniteFloat
    """Of what it encloses."""


class Debris(_Strict):
    """The pieces left out."""

    threshold: Annotated[float, Field(ge=0, le=1)]
    """Pieces with a smaller share of the total surface area are left out."""
    dropped: list[Piece]
    """From the largest to the smallest."""


class Level(_Strict):
    """A coarser level of detail: the same shape with fewer cuboids."""

    boxes: Annotated[int, Field(ge=1)]
    """How many cuboids it has at most."""
    origins: list[list[_Count]]
    """For each cuboid, positives before negatives, the cuboids of the document that it stands
    for, counted in the same way."""
    positives: list[Cuboid]
    """As the document's."""
    negatives: list[Cuboid]
    """As the document's."""
    crop: Crop
    """As the document's."""
    debris: Debris
    """As the document's."""
    metrics: dict[str, int | FiniteFloat | None]
    """As the document's."""
    check: dict[str, bool | int]
    """As the document's."""


class Document(_Strict):
    """A shape as positive cuboids cropped by negative ones (pnabs/abstraction, version 1)."""

    format: Literal["pnabs/abstraction"]
    """Tells it from other JSON."""
    version: Literal[1]
    """Rises when meaning or form change."""
    category: str
    """Category of the model; may be empty."""
    model_id: str
    """Name of the model in its category; may have slashes."""
    positives: list[Cuboid]
    """In the normalised frame, as they were cropped."""
    negatives: list[Cuboid]
    """In the normalised frame, as they were cropped."""
    transform: Annotated[list[_Row], Field(min_length=4, max_length=4)]
    """Normalised frame to the input's coordinates, 4 x 4, row by row; the last is [0, 0, 0, 1]."""
    crop: Crop
    """How the mesh is made from the cuboids."""
    debris: Debris
    """What was left out of it."""
    metrics: dict[str, int | FiniteFloat | None]
    """What was measured; null where a distance isn't defined."""
    check: dict[str, bool | int]
    """Findings about the written mesh; `ok` where nothing is wrong with it."""
    provenance: dict[str, Any]
    """What made it."""
    levels: list[Level] = []
    """Coarser levels of detail, if there are any, the finest first."""

    @field_validator("levels")
    @classmethod
    def _nested(cls, levels: list[Level], info: ValidationInfo) -> list[Level]:
        finest = sum(len(info.data.get(name, ())) for name in ("positives", "negatives"))
        for level in levels:
            if len(level.origins) != len(level.positives) + len(level.negatives):
                raise ValueError(f"level {level.boxes}: a cuboid each needs its origins")
            if any(not 0 <= i < finest for origin in level.origins for i in origin):
                raise ValueError(f"level {level.boxes}: an origin isn't there")
        if len({level.boxes for level in levels}) != len(levels):
            raise ValueError("two levels have the same number of boxes")
        return levels

    @field_validator("transform")
    @classmethod
    def _affine(cls, transform: list[list[float]]) -> list[list[float]]:
        if transform[3] != [0, 0, 0, 1]:
            raise ValueError("must be affine: its last row is [0, 0, 0, 1]")
        return transform


def schema() -> dict[str, Any]:
    """The form of `abstraction.json` as a JSON schema (draft 2020-12)."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **Document.model_json_schema(),
    }


def to_json(abstraction: Abstraction) -> bytes:
    """The abstraction as `abstraction.json`; the same abstraction gives the same bytes.

    Parameters
    ----------
    abstraction : Abstraction

    Returns
    -------
    bytes
        ASCII, one line a key and a cuboid; keys below the first level are sorted.

    Raises
    ------
    ValueError
        A number outside the metrics is not finite.
    """
    lines = [
        _line("format", FORMAT),
        _line("version", VERSION),
        _line("category", abstraction.category),
        _line("model_id", abstraction.model_id),
        _rows("positives", cuboid_records(abstraction.positives)),
        _rows("negatives", cuboid_records(abstraction.negatives)),
        _rows("transform", np.asarray(abstraction.transform, dtype=np.float64).tolist()),
        _line("crop", abstraction.crop),
        _line("debris", abstraction.debris),
        _line("metrics", {k: _defined(v) for k, v in abstraction.metrics.items()}),
        _line("check", abstraction.check),
        _line("provenance", abstraction.provenance),
    ]
    if abstraction.levels:
        lines.append(_rows("levels", [_level(*one) for one in abstraction.levels.items()]))
    return ("{\n" + ",\n".join(lines) + "\n}\n").encode("ascii")


def from_json(data: bytes) -> Abstraction:
    """Read what `to_json` wrote.

    Parameters
    ----------
    data : bytes

    Returns
    -------
    Abstraction

    Raises
    ------
    FormatError
        Not JSON, not this format or this version of it, an unknown or missing key, or a value
        that makes no sense; the message names the place.
    """
    try:
        document = json.loads(data, parse_constant=_no_constant, object_pairs_hook=_no_repeats)
    except FormatError:
        raise
    except (ValueError, RecursionError) as error:
        raise FormatError(f"not an abstraction: not valid JSON ({error})") from error
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise FormatError(f'not an abstraction: "format" must be "{FORMAT}"')
    if document.get("version") != VERSION:
        raise FormatError(
            f"version {document.get('version')!r} of the format is not known, only {VERSION}: "
            "use a pnabs as new as the one that wrote it"
        )
    try:
        found = Document.model_validate(document)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"]) or "the document"
        raise FormatError(f"not an abstraction: {place}: {first['msg']}") from error
    levels = {level.boxes: _abstraction(found, level) for level in found.levels}
    return replace(_abstraction(found, found), levels=levels)


def _abstraction(document: Document, part: Document | Level) -> Abstraction:
    """The document's own cuboids, or those of one of its levels."""
    return Abstraction(
        category=document.category,
        model_id=document.model_id,
        positives=_cuboids(part.positives),
        negatives=_cuboids(part.negatives),
        transform=np.array(document.transform, dtype=np.float64),
        crop=part.crop.model_dump(),
        debris=part.debris.model_dump(),
        metrics={k: math.nan if v is None else v for k, v in part.metrics.items()},
        check=part.check,
        provenance=document.provenance,
        origins=part.origins if isinstance(part, Level) else [],
    )


def _level(size: int, level: Abstraction) -> dict[str, Any]:
    return {
        "boxes": size,
        "origins": level.origins,
        "positives": cuboid_records(level.positives),
        "negatives": cuboid_records(level.negatives),
        "crop": level.crop,
        "debris": level.debris,
        "metrics": {k: _defined(v) for k, v in level.metrics.items()},
        "check": level.check,
    }


def cuboid_records(cuboids: Cuboids) -> list[dict[str, list[float]]]:
    """The cuboids' parameters as plain numbers, shortest decimals of their float32 values."""
    return [
        {"scale": _shortest(s), "rotation": _shortest(r), "translation": _shortest(t)}
        for s, r, t in zip(cuboids.scale, cuboids.rotation, cuboids.translation, strict=True)
    ]


def _shortest(values: Float32) -> list[float]:
    return [float(str(value)) for value in values]


def _cuboids(records: list[Cuboid]) -> Cuboids:
    def column(values: list[list[float]], width: int) -> Float32:
        return np.array(values, dtype=np.float32).reshape(-1, width)

    return Cuboids(
        column([c.scale for c in records], 3),
        column([c.rotation for c in records], 4),
        column([c.translation for c in records], 3),
    )


def _line(key: str, value: object) -> str:
    return f' "{key}": {_dump(value)}'


def _rows(key: str, values: list[Any]) -> str:
    if not values:
        return f' "{key}": []'
    return f' "{key}": [\n  ' + ",\n  ".join(_dump(value) for value in values) + "\n ]"


def _dump(value: object) -> str:
    return json.dumps(value, allow_nan=False, sort_keys=True, default=_plain)


def _plain(value: object) -> object:
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a {type(value).__name__} has no place in abstraction.json")


def _defined(value: float | int) -> float | int | None:
    return None if math.isnan(value) else value


def _no_constant(name: str) -> NoReturn:
    raise FormatError(f"not an abstraction: {name} is not a number of JSON")


def _no_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise FormatError("not an abstraction: a key stands twice in one object")
    return found
