"""The same job on a cluster, through Ray's Job API."""

from __future__ import annotations

import shlex
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import IO

import yaml

import pnabs
from pnabs.stages.errors import RunError
from pnabs.stages.job import Job

POLL_SECONDS = 1.0
AGENT_SECONDS = 60.0
"""How long a head that has just come up may take until it takes jobs."""


def submit(job: Job, address: str, arguments: Sequence[str], *, wait: bool, log: IO[str]) -> int:
    """Send a job to a Ray head and, if asked, follow it to its end.

    The job's settings travel as resolved here, and this package's code with them;
    the cluster must have the libraries, and see the dataset and the run folder under
    the same paths.

    Parameters
    ----------
    address
        The head's dashboard, such as http://head:8265.
    arguments
        Further arguments of `pnabs run`.
    wait
        Follow the job's log and return its exit code.
    log
        Where the job's log goes.

    Returns
    -------
    The job's exit code, or 0 once submitted when not waiting.

    Raises
    ------
    RunError
        When no head answers, or the job ends without an exit code.
    """
    from ray.job_submission import JobStatus, JobSubmissionClient

    try:
        client = JobSubmissionClient(address)
    except (ConnectionError, RuntimeError) as error:
        raise RunError(f"no Ray head answers at {address}: {error}") from None
    with tempfile.TemporaryDirectory() as folder:
        # Only what the job file says travels; no file beside it.
        text = yaml.safe_dump(job.settings.model_dump(mode="json"), sort_keys=False)
        (Path(folder) / "job.yaml").write_text(text)
        command = ["python", "-m", "pnabs.cli", "run", "job.yaml", *arguments]
        package = str(Path(pnabs.__file__).parent)
        deadline = time.monotonic() + AGENT_SECONDS
        while True:
            try:
                identifier = client.submit_job(
                    entrypoint=shlex.join(command),
                    runtime_env={"working_dir": folder, "py_modules": [package]},
                )
                break
            except RuntimeError as error:
                # A head that has just come up has no agent to take jobs yet.
                if "No available agent" not in str(error) or time.monotonic() > deadline:
                    raise RunError(f"{address} does not take the job: {error}") from None
                time.sleep(POLL_SECONDS)
    log.write(f"submitted {identifier} to {address}\n")
    if not wait:
        return 0
    shown = 0
    while True:
        status = client.get_job_status(identifier)
        text = client.get_job_logs(identifier)
        log.write(text[shown:])
        log.flush()
        shown = len(text)
        if status in (JobStatus.SUCCEEDED, JobStatus.FAILED, JobStatus.STOPPED):
            break
        time.sleep(POLL_SECONDS)
    code = client.get_job_info(identifier).driver_exit_code
    if code is None:
        raise RunError(f"job {identifier} ended as {status} without an exit code")
    return int(code)
