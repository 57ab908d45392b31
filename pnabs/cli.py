"""The command line: click commands, nothing else."""

from __future__ import annotations

import contextlib
import gc
import json
import os
import shlex
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

import click

import pnabs

if TYPE_CHECKING:
    from pnabs.evaluation.reading import Frame
    from pnabs.settings import Layout
    from pnabs.stages.run import Result

STAGES = (
    *("scan", "ingest", "train-positive", "difference"),
    *("train-negative", "abstract", "report"),
)
FORMATS = ("json", "glb", "parts", "obj", "ply", "stl", "urdf", "mjcf")
KINDS = ("invalid", "error", "crash", "timeout", "memory")
LAYOUTS = ("shapenet-v1", "shapenet-v2", "folder")
SPLITS = ("train", "val", "test")
FRAMES = ("input", "normalised")


class Commands(click.Group):
    """The commands; Ctrl-C ends them also while they load, and when they have nothing to tidy."""

    def invoke(self, ctx: click.Context) -> object:
        """Run the command that was named."""
        if threading.current_thread() is not threading.main_thread():
            return super().invoke(ctx)
        before = signal.signal(signal.SIGINT, _stop)
        try:
            return super().invoke(ctx)
        finally:
            signal.signal(signal.SIGINT, before)


def _stop(number: int, frame: FrameType | None) -> NoReturn:
    # Not as an exception: libraries swallow any while they import each other.
    os.write(2, b"stopped\n")
    os._exit(128 + number)


@click.group(
    cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100}
)
@click.version_option(pnabs.__version__, prog_name="pnabs")
def main() -> None:
    """Abstract collections of 3D meshes: positive cuboids, cropped by negative ones.

    A job file names a dataset and settings; `pnabs run` does what is missing of it, on this
    machine or on a Ray cluster, and can be stopped and run again at any time.

    Exit codes: 0 done, 1 internal error, 2 wrong usage or job file, 3 finished but too much
    failed, 4 refused, 5 damage found, 130 and 143 interrupted.
    """


def _numbers(
    ctx: click.Context, param: click.Parameter, value: str | None
) -> tuple[int, ...] | None:
    """`4,8` as (4, 8)."""
    if value is None:
        return None
    parts = [part.strip() for part in value.split(",")]
    if not all(part.isdecimal() and int(part) for part in parts):
        raise click.BadParameter(f"{value!r} is no list of numbers such as 4,8,16", ctx, param)
    return tuple(int(part) for part in parts)


job_argument = click.argument("job", type=click.Path(dir_okay=False, path_type=Path))
run_argument = click.argument("run", type=click.Path(file_okay=False, path_type=Path))
boxes_option = click.option(
    "--boxes", type=click.IntRange(1), help="Boxes a shape at most, negatives included [20]."
)
levels_option = click.option(
    "--levels",
    metavar="N,N...",
    callback=_numbers,
    help="Coarser levels of detail too, of so many boxes: 4,8,16.",
)
run_options = [
    click.option("--out", type=click.Path(path_type=Path), help="The run folder."),
    click.option(
        "--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Replace a setting."
    ),
    click.option("--stages", help=f"Only these, by comma: {', '.join(STAGES)}."),
    click.option("--category", "categories", multiple=True, help="Only this category."),
    click.option("--limit", type=click.IntRange(1), help="At most so many models a category."),
    boxes_option,
    levels_option,
    click.option(
        "--max-failed",
        type=click.FloatRange(0, 100),
        help="Per cent of the models that may fall out of a stage [5].",
    ),
    click.option("--accept-changes", is_flag=True, help="Redo what changed, and just that."),
    click.option(
        "--keep-weights", is_flag=True, help="With --accept-changes: don't train again for it."
    ),
]


def _with_run_options(command: click.decorators.FC) -> click.decorators.FC:
    for option in reversed(run_options):
        command = option(command)
    return command


@main.command()
@job_argument
@_with_run_options
@click.option("--address", help="A Ray cluster's address; started here when left out.")
@click.option("--dry-run", is_flag=True, help="Say what would be done, and do nothing.")
def run(
    job: Path,
    out: Path | None,
    overrides: tuple[str, ...],
    stages: str | None,
    categories: tuple[str, ...],
    limit: int | None,
    boxes: int | None,
    levels: tuple[int, ...] | None,
    max_failed: float | None,
    accept_changes: bool,
    keep_weights: bool,
    address: str | None,
    dry_run: bool,
) -> None:
    """Do what is missing of JOB, a job file; safe to run again at any time."""
    from pnabs.stages.dry_run import dry_run as describe
    from pnabs.stages.job import load_job
    from pnabs.stages.options import Options
    from pnabs.stages.progress import Reporter
    from pnabs.stages.run import run_job

    reporter = Reporter()
    _check_keep(accept_changes, keep_weights)
    with _errors():
        loaded = load_job(job, _overrides(overrides, limit, boxes, levels), out, reporter.say)
        options = Options(
            address=address,
            stages=_stages(stages),
            categories=categories,
            max_failed=max_failed,
            accept=accept_changes,
            keep_weights=keep_weights,
            command=shlex.join(["pnabs", *sys.argv[1:]]),
        )
        if dry_run:
            click.echo(describe(loaded, options, reporter), nl=False)
            return
        # Ray writes to stdout when workers die; stdout is for results alone.
        with contextlib.redirect_stdout(sys.stderr):
            result = run_job(loaded, options, reporter)
    _finish(result)


@main.command()
@run_argument
@click.option("--stage", help="Only models that fell out of this stage, such as ingest.")
@click.option("--kind", type=click.Choice(KINDS), help="Only models that fell out like this.")
@click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE",
    help="Replace a setting, such as runtime.deadline=600.",
)  # fmt: skip
@click.option("--max-failed", type=click.FloatRange(0, 100), help="As for `run`.")
@click.option("--keep-weights", is_flag=True, help="Don't train again for models recovered.")
@click.option("--address", help="A Ray cluster's address; started here when left out.")
def retry(
    run: Path,
    stage: str | None,
    kind: str | None,
    overrides: tuple[str, ...],
    max_failed: float | None,
    keep_weights: bool,
    address: str | None,
) -> None:
    """Try RUN's quarantined models again, and do what follows from those that come through.

    A model's shard is done again as a whole, and gives the others the same results.
    """
    from pnabs.stages.options import Options, Retry
    from pnabs.stages.progress import Reporter
    from pnabs.stages.retry import retry as again

    with _errors():
        options = Options(
            address=address,
            max_failed=max_failed,
            keep_weights=keep_weights,
            command=shlex.join(["pnabs", *sys.argv[1:]]),
        )
        with contextlib.redirect_stdout(sys.stderr):
            result = again(run, Retry(stage, kind), overrides, options, Reporter())
    _finish(result)


@main.command()
@job_argument
@_with_run_options
@click.option("--address", required=True, help="The head's dashboard, http://HEAD:8265.")
@click.option("--wait/--no-wait", default=True, help="Follow the job to its end [wait].")
def submit(
    job: Path,
    out: Path | None,
    overrides: tuple[str, ...],
    stages: str | None,
    categories: tuple[str, ...],
    limit: int | None,
    boxes: int | None,
    levels: tuple[int, ...] | None,
    max_failed: float | None,
    accept_changes: bool,
    keep_weights: bool,
    address: str,
    wait: bool,
) -> None:
    """Run JOB on a cluster, through Ray's Job API.

    The dataset and the run folder must lie on storage that all nodes share.
    """
    from pnabs.stages.job import load_job
    from pnabs.stages.progress import Reporter
    from pnabs.stages.submit import submit as send

    _check_keep(accept_changes, keep_weights)
    with _errors():
        say = Reporter().say
        loaded = load_job(job, _overrides(overrides, limit, boxes, levels), out, say)
        _stages(stages)
        arguments = ["--stages", stages] if stages else []
        for category in categories:
            arguments += ["--category", category]
        if max_failed is not None:
            arguments += ["--max-failed", f"{max_failed:g}"]
        if accept_changes:
            arguments.append("--accept-changes")
        if keep_weights:
            arguments.append("--keep-weights")
        code = send(loaded, address, arguments, wait=wait, log=sys.stderr)
    sys.exit(code)


@main.command()
@run_argument
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.option("--shards", is_flag=True, help="List every shard, not only those running or failed.")
def status(run: Path, as_json: bool, shards: bool) -> None:
    """How far RUN is, from its files: works while the run goes on."""
    from pnabs.stages.progress import Reporter
    from pnabs.stages.status import render, stored_context
    from pnabs.stages.status import status as read
    from pnabs.store.run import RunFolder

    # It only gathers, and ends: the collector would go through a million models' shards in vain.
    gc.disable()
    with _errors():
        found = read(stored_context(RunFolder(run), Reporter()))
    gc.enable()
    if as_json:
        click.echo(json.dumps([item.to_json(shards=shards) for item in found], indent=1))
    else:
        click.echo(render(found, shards=shards), nl=False)


@main.command()
@run_argument
def verify(run: Path) -> None:
    """Read everything in RUN back; what is damaged is redone by the next run."""
    from pnabs.stages.folder import held
    from pnabs.stages.progress import Reporter
    from pnabs.stages.verify import DAMAGE_EXIT_CODE
    from pnabs.stages.verify import verify as read_back
    from pnabs.store.run import RunFolder

    if not run.is_dir():
        raise click.BadParameter(f"there is no folder {run}", param_hint="RUN")
    damaged = 0
    with _errors(), held(run):
        for line in read_back(RunFolder(run), Reporter()):
            click.echo(line)
            damaged += 1
    if damaged:
        _fail("damage found; the next `pnabs run` does what it touches again", DAMAGE_EXIT_CODE)


@main.command()
@run_argument
def report(run: Path) -> None:
    """Tables and page of RUN again, from what is stored."""
    from pnabs.stages import report as stage
    from pnabs.stages.progress import Reporter
    from pnabs.stages.status import stored_context
    from pnabs.store.run import RunFolder

    with _errors():
        folder = RunFolder(run)
        identity = folder.read_identity() or {}
        tables = stage.run(stored_context(folder, Reporter()), identity.get("command", ""))
    click.echo(tables, nl=False)
    click.echo(f"\nreport: {folder.report / 'index.html'}")


@main.command()
@click.argument(
    "meshes", metavar="MESH...", nargs=-1, required=True, type=click.Path(path_type=Path)
)
@click.option(
    "--out",
    required=True,
    type=click.Path(file_okay=False, path_type=Path),
    help="Where results go: DIR/<path of the mesh>/abstraction.json and so on.",
)
@click.option(
    "--weights", default="shipped", show_default=True, help="Folder with trained weights."
)
@click.option(
    "--format",
    "formats",
    multiple=True,
    type=click.Choice(FORMATS),
    help="What to write beside abstraction.json [glb]; may be repeated.",
)
@boxes_option
@levels_option
@click.option("--jobs", type=click.IntRange(1), help="Meshes at a time [one a CPU].")
@click.option(
    "--seed",
    type=click.IntRange(0, 2**32 - 1),
    default=0,
    show_default=True,
    help="Same seed, same results.",
)
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Replace a setting.")
@click.option("--max-failed", type=click.FloatRange(0, 100), help="Per cent that may fall out [5].")
@click.option("--retry", is_flag=True, help="Try again what was quarantined before.")
def abstract(
    meshes: tuple[Path, ...],
    out: Path,
    weights: str,
    formats: tuple[str, ...],
    boxes: int | None,
    levels: tuple[int, ...] | None,
    jobs: int | None,
    seed: int,
    overrides: tuple[str, ...],
    max_failed: float | None,
    retry: bool,
) -> None:
    """Abstract mesh files, and the meshes in folders: no dataset, no training, no Ray.

    Run it again to go on, or for files that are new or have changed; what is done stays.
    """
    from pnabs.stages.head_start import head_start

    head_start()
    from pnabs.dataset.files import find_files
    from pnabs.stages.files import abstract_files, files_job
    from pnabs.stages.progress import Reporter

    overrides = _overrides(overrides, None, boxes, levels)
    if max_failed is not None:
        overrides = (*overrides, f"runtime.max_failed={max_failed}")
    reporter = Reporter()
    with _errors():
        found = find_files(meshes, out)
        say = reporter.say
        job = files_job(found, out, weights, seed, formats or ("glb",), overrides, say)
        summary = abstract_files(
            found,
            job,
            jobs=jobs or len(os.sched_getaffinity(0)),
            retry=retry,
            command=shlex.join(["pnabs", *sys.argv[1:]]),
            reporter=reporter,
        )
        text = summary.text
    click.echo(text, nl=False)
    sys.exit(summary.exit_code)


@main.command()
@click.argument("shapes", metavar="SHAPES")
@click.argument(
    "results", metavar="RESULTS...", nargs=-1, required=True, type=click.Path(path_type=Path)
)
@click.option("--name", "names", multiple=True, help="Of each RESULTS, in their order.")
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("evaluation"),
    show_default=True,
    help="Where rows and tables go.",
)
@click.option("--layout", type=click.Choice(LAYOUTS), help="Of a dataset [found out].")
@click.option("--split", metavar="CSV|hash", help="Where the models' splits come from.")
@click.option("--only", type=click.Choice(SPLITS), help="Models of this split alone.")
@click.option("--category", "categories", multiple=True, help="Only this category.")
@click.option(
    "--frame",
    type=click.Choice(FRAMES),
    default="input",
    show_default=True,
    help="In which RESULTS' meshes and boxes are given.",
)
@click.option("--max-parts", type=click.IntRange(1), help="Results of more parts are failures.")
@click.option("--jobs", type=click.IntRange(1), help="Results at a time [one a CPU].")
@click.option("--address", help="Work on the Ray cluster there; `local` starts Ray here.")
@click.option(
    "--seed", type=click.IntRange(0, 2**32 - 1), help="Same seed, same figures [the run's, or 0]."
)
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Replace a setting.")
@click.option("--max-failed", type=click.FloatRange(0, 100), help="Per cent that may fail [5].")
@click.option("--retry", is_flag=True, help="Try again what couldn't be measured before.")
def evaluate(
    shapes: str,
    results: tuple[Path, ...],
    names: tuple[str, ...],
    out: Path,
    layout: Layout | None,
    split: str | None,
    only: str | None,
    categories: tuple[str, ...],
    frame: Frame,
    max_parts: int | None,
    jobs: int | None,
    address: str | None,
    seed: int | None,
    overrides: tuple[str, ...],
    max_failed: float | None,
    retry: bool,
) -> None:
    """Score RESULTS, anybody's, against SHAPES: a run, a dataset or meshes.

    Results are folders of abstraction.json files or meshes, single ones, or boxes as csv or npz;
    several stand side by side.  Run it again to go on, or with more of them: what is done stays.
    """
    if address is None:
        from pnabs.batch.child import start_server

        # Loads while the command itself does.
        start_server(("pnabs.evaluation.warm",))
    from pnabs.evaluation.names import named
    from pnabs.evaluation.run import Request
    from pnabs.evaluation.run import run as measure
    from pnabs.evaluation.shapes import Choice
    from pnabs.stages.progress import Reporter

    if max_failed is not None:
        overrides = (*overrides, f"runtime.max_failed={max_failed}")
    with _errors():
        request = Request(
            shapes=shapes if "://" in shapes else Path(shapes),
            results=named(results, names),
            out=out,
            choice=Choice(layout, split, only, categories),
            frame=frame,
            max_parts=max_parts,
            seed=seed,
            overrides=overrides,
            jobs=jobs or len(os.sched_getaffinity(0)),
            address=address,
            retry=retry,
            command=shlex.join(["pnabs", *sys.argv[1:]]),
        )
        # Ray writes to stdout when workers die; stdout is for results alone.
        with contextlib.redirect_stdout(sys.stderr):
            evaluation = measure(request, Reporter())
    click.echo(evaluation.text, nl=False)
    click.echo(f"\nmodels: {out / 'models.csv'}")
    for line in evaluation.notices:
        click.echo(line, err=True)
    sys.exit(evaluation.exit_code)


@main.command()
@click.argument("directory", type=click.Path(file_okay=False, path_type=Path))
@click.option("--seed", default=0, show_default=True, help="Same seed, same bytes.")
@click.option(
    "--per-category", type=click.IntRange(1), default=30, show_default=True, help="Models each."
)
@click.option("--category", "categories", multiple=True, help="Only this category.")
def samples(directory: Path, seed: int, per_category: int, categories: tuple[str, ...]) -> None:
    """Write the embedded sample collection to DIRECTORY, in ShapeNetCore.v2's layout."""
    from pnabs.dataset.samples import write_collection

    try:
        paths = write_collection(
            directory, seed=seed, per_category=per_category, categories=categories or None
        )
    except ValueError as error:
        raise click.BadParameter(str(error), param_hint="--category") from None
    click.echo(f"{len(paths)} models in {directory}", err=True)


def _finish(result: Result) -> NoReturn:
    click.echo(result.tables, nl=False)
    if result.page is not None:
        click.echo(f"\nreport: {result.page}")
    for problem in result.problems:
        click.echo(problem, err=True)
    sys.exit(result.exit_code)


def _check_keep(accept_changes: bool, keep_weights: bool) -> None:
    if keep_weights and not accept_changes:
        raise click.UsageError("--keep-weights goes with --accept-changes")


def _overrides(
    overrides: tuple[str, ...],
    limit: int | None,
    boxes: int | None,
    levels: tuple[int, ...] | None,
) -> tuple[str, ...]:
    """The settings that options stand for, after those that are given by name."""
    options = {"dataset.limit": limit, "abstract.boxes": boxes}
    given = [f"{key}={value}" for key, value in options.items() if value is not None]
    given += [f"abstract.levels={list(levels)}"] if levels is not None else []
    return (*overrides, *given)


def _stages(text: str | None) -> tuple[str, ...]:
    if text is None:
        return ()
    names = tuple(part.strip() for part in text.split(","))
    for name in names:
        if name not in STAGES:
            import difflib

            near = difflib.get_close_matches(name, STAGES, n=1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(STAGES)}"
            raise click.BadParameter(f"no stage {name!r}; {hint}", param_hint="--stages")
    return names


@contextlib.contextmanager
def _errors() -> Iterator[None]:
    """The known errors as messages with their exit codes; any other is a bug, exit code 1."""
    from pnabs.dataset.errors import DatasetError
    from pnabs.stages.errors import RunError, is_storage, storage_message
    from pnabs.stages.job import JobError
    from pnabs.store.errors import DamagedDataError
    from pnabs.store.ledger import LedgerError
    from pnabs.store.run import RunFolderError

    try:
        yield
    except (JobError, DatasetError) as error:
        _fail(str(error), 2)
    except RunError as error:
        _fail(str(error), error.exit_code)
    except (RunFolderError, LedgerError) as error:
        _fail(str(error), 4)
    except DamagedDataError as error:
        _fail(str(error), 5)
    except OSError as error:
        if not is_storage(error):
            raise
        _fail(storage_message(error), 3)


def _fail(message: str, code: int) -> NoReturn:
    click.echo(message, err=True)
    sys.exit(code)


if __name__ == "__main__":
    main()
