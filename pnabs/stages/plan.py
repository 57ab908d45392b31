"""What each stage's results depend on, as fingerprints.

A stage's *recipe* holds the settings that can change its results and its integer
version; recipes chain, so that a variant whose recipe for a stage equals an earlier
variant's finds that stage done there and takes it as it is.  Place, workers' number
in sharded stages and progress are in no recipe.
"""

from __future__ import annotations

from typing import Any

from pnabs.settings import Settings
from pnabs.store.atomic import digest

STAGES = (
    *("scan", "ingest", "train-positive", "difference"),
    *("train-negative", "abstract", "report"),
)

VERSIONS = {
    "ingest": 2,
    "train-positive": 1,
    "difference": 1,
    "train-negative": 1,
    "abstract": 1,
}
"""Raised when a stage's bytes change for the same settings and inputs."""


def recipe(stage: str, job: Settings) -> dict[str, Any]:
    """All of a job that a stage's results depend on, earlier stages' recipes included."""
    values: dict[str, Any]
    if stage == "ingest":
        values = {
            "seed": job.seed,
            "layout": job.dataset.layout,
            "ingest": job.ingest.model_dump(mode="json"),
        }
    elif stage == "train-positive":
        network = job.network.model_dump(mode="json", exclude={"negatives"})
        training = job.training.model_dump(mode="json", exclude={"losses": {"separation"}})
        values = {"network": network, "training": training, "after": recipe("ingest", job)}
    elif stage == "difference":
        values = {
            "difference": job.difference.model_dump(mode="json"),
            "iterations": job.abstract.iterations,
            "after": _positives(job),
        }
    elif stage == "train-negative":
        network = job.network.model_dump(mode="json", exclude={"positives"})
        training = job.training.model_dump(mode="json")
        values = {"network": network, "training": training, "after": recipe("difference", job)}
    elif stage == "abstract":
        values = {
            "abstract": job.abstract.model_dump(mode="json"),
            "difference": job.difference.model_dump(mode="json"),
            "after": _negatives(job) if job.abstract.negatives else _positives(job),
        }
    else:
        raise ValueError(f"stage {stage} keeps no records")
    return {"stage": stage, "version": VERSIONS[stage], **values}


def recipe_digest(stage: str, job: Settings) -> str:
    """A recipe as a short name; equal for variants that share the stage's results."""
    return digest(recipe(stage, job))


def fingerprint(stage: str, job: Settings, inputs: Any) -> str:
    """What a shard's record or a phase's checkpoint carries: recipe and inputs' digests."""
    return digest({"recipe": recipe(stage, job), "inputs": inputs})


def _positives(job: Settings) -> dict[str, Any]:
    return recipe("train-positive", job) if job.weights is None else _given(job)


def _negatives(job: Settings) -> dict[str, Any]:
    return recipe("train-negative", job) if job.weights is None else _given(job)


def _given(job: Settings) -> dict[str, Any]:
    # Given weights enter through the digests of their files, as inputs.
    return {"weights": "given", "after": recipe("ingest", job)}


def homes(variants: dict[str, Settings], stage: str) -> dict[str, str]:
    """The variant in whose folder each variant's results of a stage lie: the first with its recipe.

    Parameters
    ----------
    variants
        Name -> settings, in the job's order with `main` first.
    """
    first: dict[str, str] = {}
    out = {}
    for name, job in variants.items():
        out[name] = first.setdefault(recipe_digest(stage, job), name)
    return out
