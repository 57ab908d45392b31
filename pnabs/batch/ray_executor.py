"""Shards over Ray actors: one call in flight each, no restarts by Ray.

Ray's own retries would run a poisonous model again and again or blame its
neighbours, so actors never restart; a lost actor is replaced here and its shard
leased again, a few times at most.  A worker that doesn't see what it needs is left
out and keeps its place, so that no other is put there; one that gets nowhere is
killed.  So the work always ends.
"""

from __future__ import annotations

import os
import time
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import ray
from ray.exceptions import RayError, RayTaskError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from pnabs.batch.child import GRACE_SECONDS
from pnabs.batch.executor import ShardDone, ShardFailed, Watcher, describe, full_or_readonly
from pnabs.batch.work import ShardWork, Unavailable, WorkerLimits
from pnabs.batch.worker import Activity, ShardWorker

LEASES = 3
"""How often a shard is handed out before its workers' deaths count as its failure."""

POLL_SECONDS = 0.5

QUIET_SECONDS = 60.0
"""When nothing has moved for so long, the user is told what is in flight."""


class RayExecutor:
    """Runs shards on non-restarting actors of an initialised Ray.

    Parameters
    ----------
    limits
        Deadline and memory a model, and how long a worker may get nowhere.
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
        # The second thread of an actor tells what the first is at.
        self._worker: Any = ray.remote(_Worker).options(
            num_cpus=threads, max_restarts=0, max_concurrency=2, runtime_env={"env_vars": env}
        )

    def map(
        self, work: ShardWork, shards: Sequence[str], watcher: Watcher
    ) -> Iterator[ShardDone | ShardFailed]:
        """Results as actors finish them; every shard gives exactly one unless it raises.

        Raises
        ------
        Unavailable
            When no shard could be finished any more.
        """
        count = min(self._actors, len(shards))
        yield from _Floor(self._worker, work, self._limits, shards, count, watcher).run()


class _Worker(ShardWorker):
    """A worker that knows the node it is on."""

    def place(self) -> tuple[str, str]:
        """Host and process, and the node's id; whatever the worker sees or doesn't."""
        return self.where, ray.get_runtime_context().get_node_id()


@dataclass(eq=False, slots=True)
class _Seat:
    """One worker's place: its actor, the call in flight, and what it was last seen at.

    Attributes
    ----------
    call
        `place` and then `check` of a new worker, `run` of a shard, or `check` after a shard failed;
        None when the worker is free or left out.
    deaths
        How many workers died in this place while they started.
    ready
        Whether the worker has been seen to see what it needs.
    failure
        Why the shard failed, while the worker is looked at.
    """

    actor: Any
    call: Any
    deaths: int = 0
    where: str = ""
    node: str = ""
    ready: bool = False
    shard: str | None = None
    failure: BaseException | None = None
    left_out: str = ""
    question: Any = None
    activity: Activity | None = None
    moved: float = 0.0

    @property
    def starting(self) -> bool:
        return self.call is not None and not self.ready

    def free(self) -> None:
        self.call = self.shard = self.failure = self.activity = None

    def see(self, activity: Activity) -> bool:
        """Take an answer; whether the worker got on since the last."""
        before, self.activity = self.activity, activity
        return before is None or replace(before, seconds=0) != replace(activity, seconds=0)


class _Floor:
    """The workers of one `map` and the shards between them."""

    def __init__(
        self,
        worker: Any,
        work: ShardWork,
        limits: WorkerLimits,
        shards: Sequence[str],
        count: int,
        watcher: Watcher,
    ) -> None:
        self._worker, self._work, self._limits, self._watcher = worker, work, limits, watcher
        self._waiting = deque(shards)
        self._leases: Counter[str] = Counter()
        self._moved = self._told = time.monotonic()
        self._seats = [self._new_seat() for _ in range(count)]

    def run(self) -> Iterator[ShardDone | ShardFailed]:
        try:
            while self._waiting or any(seat.shard for seat in self._seats):
                self._lease()
                calls = {seat.call: seat for seat in self._seats if seat.call is not None}
                ready, _ = ray.wait(list(calls), num_returns=1, timeout=POLL_SECONDS)
                for call in ready:
                    self._moved = time.monotonic()
                    yield from self._answered(calls[call])
                yield from self._look_round()
        finally:
            for seat in self._seats:
                ray.kill(seat.actor)

    def _new_seat(self, deaths: int = 0, node: str | None = None) -> _Seat:
        """A new worker, wherever Ray puts it or on a given node."""
        worker = self._worker
        if node is not None:
            where = NodeAffinitySchedulingStrategy(node, soft=False)
            worker = worker.options(scheduling_strategy=where)
        actor = worker.remote(self._work, self._limits)
        return _Seat(actor, actor.place.remote(), deaths, node=node or "", moved=time.monotonic())

    def _lease(self) -> None:
        for seat in self._seats:
            if self._waiting and seat.call is None and not seat.left_out:
                seat.shard = self._waiting.popleft()
                self._leases[seat.shard] += 1
                seat.call = seat.actor.run.remote(seat.shard)
                seat.moved = time.monotonic()
                self._watcher.started(seat.shard, seat.where)

    def _answered(self, seat: _Seat) -> Iterator[ShardDone | ShardFailed]:
        shard, failure = seat.shard, seat.failure
        try:
            answer = ray.get(seat.call)
        except RayTaskError as error:
            cause = error.cause or error
            if shard is None or failure is not None:
                yield from self._leave_out(seat, describe(cause))
            elif full_or_readonly(cause):
                reason = f"{describe(cause)} (on {seat.where})"
                yield ShardFailed(shard, reason)
                raise Unavailable(reason) from None
            else:
                # The shard's fault, or its worker's that lost sight of what it needs?
                seat.failure = cause
                seat.call = seat.actor.check.remote()
        except RayError as error:
            yield from self._replace(seat, _death(error))
        else:
            if not seat.where:
                seat.where, seat.node = answer
                seat.call = seat.actor.check.remote()
                return
            seat.ready = True
            if shard is None:
                pass
            elif failure is not None:
                yield ShardFailed(shard, f"{describe(failure)} (on {seat.where})")
            else:
                yield answer
            seat.free()

    def _leave_out(self, seat: _Seat, reason: str) -> Iterator[ShardFailed]:
        """Give no more work to a worker that doesn't see what it needs.

        It keeps its place, so that Ray puts no other there; a new one is tried on a node that
        hasn't been found wanting.
        """
        shard, seat.left_out = seat.shard, reason
        seat.free()
        blind = {other.node for other in self._seats if other.left_out}
        others = [node["NodeID"] for node in _nodes() if node["NodeID"] not in blind
                  and node["Resources"].get("CPU", 0) > 0]  # fmt: skip
        working = sum(not other.left_out for other in self._seats)
        if others and not working:
            self._seats.append(self._new_seat(node=others[0]))
        hopeless = not others and not working
        if shard is not None:
            if hopeless:
                yield ShardFailed(shard, reason)
            else:
                self._leases[shard] -= 1
                self._waiting.appendleft(shard)
        if hopeless:
            raise Unavailable(reason)
        where = seat.where or "one of the nodes"
        self._watcher.warn(f"the worker on {where} is left out: {reason}")

    def _replace(self, seat: _Seat, reason: str) -> Iterator[ShardFailed]:
        """Put a new worker in the place of one that is gone; its shard is leased again."""
        shard = seat.shard
        deaths = seat.deaths + 1 if shard is None else 0
        if deaths >= LEASES:
            yield from self._leave_out(seat, f"{deaths} workers died while they started: {reason}")
            return
        if shard is None:
            pass
        elif self._leases[shard] >= LEASES:
            yield ShardFailed(
                shard, f"its workers were lost {LEASES} times, the last on {seat.where}: {reason}"
            )
        else:
            self._waiting.appendleft(shard)
            self._watcher.warn(
                f"the worker on {seat.where} was lost with shard {shard}, which is given to "
                f"another: {reason}"
            )
        # One that is only out of reach must not go on beside its successor.
        ray.kill(seat.actor)
        self._seats[self._seats.index(seat)] = self._new_seat(deaths)

    def _look_round(self) -> Iterator[ShardFailed]:
        """Ask what everyone is at, tell the user when nothing moves, give up who gets nowhere."""
        now = time.monotonic()
        for seat in self._seats:
            if seat.shard is not None and self._ask(seat):
                seat.moved = self._moved = now
        self._watcher.progress(sum(seat.activity.models for seat in self._seats if seat.activity))
        limits = self._limits
        patience = limits.stall + limits.deadline + GRACE_SECONDS
        for seat in list(self._seats):
            if seat.shard is not None and now - seat.moved > patience:
                yield from self._replace(seat, f"no progress for {patience:.0f} s at {_what(seat)}")
        starting = [seat for seat in self._seats if seat.starting]
        idle = now - self._moved
        if starting and idle > LEASES * patience and not any(s.shard for s in self._seats):
            raise Unavailable(
                f"no worker could start within {idle:.0f} s: are the cluster's CPUs taken?"
            )
        if idle > QUIET_SECONDS and now - self._told > QUIET_SECONDS:
            self._told = now
            busy = [f"{seat.shard} on {seat.where}, at {_what(seat)}"
                    for seat in self._seats if seat.shard]  # fmt: skip
            busy += [f"{len(starting)} workers that Ray has not started yet"] * bool(starting)
            self._watcher.warn(f"nothing has moved for {idle:.0f} s; in flight: {'; '.join(busy)}")

    def _ask(self, seat: _Seat) -> bool:
        # Answers are taken when they are there, never waited for.
        if seat.question is None:
            seat.question = seat.actor.activity.remote()
            return False
        if not ray.wait([seat.question], timeout=0)[0]:
            return False
        question, seat.question = seat.question, None
        try:
            return seat.see(ray.get(question))
        except RayError:
            return False


def _what(seat: _Seat) -> str:
    if seat.activity is None:
        return "nothing it told of yet"
    return f"{seat.activity.what} for {seat.activity.seconds:.0f} s"


def _death(error: RayError) -> str:
    """The telling line of Ray's many."""
    text = str(error)
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    telling = ("died", "killed", "dead", "unavailable", "exit", "memory")
    for line in lines[1:]:
        if any(word in line for word in telling):
            return line
    return lines[0] if lines else type(error).__name__


def _nodes() -> list[dict[str, Any]]:
    nodes: list[dict[str, Any]] = ray.nodes()  # type: ignore[no-untyped-call]
    return [node for node in nodes if node["Alive"]]
