"""Ray: started here, or a cluster joined; quiet, and with the run folder shared."""

from __future__ import annotations

import logging
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pnabs.stages.errors import RefusedError

LOCAL_OBJECT_STORE = 256 * 2**20
"""Bytes of the object store on one machine: only small results travel through it."""

ANSWER_SECONDS = 60.0
"""What a node may take to look for the run folder."""


@contextmanager
def ray_session(address: str | None, run: Path) -> Iterator[bool]:
    """An initialised Ray while the body runs; one that is there already is left running.

    Parameters
    ----------
    address
        A cluster's address, `auto`, or None: the one of RAY_ADDRESS, else a local Ray.
    run
        The run folder; every node must see it.

    Yields
    ------
    Whether this Ray was started here, and ends with the body.

    Raises
    ------
    RefusedError
        When a node doesn't see the run folder, or no cluster answers at the address.
    """
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    # Start-up of training workers imports torch; a busy machine needs longer than Ray's minute.
    os.environ.setdefault("RAY_TRAIN_WORKER_GROUP_START_TIMEOUT_S", "300")
    os.environ.setdefault("RAY_TRAIN_HEALTH_CHECK_INTERVAL_S", "0.2")
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    address = address or os.environ.get("RAY_ADDRESS")
    if address is None:
        # Nothing but this user's own processes talks to a local Ray.
        os.environ.setdefault("RAY_AUTH_MODE", "disabled")
    import ray

    if ray.is_initialized():
        yield False
        return
    options: dict[str, Any] = {"address": address}
    if address is None:
        # `local`: never a cluster that somebody started on this machine for something else.
        options = {
            "address": "local",
            "include_dashboard": False,
            "object_store_memory": LOCAL_OBJECT_STORE,
        }
    try:
        ray.init(log_to_driver=False, logging_level=logging.ERROR, **options)
    except ConnectionError as error:
        raise RefusedError(f"no Ray cluster answers at {address}: {error}") from None
    try:
        if address is not None:
            _check_shared(run)
        yield address is None
    finally:
        ray.shutdown()


def _answer(reference: Any) -> str:
    """What a node says by now; a disk that hangs says nothing."""
    import ray
    from ray.exceptions import GetTimeoutError, RayError

    try:
        answer: str = ray.get(reference, timeout=0)
    except GetTimeoutError:
        return f"no answer within {ANSWER_SECONDS:g} s"
    except RayError as error:
        return f"{type(error).__name__}"
    return answer


def _check_shared(run: Path) -> None:
    import ray
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

    nonce = secrets.token_hex(8)
    path = run / f".shared-{nonce}.partial"  # swept, should this be killed
    path.write_text(nonce)

    @ray.remote(num_cpus=0)
    def sees(path: str) -> str:
        try:
            return Path(path).read_text()
        except OSError as error:
            return f"{type(error).__name__}: {error}"

    try:
        known: list[dict[str, Any]] = ray.nodes()  # type: ignore[no-untyped-call]
        nodes = [node for node in known if node["Alive"]]
        asked = [
            sees.options(
                scheduling_strategy=NodeAffinitySchedulingStrategy(node["NodeID"], soft=False)
            ).remote(str(path))
            for node in nodes
        ]
        ray.wait(asked, num_returns=len(asked), timeout=ANSWER_SECONDS)
        answers = [_answer(reference) for reference in asked]
    finally:
        path.unlink(missing_ok=True)
    blind = [
        f"{node['NodeManagerHostname']} ({answer})"
        for node, answer in zip(nodes, answers, strict=True)
        if answer != nonce
    ]
    if blind:
        raise RefusedError(
            f"the run folder {run} is not on storage that all nodes share; "
            f"these don't see it: {', '.join(blind)}. Put `out` on a shared disk."
        )
