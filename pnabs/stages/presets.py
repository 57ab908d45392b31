"""Presets: named sets of settings, for a job or for one of its variants."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from pnabs.settings import Dataset, Settings
from pnabs.stages.trees import and_parents, at, dotted, flattened, merge

PAPER: dict[str, Any] = {
    "network": {"channels": [4, 8, 16, 32, 64], "hidden": 64, "refine_input": "vector"},
    "training": {
        "schedule": "constant",
        "mirror_augment": False,
        "turn": 0.0,
        "stretch": 0.0,
        "burn_in": 0,
        "losses": {"occupancy": 0.0, "separation": 1.0},
    },
    "abstract": {"iterations": 3, "fit": False},
}
"""`preset: paper`: where our defaults go beyond the paper's numbers."""

PRESETS: dict[str, dict[str, Any]] = {"best": {}, "paper": PAPER}


def written_out(changes: Mapping[str, Any], job: str, said: Collection[str]) -> dict[str, Any]:
    """A variant's changes as dotted leaves, with its own preset's if it takes another than the job.

    They stand in the place of the job's preset: what the job or the variant itself says stands
    above them.

    Parameters
    ----------
    changes
        Dotted keys to values; `preset` among them, or not.
    job
        The job's preset.
    said
        Dotted keys that the job's file and overrides give.

    Raises
    ------
    ValueError
        When there is no such preset.
    """
    preset = changes.get("preset", job)
    if not isinstance(preset, str) or preset not in PRESETS:
        raise ValueError(f"preset: there are {' and '.join(PRESETS)} (got {preset!r})")
    own = flattened({key: value for key, value in changes.items() if key != "preset"})
    if preset == job:
        return own
    keys = dotted(PRESETS[job]) | dotted(PRESETS[preset])
    keys = {key for key in keys if not set(said).intersection(and_parents(key))}
    defaults = Settings(dataset=Dataset(root="/"), out=Path("/")).model_dump(mode="json")
    values = merge(defaults, PRESETS[preset])
    return {key: at(values, key.split(".")) for key in sorted(keys)} | own
