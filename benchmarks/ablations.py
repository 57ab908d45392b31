"""The tables of benchmarks/ablations.md, from a run of jobs/ablations.yaml.

    python -m benchmarks.ablations --run RUN

Reads what the run has stored: the report's tables, metrics of the test models, and the curves.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click
import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq

from pnabs.report import build_tables

NAMES = {
    "main": "OURS",
    "no-preprocess": "without pre-process",
    "no-postprocess": "without post-process",
    "no-separation": "without `L_sep`",
    "positives-only": "POSPRIM (positives only)",
    "plus": "OURS+",
    "plus-no-postprocess": "OURS+ without post-process",
}
MEASURES = {
    "iou_32": "IoU at 32³, %",
    "cd_l1": "L1 Chamfer distance, x 1000",
    "open_space": "open space, %",
}
FATES = {
    "discarded_deep": "too deep",
    "discarded_overlap": "overlap",
    "discarded_gap": "gap",
    "discarded_idle": "idle",
    "suppressed": "suppressed",
    "negatives_kept": "kept",
}
PHASES = ("positive-initial", "positive-refinement", "negative-initial", "negative-refinement")


def markdown(head: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def signed(value: float) -> str:
    """With its sign, a true minus."""
    return f"{value:+.2f}".replace("-", "−")


def averages(table: dict[str, Any]) -> str:
    """Every variant's figures by category, and their average."""
    kept = [j for j, column in enumerate(table["columns"]) if column["models"] >= 5]
    labels = [table["columns"][j]["label"].replace("04490091", "van") for j in kept]
    rows = [
        [
            NAMES.get(row["variant"], row["variant"]),
            *("-" if row["values"][j] is None else f"{row['values'][j]:.1f}" for j in kept),
            f"{row['summary']:.2f}",
        ]
        for row in table["rows"]
        if row["role"] == "cropped"
    ]
    return markdown([MEASURES[table["name"].partition("/")[2]], *labels, "average"], rows)


def differences(tables: dict[str, dict[str, Any]]) -> str:
    """What `main` has ahead of each variant, paired by model, with intervals."""
    cells: dict[str, list[str]] = {}
    for measure in MEASURES:
        for row in tables[f"variants/{measure}"]["rows"]:
            if row["role"] == "difference":
                low, high = (signed(value) for value in row["interval"])
                cell = f"{signed(row['summary'])} ({low} to {high})"
                cells.setdefault(row["variant"], []).append(cell)
    rows = [[NAMES.get(name, name), *values] for name, values in cells.items()]
    return markdown(["OURS minus", *MEASURES.values()], rows)


def models(run: Path, variant: str) -> dict[str, np.ndarray]:
    """Metrics of the test models, in the order of their names."""
    table = pq.read_table(run / "variants" / variant / "metrics")
    table = table.filter(pc.equal(table["split"], "test")).sort_by(
        [("category", "ascending"), ("model_id", "ascending")]
    )
    names = [*MEASURES, *FATES, "negatives_predicted"]
    return {name: table[name].to_numpy().astype(float) for name in names}


def fates(run: Path, variants: list[str]) -> str:
    """What becomes of the negatives, a model at the mean."""
    rows = []
    for name in variants:
        metrics = models(run, name)
        if metrics["negatives_predicted"].any():
            rows.append([NAMES.get(name, name), *(f"{metrics[fate].mean():.2f}" for fate in FATES)])
    return markdown(["negatives a model", *FATES.values()], rows)


def curves(run: Path, variants: list[str]) -> str:
    """Validation IoU after the last epoch of each phase that a variant trained itself."""
    rows = []
    for name in variants:
        ends = []
        for phase in PHASES:
            found = (run / "variants" / name / "checkpoints" / phase).glob("*/curves.json")
            last = [json.loads(path.read_text())[-1].get("iou_32") for path in found]
            ends.append(f"{last[0]:.3f}" if last and last[0] is not None else "")
        if any(ends):
            rows.append([NAMES.get(name, name), *ends])
    return markdown(["", *(phase.replace("-", ", ") for phase in PHASES)], rows)


@click.command()
@click.option("--run", type=click.Path(path_type=Path, exists=True), required=True)
def main(run: Path) -> None:
    """Print the tables of benchmarks/ablations.md."""
    document = json.loads((run / "report/tables.json").read_text())
    tables = {table["name"]: table for table in document["tables"]}
    variants = document["variants"]
    for measure in ("iou_32", "cd_l1"):
        click.echo(averages(tables[f"variants/{measure}"]))
    click.echo(differences(tables))
    click.echo(fates(run, variants))
    click.echo(curves(run, variants))
    ours, raw = models(run, "main"), models(run, "no-postprocess")
    change = {name: ours[name] - raw[name] for name in MEASURES}
    known = np.all([np.isfinite(values) for values in change.values()], axis=0)
    together = np.corrcoef(change["cd_l1"][known], change["open_space"][known])[0, 1]
    click.echo(
        f"Over {known.sum()} models the post-process' change of the distance and of the open "
        f"space correlate by {together:.2f}."
    )
    pair = ("plus", "plus-no-postprocess")
    if set(pair) <= set(variants):
        stored = {name: pq.read_table(run / "variants" / name / "metrics") for name in pair}
        compared = build_tables(stored, np.random.default_rng(0))
        for name in MEASURES:
            row = compared[f"variants/{name}"].rows[-1]
            click.echo(f"OURS+ minus itself without post-process: {row.summary:.2f} {row.interval}")


if __name__ == "__main__":
    main()
