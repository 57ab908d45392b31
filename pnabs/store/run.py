"""The run folder's paths, its identity (run.json) and the arrays it holds."""

from __future__ import annotations

import importlib.metadata
import json
import platform
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pnabs import settings
from pnabs.store.arrays import ArraySpec, CategoryArrays
from pnabs.store.atomic import digest, file_digest, sweep, write_atomic
from pnabs.store.ledger import Ledger
from pnabs.store.sealed import SealError, seal, unseal

VERSION = 2
LIBRARIES = (
    *("pnabs", "torch", "ray", "trimesh", "manifold3d", "pymeshlab", "zarr"),
    *("numpy", "scipy", "numba", "libigl", "pyarrow"),
)


class RunFolderError(Exception):
    """The folder isn't a run of this version, or is damaged; names the file and what to do."""


@dataclass(frozen=True, slots=True)
class Variant:
    """Paths of one variant: everything from training on."""

    run: Path
    name: str

    @property
    def root(self) -> Path:
        """RUN/variants/<name>."""
        return self.run / "variants" / self.name

    @property
    def differences(self) -> Path:
        """The store of difference volumes."""
        return self.root / "differences.zarr"

    def checkpoints(self, phase: str) -> Path:
        """Checkpoints of one phase, such as `positive-initial`."""
        return self.root / "checkpoints" / phase

    def abstraction(self, category: str, model_id: str) -> Path:
        """Folder of one model's abstraction."""
        return self.root / "abstractions" / category / model_id

    def metrics(self, shard: str) -> Path:
        """Metrics of one shard, a parquet file."""
        return self.root / "metrics" / f"{shard}.parquet"

    def stage(self, stage: str) -> str:
        """Name of a stage's records: the stage, `stage@variant` outside `main`."""
        return stage if self.name == "main" else f"{stage}@{self.name}"


class RunFolder:
    """One run: RUN/run.json, catalogue.parquet, fields.zarr, variants, ledger, report."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.ledger = Ledger(root)

    @property
    def catalogue(self) -> Path:
        """RUN/catalogue.parquet."""
        return self.root / "catalogue.parquet"

    @property
    def catalogue_index(self) -> Path:
        """RUN/index/catalogue: the catalogue by shard, derived from it."""
        return self.root / "index" / "catalogue"

    @property
    def report(self) -> Path:
        """RUN/report."""
        return self.root / "report"

    def variant(self, name: str) -> Variant:
        """The paths of a variant."""
        return Variant(self.root, name)

    def fields(self, job: settings.Settings) -> CategoryArrays:
        """The store of every model's fields."""
        ingest = job.ingest
        specs = (
            ArraySpec("valid", (), "u1"),
            ArraySpec("occupancy", (32, 32, 32), "u1"),
            ArraySpec("occupancy_64", (64**3 // 8,), "u1"),
            ArraySpec("occupancy_128", (128**3 // 8,), "u1"),
            ArraySpec("occupancy_192", (192**3 // 8,), "u1"),
            ArraySpec("sdf", (32, 32, 32), "f4"),
            ArraySpec("surface", (ingest.surface_points, 6), "f4"),
            ArraySpec("interior", (ingest.interior_points, 3), "f4"),
            ArraySpec("transform", (4, 4), "f8"),
            ArraySpec("mirror", (), "i1"),
            ArraySpec("preview", (ingest.preview_faces, 3, 3), "f2"),
            ArraySpec("extent", (3,), "f8"),
        )
        store = self.root / "fields.zarr"
        return CategoryArrays(store, self.root, specs, job.dataset.shard_size)

    def boundaries(self, shard: str) -> Path:
        """The boundaries of one shard's shapes, a parquet file."""
        return self.root / "boundaries" / f"{shard}.parquet"

    def differences(self, variant: Variant, job: settings.Settings) -> CategoryArrays:
        """The store of a variant's difference volumes; `valid` is 0 where V_delta is empty."""
        samples = job.ingest.interior_points
        specs = (
            ArraySpec("valid", (), "u1"),
            ArraySpec("occupancy", (32, 32, 32), "u1"),
            ArraySpec("occupancy_192", (192**3 // 8,), "u1"),
            ArraySpec("sdf", (32, 32, 32), "f4"),
            ArraySpec("surface", (samples, 3), "f4"),
            ArraySpec("interior", (samples, 3), "f4"),
        )
        return CategoryArrays(variant.differences, self.root, specs, job.dataset.shard_size)

    def read_identity(self, *, anew: bool = False) -> dict[str, Any] | None:
        """run.json, or None for a new folder.

        Parameters
        ----------
        anew
            Take a damaged or lost run.json for one that is to be written anew.

        Raises
        ------
        RunFolderError
            When the folder holds something else, or a run of another version, or run.json is
            damaged or lost.
        """
        path = self.root / "run.json"
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            if self.ledger.stages():
                if anew:
                    return None
                raise RunFolderError(f"{path} is missing. {_ADVICE}") from None
            names = {p.name for p in self.root.iterdir()} if self.root.is_dir() else set()
            if any(name not in _EARLY and not name.endswith(".partial") for name in names):
                raise RunFolderError(
                    f"{self.root} is neither empty nor a run folder (no run.json); "
                    "give another folder with --out"
                ) from None
            return None
        try:
            value = unseal(data)
            _check_version(path, value)
            return value
        except SealError as error:
            _check_unsealed(path, data)
            if anew:
                return None
            raise RunFolderError(f"{path} is damaged: {error}. {_ADVICE}") from None

    def write_identity(
        self,
        job: settings.Settings,
        *,
        variants: Sequence[str],
        origins: dict[str, str],
        stage_versions: dict[str, int],
        dataset_fingerprint: str,
        catalogue: bytes,
        weights: dict[str, str],
        kept_weights: dict[str, str],
        command: str,
    ) -> None:
        """Write run.json: settings and where each came from, versions, dataset, command.

        The catalogue is to be written after it: until then the one that is there counts too.
        """
        there = self.catalogue
        value = {
            "format": "pnabs/run",
            "version": VERSION,
            "settings": job.model_dump(mode="json"),
            "variants": list(variants),  # JSON's keys are sorted, and their order counts
            "origins": origins,
            "seed": job.seed,
            "versions": versions(),
            "stage_versions": stage_versions,
            "command": command,
            "git_commit": _git_commit(),
            "dataset_fingerprint": dataset_fingerprint,
            "catalogue": {"bytes": len(catalogue), "sha256": digest(catalogue)},
            "catalogue_before": file_digest(there) if there.exists() else None,
            "weights": weights,
            "kept_weights": kept_weights,
        }
        write_atomic(self.root / "run.json", seal(value))

    def check_catalogue(self, identity: dict[str, Any]) -> str:
        """Compare the catalogue's bytes with what run.json says; returns their SHA-256.

        Raises
        ------
        RunFolderError
            When they differ; says what can be done.
        """
        expected = [identity["catalogue"], identity["catalogue_before"]]
        damage = "missing"
        if self.catalogue.exists():
            found = file_digest(self.catalogue)
            if found in expected:
                return str(found["sha256"])
            damage = "damaged: its checksum isn't the one in run.json"
        raise RunFolderError(
            f"{self.catalogue} is {damage}. Put back a copy, or run the job with "
            "--accept-changes: the dataset is then listed anew, and if it still gives the same "
            "catalogue the run goes on. Else begin a new run folder: the catalogue says which "
            "model lies where."
        )

    def sweep(self) -> None:
        """Remove what killed drivers left half-written; workers do it where they write."""
        places = ("", "ledger/*", "index", "quarantine", "report", "boundaries")
        for place in (*places, "variants/*/metrics", "variants/*/checkpoints/*/*"):
            for folder in self.root.glob(place) if place else [self.root]:
                if folder.is_dir():
                    sweep(folder)
        shutil.rmtree(self.scratch, ignore_errors=True)

    @property
    def scratch(self) -> Path:
        """Where Ray Train keeps files that nothing depends on; emptied when a run begins."""
        return self.root / ".scratch"


_EARLY = ("lock", "catalogue.parquet", "events", "index", ".scratch")
"""What lies in a folder whose first run came to nothing."""

_ADVICE = (
    "Put back a copy, or run the job with --accept-changes: run.json is then written anew from "
    "the job file, and what doesn't belong to its settings is redone."
)


def _check_version(path: Path, value: dict[str, Any]) -> None:
    if value.get("version") != VERSION:
        raise RunFolderError(
            f"{path} has version {value.get('version')}, this pnabs reads {VERSION}: go on with "
            "the pnabs that made the run, or give another folder with --out"
        )


def _check_unsealed(path: Path, data: bytes) -> None:
    """Tell a sound file of a version that had no checksum, and one of something else."""
    try:
        value = json.loads(data)
    except ValueError:
        return
    if not isinstance(value, dict) or value.get("format") != "pnabs/run":
        raise RunFolderError(f"{path} is not a pnabs run; give another folder with --out")
    if "sha256" not in value:
        _check_version(path, value)


def versions() -> dict[str, str]:
    """Versions of pnabs, Python and the libraries that results depend on."""
    out = {"python": platform.python_version(), "machine": platform.machine()}
    for name in LIBRARIES:
        try:
            out[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            out[name] = "not installed as a package"
    return out


def _git_commit() -> str | None:
    # A checkout has a commit worth telling; an installed package has its version.
    source = Path(__file__).resolve().parents[2]
    if not (source / ".git").exists():
        return None
    try:
        done = subprocess.run(
            ["git", "-C", str(source), "rev-parse", "HEAD"],
            capture_output=True,
            text=True,
            check=True,
            timeout=10,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()
