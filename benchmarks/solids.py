"""Solids from polygon soups: accuracy under corruption, thin parts, fields and time.

    python -m benchmarks.solids [--corpus DIR] [--sheet PNG]

prints its tables as Markdown.  Without `--corpus`, a collection in the layout of
ShapeNetCore.v2, only the embedded samples are measured.  mesh2sdf is optional
(`pip install mesh2sdf`); its column is left out where it can't be imported.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path

import click
import igl
import numpy as np
import trimesh

from benchmarks.contact import contact_sheet
from benchmarks.known_solids import (
    LEAST_CELLS,
    WAYS,
    KnownSolid,
    concatenate,
    corpus_solids,
    sample_solids,
    spoil,
    with_thin_parts,
)
from pnabs.geometry.distance import unsigned_distance
from pnabs.geometry.fields import Fields, compute_fields, warm_up
from pnabs.geometry.load import InvalidMeshError, parse_mesh
from pnabs.geometry.normalise import normalise
from pnabs.geometry.orient import prepare
from pnabs.geometry.solid import voxelise
from pnabs.geometry.types import GRID_SIDE, THETA_D, Bool, Mesh, grid_points
from pnabs.settings import Ingest

Method = Callable[[Mesh, int], Bool]


def ours(mesh: Mesh, resolution: int) -> Bool:
    """The package's solid."""
    return voxelise(prepare(mesh), resolution)


def fast_winding(mesh: Mesh, resolution: int) -> Bool:
    """libigl's fast winding number, above a half."""
    winding = igl.fast_winding_number(mesh.vertices, mesh.faces, grid_points(resolution))
    core = np.asarray(winding > 0.5).reshape((resolution,) * 3)
    return with_thin_parts(mesh, core)


def voxeliser(mesh: Mesh, resolution: int) -> Bool:
    """trimesh's voxeliser, filled, its lattice laid onto ours."""
    cell = GRID_SIDE / resolution
    moved = trimesh.Trimesh(mesh.vertices - cell / 2, mesh.faces, process=False)
    grid = moved.voxelized(cell).fill()
    core = grid.is_filled(grid_points(resolution) - cell / 2).reshape((resolution,) * 3)
    return np.asarray(core)


def mesh_to_sdf(mesh: Mesh, resolution: int) -> Bool:
    """mesh2sdf without its repair (with it, minutes a mesh), below 0."""
    import mesh2sdf

    # it samples at -1 + 2 i / resolution
    vertices = mesh.vertices * (2 / GRID_SIDE) - 1 / resolution
    field = mesh2sdf.compute(vertices.astype(np.float32), mesh.faces, resolution, fix=False)
    return with_thin_parts(mesh, field < 0)


METHODS: dict[str, Method] = {
    "pnabs": ours,
    "igl fast winding": fast_winding,
    "trimesh voxelized().fill()": voxeliser,
}


def iou(a: Bool, b: Bool) -> float:
    """Intersection over union."""
    return np.count_nonzero(a & b) / np.count_nonzero(a | b)


def score(method: Method, models: list[KnownSolid], way: str, resolution: int) -> list[float]:
    """IoU of each model spoilt in a way with its true solid; 0 where the method fails."""
    found = []
    for index, known in enumerate(models):
        truth = known.truth(resolution)
        mesh = WAYS[way](known, np.random.default_rng([0, index]))
        if np.count_nonzero(truth) < LEAST_CELLS or len(mesh.faces) == 0:
            continue
        try:
            found.append(iou(method(mesh, resolution), truth))
        except Exception as error:
            click.echo(f"{known.name}, {way}: {type(error).__name__}: {error}", err=True)
            found.append(0.0)
    return found


def accuracy(models: list[KnownSolid], others: int, resolution: int, title: str) -> Iterator[str]:
    """Rows of the accuracy table: every way, every method.

    The other methods are slow, and see only every so manieth model, `others` in all; with
    `others` 0 they are left out.
    """
    step = max(1, len(models) // max(1, others))
    methods = {"pnabs": ours}
    if others:
        methods |= {"pnabs, the same": ours, **METHODS}
    yield ""
    yield f"### {title}, {resolution}³: IoU, median / 10th percentile (mean)"
    yield ""
    chosen = {name: models if name == "pnabs" else models[::step] for name in methods}
    heads = [f"{name} ({len(some)})" for name, some in chosen.items()]
    yield "| way (models) | " + " | ".join(heads) + " |"
    yield "| --- |" + " --- |" * len(methods)
    for way in WAYS:
        cells = []
        for name, method in methods.items():
            x = np.array(score(method, chosen[name], way, resolution))
            cells.append(f"{np.median(x):.3f} / {np.quantile(x, 0.1):.3f} ({x.mean():.3f})")
        yield f"| {way} | " + " | ".join(cells) + " |"


def read_all(root: Path) -> Iterator[tuple[str, bytes]]:
    """Every mesh file of a collection."""
    for path in sorted(root.glob("*/*/models/model_normalized.obj")):
        yield path.parts[-3], path.read_bytes()


def surface_left_out(prepared: Mesh, occupancy: Bool, rng: np.random.Generator) -> float:
    """Share of the surface farther than one cell from the solid's cells."""
    area = igl.doublearea(prepared.vertices, prepared.faces)
    face = rng.choice(len(area), 4000, p=area / area.sum())
    weights = rng.dirichlet(np.ones(3), 4000)
    points = np.einsum("pc,pcd->pd", weights, prepared.triangles[face])
    cell = GRID_SIDE / len(occupancy)
    centres = (np.argwhere(occupancy) + 0.5) * cell - GRID_SIDE / 2
    gaps = np.empty(len(points))
    for some in np.array_split(np.arange(len(points)), 8):
        outside = np.abs(points[some, None] - centres) - cell / 2
        gaps[some] = np.linalg.norm(np.maximum(outside, 0), axis=2).min(axis=1)
    return float((gaps > cell).mean())


def thin_and_fields(models: Iterable[tuple[str, bytes]], every: int) -> Iterator[str]:
    """Rows on real meshes: solids, their surface, the fields and the samples."""
    options = Ingest()
    empty, left_out, hollow = 0, [], 0
    band, beyond, mean, signs, sides = [], [], [], 0, []
    count = fallen = 0
    for index, (name, data) in enumerate(models):
        try:
            mesh = parse_mesh(data, ".obj", options.limits)
        except InvalidMeshError as error:
            click.echo(f"{name}: {error}", err=True)
            fallen += 1
            continue
        count += 1
        found = compute_fields(mesh, options, "shapenet-v2", np.random.default_rng(0))
        normalised = normalise(mesh)[0]
        empty += not found.occupancy.any()
        left_out.append(surface_left_out(normalised, found.occupancy, np.random.default_rng(0)))
        hollow += not (found.sdf < 0).any()
        signs += not np.array_equal(found.sdf < 0, found.occupancy)
        sides.append(normals_out(found))
        if index % every:
            continue
        prepared = prepare(normalised)
        squared, _, _ = igl.point_mesh_squared_distance(
            grid_points(32), prepared.mesh.vertices, prepared.mesh.faces
        )
        exact = np.sqrt(squared)
        error = np.abs(unsigned_distance(prepared, 32).ravel() - exact) * (32 / GRID_SIDE)
        near = exact <= THETA_D + GRID_SIDE / 32
        band.append(error[near].max(initial=0.0))
        beyond.append(error.max())
        mean.append(error.mean())
    yield ""
    yield f"### Real meshes: {count} read, {fallen} refused"
    yield ""
    yield "| | |"
    yield "| --- | --- |"
    worst = max(left_out)
    told = {
        "empty solids": f"{empty}",
        "models with more than 10 % of the surface farther than a voxel from the solid": (
            f"{sum(x > 0.1 for x in left_out)}"
        ),
        "the most of any model; the mean": f"{worst:.2%}; {np.mean(left_out):.3%}",
        "signed fields without an inside": f"{hollow}",
        "fields whose sign differs from the solid somewhere": f"{signs}",
        f"distance, {len(band)} models: largest error in the band (θ_d and a voxel), voxels": (
            f"{max(band):.2g}"
        ),
        "largest error anywhere; mean, voxels": f"{max(beyond):.3f}; {np.mean(mean):.5f}",
        "surface samples whose normal leads out, of those where the solid tells, "
        "median model; 10th percentile": f"{np.median(sides):.1%}; {np.quantile(sides, 0.1):.1%}",
    }
    for name, value in told.items():
        yield f"| {name} | {value} |"


def normals_out(found: Fields) -> float:
    """Share of surface samples whose normal leads out, of those where the solid tells."""
    cell = GRID_SIDE / 64
    points, normals = found.surface[:, :3], found.surface[:, 3:]

    def solid_at(where: np.ndarray) -> Bool:
        index = np.floor((where + GRID_SIDE / 2) / cell).astype(int).clip(0, 63)
        return np.asarray(found.occupancy_64[tuple(index.T)])

    ahead, behind = solid_at(points + cell * normals), solid_at(points - cell * normals)
    told = ahead != behind
    return float((behind & ~ahead)[told].mean()) if told.any() else 1.0


def cpu(function: Callable[[], object]) -> float:
    """CPU seconds of a call, of all its threads."""
    start = time.process_time()
    function()
    return time.process_time() - start


def timing(models: Iterable[tuple[str, bytes]], every: int, others: int) -> Iterator[str]:
    """Rows on time: the whole of ingest against libigl's exact distance on the same grid."""
    options, points = Ingest(), grid_points(32)
    rows: dict[str, list[float]] = {}
    faces = []

    def note(name: str, seconds: float) -> None:
        rows.setdefault(name, []).append(seconds)

    for index, (_, data) in enumerate(islice(models, 0, None, every)):
        mesh = parse_mesh(data, ".obj", options.limits)
        faces.append(len(mesh.faces))
        rng = np.random.default_rng(0)
        parse = cpu(lambda data=data: parse_mesh(data, ".obj", options.limits))
        fields = cpu(lambda mesh=mesh, rng=rng: compute_fields(mesh, options, "folder", rng))
        note("pnabs: load", parse)
        note("pnabs: load, solids 32³ and 64³, field, samples, preview", parse + fields)
        prepared = prepare(normalise(mesh)[0]).mesh
        note(
            "igl: exact unsigned distance 32³ alone",
            cpu(lambda p=prepared: igl.point_mesh_squared_distance(points, p.vertices, p.faces)),
        )
        if index % max(1, others) == 0:
            plain = normalise(mesh)[0]
            for name, method in METHODS.items():
                note(f"solid 32³ alone: {name}", cpu(lambda m=method, p=plain: m(p, 32)))
    yield ""
    yield f"### CPU seconds a model, {len(faces)} models, median {int(np.median(faces)):,} faces"
    yield ""
    yield "| | median | mean | 95th percentile | most | models |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for name, values in rows.items():
        x = np.array(values)
        yield (
            f"| {name} | {np.median(x):.4f} | {x.mean():.4f} | {np.quantile(x, 0.95):.4f} "
            f"| {x.max():.3f} | {len(x)} |"
        )
    own = np.array(rows["pnabs: load, solids 32³ and 64³, field, samples, preview"])
    exact = np.array(rows["igl: exact unsigned distance 32³ alone"])
    yield ""
    yield (
        f"Ratio of the second row to the third: {own.sum() / exact.sum():.2f} in all, "
        f"{np.median(own / exact):.2f} for the median model."
    )


def growth() -> Iterator[str]:
    """Rows on faces: closed tori side by side, as they are and torn to pieces."""
    rng = np.random.default_rng(0)
    yield ""
    yield "### Growth with faces: tori, CPU seconds (microseconds a face)"
    yield ""
    yield "| faces | closed | 30 % flipped, 10 % deleted, own vertices |"
    yield "| --- | --- | --- |"
    for count in (1_000, 10_000, 100_000, 1_000_000):
        each = min(count, 20_000)
        rings = round((each / 8) ** 0.5)
        tori = []
        for _ in range(count // each):
            torus = trimesh.creation.torus(0.3, 0.1, 4 * rings, rings)
            vertices = np.array(torus.vertices) + rng.uniform(-1, 1, 3)
            tori.append(Mesh(vertices, np.array(torus.faces, dtype=np.int64)))
        closed = concatenate(tori)
        torn = spoil(closed, "flip+tear+unweld", rng)
        cells = []
        for mesh in (closed, torn):
            options = Ingest()
            seconds = cpu(
                lambda m=mesh, o=options: compute_fields(m, o, "folder", np.random.default_rng(0))
            )
            cells.append(f"{seconds:.2f} ({1e6 * seconds / len(mesh.faces):.1f})")
        yield f"| {len(closed.faces):,} | {cells[0]} | {cells[1]} |"


@click.command()
@click.option("--corpus", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--samples", default=30, show_default=True, help="Sample models a category.")
@click.option(
    "--others",
    default=24,
    show_default=True,
    help="Models the others see, at the first resolution.",
)
@click.option("--resolution", type=int, default=(32, 64), multiple=True, show_default=True)
@click.option("--every", default=4, show_default=True, help="Every so manieth mesh is timed.")
@click.option("--sheet", type=click.Path(dir_okay=False, path_type=Path), help="Contact sheet.")
def main(
    corpus: Path | None,
    samples: int,
    others: int,
    resolution: tuple[int, ...],
    every: int,
    sheet: Path | None,
) -> None:
    """Measure the solids and print the tables."""
    try:
        import mesh2sdf  # noqa: F401

        METHODS["mesh2sdf"] = mesh_to_sdf
    except ImportError:
        click.echo("mesh2sdf is not installed: left out", err=True)
    warm_up()
    made = list(sample_solids(samples))
    for side in resolution:
        for row in accuracy(made, others if side == resolution[0] else 0, side, "Embedded samples"):
            click.echo(row)
    if corpus is not None:
        known = list(corpus_solids(corpus))
        for side in resolution:
            for row in accuracy(
                known, others if side == resolution[0] else 0, side, "Closed models of the corpus"
            ):
                click.echo(row)
        for row in thin_and_fields(read_all(corpus), every):
            click.echo(row)
        for row in timing(read_all(corpus), every, 6):
            click.echo(row)
        if sheet is not None:
            contact_sheet(corpus, sheet)
    for row in growth():
        click.echo(row)


if __name__ == "__main__":
    main()
