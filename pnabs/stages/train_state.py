"""The state of a training phase under way: one checkpoint, and a record that vouches for it.

It is pnabs's own rather than Ray Train's so that a damaged byte is noticed, and then
costs no more than its phase.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pnabs.store.atomic import file_digest, is_as_written, write_atomic
from pnabs.store.sealed import SealError, seal, unseal

if TYPE_CHECKING:
    from torch.optim import Adam

    from pnabs.model.network import CuboidNetwork

STATE = "state.json"
CHECKPOINTS = "epoch-*.safetensors"
VERSION = 1


@dataclass(frozen=True, slots=True)
class PhaseState:
    """How far a phase is: the checkpoint's file, epochs done, and their losses."""

    file: str
    epoch: int
    curves: list[dict[str, Any]]


def begin(folder: Path) -> None:
    """Write the state of a phase that has done nothing, unless it has a sound one.

    From then on a missing state is damage.
    """
    if not (folder / STATE).exists() or damaged_state(folder):
        drop(folder)
        _write(folder, 0, [], {})


def save_state(
    folder: Path,
    network: CuboidNetwork,
    optimizer: Adam,
    epoch: int,
    curves: list[dict[str, Any]],
) -> None:
    """Write a checkpoint, then the record that makes it count, then drop the one before."""
    from pnabs.model.checkpoint import save_training

    name = f"epoch-{epoch:05d}.safetensors"
    save_training(folder / name, network, optimizer, epoch)
    _write(folder, epoch, curves, {name: file_digest(folder / name)})
    for path in folder.glob(CHECKPOINTS):
        if path.name != name:
            path.unlink()


def read_state(folder: Path) -> PhaseState | None:
    """The state to go on from; None when nothing is done, or what was done is damaged."""
    if not (folder / STATE).exists() or damaged_state(folder):
        return None
    value = unseal((folder / STATE).read_bytes())
    if value["version"] != VERSION or not value["epoch"]:
        return None
    return PhaseState(next(iter(value["outputs"])), value["epoch"], value["curves"])


def damaged_state(folder: Path) -> list[str]:
    """Files of a phase under way that are missing or changed."""
    try:
        outputs = unseal((folder / STATE).read_bytes())["outputs"]
    except FileNotFoundError:
        return [STATE] if any(folder.glob(CHECKPOINTS)) else []
    except (OSError, SealError):
        return [STATE]
    return [
        name for name, expected in outputs.items() if not is_as_written(folder / name, expected)
    ]


def drop(folder: Path) -> None:
    """Remove the state: the phase begins again, or needs it no more."""
    for path in [folder / STATE, *folder.glob(CHECKPOINTS)]:
        path.unlink(missing_ok=True)


def _write(folder: Path, epoch: int, curves: list[dict[str, Any]], outputs: dict[str, Any]) -> None:
    value = {
        "format": "pnabs/phase-state",
        "version": VERSION,
        "epoch": epoch,
        "curves": curves,
        "outputs": outputs,
    }
    write_atomic(folder / STATE, seal(value))
