"""Ray, started or joined when a stage first needs it."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

from pnabs.batch import Executor, WorkerLimits
from pnabs.settings import Runtime
from pnabs.stages.errors import InterruptedRunError, UsageError
from pnabs.stages.interrupts import Interrupts
from pnabs.stages.progress import Reporter


class LazyRay:
    """The Ray of one run.

    Parameters
    ----------
    address
        A cluster's; None starts one here, or joins the one of RAY_ADDRESS.
    run
        The run folder.
    stack
        Ends what was started here.
    """

    def __init__(
        self,
        address: str | None,
        run: Path,
        reporter: Reporter,
        interrupts: Interrupts,
        stack: ExitStack,
    ) -> None:
        self._address, self._run, self._stack = address, run, stack
        self._reporter, self._interrupts = reporter, interrupts
        self._owned: bool | None = None

    @property
    def owned(self) -> bool:
        """Whether Ray was started here and ends with the run."""
        return bool(self._owned)

    def start(self) -> None:
        """Have Ray running; does so once.

        Raises
        ------
        InterruptedRunError
            When a signal came while it started.
        RefusedError
            When the cluster can't be joined or doesn't see the run folder.
        """
        if self._owned is not None:
            return
        from pnabs.stages.cluster import ray_session

        doing = "starting Ray ..." if self._address is None else "joining Ray ..."
        self._reporter.say(doing)
        try:
            with self._interrupts.at_once("Ray was starting"):
                session = ray_session(self._address, self._run)
                self._owned = self._stack.enter_context(session)
        except SystemExit:
            # While it starts, Ray answers SIGTERM itself.
            raise InterruptedRunError("stopped while Ray was starting", 143) from None
        self._interrupts.install()

    def executor(self, limits: WorkerLimits, runtime: Runtime) -> Executor:
        """Actors of a started Ray.

        Raises
        ------
        UsageError
            When no machine is large enough for one.
        """
        self.start()
        from pnabs.batch.ray_executor import RayExecutor

        try:
            return RayExecutor(limits, runtime.actors, runtime.threads)
        except ValueError as error:
            raise UsageError(str(error)) from None
