"""Other programs' parts beside pnabs' boxes, on the exact solids of a run's closed models.

    pip install -e '.[peers]'
    python -m benchmarks.peers --run RUN --out OUT

Each program, pnabs among them, gets the exact solid of each closed model of a split and at most so
many parts, runs in a child with a time limit, and its parts are written to OUT/<program>.  Then
`pnabs.evaluate` measures them all against the run.  Go on with the same command; what is there
isn't done again.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
import trimesh

import pnabs
from pnabs.formats import Abstraction
from pnabs.geometry.types import Float64, Int64, Mesh
from pnabs.report.averages import bootstrap_means
from pnabs.stages.context import read_shard_rows, split_shard
from pnabs.stages.progress import Reporter
from pnabs.stages.status import stored_context
from pnabs.store.boundaries import read_boundaries, read_reasons
from pnabs.store.run import RunFolder

Part = tuple[Float64, Int64]

OURS = "pnabs, boxes"

THINNEST = 1e-6
"""Parts that enclose less than this share of the cube of their longest side are left out: box
modes return degenerate ones, which no physics engine takes."""


def coacd_hulls(vertices: Float64, faces: Int64, parts: int) -> list[Part]:
    """CoACD's convex hulls, as its README runs it; the cap is its own."""
    import coacd

    coacd.set_log_level("error")
    found = coacd.run_coacd(coacd.Mesh(vertices, faces), max_convex_hull=parts, seed=0)
    return [(np.asarray(v, float), np.asarray(f, np.int64)) for v, f in found]


def coacd_boxes(vertices: Float64, faces: Int64, parts: int) -> list[Part]:
    """CoACD with boxes in place of hulls (`apx_mode`)."""
    import coacd

    coacd.set_log_level("error")
    mesh = coacd.Mesh(vertices, faces)
    found = coacd.run_coacd(mesh, max_convex_hull=parts, apx_mode="box", seed=0)
    return [(np.asarray(v, float), np.asarray(f, np.int64)) for v, f in found]


def miniacd_hulls(vertices: Float64, faces: Int64, parts: int) -> list[Part]:
    """miniacd's convex hulls; it has no cap, so its threshold is raised until they are few."""
    import miniacd

    found: list[Any] = []
    for threshold in (0.05, 0.1, 0.2, 0.4, 0.8):
        mesh = miniacd.Mesh(vertices, faces)
        found = miniacd.run(mesh, threshold=threshold, mcts_random_seed=0, print=False)
        if len(found) <= parts:
            break
    return [
        (np.asarray(hull.vertices(), float), np.asarray(hull.faces(), np.int64)) for hull in found
    ]


def vhacd_hulls(vertices: Float64, faces: Int64, parts: int) -> list[Part]:
    """V-HACD's convex hulls; the cap is its own."""
    import vhacdx

    found = vhacdx.compute_vhacd(vertices, faces.astype(np.uint32), maxConvexHulls=parts)
    return [(np.asarray(v, float), np.asarray(f, np.int64)) for v, f in found]


def oriented_boxes(vertices: Float64, faces: Int64, parts: int) -> list[Part]:
    """One oriented bounding box a connected body of the solid, by trimesh."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    found = []
    for component in mesh.split(only_watertight=False, repair=False):
        box = component.bounding_box_oriented
        found.append((np.asarray(box.vertices, float), np.asarray(box.faces, np.int64)))
    return found


def pnabs_boxes(vertices: Float64, faces: Int64, parts: int) -> Abstraction:
    """pnabs with the weights that come with it."""
    return pnabs.abstract(Mesh(vertices, faces), settings={"abstract": {"boxes": parts}})


PROGRAMS: dict[str, Callable[[Float64, Int64, int], list[Part] | Abstraction]] = {
    OURS: pnabs_boxes,
    "CoACD, hulls": coacd_hulls,
    "CoACD, boxes": coacd_boxes,
    "miniacd, hulls": miniacd_hulls,
    "V-HACD, hulls": vhacd_hulls,
    "a box a body": oriented_boxes,
}


@dataclass(frozen=True, slots=True)
class Model:
    """A closed model: its exact solid in the input's coordinates."""

    category: str
    model_id: str
    vertices: Float64
    faces: Int64


def closed_models(run: RunFolder, split: str) -> Iterator[Model]:
    """The closed models of a split (`all`: of every split), as ingest kept them."""
    context = stored_context(run, Reporter())
    store = run.fields(context.job)
    for shard in context.shards.names:
        category, number = split_shard(shard)
        rows = read_shard_rows(run.catalogue, shard)
        reasons = read_reasons(run.boundaries(shard))
        transforms = store.read_shard(category, number, "transform", len(rows))
        chosen = [
            row for row in rows if reasons[row["row"]] == "" and split in ("all", row["split"])
        ]
        boundaries = read_boundaries(run.boundaries(shard), [row["row"] for row in chosen])
        for row, boundary in zip(chosen, boundaries, strict=True):
            matrix = transforms[row["row"]]
            vertices = boundary.vertices.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
            yield Model(category, row["model_id"], vertices, boundary.faces.astype(np.int64))


def folder_of(out: Path, program: str) -> Path:
    """Where a program's parts lie."""
    return out / program.replace(", ", "-").replace(" ", "-")


def write_solid(out: Path, model: Model) -> None:
    """Put the exact solid where programs and the evaluation find it."""
    path = solids_of(out) / model.category / f"{model.model_id}.ply"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        trimesh.Trimesh(model.vertices, model.faces, process=False).export(path)


def decompose(model: Model, program: str, out: Path, parts: int, seconds: float) -> None:
    """Run a program on a model in a child; write its parts, and how it ended."""
    folder = folder_of(out, program)
    place = folder / model.category / model.model_id
    record = record_of(out, program, model)
    if record.exists():
        return
    place.mkdir(parents=True, exist_ok=True)
    source = solids_of(out) / model.category / f"{model.model_id}.ply"
    command = [sys.executable, "-m", "benchmarks.peers", "--child", program]
    command += ["--source", str(source), "--out", str(place), "--parts", str(parts)]
    begun = time.monotonic()
    told: dict[str, Any] = {}
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=seconds)
        ended = "ok" if done.returncode == 0 else f"exit {done.returncode}"
        if ended == "ok":
            told = json.loads(done.stdout.splitlines()[-1])
    except subprocess.TimeoutExpired:
        ended = "timeout"
    if ended != "ok":
        shutil.rmtree(place)
    record.parent.mkdir(parents=True, exist_ok=True)
    value = {"ended": ended, "wall": round(time.monotonic() - begun, 3), **told}
    record.write_text(json.dumps(value))


def solids_of(out: Path) -> Path:
    """Where the exact solids lie."""
    return out / "solids"


def record_of(out: Path, program: str, model: Model) -> Path:
    """The file that says how a program ended on a model."""
    folder = out / "records" / folder_of(out, program).name / model.category
    return folder / f"{model.model_id}.json"


def child(program: str, source: Path, out: Path, parts: int) -> None:
    """What runs in the child: the program's parts as files, and its CPU seconds on stdout."""
    mesh = trimesh.load_mesh(source, process=False)
    vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)
    box = trimesh.creation.box((3, 2, 1))
    # What loads and compiles at the first call is no part of the figure.
    PROGRAMS[program](np.asarray(box.vertices, float), np.asarray(box.faces, np.int64), parts)
    begun = time.process_time()
    found = PROGRAMS[program](vertices, faces, parts)
    told: dict[str, Any] = {"cpu": round(time.process_time() - begun, 3)}
    if isinstance(found, Abstraction):
        found.save(out / "abstraction.json")
        found.save(out / "abstraction.glb")
        told["parts"] = len(found.positives) + len(found.negatives)
    else:
        hulls = [trimesh.Trimesh(v, f, process=False).convex_hull for v, f in found]
        sizes = [float(np.ptp(v, axis=0).max()) for v, _ in found]
        kept = [h for h, size in zip(hulls, sizes, strict=True) if h.volume > THINNEST * size**3]
        for number, hull in enumerate(kept):
            hull.export(out / f"part{number:03d}.ply")
        told |= {"parts": len(kept), "degenerate": len(found) - len(kept)}
    click.echo(json.dumps(told))


def report(
    run: Path, split: str, out: Path, models: list[Model], programs: list[str], parts: int
) -> None:
    """Measure, and print a row a program and its paired differences to pnabs."""
    evaluation = pnabs.evaluate(
        run,
        {program: folder_of(out, program) for program in programs},
        only=None if split == "all" else split,
        max_parts=parts,
        out=out / "evaluation",
    )
    rows = evaluation.models.to_pylist()
    order = [(model.category, model.model_id) for model in models]

    def column(program: str, name: str) -> Float64:
        found = {
            (row["category"], row["model_id"]): row[name] for row in rows if row["name"] == program
        }
        values = [found.get(key) for key in order]
        return np.array([np.nan if value is None else value for value in values], dtype=float)

    click.echo(f"{len(models)} closed models, at most {parts} parts\n")
    click.echo(
        "| program | volume IoU, failures 0 | without failures | covered | excess | coverage "
        "| out 99 % | miss 99 % | parts | CPU s, median | largest | failures |"
    )
    click.echo("| --- " * 12 + "|")
    volumes: dict[str, Float64] = {}
    for program in programs:
        volume = volumes[program] = column(program, "volume_iou")
        ended = [json.loads(record_of(out, program, model).read_text()) for model in models]
        seconds = [one["cpu"] for one in ended if "cpu" in one]
        kinds = Counter(one["ended"] for one in ended if one["ended"] != "ok")
        kinds["over the cap"] = sum(one.get("parts", 0) > parts for one in ended)
        kinds["not closed"] = int(np.isnan(volume).sum()) - sum(kinds.values())
        failures = ", ".join(f"{count} {kind}" for kind, count in kinds.items() if count) or "0"
        low, high = interval(np.nan_to_num(volume))
        cells = [
            f"{np.nan_to_num(volume).mean():.3f} ({low:.3f} to {high:.3f})",
            f"{np.nanmean(volume):.3f}" if np.isfinite(volume).any() else "-",
        ]
        for name, factor in (("covered", 1), ("excess", 1), ("coverage", 1)):
            cells.append(f"{np.nanmean(column(program, name)) * factor:.3f}")
        cells += [f"{100 * np.nanmean(column(program, n)):.2f} %" for n in ("out_99", "miss_99")]
        cells.append(f"{np.nanmean(column(program, 'parts')):.1f}")
        cells += [f"{np.median(seconds):.2f}", f"{max(seconds):.1f}"] if seconds else ["-", "-"]
        click.echo(f"| {program} | {' | '.join([*cells, failures])} |")
    if OURS not in volumes:
        return
    click.echo("\npnabs minus the other, by model, where both finish\n")
    click.echo("| program | models | volume IoU | 95 % interval |")
    click.echo("| --- | --- | --- | --- |")
    for program in programs:
        difference = volumes[OURS] - volumes[program]
        both = difference[np.isfinite(difference)]
        if program != OURS and len(both):
            low, high = interval(both)
            click.echo(
                f"| {program} | {len(both)} | {both.mean():+.3f} | {low:+.3f} to {high:+.3f} |"
            )


def interval(values: Float64) -> tuple[float, float]:
    """95 % bootstrap interval of a mean."""
    means = bootstrap_means(values[:, None], 2000, np.random.default_rng(0))
    low, high = np.percentile(means, [2.5, 97.5])
    return float(low), float(high)


@click.command()
@click.option("--run", "run_folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--out", required=True, type=click.Path(file_okay=False, path_type=Path))
@click.option("--split", default="test", show_default=True, help="Models taken; `all` for every.")
@click.option("--each", type=int, help="At most so many models a category.")
@click.option("--only", multiple=True, type=click.Choice(list(PROGRAMS)), help="Only this program.")
@click.option("--parts", default=20, show_default=True, help="Parts at most.")
@click.option("--seconds", default=120.0, show_default=True, help="Wall seconds a model.")
@click.option("--jobs", default=1, show_default=True, help="Models at a time.")
@click.option("--child", "child_of", hidden=True)
@click.option("--source", hidden=True, type=click.Path(path_type=Path))
def main(
    run_folder: Path | None,
    out: Path,
    split: str,
    each: int | None,
    only: tuple[str, ...],
    parts: int,
    seconds: float,
    jobs: int,
    child_of: str | None,
    source: Path | None,
) -> None:
    """Decompose, measure, and print the tables."""
    if child_of is not None and source is not None:
        child(child_of, source, out, parts)
        return
    if run_folder is None:
        raise click.UsageError("--run is missing")
    taken: dict[str, int] = {}
    models = []
    for model in closed_models(RunFolder(run_folder), split):
        taken[model.category] = taken.get(model.category, 0) + 1
        if each is None or taken[model.category] <= each:
            models.append(model)
            write_solid(out, model)
    programs = list(only or PROGRAMS)
    work = [(model, program) for program in programs for model in models]
    with ThreadPoolExecutor(jobs) as pool:
        for number, _ in enumerate(
            pool.map(lambda one: decompose(one[0], one[1], out, parts, seconds), work), 1
        ):
            click.echo(f"{number} of {len(work)}", err=True)
    report(run_folder, split, out, models, programs, parts)


if __name__ == "__main__":
    main()
