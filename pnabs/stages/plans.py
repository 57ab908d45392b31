"""The shards of each sharded stage, and what their results depend on.

Apart from the stages themselves, so that who only counts loads no geometry.
"""

from __future__ import annotations

from pathlib import Path

from pnabs.stages.context import Context
from pnabs.stages.phases import weights_path
from pnabs.stages.plan import fingerprint, recipe_digest
from pnabs.stages.sharded import ShardPlan
from pnabs.stages.shards import INPUTS, MODELS
from pnabs.store.atomic import file_digest

SPLITS = ("train", "val")
"""Only models that train or validate have a stored difference volume."""


def ingest(context: Context) -> list[ShardPlan]:
    """Every shard with what its result depends on: settings, and its models' files."""
    recipe, shards = recipe_digest("ingest", context.job), context.shards
    inputs = shards.digests(INPUTS)
    return [
        ShardPlan(name, fingerprint(recipe, content), models)
        for name, content, models in zip(shards.names, inputs, shards.models, strict=True)
    ]


def difference(context: Context, variant: str) -> list[ShardPlan]:
    """Every shard with training models, and what its result depends on."""
    recipe, shards = recipe_digest("difference", context.variants[variant]), context.shards
    weights = file_digest(weights_path(context, variant, "positive"))["sha256"]
    ingested = context.run.ledger.index("ingest")
    out = []
    for number, content in enumerate(shards.digests(MODELS)):
        shard = shards.names[number]
        entry = ingested.get(shard)
        models = 0 if entry is None else len(shards.chosen(number, SPLITS, dict(entry.fallen)))
        if entry is not None and models:
            inputs = {"weights": weights, "ingest": entry.digest, "models": content}
            out.append(ShardPlan(shard, fingerprint(recipe, inputs), models))
    return out


def abstract(context: Context, variant: str) -> list[ShardPlan]:
    """Every ingested shard and what its abstractions depend on."""
    recipe, shards = recipe_digest("abstract", context.variants[variant]), context.shards
    weights = [
        file_digest(path)["sha256"] for path in weights_of(context, variant) if path is not None
    ]
    ingested = context.run.ledger.index("ingest")
    out = []
    # The metrics' rows name the splits.
    for number, content in enumerate(shards.digests(MODELS)):
        shard = shards.names[number]
        entry = ingested.get(shard)
        if entry is not None:
            inputs = {"weights": weights, "ingest": entry.digest, "models": content}
            models = entry.models - len(entry.fallen)
            out.append(ShardPlan(shard, fingerprint(recipe, inputs), models))
    return out


def weights_of(context: Context, variant: str) -> tuple[Path, Path | None]:
    """The weights that a variant's abstractions are predicted with, positive and negative.

    Raises
    ------
    RunError
        When they aren't there yet.
    """
    positive = weights_path(context, variant, "positive")
    if not context.variants[variant].abstract.negatives:
        return positive, None
    return positive, weights_path(context, variant, "negative")
