"""A child process that runs one model at a time, so that a crash is that model's alone.

The worker keeps one child from a fork server that has the heavy modules imported;
after a crash, a hang past the deadline or a breach of the memory limit a new child
is there within milliseconds, and the shard's finished models are untouched.
"""

from __future__ import annotations

import contextlib
import faulthandler
import fcntl
import multiprocessing
import multiprocessing.connection
import os
import re
import resource
import signal
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from multiprocessing import forkserver, resource_tracker
from pathlib import Path
from typing import IO, Any

from pnabs.batch.work import InvalidInput, Outcome, Unavailable, WorkerLimits

START_SECONDS = 300.0
"""What a child may take to start, its server's imports on a busy machine included."""

GRACE_SECONDS = 5.0
"""A child ends itself at the deadline; after this longer it is killed."""

_STARTING = threading.Lock()


def start_server(preload: Sequence[str]) -> None:
    """Start the server that children are forked from, if there is none yet in this process.

    Parameters
    ----------
    preload
        Modules that it imports, and all children find imported.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(preload))
    # Starting this by the way, as the next would, lets Ctrl-C through again.
    resource_tracker.ensure_running()
    # Ctrl-C goes to the server as well, which ignores it once its imports are done.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        with _STARTING, _main_hidden():
            forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class IsolatedChild:
    """Runs a task on payloads in a child process with a deadline and a memory limit.

    Parameters
    ----------
    task
        Picklable function of one payload.
    limits
        Deadline in seconds and bytes a model.
    preload
        Modules that the fork server imports once for all children.
    """

    def __init__(
        self, task: Callable[[Any], Any], limits: WorkerLimits, preload: tuple[str, ...]
    ) -> None:
        self._task = task
        self._limits = limits
        self._preload = preload
        self._process: Any = None
        self._connection: multiprocessing.connection.Connection | None = None
        # The child's last words: which line hung or crashed.
        self._words: IO[bytes] | None = None
        self._abandoned = False

    def run(self, model_id: str, payload: Any) -> Outcome:
        """One model's outcome.

        Raises
        ------
        Unavailable
            When the task says so, or no child can be started: neither is the model's fault.
        """
        connection = self._connection or self._started()
        deadline = self._limits.deadline
        started = time.monotonic()
        try:
            connection.send(payload)
            if not connection.poll(deadline + GRACE_SECONDS):
                raise TimeoutError
            kind, value, reason, trace = connection.recv()
        except (EOFError, OSError):
            # OSError too, where it died while it sent its result.
            if self._abandoned:
                self._end()
                raise Unavailable("stopped") from None
            # The child's own timer ends it at the deadline, at once or a moment later.
            late = time.monotonic() - started >= deadline
            process = self._process
            process.join(0 if late else GRACE_SECONDS)
            code = process.exitcode
            stack = self._end()
            if late:
                reason = f"no result within {deadline:g} s"
                return Outcome(model_id, "timeout", reason=reason, traceback=stack)
            return Outcome(model_id, "crash", reason=_exit_reason(code), traceback=stack)
        return _outcome(model_id, kind, value, reason, trace)

    def start(self) -> None:
        """Have a child ready, its server's imports included.

        Raises
        ------
        Unavailable
            When none can be started.
        """
        if self._connection is None:
            self._started()

    def restart(self) -> None:
        """End the child; the next model gets a fresh one."""
        self._end()

    def close(self) -> None:
        """End the child for good."""
        self._end()

    def abandon(self) -> None:
        """From another thread: end the child, so that what is in flight raises `Unavailable`."""
        self._abandoned = True
        # A start that is under way is over after this, or sees the flag.
        with _STARTING:
            process = self._process
        with contextlib.suppress(AttributeError, ValueError):
            process.kill()

    def _started(self) -> multiprocessing.connection.Connection:
        """A connection to a new child that is ready for work."""
        # Named until the child has opened it, so that nothing is left wherever this ends.
        descriptor, name = tempfile.mkstemp(prefix="pnabs-stack-")
        self._words = os.fdopen(descriptor, "rb")
        try:
            connection = self._start(Path(name))
            if connection.poll(START_SECONDS):
                connection.recv()
                return connection
            reason = f"none is ready after {START_SECONDS:g} s"
        except Unavailable:
            self._end()
            raise
        except (EOFError, OSError):
            reason = "the server that they are forked from is gone"
            if self._process is not None:
                self._process.join(GRACE_SECONDS)
                reason = _exit_reason(self._process.exitcode)
        finally:
            Path(name).unlink(missing_ok=True)
        stack = self._end().strip()
        raise Unavailable(f"a child process can't be started: {reason} {stack}".strip())

    def _start(self, stack: Path) -> multiprocessing.connection.Connection:
        start_server(self._preload)
        context = multiprocessing.get_context("forkserver")
        ours, theirs = context.Pipe()
        process = context.Process(
            target=_serve,
            args=(theirs, self._task, self._limits, stack),
            daemon=True,
        )
        with _STARTING, _main_hidden():
            if self._abandoned:
                raise Unavailable("stopped")
            process.start()
            self._process = process
        theirs.close()
        self._connection = ours
        return ours

    def _end(self) -> str:
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process.close()
        if self._connection is not None:
            self._connection.close()
        self._process = self._connection = None
        stack = ""
        if self._words is not None:
            stack = self._words.read().decode(errors="replace")
            self._words.close()
            self._words = None
        # Thread ids differ from run to run, and records must not.
        return re.sub(r"0x[0-9a-f]{8,}", "0x…", stack)[-4000:]


class InProcess:
    """The same in this process: no deadline, no memory limit, and a crash takes all with it."""

    def __init__(
        self, task: Callable[[Any], Any], limits: WorkerLimits, preload: tuple[str, ...]
    ) -> None:
        self._task = task

    def run(self, model_id: str, payload: Any) -> Outcome:
        """One model's outcome; raises nothing of what the task does but `Unavailable`."""
        return _outcome(model_id, *_attempt(self._task, payload))

    def start(self) -> None:
        """Nothing: there is no child."""

    def restart(self) -> None:
        """Nothing: there is no child."""

    def close(self) -> None:
        """Nothing: there is no child."""

    def abandon(self) -> None:
        """Nothing: there is no child."""


def _outcome(model_id: str, kind: Any, value: Any, reason: str, trace: str) -> Outcome:
    if kind == "unavailable":
        raise Unavailable(reason)
    return Outcome(model_id, kind, value=value, reason=reason, traceback=trace)


def _serve(
    connection: multiprocessing.connection.Connection,
    task: Callable[[Any], Any],
    limits: WorkerLimits,
    stack: Path,
) -> None:
    # Ctrl-C goes to the whole process group; the driver decides what ends.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    _end_with_the_worker()
    words = stack.open("ab", buffering=0)
    faulthandler.enable(words)
    limit = _address_space() + limits.memory
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    connection.send("ready")
    while True:
        try:
            payload = connection.recv()
        except EOFError:
            return
        # The timer needs no interpreter lock: it ends a child that hangs in native code, also
        # one whose worker is gone, and leaves behind where it hung.
        faulthandler.dump_traceback_later(limits.deadline, exit=True, file=words)
        connection.send(_attempt(task, payload))
        faulthandler.cancel_dump_traceback_later()


def _end_with_the_worker() -> None:
    """Have the kernel end this process with its worker.

    A thread that waits for the worker could not act while native code holds the interpreter.
    """
    worker = multiprocessing.parent_process()
    if worker is None:
        return
    # The sentinel is a pipe that the worker's end closes; SIGIO's default is to end the process.
    signal.signal(signal.SIGIO, signal.SIG_DFL)
    fcntl.fcntl(worker.sentinel, fcntl.F_SETOWN, os.getpid())
    flags = fcntl.fcntl(worker.sentinel, fcntl.F_GETFL)
    fcntl.fcntl(worker.sentinel, fcntl.F_SETFL, flags | os.O_ASYNC)
    if multiprocessing.connection.wait([worker.sentinel], timeout=0):
        os._exit(1)


def _attempt(task: Callable[[Any], Any], payload: Any) -> tuple[str, Any, str, str]:
    try:
        return "ok", task(payload), "", ""
    except InvalidInput as error:
        return "invalid", None, str(error), ""
    except Unavailable as error:
        return "unavailable", None, str(error), ""
    except MemoryError as error:
        return "memory", None, f"out of its memory limit: {error}", traceback.format_exc()
    except Exception as error:
        return "error", None, f"{type(error).__name__}: {error}", traceback.format_exc()


def _address_space() -> int:
    with open("/proc/self/statm") as stream:
        return int(stream.read().split()[0]) * resource.getpagesize()


def _exit_reason(code: int | None) -> str:
    if code is not None and code < 0:
        with contextlib.suppress(ValueError):
            return f"the process died of {signal.Signals(-code).name}"
    return f"the process ended with exit code {code}"


@contextlib.contextmanager
def _main_hidden() -> Iterator[None]:
    # A new child would import the parent's main script again, half a second each time.
    main = sys.modules["__main__"]
    hidden = {name: main.__dict__.pop(name) for name in ("__file__",) if name in main.__dict__}
    spec = getattr(main, "__spec__", None)
    main.__spec__ = None
    try:
        yield
    finally:
        main.__dict__.update(hidden)
        main.__spec__ = spec
