"""What all tests share: a quiet environment, and one Ray session for those that need it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

# Before anything imports numpy or Ray.
os.environ["RAY_AUTH_MODE"] = "disabled"
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
os.environ.setdefault("OMP_NUM_THREADS", "1")


@pytest.fixture(scope="session")
def ray_session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The suite's Ray, on two CPUs."""
    os.environ["HOME"] = str(tmp_path_factory.mktemp("home"))
    from pnabs.stages.cluster import ray_session as session

    os.environ.pop("RAY_ADDRESS", None)
    with session(None, Path(os.environ["HOME"])):
        yield
