"""What sets of results are called."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pnabs.stages.errors import UsageError


def named(paths: Sequence[Path], names: Sequence[str]) -> tuple[tuple[str, Path], ...]:
    """Name and path of each set of results.

    Parameters
    ----------
    paths
    names
        As many, or none: then each is called by its path's last component, a file without its
        suffix.

    Raises
    ------
    UsageError
        When the numbers differ or a name is empty.
    """
    if not paths:
        raise UsageError("there are no results: name at least one folder or file")
    if names and len(names) != len(paths):
        raise UsageError(
            f"--name: {len(names)} names for {len(paths)} sets of results; give one for each, in "
            "their order, or none"
        )
    if not all(names):
        raise UsageError("--name: a name is empty")
    return tuple(zip(names or [_own(path) for path in paths], paths, strict=True))


def _own(path: Path) -> str:
    path = path.absolute()
    return (path.name if path.is_dir() else path.stem) or "results"
