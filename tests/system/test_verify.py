"""Every stored byte is covered: whatever is damaged is named, and just that is redone."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner
from click.testing import Result as CliResult

from pnabs.cli import main
from pnabs.stages import train_state
from pnabs.stages.errors import InterruptedRunError
from pnabs.stages.run import Result
from pnabs.store.events import read_events
from pnabs.store.run import RunFolderError
from tests.system.conftest import Launcher, tree

DAMAGES = ("flip", "truncate", "delete", "empty")


def damage(path: Path, how: str, place: float = 0.5) -> None:
    """Spoil a file; `place` says where between its beginning and end a bit is flipped."""
    data = bytearray(path.read_bytes())
    if how == "delete":
        path.unlink()
    elif how == "flip":
        data[int(place * (len(data) - 1))] ^= 1 << int(place * 7)
        path.write_bytes(data)
    else:
        path.write_bytes(b"" if how == "empty" else data[:-1])


def verify(run: Path) -> CliResult:
    return CliRunner().invoke(main, ["verify", str(run)])


def files(run: Path, *globs: str) -> list[Path]:
    return [path for glob in globs for path in sorted(run.glob(glob)) if path.is_file()]


@pytest.fixture
def copy(finished: tuple[Path, Result], tmp_path: Path) -> Path:
    """A finished run to be spoilt."""
    run = tmp_path / "copy"
    shutil.copytree(finished[0], run)
    return run


@pytest.mark.parametrize("how", DAMAGES)
@pytest.mark.parametrize(
    "globs",
    [
        ("fields.zarr/**/*", "variants/*/differences.zarr/**/*"),
        ("variants/*/abstractions/**/*", "variants/*/metrics/*"),
        ("ledger/*/*",),
        ("variants/*/checkpoints/*/*/record.json",),
        ("variants/*/checkpoints/*/*/[!r]*",),
    ],
    ids=["stores", "abstractions", "ledger", "phases", "weights"],
)
def test_verify_names_every_file_that_is_damaged(
    copy: Path, how: str, globs: tuple[str, ...]
) -> None:
    spoilt = files(copy, *globs)
    assert len(spoilt) > 3
    for number, path in enumerate(spoilt):
        damage(path, how, number / len(spoilt))
    result = verify(copy)
    assert result.exit_code == 5
    named = result.stdout.splitlines()
    for path in spoilt:
        name = path.relative_to(copy).as_posix()
        assert sum(name in line for line in named) == 1, name
    assert len(named) == len(spoilt)
    assert "the next `pnabs run` does what it touches again" in result.stderr


def events(run: Path, kind: str, key: str) -> list[str]:
    return [event[key] for event in read_events(run, "driver") if event["event"] == kind]


def test_the_next_run_redoes_just_what_was_damaged(
    finished: tuple[Path, Result], launch: Launcher, copy: Path
) -> None:
    spoilt = {
        "fields.zarr/02828884/sdf/c/0/0/0/0": "flip",
        "fields.zarr/03001627/mirror/zarr.json": "truncate",
        "variants/main/differences.zarr/03001627/sdf/c/1/0/0/0": "delete",
        "ledger/abstract/03001627-00001.json": "flip",
        "variants/main/metrics/02828884-00001.parquet": "empty",
    }
    (weights,) = files(copy, "variants/main/checkpoints/negative-refinement/*/weights.safetensors")
    spoilt[weights.relative_to(copy).as_posix()] = "flip"
    for name, how in spoilt.items():
        damage(copy / name, how)
    result = verify(copy)
    assert len(result.stdout.splitlines()) == len(spoilt)
    began, trained = len(events(copy, "shard-start", "shard")), events(copy, "phase-start", "phase")
    launch(copy)
    assert tree(copy) == tree(finished[0])
    stages = events(copy, "shard-start", "stage")[began:]
    shards = events(copy, "shard-start", "shard")[began:]
    assert sorted(zip(stages, shards, strict=True)) == [
        ("abstract", "02828884-00001"),
        ("abstract", "03001627-00001"),
        ("difference", "03001627-00001"),
        ("ingest", "02828884-00000"),
    ]
    assert events(copy, "phase-start", "phase")[len(trained) :] == ["negative-refinement"]


LONGER = "training.epochs=40"
TRAIN = ("scan", "ingest", "train-positive")


@pytest.fixture
def under_way(launch: Launcher, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A run that was stopped in its first phase, after some checkpoints."""
    from pnabs.stages.interrupts import Interrupts

    run = tmp_path / "under-way"

    class Stop(Interrupts):
        """SIGINT once the state is at the second epoch."""

        def __call__(self) -> int | None:
            states = run.glob("variants/main/checkpoints/positive-initial/*/")
            epochs = [train_state.read_state(folder) for folder in states]
            return 2 if any(state and state.epoch >= 2 for state in epochs) else None

    with monkeypatch.context() as once:
        once.setattr("pnabs.stages.run.Interrupts", Stop)
        with pytest.raises(InterruptedRunError, match="phase positive-initial"):
            launch(run, LONGER, stages=TRAIN)
    return run


@pytest.mark.slow
def test_a_damaged_checkpoint_costs_its_phase(
    launch: Launcher, under_way: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (state,) = files(under_way, "variants/main/checkpoints/positive-initial/*/state.json")
    (checkpoint,) = files(under_way, "variants/main/checkpoints/positive-initial/*/epoch-*")
    assert verify(under_way).exit_code == 0
    for number, path in enumerate((state, checkpoint)):
        for how in DAMAGES:
            run = tmp_path / f"{number}-{how}"
            shutil.copytree(under_way, run)
            spoilt = run / path.relative_to(under_way)
            damage(spoilt, how)
            result = verify(run)
            assert result.exit_code == 5
            (line,) = result.stdout.splitlines()
            assert spoilt.relative_to(run).as_posix() in line
            assert "positive-initial is to be trained again" in line
            assert not list(spoilt.parent.iterdir())
    # Without verify, too: the run notices, says so, and trains the phase again.
    damage(checkpoint, "flip")
    before = len(epochs(under_way))
    launch(under_way, LONGER, stages=TRAIN)
    assert (
        f"{checkpoint.name} is missing or damaged; the phase begins again"
        in capsys.readouterr().err
    )
    assert epochs(under_way)[before:] == list(range(40))


def epochs(run: Path) -> list[int]:
    """The first phase's epochs in the order in which they were trained."""
    (folder,) = run.glob("events/train-positive-initial-*-0")
    return [e["epoch"] for e in read_events(run, folder.name) if e["event"] == "epoch"]


@pytest.mark.parametrize("how", DAMAGES)
@pytest.mark.parametrize("name", ["run.json", "catalogue.parquet"])
def test_the_runs_identity_and_catalogue_are_refused_with_advice(
    finished: tuple[Path, Result], launch: Launcher, copy: Path, name: str, how: str
) -> None:
    damage(copy / name, how, 0.3)
    result = verify(copy)
    assert result.exit_code == 5
    (line,) = result.stdout.splitlines()
    assert str(copy / name) in line
    assert "Put back a copy" in line
    with pytest.raises(RunFolderError, match="--accept-changes") as refused:
        launch(copy)
    assert str(copy / name) in str(refused.value)
    for command in ("status", "report"):
        assert CliRunner().invoke(main, [command, str(copy)]).exit_code == 4
    # The advice works, and nothing is done again.
    began = len(events(copy, "shard-start", "shard"))
    launch(copy, accept=True)
    assert tree(copy) == tree(finished[0])
    assert len(events(copy, "shard-start", "shard")) == began
    assert verify(copy).exit_code == 0


def test_what_is_derived_is_made_again(copy: Path, finished: tuple[Path, Result]) -> None:
    """As after a kill: behind the records, which is no damage."""
    (copy / "quarantine/ingest.jsonl").write_text("")
    (copy / "index/ingest.json").unlink()
    assert verify(copy).exit_code == 0
    assert tree(copy) == tree(finished[0])


def test_a_folder_that_is_no_run(tmp_path: Path) -> None:
    assert CliRunner().invoke(main, ["verify", str(tmp_path)]).exit_code == 2
    assert CliRunner().invoke(main, ["verify", str(tmp_path / "none")]).exit_code == 2
