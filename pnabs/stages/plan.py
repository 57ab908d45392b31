"""What each stage's results depend on, as fingerprints.

A stage's *recipe* holds the settings that can change its results and its integer
version; recipes chain, so that a variant whose recipe for a stage equals an earlier
variant's finds that stage done there and takes it as it is.  Place, workers' number
in sharded stages and progress are in no recipe.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pnabs.settings import Settings
from pnabs.store.atomic import canonical_json, digest

STAGES = (
    *("scan", "ingest", "train-positive", "difference"),
    *("train-negative", "abstract", "report"),
)

MODULES = ("positive", "negative")

VERSIONS = {
    "ingest": 4,
    "train-positive": 2,
    "difference": 3,
    "train-negative": 3,
    "abstract": 6,
}
"""Raised when a stage's bytes change for the same settings and inputs."""


def stages_of(job: Settings) -> tuple[str, ...]:
    """The stages with records that a job goes through, in order."""
    if job.weights is not None:
        return ("ingest", "abstract")
    if not job.abstract.negatives:
        return ("ingest", "train-positive", "abstract")
    return tuple(VERSIONS)


def recipe(stage: str, job: Settings, versions: Mapping[str, int] | None = None) -> dict[str, Any]:
    """All of a job that a stage's results depend on, earlier stages' recipes included.

    Parameters
    ----------
    versions
        The stages' versions; this program's when None.
    """
    versions = VERSIONS if versions is None else versions
    values: dict[str, Any]
    if stage == "ingest":
        values = {
            "seed": job.seed,
            "layout": job.dataset.layout,
            "shard_size": job.dataset.shard_size,
            "ingest": job.ingest.model_dump(mode="json"),
        }
    elif stage == "train-positive":
        network = job.network.model_dump(mode="json", exclude={"negatives"})
        training = job.training.model_dump(mode="json", exclude={"losses": {"separation"}})
        before = recipe("ingest", job, versions)
        values = {"network": network, "training": training, "after": before}
    elif stage == "difference":
        values = {
            "difference": job.difference.model_dump(mode="json"),
            "iterations": job.abstract.iterations,
            "after": _positives(job, versions),
        }
    elif stage == "train-negative":
        network = job.network.model_dump(mode="json", exclude={"positives"})
        training = job.training.model_dump(mode="json")
        before = recipe("difference", job, versions)
        values = {"network": network, "training": training, "after": before}
    elif stage == "abstract":
        networks = _negatives if job.abstract.negatives else _positives
        values = {
            "abstract": job.abstract.model_dump(mode="json"),
            "difference": job.difference.model_dump(mode="json"),
            "after": networks(job, versions),
        }
    else:
        raise ValueError(f"stage {stage} keeps no records")
    return {"stage": stage, "version": versions.get(stage), **values}


def recipe_digest(stage: str, job: Settings, versions: Mapping[str, int] | None = None) -> str:
    """A recipe as a short name; equal for variants that share the stage's results."""
    return digest(recipe(stage, job, versions))


def fingerprint(recipe: str, inputs: Any) -> str:
    """What a shard's record or a phase's checkpoint carries.

    Parameters
    ----------
    recipe
        `recipe_digest` of the stage.
    inputs
        Digests of what the result is made from.
    """
    content = inputs if isinstance(inputs, str) else canonical_json(inputs).decode()
    return digest(f"{recipe}\n{content}".encode())


def _positives(job: Settings, versions: Mapping[str, int]) -> dict[str, Any]:
    trained = job.weights is None
    return recipe("train-positive", job, versions) if trained else _given(job, versions)


def _negatives(job: Settings, versions: Mapping[str, int]) -> dict[str, Any]:
    trained = job.weights is None
    return recipe("train-negative", job, versions) if trained else _given(job, versions)


def _given(job: Settings, versions: Mapping[str, int]) -> dict[str, Any]:
    # Given weights enter through the digests of their files, as inputs.
    return {"weights": "given", "after": recipe("ingest", job, versions)}


def homes(variants: Mapping[str, Settings], stage: str, given: Mapping[str, str]) -> dict[str, str]:
    """The variant in whose folder each variant's results of a stage lie.

    It is the first that does the stage with the same recipe and the same given weights; a variant
    that doesn't do the stage has its own.

    Parameters
    ----------
    variants
        Name -> settings, in the run folder's order with `main` first.
    given
        Digests of given weights, as `identity.given_weights` has them.
    """
    first: dict[tuple[str, tuple[str | None, ...]], str] = {}
    out = {}
    for name, job in variants.items():
        out[name] = name
        if stage in stages_of(job):
            key = recipe_digest(stage, job), given_to(stage, name, given)
            out[name] = first.setdefault(key, name)
    return out


def given_to(stage: str, variant: str, given: Mapping[str, str]) -> tuple[str | None, ...]:
    """Digests of the given weights that a variant's results of a stage depend on."""
    if stage == "ingest":
        return ()
    modules = MODULES if stage in ("train-negative", "abstract") else MODULES[:1]
    return tuple(
        given.get(f"{variant}/{use}{module}") for use in ("", "init_from/") for module in modules
    )
