"""The shard runner at scale: memory, start, resume, overhead a model, status; and efficiency.

    python -m benchmarks.scale [--models 10000 --models 1000000] [--corpus DIR]

prints its tables as Markdown.  A stage that does nothing goes through catalogues of so
many models, in this process and through an isolated child, with records, indexes and
events as in any run.  With `--corpus`, a collection in the layout of ShapeNetCore.v2, real
ingest on one and two actors is compared with a plain loop in one and two processes.
"""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
import numpy as np
import pyarrow as pa

from benchmarks.loops import NoWork, plain_loop
from pnabs.batch import Executor, InlineExecutor, ShardDone, Watcher, WorkerLimits
from pnabs.dataset import catalogue as catalogues
from pnabs.settings import Settings
from pnabs.stages import ingest
from pnabs.stages import plans as plan_shards
from pnabs.stages.context import Context
from pnabs.stages.plan import VERSIONS
from pnabs.stages.progress import Reporter
from pnabs.stages.sharded import run_sharded
from pnabs.stages.shards import Shards
from pnabs.store.atomic import digest, write_atomic
from pnabs.store.events import EventLog
from pnabs.store.lock import run_lock
from pnabs.store.run import RunFolder

SHARD_SIZE = 64
CATEGORY_MODELS = 10_000
CHILD_MODELS = 10_000
"""At most so many models go through an isolated child: its cost doesn't grow."""


def make_catalogue(models: int) -> pa.Table:
    """A catalogue of so many models in categories of at most ten thousand."""
    rng = np.random.default_rng(0)
    tables = []
    for number, start in enumerate(range(0, models, CATEGORY_MODELS)):
        count = min(CATEGORY_MODELS, models - start)
        category = f"{number:08d}"
        ids = sorted(row.tobytes().hex() for row in rng.integers(0, 256, (count, 16), np.uint8))
        shard, row = np.divmod(np.arange(count), SHARD_SIZE)
        tables.append(
            pa.table(
                {
                    "category": pa.repeat(category, count),
                    "model_id": pa.array(ids),
                    "split": pa.array(rng.choice(["train", "test"], count, p=[2 / 3, 1 / 3])),
                    "source": [f"{category}/{name}/models/model_normalized.obj" for name in ids],
                    "shard": [f"{category}-{value:05d}" for value in shard],
                    "row": row.astype(np.int32),
                    "size": rng.integers(10_000, 10_000_000, count),
                    "mtime_ns": rng.integers(1e18, 2e18, count),
                    "reason": pa.repeat("", count),
                },
                schema=catalogues.SCHEMA,
            )
        )
    return pa.concat_tables(tables)


def make_run(out: Path, models: int) -> None:
    """A run folder with such a catalogue, as `pnabs run` would have made it."""
    out.mkdir(parents=True)
    run, job = RunFolder(out), job_at(out)
    table = make_catalogue(models)
    content = catalogues.to_bytes(table)
    run.write_identity(
        job, origins={}, stage_versions=VERSIONS, command="benchmarks.scale", catalogue=content,
        dataset_fingerprint=catalogues.fingerprint(table), weights={}, kept_weights={},
    )  # fmt: skip
    write_atomic(run.catalogue, content)
    mark = digest(content)
    Shards.of_file(run.catalogue, run.catalogue_index, mark).save_index(run.catalogue_index, mark)


def job_at(out: Path) -> Settings:
    return Settings.model_validate({"dataset": {"root": "nowhere"}, "out": str(out)})


def memory() -> int:
    """Resident bytes of this process."""
    with open("/proc/self/statm") as stream:
        return int(stream.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


class Sampler(Reporter):
    """Takes the memory at each tenth of a stage instead of telling of progress."""

    def __init__(self) -> None:
        super().__init__(quiet=True)
        self.samples: list[int] = []
        self.first: float | None = None

    @contextmanager
    def track(self, stage: str, total: int, unit: str) -> Iterator[Any]:
        """Follow the stage."""
        self._total = total
        yield self

    def update(self, done: int, note: str = "") -> None:
        """Sample when a tenth is full."""
        if done and self.first is None:
            self.first = time.perf_counter()
        if done >= len(self.samples) * self._total / 10:
            self.samples.append(memory())


def no_op(out: Path, isolated: bool) -> dict[str, Any]:
    """One session over the run: open it, do what is missing, end."""
    begun, cpu = time.perf_counter(), time.process_time()
    run, job = RunFolder(out), job_at(out)
    identity = run.read_identity()
    assert identity
    mark = run.check_catalogue(identity)
    sampler = Sampler()
    limits = WorkerLimits(120, 2**32, isolated)
    with run_lock(out) as token:
        shards = Shards.of_file(run.catalogue, run.catalogue_index, mark)
        events = EventLog(out, "driver")
        context = Context(
            job=job, variants={"main": job}, run=run, shards=shards, selected=None,
            executor=lambda: InlineExecutor(limits), reporter=sampler, events=events,
            max_failed=5.0, interrupted=lambda: None, token=token,
        )  # fmt: skip
        plans = plan_shards.ingest(context)
        started = time.perf_counter()
        run_sharded(context, "ingest", NoWork(out, token), plans, lambda _: None)
        events.close()
    ended = time.perf_counter()
    return {
        "models": sum(plan.models for plan in plans),
        "start": started - begun,
        "seconds": ended - started,
        "cpu": time.process_time() - cpu,
        "samples": sampler.samples,
        "peak": memory(),
    }


class FirstToLast(Watcher):
    """Wall time from the first shard given out to the last that came back."""

    def __init__(self) -> None:
        self.begun: float | None = None

    def started(self, shard: str, where: str) -> None:
        """Begin with the first."""
        if self.begun is None:
            self.begun = time.perf_counter()


def real_run(out: Path, corpus: Path, models: int) -> tuple[Settings, list[str]]:
    """A run folder over the corpus' readable models, and its shards."""
    job = Settings.model_validate(
        {"dataset": {"root": str(corpus), "shard_size": 16}, "out": str(out)}
    )
    table = catalogues.scan(job.dataset, Path.cwd())
    rng = np.random.default_rng(0)
    # Whole shards, drawn at large, so that every part of the comparison has all kinds.
    names = sorted(set(table["shard"].to_pylist()))
    rng.shuffle(names)
    chosen = names[: max(2, models // 16) // 2 * 2]
    out.mkdir(parents=True)
    write_atomic(RunFolder(out).catalogue, catalogues.to_bytes(table))
    store = RunFolder(out).fields(job)
    for category in sorted({name.rpartition("-")[0] for name in chosen}):
        highest = max(int(n.rpartition("-")[2]) for n in names if n.rpartition("-")[0] == category)
        store.ensure(category, highest + 1)
    return job, chosen


def plain() -> None:
    """One plain process: warm up, say so, wait for the word, loop, say how long."""
    from pnabs.geometry.fields import warm_up

    job, shards = json.loads(os.environ["BENCH_JOB"]), json.loads(os.environ["BENCH_SHARDS"])
    warm_up()
    settings = Settings.model_validate(job)
    click.echo("ready")
    sys.stdin.readline()
    begun = time.perf_counter()
    plain_loop(settings, shards)
    click.echo(json.dumps({"seconds": time.perf_counter() - begun}))


def plain_processes(job: Settings, parts: Sequence[Sequence[str]]) -> float:
    """Wall seconds of plain loops side by side, from a common start to the last's end."""
    processes = []
    for shards in parts:
        environ = {
            **os.environ,
            "BENCH_JOB": json.dumps(job.model_dump(mode="json")),
            "BENCH_SHARDS": json.dumps(list(shards)),
            **dict.fromkeys(("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"),
        }
        processes.append(
            subprocess.Popen(
                [sys.executable, "-m", "benchmarks.scale", "--part", "plain"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                env=environ,
            )
        )
    for process in processes:
        assert process.stdout
        process.stdout.readline()
    begun = time.perf_counter()
    for process in processes:
        assert process.stdin
        process.stdin.write("go\n")
        process.stdin.flush()
    for process in processes:
        assert process.stdout
        process.stdout.readline()
    seconds = time.perf_counter() - begun
    for process in processes:
        process.wait()
    return seconds


def on_actors(job: Settings, shards: Sequence[str], actors: int) -> tuple[float, float]:
    """Wall seconds on so many actors: from the first shard given out, and in all."""
    from pnabs.batch.ray_executor import RayExecutor

    with run_lock(job.out) as token:
        executor: Executor = RayExecutor(WorkerLimits(120, 2**32), actors, 1)
        watcher = FirstToLast()
        begun = time.perf_counter()
        for result in executor.map(ingest.IngestWork(job, token), shards, watcher):
            assert isinstance(result, ShardDone), result
        ended = time.perf_counter()
    assert watcher.begun is not None
    return ended - watcher.begun, ended - begun


def efficiency(corpus: Path, models: int, rounds: int, folder: Path) -> None:
    """Actors against plain processes on the same shards, turn about."""
    from pnabs.stages.cluster import ray_session

    job, shards = real_run(folder / "real", corpus, models)
    halves = [shards[::2], shards[1::2]]
    times: dict[str, list[float]] = {name: [] for name in ("plain 1", "plain 2", "1", "2")}
    starts: dict[str, list[float]] = {"1": [], "2": []}
    with ray_session(None, job.out):
        for _ in range(rounds):
            times["plain 2"].append(plain_processes(job, halves))
            for actors in (2, 1):
                working, in_all = on_actors(job, shards, actors)
                times[str(actors)].append(working)
                starts[str(actors)].append(in_all - working)
            times["plain 1"].append(plain_processes(job, [shards]))
    best = {name: float(np.median(values)) for name, values in times.items()}
    click.echo(f"\n### Efficiency: real ingest of {len(shards)} shards of up to 16 models\n")
    click.echo(
        "| | seconds, each round | median | throughput against plain |\n| --- | --- | --- | --- |"
    )
    for actors in ("1", "2"):
        for name, text in ((f"plain {actors}", "plain loops"), (actors, "actors")):
            each = ", ".join(f"{value:.1f}" for value in times[name])
            ratio = best[f"plain {actors}"] / best[name]
            click.echo(f"| {actors} {text} | {each} | {best[name]:.1f} | {ratio:.3f} |")
    for actors, values in starts.items():
        click.echo(f"\nUntil {actors} actors are up: {np.median(values):.1f} s")


def ask(*arguments: str) -> Any:
    """A part in a process of its own, so that its memory is its own."""
    command = [sys.executable, "-m", "benchmarks.scale", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return json.loads(done.stdout)


def scale(counts: Sequence[int], folder: Path) -> None:
    """The stage that does nothing, over catalogues of so many models."""
    megabytes = 2**20
    rows: list[list[str]] = []
    for count in counts:
        out = folder / f"{count}"
        make_run(out, count)
        arguments = ["--part", "no-op", "--out", str(out)]
        first = ask(*arguments)
        again = ask(*arguments)
        assert again["seconds"] < first["seconds"]
        begun = time.perf_counter()
        subprocess.run(
            [sys.executable, "-m", "pnabs.cli", "status", str(out)],
            check=True, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        status = time.perf_counter() - begun
        (out / "index" / "ingest.json").unlink()
        rebuilt = ask(*arguments)
        # Half of the work lost, as after a kill between two writings of the index.
        records = sorted((out / "ledger" / "ingest").iterdir())
        for record in records[::2]:
            record.unlink()
        half = ask(*arguments)
        samples = first["samples"]
        child_out = folder / f"{count}-child"
        make_run(child_out, min(count, CHILD_MODELS))
        child = ask("--part", "no-op", "--out", str(child_out), "--isolated")
        rows.append(
            [
                f"{count:,}",
                f"{first['start']:.2f}",
                f"{again['start'] + again['seconds']:.2f}",
                f"{rebuilt['start'] + rebuilt['seconds']:.2f}",
                f"{half['start']:.2f}",
                f"{1000 * first['seconds'] / first['models']:.3f}",
                f"{1000 * first['cpu'] / first['models']:.3f}",
                f"{1000 * child['seconds'] / child['models']:.2f}",
                f"{samples[0] / megabytes:.0f}",
                f"{max(samples) / megabytes:.0f}",
                f"{samples[-1] / megabytes:.0f}",
                f"{status:.2f}",
            ]
        )
    names = (
        "models", "start, s", "run again, s", "index rebuilt, s", "resume at half, s",
        "inline, ms a model", "of it CPU", "child, ms a model",
        "memory at start, MiB", "most", "at end", "`pnabs status`, s",
    )  # fmt: skip
    click.echo("### A stage that does nothing, shards of 64\n")
    click.echo("| | " + " | ".join(row[0] for row in rows) + " |")
    click.echo("| --- |" + " --- |" * len(rows))
    for number, name in itertools.islice(enumerate(names), 1, None):
        click.echo(f"| {name} | " + " | ".join(row[number] for row in rows) + " |")


@click.command()
@click.option("--models", "counts", multiple=True, type=int, default=(10_000, 1_000_000))
@click.option("--corpus", type=click.Path(exists=True, path_type=Path))
@click.option("--corpus-models", default=320, show_default=True)
@click.option("--rounds", default=3, show_default=True)
@click.option("--folder", type=click.Path(path_type=Path), help="Where the runs lie meanwhile.")
@click.option("--part", type=click.Choice(["no-op", "plain", "scale", "efficiency"]))
@click.option("--out", type=click.Path(path_type=Path))
@click.option("--isolated", is_flag=True)
def main(
    counts: tuple[int, ...],
    corpus: Path | None,
    corpus_models: int,
    rounds: int,
    folder: Path | None,
    part: str | None,
    out: Path | None,
    isolated: bool,
) -> None:
    """Measure, and print tables as Markdown."""
    if part == "plain":
        plain()
        return
    if part == "no-op":
        assert out
        click.echo(json.dumps(no_op(out, isolated)))
        return
    with tempfile.TemporaryDirectory(dir=folder) as name:
        if part != "efficiency":
            scale(counts, Path(name))
        if corpus is not None and part != "scale":
            efficiency(corpus, corpus_models, rounds, Path(name))


if __name__ == "__main__":
    main()
