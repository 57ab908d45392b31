"""The fit: agreement against seconds, boxes, splits and starts.

    python -m benchmarks.fit --run RUN [--split test]

RUN is a finished run with networks' weights.  CPU seconds on one core, fit alone.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

from pnabs.dataset import catalogue
from pnabs.geometry.exact import overlap
from pnabs.geometry.fit import fit as fitting
from pnabs.geometry.fit.build import Effort, Terms
from pnabs.geometry.manifolds import to_manifold
from pnabs.geometry.metrics import hull_occupancy, iou, predicted_occupancy
from pnabs.geometry.postprocess import postprocess
from pnabs.geometry.reference import Reference
from pnabs.geometry.solidify import solidify
from pnabs.geometry.types import Bool, Cuboids, Float64
from pnabs.pipeline import Predictor, Shape, model_rng, thickened
from pnabs.report.averages import bootstrap_means
from pnabs.report.tables import MIN_MODELS
from pnabs.settings import Abstract
from pnabs.stages.context import read_shard_rows
from pnabs.stages.difference import models_of as finished_models
from pnabs.stages.status import stored_job
from pnabs.stages.stored import StoredShard
from pnabs.store.run import RunFolder

OPTIONS = Abstract()
PRICE = OPTIONS.min_gain
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
    """What a way of fitting gives for each model, (n,) each.

    `volume` is NaN for models that aren't closed.
    """

    volume: Float64
    iou_128: Float64
    iou_64: Float64
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


def agreement(pair: Pair, model: Model) -> tuple[float, float, float]:
    """Exact volume IoU of the mesh, NaN where the shape isn't closed; `iou_128`; `iou_64`."""
    shape = model.shape
    grids = [
        iou(predicted_occupancy(*pair, side, OPTIONS.min_side), cells)
        for side, cells in ((128, shape.occupancy_128), (64, shape.occupancy_64))
    ]
    exact = Reference.of(shape).solid
    if exact is None:
        return float("nan"), *grids
    mesh = solidify(*pair, OPTIONS, np.random.default_rng(0)).mesh
    result = None if mesh.is_empty else to_manifold(mesh.vertices, mesh.faces)
    return 0.0 if result is None else overlap(exact, result).volume_iou, *grids


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
        shape.occupancy_192,
        shape.surface,
        shape.mirror,
        terms,
        model_rng(0, "abstract"),
        extent=shape.extent,
        min_side=OPTIONS.min_side,
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
        rows.append((*agreement(pair, model), count, len(pair[1]), seconds))
    return Figures(*np.array(rows, dtype=np.float64).T)


def closed_mean(values: Float64) -> tuple[float, float, float]:
    """Mean over the closed models, with its 95 % bootstrap interval."""
    known = values[np.isfinite(values)]
    if not len(known):
        return (float("nan"),) * 3
    draws = bootstrap_means(known[:, None], 2000, np.random.default_rng(0))
    low, high = np.percentile(draws, [2.5, 97.5])
    return float(known.mean()), float(low), float(high)


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
    click.echo(
        "| | exact volume IoU, closed | 95 % interval | IoU 128^3, macro | 95 % interval "
        "| IoU 64^3, macro | boxes | negatives | s, mean | s, p95 |"
    )
    click.echo("| --- " * 10 + "|")
    for name, found in ways.items():
        volume, finest = closed_mean(found.volume), macro(found.iou_128, models)
        click.echo(
            f"| {name} | {volume[0]:.3f} | {volume[1]:.3f} to {volume[2]:.3f} "
            f"| {finest[0]:.3f} | {finest[1]:.3f} to {finest[2]:.3f} "
            f"| {macro(found.iou_64, models)[0]:.3f} | {found.boxes.mean():.1f} "
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
    closed = int(np.isfinite(free.volume).sum())
    click.echo(
        "\nFound for each shape less fixed, paired by model (95 % interval): exact volume IoU over "
        f"the {closed} closed models; IoU at 128^3, macro, over all {len(models)} models, and over "
        f"the {hollow.sum()} that fill less than half of their convex hull.\n"
    )
    click.echo("| fixed | volume IoU, closed | IoU 128^3, all | IoU 128^3, concave |")
    click.echo("| --- | --- | --- | --- |")
    inner = [model for model, chosen in zip(models, hollow, strict=True) if chosen]
    for name, found in list(ways.items())[1:]:
        gain = free.iou_128 - found.iou_128
        cells = [
            f"{mean:+.4f} ({low:+.4f} to {high:+.4f})"
            for mean, low, high in (
                closed_mean(free.volume - found.volume),
                macro(gain, models),
                macro(gain[hollow], inner),
            )
        ]
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
    """The networks' boxes and the fitted ones by category."""
    alone = figures(models, lambda model: (model.predicted, 0.0))
    found = figures(models, lambda model: fitted(model, Terms(20, PRICE)))
    category = np.array([model.category for model in models])
    click.echo("\n### By category, networks alone and fitted\n")
    click.echo(
        "| category | models | closed | volume IoU, networks | fitted | IoU 128^3, networks "
        "| fitted | IoU 64^3, networks | fitted | positives | negatives | s |"
    )
    click.echo("| --- " * 12 + "|")

    def row(name: str, chosen: Bool) -> None:
        known = chosen & np.isfinite(found.volume)
        volumes = ["-", "-"]
        if known.any():
            volumes = [f"{one.volume[known].mean():.3f}" for one in (alone, found)]
        cells = [name, str(chosen.sum()), str(known.sum()), *volumes]
        for grid in ("iou_128", "iou_64"):
            cells += [f"{getattr(one, grid)[chosen].mean():.3f}" for one in (alone, found)]
        cells += [
            f"{(found.boxes - found.negatives)[chosen].mean():.1f}",
            f"{found.negatives[chosen].mean():.1f}",
            f"{found.seconds[chosen].mean():.2f}",
        ]
        click.echo(f"| {' | '.join(cells)} |")

    for name in sorted(set(category)):
        row(name, category == name)
    row("all models", np.ones(len(models), dtype=bool))


PARTS = ("categories", "splits", "budgets", "efforts")


@click.command()
@click.option("--run", required=True, type=click.Path(path_type=Path), help="A finished run.")
@click.option("--split", default="test", show_default=True)
@click.option("--part", "parts", multiple=True, type=click.Choice(PARTS), help="Only this.")
def main(
    run: Path,
    split: str,
    parts: tuple[str, ...],
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


if __name__ == "__main__":
    main()
