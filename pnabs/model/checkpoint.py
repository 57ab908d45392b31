"""Weights and training state in files: safetensors, never pickle."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor
from torch.optim import Adam

from pnabs import settings
from pnabs.model.network import CuboidNetwork

FORMAT = "pnabs/network"
VERSION = 1


class CheckpointError(ValueError):
    """A file isn't a checkpoint that this version can read."""


def save_network(path: Path, network: CuboidNetwork) -> None:
    """Write a network's weights and options; equal networks give equal bytes."""
    _write(path, network.state_dict(), _describe(network))


def load_network(path: Path, device: torch.device | str = "cpu") -> CuboidNetwork:
    """Read a network that `save_network` or `save_training` wrote, in evaluation mode.

    Raises
    ------
    CheckpointError
        If the file isn't such a checkpoint, is damaged, or its weights don't fit its options.
    """
    tensors, about = _read(path)
    try:
        options = settings.Network.model_validate(about["network"])
        network = CuboidNetwork(int(about["count"]), options, tensors["start"])
        network.load_state_dict(
            {k: v for k, v in tensors.items() if not k.startswith("optimizer.")}
        )
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise CheckpointError(f"{path}: weights and options don't fit: {error}") from error
    return network.to(device).eval()


def save_training(path: Path, network: CuboidNetwork, optimizer: Adam, epoch: int) -> None:
    """Write what goes on after a stop: weights, the optimiser's moments, epochs done."""
    tensors = dict(network.state_dict())
    for index, state in optimizer.state_dict()["state"].items():
        for name, value in state.items():
            tensors[f"optimizer.{index}.{name}"] = value
    _write(path, tensors, {**_describe(network), "epoch": epoch})


def load_training(path: Path, network: CuboidNetwork, optimizer: Adam) -> int:
    """Restore network and optimiser in place from `save_training`; returns the epochs done.

    Raises
    ------
    CheckpointError
        If the file holds no training state, or that of another network.
    """
    tensors, about = _read(path)
    if "epoch" not in about:
        raise CheckpointError(f"{path}: holds weights only, no state to go on from")
    own = _describe(network)
    if any(about.get(key) != own[key] for key in own):
        raise CheckpointError(f"{path}: made with other network options: {about['network']}")
    state: dict[int, dict[str, Tensor]] = {}
    for key in [key for key in tensors if key.startswith("optimizer.")]:
        _, index, name = key.split(".")
        state.setdefault(int(index), {})[name] = tensors.pop(key)
    try:
        network.load_state_dict(tensors)
        optimizer.load_state_dict({**optimizer.state_dict(), "state": state})
    except (RuntimeError, ValueError) as error:
        raise CheckpointError(f"{path}: state doesn't fit this phase: {error}") from error
    return int(about["epoch"])


def _describe(network: CuboidNetwork) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "version": VERSION,
        "count": network.count,
        "network": network.options.model_dump(mode="json"),
    }


def _write(path: Path, tensors: dict[str, Tensor], about: dict[str, Any]) -> None:
    """Write under another name, then rename: a reader never sees half a file."""
    plain = {key: value.detach().cpu().contiguous() for key, value in tensors.items()}
    # One metadata key: the library doesn't keep the order of several.
    data = save(plain, metadata={"pnabs": json.dumps(about, sort_keys=True)})
    partial = path.with_name(path.name + ".partial")
    with partial.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)


def _read(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    try:
        with safe_open(path, framework="pt") as file:
            about = json.loads((file.metadata() or {}).get("pnabs", "null"))
            tensors = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118
    except (SafetensorError, json.JSONDecodeError) as error:
        raise CheckpointError(f"{path}: not a readable safetensors file: {error}") from error
    if not isinstance(about, dict) or about.get("format") != FORMAT:
        raise CheckpointError(f"{path}: not a network of pnabs")
    if about.get("version") != VERSION:
        raise CheckpointError(
            f"{path}: format version {about.get('version')}, this program reads {VERSION}"
        )
    return tensors, about
