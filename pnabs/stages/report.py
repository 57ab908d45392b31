"""report: tables and page from what is stored; needs no Ray and no dataset."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import PurePosixPath
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import yaml

from pnabs import report
from pnabs.dataset.synsets import name_of
from pnabs.formats import FORMATS, STEM, FormatError, from_json
from pnabs.geometry import cuboid
from pnabs.geometry.solidify import CropRecipe, make_solid
from pnabs.geometry.types import Cuboids, Float64, Mesh
from pnabs.settings import Settings
from pnabs.stages.context import Context, split_shard
from pnabs.stages.errors import UsageError
from pnabs.stages.phases import CURVES, PHASES, is_done, phase_plans
from pnabs.store.atomic import write_atomic
from pnabs.store.events import read_events
from pnabs.store.ledger import DamagedRecordError
from pnabs.store.metrics import read_metrics

STAGE = "report"


def run(context: Context, command: str) -> str:
    """Write the page and the tables to RUN/report; returns the tables as text.

    Raises
    ------
    RunError
        When nothing is abstracted yet.
    """
    job = context.job
    rows = {name: _rows(context, name) for name in context.variants}
    if not any(len(table) for table in rows.values()):
        raise UsageError("there is nothing to report yet: no shard has been abstracted")
    categories = sorted(set(context.catalogue["category"].unique().to_pylist()))
    names = {category: name_of(category) for category in categories}
    split = _covered(job, rows["main"])
    if split != job.report.split:
        context.reporter.say(
            f"no model is of split {job.report.split}: the report covers all models"
        )
    rng = np.random.default_rng([job.seed, 1])
    tables = report.build_tables(rows, rng, names=names, split=split)
    identity = context.run.read_identity() or {}
    data = report.ReportData(
        title=f"Abstractions of {PurePosixPath(job.dataset.root).name}",
        tables=tables,
        rows=rows,
        names=names,
        split=split,
        seed=job.seed,
        without_negatives=_without_negatives(context.variants),
        curves=_curves(context),
        gallery=list(_gallery(context, rows["main"], split)),
        quarantine=list(_quarantine(context)),
        timings=_timings(context),
        settings_yaml=yaml.safe_dump(job.model_dump(mode="json"), sort_keys=False),
        versions=identity.get("versions", {}),
        fingerprint=identity.get("dataset_fingerprint", ""),
        command=command,
    )
    for suffix, text in (
        ("json", tables.to_json()),
        ("csv", tables.to_csv()),
        ("tex", tables.to_latex()),
    ):
        write_atomic(context.run.report / f"tables.{suffix}", text.encode())
    report.write_page(data, context.run.report / "index.html")
    return report.render_text(tables)


def _rows(context: Context, variant: str) -> pa.Table:
    home = context.home("abstract", variant)
    done = context.run.ledger.index(home.stage("abstract"))
    return read_metrics([home.metrics(shard) for shard in context.shards.names if shard in done])


def _without_negatives(variants: Mapping[str, Settings]) -> list[str]:
    """Variants that differ from the main one in having no negatives, and in nothing else."""

    def without(job: Settings) -> Settings:
        abstract = job.abstract.model_copy(update={"negatives": False})
        return job.model_copy(update={"abstract": abstract})

    main = variants["main"]
    return [
        name
        for name, job in variants.items()
        if main.abstract.negatives and not job.abstract.negatives and job == without(main)
    ]


def _covered(job: Settings, rows: pa.Table) -> str:
    # A job with given weights may have no test split; then all models are covered.
    split = job.report.split
    present = set(rows["split"].unique().to_pylist())
    return split if split == "all" or split in present else "all"


def _gallery(context: Context, rows: pa.Table, split: str) -> Iterator[report.GalleryItem]:
    job = context.variants["main"]
    store = context.run.fields(job)
    catalogue = context.catalogue
    chosen = rows.filter(pc.equal(rows["status"], "ok"))
    if split != "all":
        chosen = chosen.filter(pc.equal(chosen["split"], split))
    for category in sorted(chosen["category"].unique().to_pylist()):
        found = chosen.filter(pc.equal(chosen["category"], category))
        own = catalogue.filter(pc.equal(catalogue["category"], category))
        measures = found.select(["model_id", "not_exact", "volume_iou", "iou_128"]).to_pylist()
        for index in report.pictured(measures, job.report.pictures):
            (row,) = found.slice(index, 1).to_pylist()
            (place,) = own.filter(pc.equal(own["model_id"], row["model_id"])).to_pylist()
            number, at = split_shard(place["shard"])[1], place["row"]
            triangles = store.read_shard(category, number, "preview", at + 1)[at]
            yield _item(job, row, triangles.astype(np.float64), _check(context, row))


def _check(context: Context, row: dict[str, Any]) -> dict[str, bool | int] | None:
    """What the check found wrong with a model's mesh, where it was written down."""
    if row["check_ok"]:
        return None
    folder = context.home("abstract", "main").abstraction(row["category"], row["model_id"])
    try:
        return from_json((folder / f"{STEM}{FORMATS['json'].suffix}").read_bytes()).check
    except (FileNotFoundError, FormatError):
        return None


def _item(
    job: Settings,
    row: dict[str, Any],
    triangles: np.ndarray[Any, Any],
    check: dict[str, bool | int] | None,
) -> report.GalleryItem:
    positives = Cuboids.from_vector(np.array(row["positive_cuboids"]))
    negatives = Cuboids.from_vector(np.array(row["negative_cuboids"]))
    options = job.abstract
    recipe = CropRecipe(options.min_side, options.jitter, 0, 0, options.debris)
    solid = make_solid(positives, negatives, recipe)
    return report.GalleryItem(
        category=row["category"],
        model_id=row["model_id"],
        original=_soup(triangles),
        positives=cuboid.to_mesh(positives),
        negatives=cuboid.to_mesh(negatives),
        result=Mesh(solid.vertices.astype(np.float64), solid.faces.astype(np.int64)),
        row=row,
        result_source=solid.source.astype(np.int64),
        positives_part=np.repeat(np.arange(len(positives)), 12),
        check=check,
    )


def _soup(triangles: Float64) -> Mesh:
    # Unused rows of the preview are zero: triangles without extent.
    used = triangles[np.ptp(triangles, axis=1).any(axis=1)]
    return Mesh(used.reshape(-1, 3), np.arange(3 * len(used)).reshape(-1, 3))


def _curves(context: Context) -> dict[tuple[str, str], list[dict[str, float]]]:
    """Losses of each phase that a variant has at home: what it shares stands with another."""
    curves = {}
    for variant, job in context.variants.items():
        modules = () if job.weights is not None else ("positive", "negative")
        for module in modules[: 1 + job.abstract.negatives]:
            if context.home(f"train-{module}", variant).name != variant:
                continue
            for phase, plan in zip(PHASES, phase_plans(context, variant, module), strict=True):
                if is_done(plan):
                    records = json.loads((plan.folder / CURVES).read_bytes())
                    curves[variant, f"{module}-{phase}"] = records
    return curves


def _quarantine(context: Context) -> Iterator[report.Quarantined]:
    ledger = context.run.ledger
    for stage in ledger.stages():
        for shard, entry in sorted(ledger.index(stage).items()):
            try:
                record = ledger.read(stage, shard) if entry.fallen else None
            except DamagedRecordError:
                continue
            for model in record.quarantined if record else ():
                category = split_shard(shard)[0]
                yield report.Quarantined(stage, category, model.model_id, model.kind, model.reason)


def _timings(context: Context) -> list[report.StageTiming]:
    """Wall time of each stage over all sessions, with the largest process it had."""
    begun: dict[tuple[int, str], float] = {}
    seconds: dict[str, float] = defaultdict(float)
    models: dict[str, int] = defaultdict(int)
    fallen: dict[str, int] = defaultdict(int)
    peak: dict[str, int] = defaultdict(int)
    for event in read_events(context.run.root):
        name, kind = event.get("phase") or event.get("stage", ""), event["event"]
        if kind in ("stage-start", "phase-start"):
            begun[event["pid"], name] = event["time"]
            seconds.setdefault(name, 0.0)
        elif kind in ("stage-end", "phase-end"):
            start = begun.pop((event["pid"], name), event["time"])
            seconds[name] += event["time"] - start
        elif kind == "shard":
            models[name] += event["models"]
            fallen[name] += event["quarantined"]
        elif kind == "end":
            models[name] += event["models"]
        if "peak_memory" in event:
            peak[name] = max(peak[name], event["peak_memory"])
    return [
        report.StageTiming(name, seconds[name], models[name], fallen[name], peak[name] or None)
        for name in seconds
    ]
