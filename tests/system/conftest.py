"""A small job on the embedded samples, and one run of it that nothing disturbed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from pnabs.dataset.samples import write_collection
from pnabs.stages.job import Job, load_job
from pnabs.stages.options import Options
from pnabs.stages.progress import Reporter
from pnabs.stages.run import Result, run_job

JOB = """
dataset: {{root: {root}, layout: shapenet-v2, shard_size: 4, val_share: 0.2}}
out: {out}
ingest: {{surface_points: 2000, interior_points: 500}}
network: {{positives: 6, negatives: 4, channels: [4, 4, 8, 8, 16], hidden: 32}}
training:
  epochs: 4
  batch_size: 8
  shape_samples: 200
  cuboid_samples: 16
  occupancy_samples: 200
  workers: 2
abstract: {{metric_samples: 1000}}
runtime: {{checkpoint_epochs: 1, deadline: 60}}
report: {{pictures: 2, split: all}}
"""


@pytest.fixture(scope="session")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two categories of eight models, and one model without a readable mesh."""
    root = tmp_path_factory.mktemp("samples")
    write_collection(root, per_category=8, categories=["chair", "bench"])
    broken = root / "03001627" / ("f" * 32) / "models"
    broken.mkdir(parents=True)
    (broken / "model_normalized.obj").write_text("this is no mesh\n")
    return root


@dataclass(frozen=True)
class Launcher:
    """Runs the small job into a folder."""

    samples: Path

    def job(self, out: Path, *overrides: str) -> Job:
        """The job, read from a file as a user's is."""
        path = out.parent / f"{out.name}.yaml"
        path.write_text(JOB.format(root=self.samples, out=out))
        return load_job(path, overrides)

    def __call__(self, out: Path, *overrides: str, **options: object) -> Result:
        """Run it on the suite's Ray."""
        given = Options(max_failed=50, command="pnabs run job.yaml", **options)  # type: ignore[arg-type]
        return run_job(self.job(out, *overrides), given, Reporter(quiet=True))


@pytest.fixture(scope="session")
def launch(samples: Path) -> Launcher:
    """Starts the small job."""
    return Launcher(samples)


@pytest.fixture(scope="session")
def finished(
    launch: Launcher, ray_session: None, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, Result]:
    """A run from nothing to the report; read-only for tests."""
    out = tmp_path_factory.mktemp("runs") / "finished"
    return out, launch(out)


def tree(run: Path) -> dict[str, bytes]:
    """A run's results: every file but those that tell of a session or of file times."""
    skip = ("events/", "index/", "run.json", "lock", "report/index.html")
    files = (path for path in sorted(run.rglob("*")) if path.is_file())
    named = ((path.relative_to(run).as_posix(), path) for path in files)
    return {name: path.read_bytes() for name, path in named if not name.startswith(skip)}
