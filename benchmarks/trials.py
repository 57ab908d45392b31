"""Trials of training: one change each from a common recipe, scored on validation models.

    python -m benchmarks.trials --run RUN --samples SAMPLES [--only NAME]... [--out TABLE.jsonl]

RUN and SAMPLES are run folders of which `ingest` is done: the collection, with a split that names
validation models, and the embedded samples.  Scores are macro means of `iou_32` over the
categories with at least five validation models, boxes as the positive module says them.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any

import click
import numpy as np
import torch

from benchmarks.ideas import AimedSet, GatedNetwork, aimed, fitted_boxes
from pnabs import settings
from pnabs.dataset import catalogue
from pnabs.geometry.metrics import iou, predicted_occupancy
from pnabs.geometry.types import Bool, Cuboids
from pnabs.model.checkpoint import load_network, save_network
from pnabs.model.data import TrainingSet
from pnabs.model.losses import TERMS, Term
from pnabs.model.memory import keep_freed_memory
from pnabs.model.network import CuboidNetwork
from pnabs.model.objective import Objective, Phase, make_optimizer
from pnabs.model.predict import predict
from pnabs.model.start import start_points
from pnabs.model.trainer import epoch_order, train_epoch
from pnabs.pipeline import Shape, thickened
from pnabs.report.tables import MIN_MODELS
from pnabs.stages.context import read_shard_rows
from pnabs.stages.difference import models_of
from pnabs.stages.presets import PAPER
from pnabs.stages.status import stored_job
from pnabs.stages.stored import StoredShard
from pnabs.stages.training_data import load_training_set
from pnabs.stages.training_models import TrainingModels
from pnabs.store.run import RunFolder

BATCH = 16
STEPS = {"initial": 1440, "refinement": 720}
"""Steps of a phase: what 80 and 40 epochs of the corpus' 287 training models take."""

SHIPPED = settings.SHIPPED_WEIGHTS / "positive.safetensors"

TURNED: dict[str, Any] = {"turn": 15.0, "stretch": 0.2}
FIXED: dict[str, Any] = {"mirror_augment": False}
UPRIGHT: dict[str, Any] = {"turn": 0.0, "stretch": 0.0}


@dataclass(frozen=True, slots=True)
class Trial:
    """What differs from the common recipe, the defaults without turns and stretches, in a phase.

    Attributes
    ----------
    data : {"corpus", "samples", "both"}
    init_from : {"nothing", "shipped"}
        Weights that the phase begins from.
    after : str
        The trial whose network is refined; `shipped` for those weights.
    category : str, optional
        Train and score on one category alone.
    turned : bool
        Augment by turns and stretches.
    steps : float
        Times as many steps.
    gated : bool
        Existence apart from size (`benchmarks.ideas.GatedNetwork`).
    targets : float
        Weight of the distance to fitted boxes (`benchmarks.ideas.aimed`); 0 for none.
    """

    why: str
    phase: Phase = "initial"
    network: Mapping[str, Any] = field(default_factory=dict)
    training: Mapping[str, Any] = field(default_factory=dict)
    losses: Mapping[str, float] = field(default_factory=dict)
    positives: int = 12
    data: str = "corpus"
    init_from: str = "nothing"
    after: str = "default"
    category: str | None = None
    turned: bool = False
    steps: float = 1.0
    gated: bool = False
    targets: float = 0.0


PAPER_NETWORK = {name: PAPER["network"][name] for name in ("channels", "hidden")}
TRIALS: dict[str, Trial] = {
    "default": Trial("the default recipe, positive module, initial phase"),
    "another seed": Trial("how much chance there is", training={"seed": 1}),
    "paper's losses": Trial("no occupancy term (OURS)", losses={"occupancy": 0}),
    "occupancy x10": Trial("its weight 1 in place of 0.1", losses={"occupancy": 1}),
    "occupancy alone": Trial("no fitting losses", losses={"occupancy": 1, "fit1": 0, "fit2": 0}),
    "no symmetry": Trial("L_sym off", losses={"symmetry": 0}),
    "8 boxes": Trial("N", positives=8),
    "8 boxes, octants": Trial("POSPRIM's start", positives=8, network={"start": "octants"}),
    "20 boxes": Trial("N", positives=20),
    "paper's network": Trial("4 to 64 channels, 64 wide", network=PAPER_NETWORK),
    "constant rate": Trial("the paper's schedule", training={"schedule": "constant"}),
    "rate 0.0003": Trial("learning rate", training={"learning_rate": 0.0003}),
    "rate 0.003": Trial("learning rate", training={"learning_rate": 0.003}),
    "not mirrored": Trial("no mirrored copies", training={"mirror_augment": False}),
    "turned, stretched": Trial("15 degrees, 20 per cent", turned=True),
    "more cells": Trial("occupancy at 4,096 cells", training={"occupancy_samples": 4096}),
    "fewer points": Trial(
        "16 a cuboid, 250 a shape", training={"cuboid_samples": 16, "shape_samples": 250}
    ),
    "samples": Trial("2,000 samples in place of the corpus", data="samples"),
    "both": Trial("the samples and the corpus together", data="both"),
    "both, turned": Trial("... with turns and stretches", data="both", turned=True),
    "from shipped": Trial("the corpus, from the shipped weights", init_from="shipped"),
    "from shipped, turned": Trial("... with turns and stretches", init_from="shipped", turned=True),
    "from shipped, rate 0.0003": Trial(
        "... slower", init_from="shipped", turned=True, training={"learning_rate": 0.0003}
    ),
    "four times as long": Trial("5,760 steps", steps=4.0),
    "gated": Trial("existence apart from size: a gate a box", gated=True),
    "targets beside": Trial("fitted boxes as targets, not mirrored", targets=0.1, training=FIXED),
    "targets strong": Trial("... at ten times the weight", targets=1.0, training=FIXED),
    "targets alone": Trial(
        "... and nothing else",
        targets=1.0,
        training=FIXED,
        losses={"occupancy": 0, "fit1": 0, "fit2": 1e-9, "symmetry": 0},
    ),
    "airplanes alone": Trial("a model for each category", category="02691156"),
    "chairs alone": Trial("a model for each category", category="03001627"),
    "tables alone": Trial("a model for each category", category="04379243"),
    "animals alone": Trial("a model for each category", category="animal"),
    "refined": Trial("the default recipe, refinement from `default`", phase="refinement"),
    "refined, vector": Trial(
        "the paper's input", phase="refinement", network={"refine_input": "vector"}
    ),
    "refined, volume": Trial(
        "cuboids as a volume", phase="refinement", network={"refine_input": "volume"}
    ),
    "refined, no burn-in": Trial("the paper's", phase="refinement", training={"burn_in": 0}),
    "refined, no regularisation": Trial(
        "L_R off", phase="refinement", losses={"regularisation": 0}
    ),
    "refined, turned": Trial("15 degrees, 20 per cent", phase="refinement", turned=True),
    "winners": Trial(
        "from shipped, turned, 4,096 cells",
        init_from="shipped",
        turned=True,
        training={"occupancy_samples": 4096},
    ),
    "winners, refined": Trial(
        "`winners`, refined alike",
        phase="refinement",
        init_from="shipped",
        after="winners",
        turned=True,
        training={"occupancy_samples": 4096},
    ),
    "shipped, refined": Trial(
        "the shipped weights, refinement alone trained on",
        phase="refinement",
        init_from="shipped",
        after="shipped",
        turned=True,
        training={"occupancy_samples": 4096},
    ),
}


@dataclass(frozen=True, slots=True)
class Models:
    """The models of one split: what trains, and what is scored."""

    category: np.ndarray
    data: TrainingSet
    occupancy: Bool


def chosen(folder: RunFolder, split: str) -> Iterator[tuple[str, list[dict[str, Any]]]]:
    """Shards with their models of a split that came through ingest."""
    for shard in sorted(set(catalogue.read(folder.catalogue)["shard"].to_pylist()) - {""}):
        rows = models_of(folder.ledger, read_shard_rows(folder.catalogue, shard), shard, [split])
        if rows:
            yield shard, rows


@cache
def models(run: Path, split: str) -> Models:
    """Models of a split of a run."""
    folder = RunFolder(run)
    job = stored_job(folder).settings
    shards, names = [], []
    for shard, rows in chosen(folder, split):
        shards.append((shard, np.array([row["row"] for row in rows], np.int32)))
        names += [row["category"] for row in rows]
    data = load_training_set(
        folder, folder.variant("main"), job, "positive", TrainingModels(tuple(shards), ""),
        rank=0, world=1,
    )  # fmt: skip
    return Models(np.array(names), data, data.occupancies())


def shapes(run: Path) -> Iterator[Shape]:
    """The training models as the fit reads them, in the order of `models`."""
    folder = RunFolder(run)
    for shard, rows in chosen(folder, "train"):
        numbers = [row["row"] for row in rows]
        yield from StoredShard(folder, stored_job(folder).settings, shard, numbers).shapes()


def joined(a: TrainingSet, b: TrainingSet) -> TrainingSet:
    """The shapes of both."""
    parts = {f.name: (getattr(a, f.name), getattr(b, f.name)) for f in fields(TrainingSet)}
    parts = {name: pair for name, pair in parts.items() if pair[0] is not None}
    width = {name: min(x.shape[1:], y.shape[1:]) for name, (x, y) in parts.items()}
    return TrainingSet(
        **{
            name: np.concatenate([x[:, : w[0]] if (w := width[name]) else x for x in pair])
            for name, pair in parts.items()
        }
    )


def scores(network: CuboidNetwork, shown: Models, iterations: int) -> tuple[np.ndarray, float]:
    """`iou_32` of each model, and CPU seconds a model of the prediction."""
    started = time.process_time()
    found = predict(network, shown.occupancy, iterations)
    spent = (time.process_time() - started) / len(found)
    none, least = Cuboids.empty(), settings.Abstract().min_side
    return np.array(
        [
            iou(predicted_occupancy(thickened(boxes, least), none, 32, least), occupancy)
            for boxes, occupancy in zip(found, shown.occupancy, strict=True)
        ]
    ), spent


def macro(values: np.ndarray, category: np.ndarray) -> float:
    """Mean over categories with enough models; over all models where there is none."""
    names, number = np.unique(category, return_counts=True)
    means = [values[category == name].mean() for name in names[number >= MIN_MODELS]]
    return float(np.mean(means)) if means else float(values.mean())


def begun(trial: Trial, options: settings.Network, data: TrainingSet, kept: Path) -> CuboidNetwork:
    """The network that a trial trains."""
    if trial.phase == "refinement":
        shipped = trial.after == "shipped"
        first = load_network(SHIPPED if shipped else kept / f"{trial.after}.safetensors")
        if shipped:
            return first
        network = CuboidNetwork(first.count, options, first.start)
        if trial.init_from == "shipped":
            network = load_network(SHIPPED)
        network.initial_encoder.load_state_dict(first.initial_encoder.state_dict())
        network.initial_decoder.load_state_dict(first.initial_decoder.state_dict())
        network.inherit_encoder()
        return network
    if trial.init_from == "shipped":
        return load_network(SHIPPED)
    start = start_points(data.mean_occupancy(), trial.positives, options.start)
    kind = GatedNetwork if trial.gated else CuboidNetwork
    return kind(trial.positives, options, start)


def tried(name: str, run: Path, samples: Path, kept: Path) -> dict[str, Any]:
    """Train and score one trial."""
    trial = TRIALS[name]
    training = dict(trial.training)
    seed = training.pop("seed", 0)
    options = settings.Training(
        batch_size=BATCH,
        losses=settings.LossWeights(**trial.losses),
        **training,
        **(TURNED if trial.turned else UPRIGHT),
    )
    shown = models(run, "val")
    learnt = models(run, "train")
    if trial.category:
        shown, learnt = (
            Models(
                part.category[rows := np.flatnonzero(part.category == trial.category)],
                TrainingSet(
                    **{
                        f.name: None if (v := getattr(part.data, f.name)) is None else v[rows]
                        for f in fields(TrainingSet)
                    }
                ),
                part.occupancy[rows],
            )
            for part in (shown, learnt)
        )
    data = learnt.data
    if trial.data != "corpus":
        generated = models(samples, "train").data
        data = generated if trial.data == "samples" else joined(data, generated)
    network = begun(trial, settings.Network(**trial.network), data, kept)
    objective = Objective(network, "positive", trial.phase, options)
    if trial.targets:
        values = {f.name: getattr(data, f.name) for f in fields(TrainingSet)}
        boxes = fitted_boxes(list(shapes(run)), trial.positives)
        data = AimedSet(**values, targets=boxes)
        objective.weights["targets"] = trial.targets
    steps = STEPS[trial.phase] * trial.steps
    epochs = max(1, round(steps / max(1, round(len(data) / BATCH))))
    options = options.model_copy(update={"epochs": epochs})
    optimizer = make_optimizer(objective, options)
    started = time.process_time()
    for epoch in range(epochs):
        order = epoch_order(len(data), epoch, seed)
        last = train_epoch(objective, optimizer, data, order, options, epoch=epoch, seed=seed)
    spent = time.process_time() - started
    iterations = settings.Abstract().iterations if trial.phase == "refinement" else 0
    values, seconds = scores(network, shown, iterations)
    seen, _ = scores(network, learnt, iterations)
    save_network(kept / f"{name.replace(' ', '-').replace(',', '')}.safetensors", network)
    return {
        "name": name,
        "why": trial.why,
        "phase": trial.phase,
        "val": macro(values, shown.category),
        "all": float(values.mean()),
        "train": macro(seen, learnt.category),
        "categories": {str(c): float(values[shown.category == c].mean())
                       for c in np.unique(shown.category)
                       if np.count_nonzero(shown.category == c) >= MIN_MODELS},
        "models": len(data),
        "epochs": epochs,
        "seconds": spent,
        "predict": seconds,
        "loss": last["total"],
    }  # fmt: skip


@click.command()
@click.option("--run", type=click.Path(path_type=Path, exists=True), required=True)
@click.option("--samples", type=click.Path(path_type=Path, exists=True), required=True)
@click.option("--only", multiple=True, type=click.Choice(list(TRIALS)))
@click.option("--out", type=click.Path(path_type=Path), default=Path("trials.jsonl"))
def main(run: Path, samples: Path, only: tuple[str, ...], out: Path) -> None:
    """Try what isn't in OUT yet, a line of JSON each, and print the table."""
    torch.set_num_threads(1)
    keep_freed_memory()
    TERMS["targets"] = Term(aimed, "", phases=())  # in no phase by itself
    done = {}
    if out.exists():
        done = {row["name"]: row for row in map(json.loads, out.read_text().splitlines())}
    kept = out.with_suffix("")
    kept.mkdir(exist_ok=True)
    for name in only or TRIALS:
        if name not in done:
            done[name] = tried(name, run, samples, kept)
            with out.open("a") as lines:
                lines.write(json.dumps(done[name]) + "\n")
            click.echo(f"{name}: val {done[name]['val']:.4f}", err=True)
    click.echo("| trial | what | val | train | CPU s |\n| --- | --- | --- | --- | --- |")
    for name in only or TRIALS:
        row = done[name]
        click.echo(
            f"| {name} | {row['why']} | {row['val']:.3f} | {row['train']:.3f} "
            f"| {row['seconds']:.0f} |"
        )


if __name__ == "__main__":
    main()
