"""Cropping twelve positives with eight negatives, beside trimesh's and pymeshlab's booleans.

    python -m benchmarks.crop [--run RUN]

CPU seconds on one core.  The hard configurations are those of the tests; with `--run`, the
abstractions of a finished run as well.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import click
import numpy as np
import pymeshlab
import trimesh

from pnabs.formats import from_json
from pnabs.geometry import cuboid, quaternion
from pnabs.geometry.crop import crop, croppable, placed
from pnabs.geometry.manifolds import difference
from pnabs.geometry.solidify import solidify
from pnabs.geometry.types import Cuboids
from pnabs.settings import Abstract
from tests.geometry.hard_boxes import MODES, configuration

OPTIONS = Abstract()
Pair = tuple[Cuboids, Cuboids]


def ours(positives: Cuboids, negatives: Cuboids) -> float:
    """The crop alone; its volume."""
    result = crop(positives, negatives, min_side=OPTIONS.min_side)
    return float(np.linalg.det(result.vertices[result.faces]).sum() / 6)


def bare(positives: Cuboids, negatives: Cuboids) -> Callable[[], float]:
    """manifold3d's part alone: the boolean of solids that are made beforehand."""
    added, removed = placed(positives, negatives, min_side=OPTIONS.min_side)
    solids = added.solids(), removed.solids()
    return lambda: float(difference(*solids).num_tri())


def checked(positives: Cuboids, negatives: Cuboids) -> float:
    """Crop, debris and check, with the second tries that takes; whether it passes."""
    return float(solidify(positives, negatives, OPTIONS, np.random.default_rng(0)).check.ok)


def by_trimesh(positives: Cuboids, negatives: Cuboids) -> float:
    """The same boxes through trimesh.boolean, which calls manifold3d mesh by mesh."""
    meshes = [
        [trimesh.Trimesh(box.vertices, box.faces, process=False) for box in boxes(group)]
        for group in (positives, negatives)
    ]
    result = trimesh.boolean.union(meshes[0])
    if meshes[1]:
        result = trimesh.boolean.difference([result, trimesh.boolean.union(meshes[1])])
    return float(result.volume)


def by_pymeshlab(positives: Cuboids, negatives: Cuboids) -> float:
    """The same boxes through pymeshlab's boolean filters, one after another."""
    meshes = pymeshlab.MeshSet(verbose=False)

    def united(group: Cuboids) -> int:
        last = -1
        for box in boxes(group):
            meshes.add_mesh(pymeshlab.Mesh(box.vertices, box.faces.astype(np.int32)))
            new = meshes.current_mesh_id()
            if last >= 0:
                meshes.generate_boolean_union(first_mesh=last, second_mesh=new)
                new = meshes.current_mesh_id()
            last = new
        return last

    added, removed = united(positives), united(negatives)
    if removed >= 0:
        meshes.generate_boolean_difference(first_mesh=added, second_mesh=removed)
    # Left out where its result isn't closed.
    return float(meshes.get_geometric_measures().get("mesh_volume", np.nan))


def boxes(cuboids: Cuboids) -> Iterator[trimesh.Trimesh]:
    """The cuboids that take part, one by one."""
    chosen = cuboids[croppable(cuboids, OPTIONS.min_side)]
    for row in range(len(chosen)):
        yield cuboid.to_mesh(chosen[row : row + 1])


WAYS: dict[str, Callable[[Cuboids, Cuboids], Callable[[], float]]] = {
    "pnabs, crop": partial(partial, ours),
    "manifold3d's part of it": bare,
    "pnabs, crop + debris + check": partial(partial, checked),
    "trimesh.boolean": partial(partial, by_trimesh),
    "pymeshlab": partial(partial, by_pymeshlab),
}


def chair(seed: int) -> Pair:
    """Seat, back, arms, legs and stretchers, with the openings between them, a little askew."""
    rng = np.random.default_rng(seed)
    seat, width, depth = rng.uniform(-0.1, 0.1), rng.uniform(0.4, 0.6), rng.uniform(0.4, 0.6)
    x, z, thick = width / 2 - 0.03, depth / 2 - 0.03, 0.05
    leg, middle = 0.5 + seat, (seat - 0.5) / 2
    positives = [
        (width, 0.08, depth, 0, seat, 0),
        (width, 0.5 - seat, 0.06, 0, (0.5 + seat) / 2, -z),
        *((thick, leg, thick, i * x, middle, k * z) for i in (-1, 1) for k in (-1, 1)),
        *((thick, thick, depth, i * x, middle, 0) for i in (-1, 1)),
        *((width, thick, thick, 0, middle, k * z) for k in (-1, 1)),
        *((thick, thick, depth, i * x, seat + 0.2, 0) for i in (-1, 1)),
    ]
    negatives = [
        (width - 0.15, leg / 2, depth + 0.2, 0, middle - leg / 4, 0),
        (width + 0.2, leg / 2, depth - 0.15, 0, middle - leg / 4, 0),
        (width - 0.15, leg / 2 - 0.08, depth + 0.2, 0, middle + leg / 4, 0),
        (width + 0.2, leg / 2 - 0.08, depth - 0.15, 0, middle + leg / 4, 0),
        *((width / 6, 0.3 - seat / 2, 0.3, i * width / 4, 0.28 + seat / 2, -z) for i in (-1, 0, 1)),
        (width + 0.1, 0.1, depth / 2, 0, seat + 0.11, 0),
    ]
    rows = np.array([*positives, *negatives])
    turns = quaternion.from_rotation_vector(rng.normal(scale=0.03, size=(len(rows), 3)))
    sides = rows[:, :3] * rng.uniform(0.9, 1.1, (len(rows), 3))
    both = Cuboids.from_vector(np.column_stack([sides, turns, rows[:, 3:]]))
    return both[: len(positives)], both[len(positives) :]


def seconds(work: Callable[[], float]) -> tuple[float, float]:
    """CPU seconds, and what the work returns."""
    started = time.process_time()
    value = work()
    return time.process_time() - started, value


def stored(run: Path) -> list[Pair]:
    """What a run cropped."""
    paths = sorted(run.glob("variants/main/abstractions/*/*/abstraction.json"))
    found = [from_json(path.read_bytes()) for path in paths]
    return [(one.positives, one.negatives) for one in found]


@click.command()
@click.option("--count", default=200, show_default=True, help="Configurations of each kind.")
@click.option("--others", default=10, show_default=True, help="Of these, for the other libraries.")
@click.option("--run", type=click.Path(path_type=Path), help="A finished run.")
def main(count: int, others: int, run: Path | None) -> None:
    """Print the table of benchmarks/crop.md."""
    kinds: dict[str, Callable[[int], Pair]] = {
        mode: partial(configuration, mode, positives=12, negatives=8) for mode in MODES
    }
    kinds["chair-like"] = chair
    if run is not None:
        kinds["a run's abstractions"] = (lambda pairs: lambda k: pairs[k % len(pairs)])(stored(run))
    for way in WAYS.values():
        way(*configuration("rotated", 10**6, 3, 1))()
    click.echo("| configuration | way | median ms | p99 ms | times pnabs' crop |")
    click.echo("| --- | --- | --- | --- | --- |")
    for kind, make in kinds.items():
        base = 0.0
        for name, way in WAYS.items():
            number = others if name in ("trimesh.boolean", "pymeshlab") else count
            found = [seconds(way(*make(seed))) for seed in range(number)]
            spent = 1e3 * np.array([spent for spent, _ in found])
            base = base or float(np.median(spent))
            tail = f"{np.percentile(spent, 99):.1f}" if number >= 100 else "-"
            note = ""
            if name == "pnabs, crop + debris + check":
                note = f" ({sum(value == 0 for _, value in found)} of {number} fail)"
            ratio = np.median(spent) / base
            click.echo(f"| {kind} | {name}{note} | {np.median(spent):.1f} | {tail} | {ratio:.1f} |")


if __name__ == "__main__":
    main()
