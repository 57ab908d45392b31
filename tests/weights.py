"""Weights of small networks that have learned nothing, for tests of what is done with them."""

from __future__ import annotations

from pathlib import Path

import torch

from pnabs.model.checkpoint import save_network
from pnabs.model.network import CuboidNetwork
from pnabs.settings import Network


def untrained(folder: Path, seed: int = 0) -> Path:
    """Write both modules' weights; returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    torch.manual_seed(seed)
    options = Network(channels=(4, 4, 8, 8, 16), hidden=32)
    for name, count in (("positive", 6), ("negative", 4)):
        start = torch.rand(count, 3) * 0.6 - 0.3
        save_network(folder / f"{name}.safetensors", CuboidNetwork(count, options, start))
    return folder
