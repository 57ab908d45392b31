"""How a run can end other than well; each has its exit code (DESIGN, command line)."""

from __future__ import annotations

import errno


class RunError(Exception):
    """Base of what ends a run with a message for the user."""

    exit_code = 1


class UsageError(RunError):
    """The command can't be done with this folder or job as it is."""

    exit_code = 2


class RefusedError(RunError):
    """The run folder is held, or settings or inputs changed, or storage isn't shared."""

    exit_code = 4


class TooManyFailedError(RunError):
    """More models fell out of a stage than `max_failed` allows."""

    exit_code = 3


class ShardsFailedError(RunError):
    """Shards could not be finished for causes that are no model's; running again resumes."""

    exit_code = 3


class TrainingError(RunError):
    """Training failed or got nowhere; running again goes on from the last checkpoint."""

    exit_code = 3


class StorageError(RunError):
    """The run folder can't be written any more; running again resumes."""

    exit_code = 3


class InterruptedRunError(RunError):
    """SIGINT or SIGTERM; `exit_code` is 130 or 143."""

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(message)
        self.exit_code = exit_code


def is_storage(error: OSError) -> bool:
    """Whether an error is the disk's or the network's, and not a mistake of ours."""
    return error.errno in (
        *(errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO, errno.ESTALE),
        *(errno.EACCES, errno.EPERM, errno.ENOTCONN, errno.ETIMEDOUT),
    )


def storage_message(error: OSError) -> str:
    """What the disk says, and where."""
    where = f"{error.filename}: " if error.filename else ""
    return f"can't read or write: {where}{error.strerror}"
