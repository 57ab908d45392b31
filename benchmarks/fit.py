"""The fit: agreement against seconds, boxes, splits and starts, and beside other programs.

    python -m benchmarks.fit --run RUN [--split test] [--others 14 --corpus CORPUS]

RUN is a finished run with networks' weights.  CPU seconds on one core, fit alone.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

from pnabs.dataset import catalogue
from pnabs.geometry.fit import fit as fitting
from pnabs.geometry.fit.build import Effort, Terms
from pnabs.geometry.metrics import (
    OriginalSurface,
    hull_occupancy,
    iou,
    predicted_occupancy,
    surface_distances,
)
from pnabs.geometry.postprocess import postprocess
from pnabs.geometry.sampling import draw_on_triangles
from pnabs.geometry.solidify import solidify
from pnabs.geometry.types import Bool, Cuboids, Float64
from pnabs.pipeline import Predictor, Shape, model_rng, thickened
from pnabs.report.compare import MIN_MODELS, bootstrap_means
from pnabs.settings import Abstract
from pnabs.stages.context import read_shard_rows
from pnabs.stages.difference import models_of as finished_models
from pnabs.stages.status import stored_job
from pnabs.stages.stored import StoredShard
from pnabs.store.run import RunFolder

OPTIONS = Abstract()
PRICE = OPTIONS.price
Pair = tuple[Cuboids, Cuboids]


@dataclass(frozen=True, slots=True)
class Model:
    """A shape, what the networks say of it, and where its mesh lies."""

    category: str
    model_id: str
    source: str
    shape: Shape
    predicted: Pair


@dataclass(frozen=True, slots=True)
class Figures:
    """What a way of fitting gives for each model, (n,) each."""

    iou: Float64
    boxes: Float64
    negatives: Float64
    seconds: Float64


def models_of(run: Path, split: str) -> list[Model]:
    """The models of a split in categories with enough of them."""
    folder = RunFolder(run)
    job = stored_job(folder).settings
    weights = job.weights_folder
    if weights is None:
        raise click.ClickException("the run has no `weights`: make one with `weights: shipped`")
    positive, negative = (weights / f"{name}.safetensors" for name in ("positive", "negative"))
    predictor = Predictor(positive, negative, job)
    found = []
    for shard in sorted(set(catalogue.read(folder.catalogue)["shard"].to_pylist()) - {""}):
        rows = finished_models(
            folder.ledger, read_shard_rows(folder.catalogue, shard), shard, [split]
        )
        if not rows:
            continue
        stored = StoredShard(folder, job, shard, [row["row"] for row in rows])
        predictions = predictor(stored.occupancy, stored.sdf)
        for row, shape, prediction in zip(rows, stored.shapes(), predictions, strict=True):
            negatives, _ = postprocess(
                prediction.negatives,
                shape.surface,
                shape.occupancy_64,
                prediction.difference,
                OPTIONS,
            )
            positives = thickened(prediction.positives, OPTIONS.min_side)
            found.append(
                Model(
                    row["category"], row["model_id"], row["source"], shape, (positives, negatives)
                )
            )
    number = Counter(model.category for model in found)
    return [model for model in found if number[model.category] >= MIN_MODELS]


def agreement(pair: Pair, occupancy: Bool) -> float:
    """`iou_64`."""
    return iou(predicted_occupancy(*pair, 64, OPTIONS.min_side), occupancy)


def fitted(
    model: Model,
    terms: Terms,
    effort: Effort | None = None,
    *,
    networks: bool = True,
    scattered: bool = True,
) -> tuple[Pair, float]:
    """The boxes of a model, and the CPU seconds they took."""
    shape = model.shape
    started = time.process_time()
    found = fitting.fit(
        shape.occupancy_64,
        shape.surface,
        shape.mirror,
        terms,
        model_rng(0, "abstract", model.category, model.model_id),
        start=model.predicted if networks else None,
        scattered=scattered,
        effort=effort or Effort(),
    )
    return (found.positives, found.negatives), time.process_time() - started


def figures(models: Sequence[Model], way: Callable[[Model], tuple[Pair, float]]) -> Figures:
    """A way of fitting on all models."""
    rows = []
    for model in models:
        pair, seconds = way(model)
        count = len(pair[0]) + len(pair[1])
        rows.append((agreement(pair, model.shape.occupancy_64), count, len(pair[1]), seconds))
    return Figures(*np.array(rows, dtype=np.float64).T)


def macro(values: Float64, models: Sequence[Model]) -> tuple[float, float, float]:
    """Mean over categories, with its 95 % bootstrap interval."""
    categories = np.array([model.category for model in models])
    rng = np.random.default_rng(0)
    groups = [values[categories == name] for name in sorted(set(categories))]
    draws = np.mean([bootstrap_means(group[:, None], 2000, rng) for group in groups], axis=0)
    low, high = np.percentile(draws, [2.5, 97.5])
    return float(np.mean([group.mean() for group in groups])), float(low), float(high)


def concave(models: Sequence[Model]) -> Bool:
    """Shapes that fill less than half of their convex hull."""
    filled = [
        np.count_nonzero(m.shape.occupancy_64)
        / np.count_nonzero(hull_occupancy(m.shape.occupancy_64))
        for m in models
    ]
    return np.array(filled) < 0.5


def table(title: str, models: Sequence[Model], ways: dict[str, Figures]) -> None:
    """One row a way."""
    click.echo(f"\n### {title}\n")
    click.echo("| | IoU 64^3, macro | 95 % interval | boxes | negatives | s, mean | s, p95 |")
    click.echo("| --- | --- | --- | --- | --- | --- | --- |")
    for name, found in ways.items():
        mean, low, high = macro(found.iou, models)
        click.echo(
            f"| {name} | {mean:.4f} | {low:.3f} to {high:.3f} | {found.boxes.mean():.1f} "
            f"| {found.negatives.mean():.1f} | {found.seconds.mean():.3f} "
            f"| {np.percentile(found.seconds, 95):.2f} |"
        )


def splits(models: Sequence[Model]) -> None:
    """The split found for each shape, paired with fixed ones."""
    free = figures(models, lambda model: fitted(model, Terms(20, PRICE)))
    ways = {"found for each shape": free}
    for negatives in (0, 2, 4, 8):
        terms = Terms(20, PRICE, 20 - negatives, negatives)
        ways[f"at most {20 - negatives} + {negatives}"] = figures(
            models, lambda model, terms=terms: fitted(model, terms)
        )
    table("Positives and negatives, 20 boxes", models, ways)
    hollow = concave(models)
    click.echo(
        "\nFound for each shape less fixed, by model (macro mean, 95 % interval): IoU, and IoU "
        f"less the price of the boxes; all {len(models)} models, and the {hollow.sum()} that fill "
        "less than half of their convex hull.\n"
    )
    click.echo("| fixed | IoU, all | less price, all | IoU, concave | less price, concave |")
    click.echo("| --- | --- | --- | --- | --- |")
    inner = [model for model, chosen in zip(models, hollow, strict=True) if chosen]
    for name, found in list(ways.items())[1:]:
        cells = []
        for mask, group in ((np.ones(len(models), bool), models), (hollow, inner)):
            gain = free.iou - found.iou
            worth = gain - PRICE * (free.boxes - found.boxes)
            for values in (gain, worth):
                mean, low, high = macro(values[mask], group)
                cells.append(f"{mean:+.4f} ({low:+.4f} to {high:+.4f})")
        click.echo(f"| {name} | {' | '.join(cells)} |")


def budgets(models: Sequence[Model]) -> None:
    """Agreement against the number of boxes."""
    ways = {}
    for budget in (1, 4, 8, 12, 16, 20, 32):
        terms = Terms(budget, PRICE)
        ways[f"at most {budget}"] = figures(models, lambda model, t=terms: fitted(model, t))
    for price in (0.001, 0.002, 0.008):
        terms = Terms(20, price)
        ways[f"at most 20, price {price}"] = figures(
            models, lambda model, t=terms: fitted(model, t)
        )
    table("Agreement against boxes", models, ways)


def efforts(models: Sequence[Model]) -> None:
    """Agreement against seconds, from the networks' boxes and from scattered ones."""
    ways = {}
    terms = Terms(20, PRICE)
    levels = {
        "least": Effort(0, 1, 0),
        "no exchange": Effort(4, 3, 0),
        "with exchange": Effort(),
        "more of it": Effort(8, 4, 40, 10),
    }
    starts = {
        "scattered": {"networks": False},
        "networks": {"scattered": False},
        "the better": {},
    }
    for level, effort in levels.items():
        for start, flags in starts.items():
            ways[f"{level}, {start}"] = figures(
                models, lambda model, e=effort, f=flags: fitted(model, terms, e, **f)
            )
    table("Agreement against seconds and starts", models, ways)


def feed_forward(models: Sequence[Model]) -> None:
    """The networks' boxes and the fitted ones by category, with distances of the meshes."""
    rows: dict[str, list[tuple[float, ...]]] = {}
    for model in models:
        occupancy, row = model.shape.occupancy_64, []
        original = OriginalSurface(model.shape.surface)
        pair, seconds = fitted(model, Terms(20, PRICE))
        for one in (model.predicted, pair):
            solid = solidify(*one, OPTIONS, np.random.default_rng(0))
            distance = 0.0
            if not solid.is_empty:
                points = draw_on_triangles(
                    solid.mesh.triangles, OPTIONS.metric_samples, np.random.default_rng(0)
                )[0]
                distance = surface_distances(original, solid.mesh, points)[2]
            row += [agreement(one, occupancy), distance]
        rows.setdefault(model.category, []).append((*row, len(pair[0]), len(pair[1]), seconds))
    click.echo("\n### By category, networks alone and fitted\n")
    click.echo(
        "| category | models | IoU 64^3, networks | fitted | surface distance x 1000, networks "
        "| fitted | positives | negatives | s |"
    )
    click.echo("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    means = {name: np.mean(values, axis=0) for name, values in sorted(rows.items())}
    means["average"] = np.mean(list(means.values()), axis=0)
    for name, m in means.items():
        count = len(rows.get(name, models))
        click.echo(
            f"| {name} | {count} | {m[0]:.3f} | {m[2]:.3f} | {m[1]:.1f} | {m[3]:.1f} "
            f"| {m[4]:.1f} | {m[5]:.1f} | {m[6]:.2f} |"
        )


OTHER = """
import json, sys, numpy as np, time
from pnabs.geometry.load import parse_mesh
from pnabs.geometry.normalise import normalise
from pnabs.settings import Limits
name, path, count = sys.argv[1], sys.argv[2], int(sys.argv[3])
mesh = normalise(parse_mesh(open(path, "rb").read(), "." + path.rsplit(".")[-1], Limits()))[0]
started = time.process_time()
if name == "CoACD, boxes":
    import coacd
    coacd.set_log_level("off")
    parts = coacd.run_coacd(
        coacd.Mesh(mesh.vertices, mesh.faces), max_convex_hull=count, apx_mode="box"
    )
else:
    import vhacdx
    parts = vhacdx.compute_vhacd(
        mesh.vertices, mesh.faces.astype(np.uint32), maxConvexHulls=count, asyncACD=False
    )
spent = time.process_time() - started
print("RESULT" + json.dumps([spent, [np.asarray(part[0]).tolist() for part in parts]]))
"""


def by_other(name: str, path: Path, count: int, limit: float) -> tuple[float, Bool] | str:
    """Seconds, and the cells of the hulls that another program makes; or how it ended."""
    from scipy.spatial import ConvexHull, QhullError

    from pnabs.geometry.types import grid_points

    command = [sys.executable, "-c", OTHER, name, str(path), str(count)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit)
    except subprocess.TimeoutExpired:
        return "time"
    lines = [line for line in done.stdout.splitlines() if line.startswith("RESULT")]
    if not lines:
        return "crash" if done.returncode < 0 else "error"
    spent, parts = json.loads(lines[0].removeprefix("RESULT"))
    points = grid_points(64)
    cells = np.zeros(len(points), dtype=bool)
    for corners in parts:
        try:
            planes = ConvexHull(np.array(corners)).equations
        except QhullError:
            continue
        cells |= np.all(points @ planes[:, :3].T + planes[:, 3] <= 1e-9, axis=1)
    return spent, cells.reshape(64, 64, 64)


def others(models: Sequence[Model], corpus: Path, each: int, limit: float) -> None:
    """Beside other programs at the number of boxes that the fit found."""
    chosen = list(_spread(models, each))
    click.echo(
        f"\n### Beside other programs, {len(chosen)} models, as many parts as the fit's boxes\n"
    )
    click.echo("| | IoU 64^3, failures 0 | without failures | s, median | failures |")
    click.echo("| --- | --- | --- | --- | --- |")
    pairs = [fitted(model, Terms(20, PRICE)) for model in chosen]
    ours = [agreement(p, m.shape.occupancy_64) for (p, _), m in zip(pairs, chosen, strict=True)]
    seconds = np.median([spent for _, spent in pairs])
    click.echo(f"| pnabs, fit | {np.mean(ours):.3f} | {np.mean(ours):.3f} | {seconds:.2f} | 0 |")
    for name in ("CoACD, boxes", "V-HACD, hulls"):
        found, spent, ends = [], [], Counter[str]()
        for model, (pair, _) in zip(chosen, pairs, strict=True):
            count = len(pair[0]) + len(pair[1])
            result = by_other(name, corpus / model.source, count, limit)
            if isinstance(result, str):
                ends[result] += 1
                continue
            spent.append(result[0])
            found.append(iou(result[1], model.shape.occupancy_64))
        failed = ", ".join(f"{number} {end}" for end, number in ends.items()) or "0"
        all_of_them = np.sum(found) / len(chosen)
        click.echo(
            f"| {name} | {all_of_them:.3f} | {np.mean(found):.3f} | {np.median(spent):.1f} "
            f"| {failed} |"
            if found
            else f"| {name} | 0 | - | - | {failed} |"
        )


def _spread(models: Sequence[Model], each: int) -> Iterator[Model]:
    """The first few models of each category."""
    seen = Counter[str]()
    for model in models:
        seen[model.category] += 1
        if seen[model.category] <= each:
            yield model


PARTS = ("categories", "splits", "budgets", "efforts", "others")


@click.command()
@click.option("--run", required=True, type=click.Path(path_type=Path), help="A finished run.")
@click.option("--split", default="test", show_default=True)
@click.option("--part", "parts", multiple=True, type=click.Choice(PARTS), help="Only this.")
@click.option("--corpus", type=click.Path(path_type=Path), help="The run's dataset, for `others`.")
@click.option("--each", default=2, show_default=True, help="Models a category for `others`.")
@click.option("--limit", default=120.0, show_default=True, help="Seconds for each of `others`.")
def main(
    run: Path,
    split: str,
    parts: tuple[str, ...],
    corpus: Path | None,
    each: int,
    limit: float,
) -> None:
    """Print the tables of benchmarks/fit.md."""
    models = models_of(run, split)
    fitting.warm_up()
    click.echo(f"{len(models)} models of {len({m.category for m in models})} categories, {split}")
    parts = parts or PARTS
    for part, show in (
        ("categories", feed_forward),
        ("splits", splits),
        ("budgets", budgets),
        ("efforts", efforts),
    ):
        if part in parts:
            show(models)
    if "others" in parts and corpus is not None:
        others(models, corpus, each, limit)


if __name__ == "__main__":
    main()
