from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import save_file

from pnabs import settings
from pnabs.model.checkpoint import (
    CheckpointError,
    load_network,
    load_training,
    save_network,
    save_training,
)
from pnabs.model.data import TrainingSet
from pnabs.model.network import CuboidNetwork
from pnabs.model.objective import Objective, make_optimizer
from pnabs.model.predict import predict
from pnabs.model.trainer import epoch_order, train_epoch

NETWORK = settings.Network(channels=(2, 2, 4, 4, 8), hidden=16)
TRAINING = settings.Training(
    epochs=4, batch_size=2, shape_samples=20, cuboid_samples=4, occupancy_samples=20
)


def build(seed: int = 0) -> CuboidNetwork:
    start = torch.tensor([[-0.1, 0, 0], [0.1, 0, 0.2]])
    return CuboidNetwork(2, NETWORK, start, torch.Generator().manual_seed(seed))


def test_round_trip(tmp_path: Path, rng: np.random.Generator) -> None:
    network = build()
    network.initial_encoder(torch.rand((2, 1, 32, 32, 32)))
    save_network(tmp_path / "a", network)
    loaded = load_network(tmp_path / "a")
    assert loaded.options == NETWORK
    assert not loaded.training
    expected = network.state_dict()
    assert loaded.state_dict().keys() == expected.keys()
    assert all(torch.equal(v, expected[k]) for k, v in loaded.state_dict().items())
    solids = rng.random((2, 32, 32, 32)) < 0.3
    pairs = zip(predict(loaded, solids, 2), predict(network, solids, 2), strict=True)
    assert all(a.as_vector().tobytes() == b.as_vector().tobytes() for a, b in pairs)


def test_equal_networks_give_equal_bytes(tmp_path: Path) -> None:
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        save_network(tmp_path / name, build(seed))
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert (tmp_path / "a").read_bytes() != (tmp_path / "c").read_bytes()
    assert {path.name for path in tmp_path.iterdir()} == {"a", "b", "c"}


def test_stopped_training_goes_on_as_if_never_stopped(tmp_path: Path, five: TrainingSet) -> None:
    def run(stop_after: int | None) -> CuboidNetwork:
        network = build()
        objective = Objective(network, "positive", "refinement", TRAINING)
        optimizer = make_optimizer(objective, TRAINING)
        epoch = 0
        while epoch < TRAINING.epochs:
            order = epoch_order(len(five), epoch, 0)
            train_epoch(objective, optimizer, five, order, TRAINING, epoch=epoch, seed=0)
            epoch += 1
            if epoch == stop_after:
                save_training(tmp_path / "state", network, optimizer, epoch)
                network = build(seed=5)
                objective = Objective(network, "positive", "refinement", TRAINING)
                optimizer = make_optimizer(objective, TRAINING)
                epoch = load_training(tmp_path / "state", network, optimizer)
        return network

    whole, resumed = run(None).state_dict(), run(2).state_dict()
    assert all(torch.equal(whole[name], resumed[name]) for name in whole)


def test_training_state_also_holds_the_weights(tmp_path: Path) -> None:
    network = build()
    objective = Objective(network, "positive", "initial", TRAINING)
    save_training(tmp_path / "state", network, make_optimizer(objective, TRAINING), 1)
    loaded = load_network(tmp_path / "state").state_dict()
    assert all(torch.equal(v, loaded[k]) for k, v in network.state_dict().items())


def test_what_is_no_checkpoint_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "weights"
    save_network(path, build())
    whole = path.read_bytes()
    path.write_bytes(whole[:-100])
    with pytest.raises(CheckpointError, match="not a readable safetensors"):
        load_network(path)
    path.write_bytes(b"\x80\x04" + bytes(50))
    with pytest.raises(CheckpointError, match="not a readable safetensors"):
        load_network(path)
    save_file({"start": torch.zeros((2, 3))}, path)
    with pytest.raises(CheckpointError, match="not a network of pnabs"):
        load_network(path)
    path.write_bytes(whole.replace(b'\\"version\\": 1', b'\\"version\\": 9'))
    with pytest.raises(CheckpointError, match="format version 9"):
        load_network(path)
    path.write_bytes(whole.replace(b'\\"hidden\\": 16', b'\\"hidden\\": 17'))
    with pytest.raises(CheckpointError, match="don't fit"):
        load_network(path)


def test_state_of_another_network_is_refused(tmp_path: Path) -> None:
    network = build()
    objective = Objective(network, "positive", "initial", TRAINING)
    optimizer = make_optimizer(objective, TRAINING)
    save_network(tmp_path / "weights", network)
    with pytest.raises(CheckpointError, match="no state"):
        load_training(tmp_path / "weights", network, optimizer)
    other = CuboidNetwork(3, NETWORK, torch.zeros((3, 3)))
    save_training(tmp_path / "state", other, optimizer, 1)
    with pytest.raises(CheckpointError, match="other network options"):
        load_training(tmp_path / "state", network, optimizer)
