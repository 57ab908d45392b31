"""Shards over Ray actors: one call in flight each, no restarts by Ray.

Ray's own retries would run a poisonous model again and again or blame its
neighbours, so actors never restart; a lost actor is replaced here and its shard
leased again, a few times at most.
"""

from __future__ import annotations

import contextlib
import os
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import ray
from ray.exceptions import GetTimeoutError, RayActorError, RayTaskError

from pnabs.batch.executor import ShardDone, ShardFailed
from pnabs.batch.work import ShardWork, WorkerLimits
from pnabs.batch.worker import ShardWorker

LEASES = 3
"""How often a shard is handed out before its workers' deaths count as its failure."""

POLL_SECONDS = 0.5


class RayExecutor:
    """Runs shards on non-restarting actors of an initialised Ray.

    Parameters
    ----------
    limits
        Deadline and memory a model.
    actors
        How many; one a CPU of the cluster when None.
    threads
        Native threads in each process.

    Raises
    ------
    ValueError
        When no machine has so many CPUs: Ray would wait for ever.
    """

    def __init__(self, limits: WorkerLimits, actors: int | None, threads: int) -> None:
        self._limits = limits
        resources: dict[str, float] = ray.cluster_resources()  # type: ignore[no-untyped-call]
        self._actors = actors or max(1, int(resources.get("CPU", 1)) // threads)
        largest = max((node["Resources"].get("CPU", 0) for node in _nodes()), default=0)
        if threads > largest:
            raise ValueError(
                f"runtime.threads={threads}: no machine of this Ray has so many CPUs "
                f"(the largest has {largest:g})"
            )
        names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
        env = dict.fromkeys(names, str(threads))
        if "NUMBA_CACHE_DIR" in os.environ:
            env["NUMBA_CACHE_DIR"] = os.environ["NUMBA_CACHE_DIR"]
        # The second thread of an actor answers for progress while the first works.
        self._worker: Any = ray.remote(ShardWorker).options(
            num_cpus=threads, max_restarts=0, max_concurrency=2, runtime_env={"env_vars": env}
        )

    def map(
        self,
        work: ShardWork,
        shards: Sequence[str],
        on_progress: Callable[[int], None] | None = None,
    ) -> Iterator[ShardDone | ShardFailed]:
        """Results as actors finish them; every shard gives exactly one."""
        waiting = deque(shards)
        leases: Counter[str] = Counter()
        idle = [
            self._worker.remote(work, self._limits) for _ in range(min(self._actors, len(waiting)))
        ]
        busy: dict[Any, tuple[Any, str]] = {}
        counts: dict[Any, int] = {}
        asked: dict[Any, Any] = {}
        try:
            while waiting or busy:
                while waiting and idle:
                    actor, shard = idle.pop(), waiting.popleft()
                    leases[shard] += 1
                    busy[actor.run.remote(shard)] = (actor, shard)
                ready, _ = ray.wait(list(busy), num_returns=1, timeout=POLL_SECONDS)
                for ref in ready:
                    actor, shard = busy.pop(ref)
                    try:
                        result: ShardDone | ShardFailed | None = ray.get(ref)
                    except RayTaskError as error:
                        cause = error.cause or error
                        result = ShardFailed(shard, f"{type(cause).__name__}: {cause}")
                    except RayActorError as error:
                        result = None
                        if leases[shard] >= LEASES:
                            reason = f"its worker died {LEASES} times, last: {error}"
                            result = ShardFailed(shard, reason)
                        else:
                            waiting.append(shard)
                        actor = self._worker.remote(work, self._limits)
                    if waiting:
                        idle.append(actor)
                    else:
                        ray.kill(actor)
                    if result is not None:
                        yield result
                if on_progress:
                    self._ask(busy, asked, counts)
                    on_progress(sum(counts.values()))
        finally:
            for actor in [*idle, *(actor for actor, _ in busy.values())]:
                ray.kill(actor)

    def _ask(
        self, busy: dict[Any, tuple[Any, str]], asked: dict[Any, Any], counts: dict[Any, int]
    ) -> None:
        # Progress is a courtesy: answers are taken when they are there, never waited for.
        for actor, ref in list(asked.items()):
            if ray.wait([ref], timeout=0)[0]:
                del asked[actor]
                with contextlib.suppress(RayActorError, RayTaskError, GetTimeoutError):
                    counts[actor] = ray.get(ref)
        for actor, _ in busy.values():
            if actor not in asked:
                asked[actor] = actor.models_done.remote()


def _nodes() -> list[dict[str, Any]]:
    nodes: list[dict[str, Any]] = ray.nodes()  # type: ignore[no-untyped-call]
    return [node for node in nodes if node["Alive"]]
