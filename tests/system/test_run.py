"""Whole runs on local Ray: from nothing to the report, stopped, and run again."""

from __future__ import annotations

import json
import os
import re
import shutil
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import trimesh
import zarr
from click.testing import CliRunner
from click.testing import Result as CliResult

from pnabs.cli import main
from pnabs.formats import from_json
from pnabs.stages.errors import InterruptedRunError, RefusedError, UsageError
from pnabs.stages.interrupts import Interrupts
from pnabs.stages.plan import VERSIONS
from pnabs.stages.progress import Reporter
from pnabs.stages.run import Result
from pnabs.stages.status import status, stored_context
from pnabs.store.events import read_events
from pnabs.store.ledger import Ledger
from pnabs.store.run import RunFolder
from tests.system.conftest import Launcher, tree

MODELS = 17


def test_the_run_folder_is_as_designed(finished: tuple[Path, Result]) -> None:
    run, result = finished
    assert result.exit_code == 0
    assert "IoU at 64" in result.tables
    assert "its positives, not cropped" in result.tables
    identity = json.loads((run / "run.json").read_text())
    assert identity["settings"]["training"]["epochs"] == 4
    assert identity["versions"]["torch"]
    catalogue = pq.read_table(run / "catalogue.parquet")
    assert len(catalogue) == MODELS
    group = zarr.open_group(run / "fields.zarr" / "03001627", mode="r")
    assert group["occupancy"].shape == (12, 32, 32, 32)
    assert group["surface"].shape == (12, 2000, 6)
    phases = ("positive-initial", "positive-refinement", "negative-initial", "negative-refinement")
    for phase in phases:
        (folder,) = (run / "variants/main/checkpoints" / phase).iterdir()
        names = {path.name for path in folder.iterdir()}
        assert names == {"weights.safetensors", "curves.json", "record.json"}
        curves = json.loads((folder / "curves.json").read_text())
        assert [point["epoch"] for point in curves] == [0, 1, 2, 3]
        assert all(np.isfinite(point["total"]) for point in curves)
        assert all(0 <= point["iou_32"] <= 1 for point in curves)
    page = (run / "report/index.html").read_text()
    assert "IoU of validation models" in page
    assert page.startswith("<!doctype html>") or page.startswith("<!DOCTYPE html>")
    assert json.loads((run / "report/tables.json").read_text())


def test_a_model_without_a_mesh_is_quarantined_with_its_reason(
    finished: tuple[Path, Result],
) -> None:
    run, _ = finished
    (line,) = (run / "quarantine/ingest.jsonl").read_text().splitlines()
    entry = json.loads(line)
    assert entry["model_id"] == "f" * 32
    assert entry["category"] == "03001627"
    assert entry["kind"] == "invalid"
    assert "model_normalized.obj" in entry["reason"]
    rows = pq.read_table(run / "variants/main/metrics").to_pylist()
    assert len(rows) == MODELS
    (fallen,) = [row for row in rows if row["status"] != "ok"]
    assert fallen["model_id"] == "f" * 32
    assert fallen["iou_64"] is None


def test_written_abstractions_read_back(finished: tuple[Path, Result]) -> None:
    run, _ = finished
    folders = sorted((run / "variants/main/abstractions").glob("*/*"))
    assert len(folders) == MODELS - 1
    for folder in folders[::5]:
        abstraction = from_json((folder / "abstraction.json").read_bytes())
        assert abstraction.model_id == folder.name
        assert abstraction.check["ok"]
        scene = trimesh.load(folder / "abstraction.glb")
        written = trimesh.util.concatenate(list(scene.dump()))
        written.merge_vertices(merge_tex=True, merge_norm=True)
        assert written.is_watertight
        again = abstraction.mesh()
        mesh = trimesh.Trimesh(again.vertices, again.faces, process=False)
        assert mesh.volume == pytest.approx(written.volume, rel=1e-5)


def test_run_again_does_nothing(finished: tuple[Path, Result], launch: Launcher) -> None:
    run, first = finished
    before = tree(run)
    shards = sum(event["event"] == "shard" for event in read_events(run))
    again = launch(run)
    assert again.tables == first.tables
    assert tree(run) == before
    assert sum(event["event"] == "shard" for event in read_events(run)) == shards


def test_status_counts_what_is_done(finished: tuple[Path, Result]) -> None:
    stages = {
        item.stage: item for item in status(stored_context(RunFolder(finished[0]), Reporter()))
    }
    assert stages["ingest"].done == stages["ingest"].total == 5
    assert stages["ingest"].models == MODELS
    assert stages["ingest"].quarantined == {"invalid": 1}
    assert stages["train positive-initial"].done == 4
    assert stages["abstract"].done == 5


class StopAfter(Interrupts):
    """An interrupt that comes when the run has asked so many times."""

    left = 0

    def __call__(self) -> int | None:
        """SIGINT, once the count is used up."""
        StopAfter.left -= 1
        return 2 if StopAfter.left < 0 else None


@pytest.mark.slow
def test_interrupted_and_run_again_equals_never_interrupted(
    finished: tuple[Path, Result],
    launch: Launcher,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    expected, _ = finished
    run = tmp_path / "stopped"
    monkeypatch.setattr("pnabs.stages.run.Interrupts", StopAfter)
    stops = []
    # Early in ingest, then a little further each time: within shards, phases and stages.
    for patience in (2, 40):
        StopAfter.left = patience
        with pytest.raises(InterruptedRunError, match="To go on: pnabs run job.yaml") as stopped:
            launch(run)
        assert stopped.value.exit_code == 130
        stops.append(str(stopped.value))
    StopAfter.left = 10**9
    launch(run)
    assert any("ingest" in stop for stop in stops), stops
    assert any("phase" in stop for stop in stops), stops
    ours, theirs = tree(run), tree(expected)
    assert ours.keys() == theirs.keys()
    assert [name for name in theirs if ours[name] != theirs[name]] == []


def test_a_lost_record_is_one_shard_again(
    finished: tuple[Path, Result], launch: Launcher, tmp_path: Path
) -> None:
    run = tmp_path / "copy"
    shutil.copytree(finished[0], run)
    Ledger(run).withdraw("abstract", "02828884-00001")
    before = tree(finished[0])
    launch(run)
    assert tree(run) == before
    events = [event for event in read_events(run) if event["event"] == "shard"]
    assert [event["shard"] for event in events if event["stage"] == "abstract"][-1] == (
        "02828884-00001"
    )


def test_verify_names_damage_and_the_next_run_mends_it(
    finished: tuple[Path, Result], launch: Launcher, tmp_path: Path
) -> None:
    run = tmp_path / "copy"
    shutil.copytree(finished[0], run)
    assert invoke(run).exit_code == 0
    glb = next(run.glob("variants/main/abstractions/*/*/abstraction.glb"))
    chunk = run / "fields.zarr/02828884/sdf/c/0/0/0/0"
    flipped = bytearray(glb.read_bytes())
    flipped[-3] ^= 1
    glb.write_bytes(flipped)
    chunk.unlink()
    (run / "fields.zarr/02828884/mirror/zarr.json").unlink()
    result = invoke(run)
    assert result.exit_code == 5
    assert len(result.stdout.splitlines()) == 3
    assert glb.relative_to(run).as_posix() in result.stdout
    assert chunk.relative_to(run).as_posix() in result.stdout
    launch(run)
    assert tree(run) == tree(finished[0])


def invoke(run: Path) -> CliResult:
    return CliRunner().invoke(main, ["verify", str(run)])


def test_changed_settings_are_refused_then_redone(
    finished: tuple[Path, Result], launch: Launcher, tmp_path: Path
) -> None:
    run = tmp_path / "copy"
    shutil.copytree(finished[0], run)
    with pytest.raises(RefusedError, match="abstract.debris") as refused:
        launch(run, "abstract.debris=0.2")
    assert refused.value.exit_code == 4
    launch(run, "abstract.debris=0.2", accept=True)
    ours, theirs = tree(run), tree(finished[0])
    changed = {name for name in theirs if ours[name] != theirs[name]}
    assert any(name.startswith("ledger/abstract/") for name in changed)
    assert not [
        name for name in changed if name.startswith(("fields", "ledger/ingest", "variants/main/ch"))
    ]


@pytest.mark.parametrize(
    ("stage", "dependent"),
    [
        ("abstract", {"abstract"}),
        pytest.param(
            "difference", {"difference", "train-negative", "abstract"}, marks=pytest.mark.slow
        ),
    ],
)
def test_a_newer_version_of_a_stage_is_refused_then_redone(
    stage: str,
    dependent: set[str],
    finished: tuple[Path, Result],
    launch: Launcher,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    run = tmp_path / "copy"
    shutil.copytree(finished[0], run)
    monkeypatch.setitem(VERSIONS, stage, VERSIONS[stage] + 1)
    begun = time.time()
    with pytest.raises(RefusedError) as refused:
        launch(run)
    now = VERSIONS[stage]
    assert refused.value.exit_code == 4
    assert f"  stage {stage}: version {now - 1} -> {now}\n" in str(refused.value)
    assert tree(run) == tree(finished[0])
    launch(run, accept=True)
    done = [event for event in read_events(run) if event["time"] >= begun]
    shards = [event["stage"] for event in done if event["event"] == "shard"]
    phases = [event["phase"] for event in done if event["event"] == "phase-start"]
    assert set(shards) == dependent - {"train-negative"}
    # Each of their shards once.
    assert all(shards.count(name) == len(Ledger(run).shards(name)) for name in shards)
    assert {f"train-{phase.partition('-')[0]}" for phase in phases} == (
        dependent & {"train-negative"}
    )
    # The version is all that differs, so the same results came out of it.
    ours, theirs = tree(run), tree(finished[0])
    results = [name for name in theirs if name.endswith((".glb", ".parquet"))]
    assert results
    assert [name for name in results if ours[name] != theirs[name]] == []
    # And from now on there is nothing to accept.
    count = [event["event"] for event in read_events(run)].count("shard")
    launch(run)
    assert [event["event"] for event in read_events(run)].count("shard") == count


def test_other_formats_are_written_instead(
    finished: tuple[Path, Result], launch: Launcher, tmp_path: Path
) -> None:
    run = tmp_path / "copy"
    shutil.copytree(finished[0], run)
    launch(run, "abstract.formats=[parts, urdf, mjcf]", accept=True)
    model = next(run.glob("variants/main/abstractions/02828884/*"))
    names = {path.name for path in model.iterdir()} - {"abstraction.convex"}
    assert names == {"abstraction.parts.glb", "abstraction.urdf", "abstraction.xml"}
    ours, theirs = tree(run), tree(finished[0])
    metrics = [name for name in theirs if "/metrics/" in name]
    assert [ours[name] for name in metrics] == [theirs[name] for name in metrics]
    convex = next(run.glob("variants/main/abstractions/*/*/abstraction.convex/*.obj"), None)
    (convex or model / "abstraction.urdf").unlink()
    assert invoke(run).exit_code == 5
    launch(run, "abstract.formats=[parts, urdf, mjcf]")
    assert tree(run) == ours
    # Back to the first formats: no file of the others is left.
    launch(run, accept=True)
    back = tree(run)
    assert {name for name in back if "/abstractions/" in name} == {
        name for name in theirs if "/abstractions/" in name
    }


def test_added_models_are_refused_then_get_shards_of_their_own(
    finished: tuple[Path, Result], launch: Launcher, samples: Path, tmp_path: Path
) -> None:
    run, data = tmp_path / "copy", tmp_path / "data"
    shutil.copytree(finished[0], run)
    shutil.copytree(samples, data)
    source = next((data / "02828884").iterdir())
    shutil.copytree(source, data / "02828884" / ("0" * 32))
    more = Launcher(data)
    with pytest.raises(RefusedError, match="added: 1 models"):
        more(run)
    more(run, accept=True, stages=("scan",))
    assert invoke(run).exit_code == 0
    more(run, stages=("scan", "ingest"))
    ours, theirs = tree(run), tree(finished[0])
    assert "ledger/ingest/02828884-00002.json" in ours
    for name in theirs:
        if name.startswith("ledger/ingest/"):
            assert ours[name] == theirs[name]


@pytest.mark.slow
def test_added_models_without_training_again(
    finished: tuple[Path, Result], launch: Launcher, samples: Path, tmp_path: Path
) -> None:
    run, data = tmp_path / "copy", tmp_path / "data"
    shutil.copytree(finished[0], run)
    shutil.copytree(samples, data)
    source = next((data / "02828884").iterdir())
    shutil.copytree(source, data / "02828884" / ("0" * 32))
    more = Launcher(data)
    before = [event["event"] for event in read_events(run)].count("phase-start")
    more(run, accept=True, keep_weights=True)
    # Kept for good, not only this once.
    more(run)
    events = list(read_events(run))
    assert [event["event"] for event in events].count("phase-start") == before
    ours, theirs = tree(run), tree(finished[0])
    assert f"variants/main/abstractions/02828884/{'0' * 32}/abstraction.glb" in ours
    for name in theirs:
        if "checkpoints" in name or "abstractions" in name or name.startswith("ledger/abstract"):
            assert ours[name] == theirs[name], name
    with pytest.raises(UsageError, match="has no finished weights of these settings"):
        more(run, "training.epochs=5", accept=True, keep_weights=True)


def test_edited_models_are_noticed_by_their_content(
    finished: tuple[Path, Result], launch: Launcher, samples: Path, tmp_path: Path
) -> None:
    run, data = tmp_path / "copy", tmp_path / "data"
    shutil.copytree(finished[0], run)
    shutil.copytree(samples, data)
    other = Launcher(data)
    folder = sorted((data / "02828884").iterdir())[0]
    mesh = folder / "models" / "model_normalized.obj"
    os.utime(mesh, (1, 1))
    other(run, stages=("scan",))  # another time, the same bytes
    text = mesh.read_text()
    moved = re.sub(
        r"^(v -?\d+\.\d)(\d)", lambda m: f"{m[1]}{9 - int(m[2])}", text, count=1, flags=re.M
    )
    assert len(moved) == len(text)
    assert moved != text
    mesh.write_text(moved)
    with pytest.raises(RefusedError, match=f"content changed: 1 models .02828884/{folder.name}"):
        other(run)
    other(run, accept=True, stages=("scan", "ingest"))
    ours, theirs = tree(run), tree(finished[0])
    changed = {name for name in theirs if ours[name] != theirs[name]}
    assert {"catalogue.parquet", "ledger/ingest/02828884-00000.json"} <= changed
    others = {name for name in changed if not name.startswith("fields.zarr/02828884/")}
    assert others == {
        "boundaries/02828884-00000.parquet",
        "catalogue.parquet",
        "ledger/ingest/02828884-00000.json",
    }


def test_one_category_leaves_the_others_and_the_training_alone(
    finished: tuple[Path, Result], launch: Launcher, tmp_path: Path
) -> None:
    run = tmp_path / "copy"
    shutil.copytree(finished[0], run)
    Ledger(run).withdraw("abstract", "02828884-00001")
    Ledger(run).withdraw("abstract", "03001627-00001")
    launch(run, categories=("chair",))
    missing = set(tree(finished[0])) - set(tree(run))
    assert missing == {"ledger/abstract/02828884-00001.json"}
    fresh = tmp_path / "fresh"
    with pytest.raises(UsageError, match="have not been through ingest"):
        launch(fresh, categories=("chair",))


def test_what_the_cluster_lacks_is_said_at_once(launch: Launcher, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no machine of this Ray has so many CPUs"):
        launch(tmp_path / "run", "runtime.threads=1000")
