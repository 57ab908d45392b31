"""Shape abstraction of mesh collections: positive cuboids cropped by negative ones."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pnabs.evaluation import evaluate, score
    from pnabs.formats import Abstraction
    from pnabs.geometry.types import Cuboids
    from pnabs.library import abstract, load

__version__ = "0.1.0"
__all__ = ["Abstraction", "Cuboids", "abstract", "evaluate", "load", "score"]

_HOMES = {
    "Abstraction": "pnabs.formats",
    "Cuboids": "pnabs.geometry.types",
    "abstract": "pnabs.library",
    "evaluate": "pnabs.evaluation",
    "load": "pnabs.library",
    "score": "pnabs.evaluation",
}


def __getattr__(name: str) -> Any:
    # `import pnabs` loads neither numpy nor torch.
    if name not in _HOMES:
        raise AttributeError(f"module 'pnabs' has no attribute {name!r}")
    import importlib

    value = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = value
    return value
