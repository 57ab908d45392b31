"""The collection: which categories there are, one model of them, and all as files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pnabs.dataset.samples import flaws as flaw
from pnabs.dataset.samples.airplanes import airplane
from pnabs.dataset.samples.animals import animal
from pnabs.dataset.samples.benches import bench
from pnabs.dataset.samples.buses import bus
from pnabs.dataset.samples.chairs import chair
from pnabs.dataset.samples.draw import Draw, model_id
from pnabs.dataset.samples.lamps import lamp
from pnabs.dataset.samples.objfile import obj_text
from pnabs.dataset.samples.parts import Part, stretched
from pnabs.dataset.samples.shelves import bookshelf
from pnabs.dataset.samples.ships import ship
from pnabs.dataset.samples.sofas import sofa
from pnabs.dataset.samples.tables import table

CATEGORIES: dict[str, str] = {
    "airplane": "02691156",
    "animal": "animal",
    "bench": "02828884",
    "bookshelf": "02871439",
    "bus": "02924116",
    "chair": "03001627",
    "lamp": "03636649",
    "ship": "04530566",
    "sofa": "04256520",
    "table": "04379243",
}
"""Folder of each category: its synset, or its name where ShapeNetCore has none."""

STRETCH = 0.14
"""How much the proportions of models vary beyond what their makers vary."""

_MAKERS: dict[str, Callable[[Draw], list[Part]]] = {
    "airplane": airplane,
    "animal": animal,
    "bench": bench,
    "bookshelf": bookshelf,
    "bus": bus,
    "chair": chair,
    "lamp": lamp,
    "ship": ship,
    "sofa": sofa,
    "table": table,
}


class SampleModel(NamedTuple):
    """One sample model in the frame of ShapeNetCore.v2.

    Up is +y, the front looks along -z, the bounding box is centred on the origin and its
    diagonal is 1.

    Attributes
    ----------
    model_id : str
        32 hexadecimal characters.
    parts : tuple of Part
        Each a (name, vertices (V, 3) float64, faces as polygons).
    flaws : tuple of str
        What is wrong with it on purpose, from `pnabs.dataset.samples.flaws.FLAWS`.
    obj : str
        The model as OBJ text.
    """

    model_id: str
    parts: tuple[Part, ...]
    flaws: tuple[str, ...]
    obj: str


def _normalised(parts: list[Part]) -> list[Part]:
    points = np.concatenate([part.vertices for part in parts])
    low, high = points.min(axis=0), points.max(axis=0)
    centre, diagonal = (low + high) / 2, float(np.linalg.norm(high - low))
    return [part._replace(vertices=(part.vertices - centre) / diagonal) for part in parts]


def _known(category: str) -> str:
    if category not in CATEGORIES:
        names = ", ".join(CATEGORIES)
        raise ValueError(f"no sample category {category!r}; there are {names}")
    return category


def make_model(category: str, seed: int, index: int) -> SampleModel:
    """One model of the collection.

    Parameters
    ----------
    category
        A name in `CATEGORIES`.
    seed
        The collection's seed.
    index
        Which model of the category, from 0.

    Raises
    ------
    ValueError
        If the category is not known.
    """
    draw = Draw(seed, _known(category), index)
    made = _MAKERS[category](draw)
    # Makers that vary one size alone would give the same model once the diagonal is 1.
    factors = [draw.between(1 - STRETCH, 1 + STRETCH) for _ in range(3)]
    parts = _normalised([stretched(part, factors) for part in made])
    chosen = flaw.choose(draw)
    flawed = tuple(flaw.apply(parts, chosen, draw))
    text = obj_text(
        flawed,
        keyword=draw.pick(("g", "o")),
        triangles=draw.chance(0.4),
        shading=draw.chance(0.3),
    )
    return SampleModel(model_id(seed, category, index), flawed, chosen, text)


def write_collection(
    root: Path,
    *,
    seed: int = 0,
    per_category: int = 30,
    categories: Sequence[str] | None = None,
) -> list[Path]:
    """Write the collection in the layout of ShapeNetCore.v2.

    Files are ``<root>/<synset>/<model_id>/models/model_normalized.obj``.  The same seed
    gives the same bytes, and a larger `per_category` adds models without changing others.

    Parameters
    ----------
    root
        Folder to write into; made if missing.
    seed
        Any whole number.
    per_category
        How many models each category gets.
    categories
        Names in `CATEGORIES`; all of them by default.

    Returns
    -------
    list of Path
        The files, by category and index.

    Raises
    ------
    ValueError
        If a category is not known or `per_category` is less than 1.
    """
    if per_category < 1:
        raise ValueError(f"per_category is {per_category}; at least 1 is needed")
    names = [_known(name) for name in (CATEGORIES if categories is None else categories)]
    written = []
    for name in names:
        for index in range(per_category):
            model = make_model(name, seed, index)
            folder = root / CATEGORIES[name] / model.model_id / "models"
            folder.mkdir(parents=True, exist_ok=True)
            path = folder / "model_normalized.obj"
            path.write_bytes(model.obj.encode("ascii"))
            written.append(path)
    return written
