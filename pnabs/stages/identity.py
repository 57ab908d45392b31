"""Whether a run folder's past and the present job fit together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from pnabs.settings import Settings
from pnabs.stages.errors import RefusedError
from pnabs.stages.job import Job
from pnabs.stages.plan import MODULES, VERSIONS, given_to, homes, recipe_digest, stages_of
from pnabs.store.atomic import file_digest

FIXED = ("dataset.layout", "dataset.shard_size")
"""Settings that the whole run folder is laid out by."""

HARMLESS = (
    *("runtime.", "report.", "out", "dataset.root", "dataset.limit", "dataset.categories"),
    *("dataset.split", "dataset.test_share", "dataset.val_share"),
)
"""Place and looks; what the choice of models changes, the catalogue's comparison tells."""


def check_identity(identity: dict[str, Any] | None, job: Settings, *, accept: bool) -> None:
    """Compare run.json with the job.

    Raises
    ------
    RefusedError
        When settings or stage versions that affect results differ and `accept` is
        False, or the folder's layout would have to change; shows what differs and
        which stages would be redone.
    """
    if identity is None:
        return
    before = dict(_flat(identity["settings"]))
    now = dict(_flat(job.model_dump(mode="json")))
    differences = [
        (key, before.get(key), now.get(key))
        for key in sorted(before.keys() | now.keys())
        if before.get(key) != now.get(key) and not key.startswith(HARMLESS)
    ]
    lines = [f"  {key}: {old!r} -> {new!r}" for key, old, new in differences]
    fixed = [key for key, _, _ in differences if key in FIXED]
    if fixed:
        raise RefusedError(
            "the run folder is laid out by settings that now differ:\n"
            + "\n".join(lines)
            + f"\nSet {', '.join(fixed)} back, or give another folder with --out."
        )
    lines += [
        f"  stage {stage}: version {identity['stage_versions'].get(stage)} -> {version}"
        for stage, version in VERSIONS.items()
        if identity["stage_versions"].get(stage) != version
    ]
    lines += [
        f"  weights {name}: other content than before"
        for name, content in sorted(given_weights(Job(job, {}, Path("run.json"))).items())
        if identity["weights"].get(name, content) != content
    ]
    if not lines or accept:
        return
    redone = _redone(identity, Job(job, {}, Path("run.json")))
    raise RefusedError(
        "the job differs from what this run folder was made with:\n"
        + "\n".join(lines)
        + f"\nStages to be redone: {', '.join(redone) or 'only the report'}. --accept-changes does "
        "that; --out gives another folder."
    )


def given_weights(job: Job) -> dict[str, str]:
    """Digests of the weights that a job gives: path in the run folder's terms -> SHA-256.

    `<variant>/<module>` are those it predicts with, `<variant>/init_from/<module>` those that
    training begins with.
    """
    given = {}
    for name, settings in job.variants().items():
        folder = settings.weights_folder
        for module in MODULES[: 1 + settings.abstract.negatives]:
            if folder is not None:
                key, path = f"{name}/{module}", folder / f"{module}.safetensors"
            elif (init := settings.training.init_weights(module)) is not None:
                key, path = f"{name}/init_from/{module}", init
            else:
                continue
            if path.is_file():
                given[key] = file_digest(path)["sha256"]
    return given


def _redone(identity: dict[str, Any], job: Job) -> list[str]:
    """Stages in which something is to be done again, in their order."""
    try:
        before = Settings.model_validate(identity["settings"])
    except ValidationError:
        return list(VERSIONS)
    past = Job(before, {}, Path("run.json"))
    given = given_weights(job)
    done = _results(past, identity, {**given, **identity["weights"]}, identity["stage_versions"])
    wanted = _results(job, identity, given, VERSIONS)
    changed = {stage for stage, *_ in wanted - done}
    return [stage for stage in VERSIONS if stage in changed]


def _results(
    job: Job, identity: dict[str, Any], given: Mapping[str, str], versions: Mapping[str, int]
) -> set[tuple[Any, ...]]:
    """What a job's stages leave: the stage, the variant with whom it lies, what it depends on."""
    variants = job.in_order_of(identity).variants()
    return {
        (
            stage,
            homes(variants, stage, given)[name],
            recipe_digest(stage, settings, versions),
            given_to(stage, name, given),
        )
        for name, settings in variants.items()
        for stage in stages_of(settings)
    }


def _flat(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, dict) and value:
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value
