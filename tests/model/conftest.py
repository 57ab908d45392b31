from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import torch

from pnabs.model.data import TrainingSet
from tests.model.shapes import CHAIR, training_set


@pytest.fixture(autouse=True)
def _one_thread() -> Iterator[None]:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


@pytest.fixture
def generator() -> torch.Generator:
    return torch.Generator().manual_seed(7)


@pytest.fixture(scope="session")
def chair() -> TrainingSet:
    """One chair of four boxes, symmetric in x."""
    return training_set([CHAIR])


@pytest.fixture(scope="session")
def five() -> TrainingSet:
    """Five different boxes."""
    sides = np.random.default_rng(3).uniform(0.2, 0.5, (5, 3))
    return training_set([((tuple(-s), tuple(s)),) for s in sides], surface=60, interior=60)
