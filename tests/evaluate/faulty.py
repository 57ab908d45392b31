"""A task that fails at some results; apart, so that children load nothing else for it."""

from __future__ import annotations

import ctypes
import time
from typing import Any

from pnabs.evaluation.items import MeshFiles
from pnabs.evaluation.task import EvaluateTask


class Faulty(EvaluateTask):
    """Some results crash native code, hang, or fail."""

    def __call__(self, payload: Any) -> dict[str, Any]:
        """Do as the result's name says."""
        place = payload[0].result
        if isinstance(place, MeshFiles) and "half" in place.root:
            if "m01" in place.sources[0]:
                ctypes.string_at(0)
            elif "m02" in place.sources[0]:
                time.sleep(60)
            elif "m03" in place.sources[0]:
                raise RuntimeError("a mistake of ours")
        return super().__call__(payload)
