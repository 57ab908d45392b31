"""`pnabs evaluate`: anybody's results scored against a run, a dataset or meshes.

`shapes` and `results` list what there is, `matching` brings it together by id; `task` is what a
worker's child does with a shape and a result, `reading` makes any result comparable, `frames`
notices one that stands elsewhere; `plan`, `work`, `rows` and `run` have it done and keep it, and
`output` says what came out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pnabs.evaluation.library import evaluate, score
    from pnabs.evaluation.output import Evaluation

__all__ = ["Evaluation", "evaluate", "score"]

_HOMES = {"Evaluation": "output", "evaluate": "library", "score": "library"}


def __getattr__(name: str) -> Any:
    # Workers' children need neither drivers nor tables.
    if name not in _HOMES:
        raise AttributeError(f"module 'pnabs.evaluation' has no attribute {name!r}")
    import importlib

    return getattr(importlib.import_module(f"pnabs.evaluation.{_HOMES[name]}"), name)
