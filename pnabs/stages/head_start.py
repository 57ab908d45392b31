"""A head start for `pnabs abstract`: its children's server loads while the command itself does."""

from __future__ import annotations

from pnabs.batch.child import start_server

PRELOAD = ("pnabs.stages.warm_files",)


def head_start() -> None:
    """Begin to load what children need, in the server that they are forked from."""
    start_server(PRELOAD)
