"""What a changed job, dataset or version asks for: said, and then done, and nothing else."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from pnabs.dataset.samples import write_collection
from pnabs.settings import Settings
from pnabs.stages.errors import RefusedError
from pnabs.stages.identity import check_identity, given_weights
from pnabs.stages.job import Job, load_job
from pnabs.stages.options import Options
from pnabs.stages.plan import VERSIONS
from pnabs.stages.progress import Reporter
from pnabs.stages.run import run_job
from pnabs.stages.status import stored_context
from pnabs.store.run import RunFolder

ALL = ("ingest", "train-positive", "difference", "train-negative", "abstract")


def job(changes: dict[str, Any] | None = None) -> Settings:
    tree: dict[str, Any] = {"dataset": {"root": "meshes"}, "out": "run"}
    for key, value in (changes or {}).items():
        *parents, last = key.split(".")
        place = tree
        for parent in parents:
            place = place.setdefault(parent, {})
        place[last] = value
    return Settings.model_validate(tree)


def identity(settings: Settings, **changes: Any) -> dict[str, Any]:
    value = {
        "settings": settings.model_dump(mode="json"),
        "stage_versions": VERSIONS,
        "weights": given_weights(Job(settings, {}, Path("job.yaml"))),
    }
    return {**value, **changes}


def redone(before: dict[str, Any], settings: Settings) -> tuple[str, tuple[str, ...]]:
    """The message of the refusal, and the stages that it names."""
    with pytest.raises(RefusedError) as refused:
        check_identity(before, settings, accept=False)
    check_identity(before, settings, accept=True)
    assert refused.value.exit_code == 4
    text = str(refused.value)
    stages = text.partition("Stages to be redone: ")[2].partition(".")[0]
    return text, () if stages == "only the report" else tuple(stages.split(", "))


@pytest.mark.parametrize(
    ("key", "value", "stages"),
    [
        ("seed", 1, ALL),
        ("ingest.surface_points", 77, ALL),
        ("network.hidden", 77, ALL[1:]),
        ("network.positives", 7, ALL[1:]),
        ("training.epochs", 77, ALL[1:]),
        ("network.negatives", 7, ALL[3:]),
        ("training.losses.separation", 0.7, ALL[3:]),
        ("difference.points_per_voxel", 7, ALL[2:]),
        ("abstract.debris", 0.7, ALL[4:]),
    ],
)
def test_a_changed_setting_redoes_what_depends_on_it(
    key: str, value: object, stages: tuple[str, ...]
) -> None:
    text, named = redone(identity(job()), job({key: value}))
    assert named == stages
    (line,) = [line for line in text.splitlines() if key in line]
    assert line.endswith(f"-> {value!r}")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("runtime.deadline", 7.0),
        ("report.pictures", 1),
        ("dataset.root", "elsewhere"),
        ("out", "x"),
    ],
)
def test_place_and_looks_may_change(key: str, value: object) -> None:
    check_identity(identity(job()), job({key: value}), accept=False)


@pytest.mark.parametrize("key", ["dataset.layout", "dataset.shard_size"])
def test_what_the_folder_is_laid_out_by_cannot_change(key: str) -> None:
    changed = job({key: "folder" if "layout" in key else 7})
    with pytest.raises(RefusedError, match=f"Set {key} back, or give another folder"):
        check_identity(identity(job()), changed, accept=True)


def test_what_lies_with_a_variant_that_goes_is_redone() -> None:
    shared = {"training.batch_size": 4}
    variants = {"main": {}, "a": shared, "b": {**shared, "abstract.debris": 0.1}}
    before = identity(job({"variants": variants}), variants=list(variants))
    _, named = redone(before, job({"variants": {"main": {}, "b": variants["b"]}}))
    assert named == ALL[1:4]
    _, named = redone(before, job({"variants": {"main": {}, "a": shared}}))
    assert named == ()


def test_variants_keep_their_order(tmp_path: Path) -> None:
    """What variants share lies with the first of them, whatever the job file's order becomes."""
    samples, out, file = tmp_path / "samples", tmp_path / "run", tmp_path / "job.yaml"
    write_collection(samples, per_category=1, categories=["chair"])

    def after(*names: str) -> tuple[list[str], str]:
        variants = {name: {"abstract.debris": 0.02} for name in names}
        tree = {"dataset": {"root": str(samples)}, "out": str(out)}
        file.write_text(json.dumps({**tree, "variants": {"main": {}, **variants}}))
        run_job(load_job(file), Options(stages=("scan",)), Reporter(quiet=True))
        context = stored_context(RunFolder(out), Reporter(quiet=True))
        return list(context.variants), context.home("abstract", "alpha").name

    assert after("zeta", "alpha") == (["main", "zeta", "alpha"], "zeta")
    assert after("alpha", "beta", "zeta") == (["main", "zeta", "alpha", "beta"], "zeta")
    assert after("beta", "alpha") == (["main", "alpha", "beta"], "alpha")


@pytest.mark.parametrize("stage", VERSIONS)
def test_a_newer_version_of_a_stage_redoes_what_depends_on_it(stage: str) -> None:
    older = {**VERSIONS, stage: VERSIONS[stage] - 1}
    text, named = redone(identity(job(), stage_versions=older), job())
    assert f"  stage {stage}: version {VERSIONS[stage] - 1} -> {VERSIONS[stage]}" in text
    assert named == ALL[ALL.index(stage) :]


def test_stages_that_a_job_leaves_out_are_not_named() -> None:
    before, after = (
        job({"abstract.negatives": False}),
        job({"abstract.negatives": False, "seed": 1}),
    )
    _, named = redone(identity(before), after)
    assert named == ("ingest", "train-positive", "abstract")


def test_other_weights_in_the_same_place_are_noticed(tmp_path: Path) -> None:
    for module in ("positive", "negative"):
        (tmp_path / f"{module}.safetensors").write_bytes(b"weights")
    given = job({"weights": str(tmp_path)})
    before = identity(given)
    check_identity(before, given, accept=False)
    (tmp_path / "negative.safetensors").write_bytes(b"others")
    text, named = redone(before, given)
    assert "  weights main/negative: other content than before" in text
    assert named == ("abstract",)
