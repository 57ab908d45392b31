"""Job files: what they need, what they may say, and how they fail."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from pnabs.settings import Settings
from pnabs.stages.errors import RefusedError
from pnabs.stages.identity import check_identity, given_weights
from pnabs.stages.job import JobError, load_job, with_overrides
from pnabs.stages.networks import check_networks
from pnabs.stages.plan import VERSIONS, homes, recipe_digest, stages_of

JOBS = Path(__file__).parents[2] / "jobs"

MINIMAL = "dataset: {root: data}\nout: runs/x\n"


def job_file(folder: Path, text: str) -> Path:
    path = folder / "job.yaml"
    path.write_text(text)
    return path


def test_a_job_needs_little(tmp_path: Path) -> None:
    job = load_job(job_file(tmp_path, MINIMAL))
    assert job.settings.training.epochs == 150
    assert job.settings.training.betas == (0.9, 0.999)
    assert job.settings.out.is_absolute()
    assert job.origins == {
        "dataset.root": f"{tmp_path / 'job.yaml'}:1",
        "out": f"{tmp_path / 'job.yaml'}:2",
    }


@pytest.mark.parametrize("path", sorted(JOBS.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_job_file_is_valid(path: Path) -> None:
    assert load_job(path).settings.out


def test_overrides_win_and_are_remembered(tmp_path: Path) -> None:
    path = job_file(tmp_path, MINIMAL + "training: {epochs: 7}\n")
    job = load_job(path, ["training.epochs=3", "dataset.categories=[chair, lamp]"], Path("o"))
    assert job.settings.training.epochs == 3
    assert job.settings.dataset.categories == ("chair", "lamp")
    assert job.origins["training.epochs"] == "--set"
    assert job.origins["out"] == "--out"


def test_the_papers_preset_is_below_what_the_file_says(tmp_path: Path) -> None:
    path = job_file(tmp_path, MINIMAL + "preset: paper\ntraining: {schedule: cosine}\n")
    settings = load_job(path).settings
    assert settings.network.channels == (4, 8, 16, 32, 64)
    assert settings.training.schedule == "cosine"


def test_the_papers_preset_has_its_numbers(tmp_path: Path) -> None:
    """Sections 3.5 and 4.1 of the paper, and what METHOD says where they are silent."""
    found = load_job(job_file(tmp_path, MINIMAL + "preset: paper\n")).settings
    training = found.training
    assert (training.learning_rate, training.encoder_learning_rate) == (1e-3, 1e-4)
    assert (training.betas, training.batch_size, training.epochs) == ((0.9, 0.999), 32, 150)
    assert (training.schedule, training.iterations, training.burn_in) == ("constant", 3, 0)
    assert (training.theta_scale, training.theta_translation) == (0.02, 0.02)
    assert (training.theta_rotation, training.symmetry_alpha) == (20, 0.3)
    augmented = (training.mirror_augment, training.turn, training.stretch, training.init_from)
    assert augmented == (False, 0, 0, None)
    weights = {"fit1": 1, "fit2": 1, "symmetry": 1, "regularisation": 1, "separation": 1}
    assert training.losses.model_dump() == weights | {"occupancy": 0}
    network = found.network
    assert (network.positives, network.negatives) == (12, 8)
    assert (network.channels, network.hidden) == ((4, 8, 16, 32, 64), 64)
    assert network.refine_input == "vector"
    assert found.difference.preprocess
    abstract = found.abstract
    assert (abstract.fit, abstract.postprocess, abstract.negatives) == (False, True, True)
    assert (abstract.iterations, abstract.debris) == (3, 0.01)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (MINIMAL + "training:\n  epoch: 3\n", r"line 4: unknown key training.epoch; .*epochs\?"),
        (MINIMAL + "training:\n  epochs: many\n", r"line 4: training.epochs: .*integer"),
        (MINIMAL + "traning: {}\n", r"line 3: unknown key traning; did you mean training\?"),
        (MINIMAL + "weights: {a: 1}\n", r"line 3: weights"),
        ("out: x\n", r"dataset is missing"),
        ("dataset: {root: d, layout: shapenet}\nout: x\n", r"line 1: dataset.layout: .*shapenet-v"),
        ("[1, 2]\n", r"a job file is a mapping"),
        ("a: {b\n", r"not valid YAML"),
        ("dataset: !!python/object/apply:os.system [id]\nout: x\n", r"not valid YAML"),
        (MINIMAL + "variants: {a: {}}\n", r"one named `main`"),
        (MINIMAL + "variants: {main: {}, a/b: {}}\n", r"use letters"),
        (
            MINIMAL + "variants: {main: {}, b: {seed: 3}}\n",
            r"line 3: variants.b: seed: variants",
        ),
        (MINIMAL + "variants: {main: {}, b: {abstract.x: 3}}\n", r"variants.b: unknown key"),
        (MINIMAL + "variants: {main: {}, b: {preset: x}}\n", r"line 3: variants.b: preset: there"),
    ],
)
def test_errors_name_key_and_line(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(JobError, match=says):
        load_job(job_file(tmp_path, text))


@pytest.mark.parametrize("override", ["training.epochs", "=3", "training.epochs=[", "a.b=1"])
def test_bad_overrides(tmp_path: Path, override: str) -> None:
    with pytest.raises(JobError, match="--set"):
        load_job(job_file(tmp_path, MINIMAL), [override])


def test_a_missing_job_file(tmp_path: Path) -> None:
    with pytest.raises(JobError, match="can't read the job file"):
        load_job(tmp_path / "none.yaml")


@pytest.mark.parametrize(
    ("override", "changed"),
    [
        ("runtime.actors=7", set()),
        ("report.pictures=1", set()),
        ("abstract.debris=0.02", {"abstract"}),
        ("training.losses.separation=0", {"train-negative", "abstract"}),
        ("network.negatives=5", {"train-negative", "abstract"}),
        ("difference.preprocess=false", {"difference", "train-negative", "abstract"}),
        ("training.epochs=3", set(VERSIONS) - {"ingest"}),
        ("ingest.surface_points=99", set(VERSIONS)),
        ("seed=5", set(VERSIONS)),
    ],
)
def test_settings_change_the_stages_that_depend_on_them(
    tmp_path: Path, override: str, changed: set[str]
) -> None:
    path = job_file(tmp_path, MINIMAL)
    before, after = load_job(path).settings, load_job(path, [override]).settings
    stages = {s for s in VERSIONS if recipe_digest(s, before) != recipe_digest(s, after)}
    assert stages == changed


def test_variants_share_what_they_have_in_common(tmp_path: Path) -> None:
    text = MINIMAL + (
        "variants:\n  main: {}\n  positives-only: {abstract.negatives: false}\n"
        "  no-separation: {training.losses.separation: 0}\n"
    )
    variants = load_job(job_file(tmp_path, text)).variants()
    assert list(variants) == ["main", "positives-only", "no-separation"]
    assert set(homes(variants, "train-positive", {}).values()) == {"main"}
    assert homes(variants, "train-negative", {})["no-separation"] == "no-separation"
    assert homes(variants, "abstract", {}) == {name: name for name in variants}


def test_variants_share_only_with_those_that_do_the_stage(tmp_path: Path) -> None:
    text = MINIMAL + (
        "variants:\n  main: {abstract.negatives: false}\n  given: {weights: shipped}\n"
        "  full: {}\n  again: {abstract.debris: 0.1}\n"
    )
    job = load_job(job_file(tmp_path, text))
    variants, given = job.variants(), given_weights(job)
    assert homes(variants, "train-positive", given)["full"] == "main"
    for stage in ("difference", "train-negative"):
        found = homes(variants, stage, given)
        assert (found["full"], found["again"]) == ("full", "full")


@pytest.mark.parametrize("key", ["weights", "training.init_from"])
def test_variants_with_other_weights_share_nothing(tmp_path: Path, key: str) -> None:
    for name in "ab":
        (tmp_path / name).mkdir()
        for module in ("positive", "negative"):
            (tmp_path / name / f"{module}.safetensors").write_text(f"{name} {module}")
    # The same content in another place is the same, but training names the place.
    shutil.copytree(tmp_path / "a", tmp_path / "c")
    lines = [f"  {name}: {{{key}: {tmp_path / name}}}\n" for name in "abc"]
    job = load_job(job_file(tmp_path, MINIMAL + "variants:\n  main: {}\n" + "".join(lines)))
    variants, given = job.variants(), given_weights(job)
    stages = stages_of(variants["a"])[1:]
    assert stages == (("abstract",) if key == "weights" else tuple(VERSIONS)[1:])
    for stage in stages:
        found = homes(variants, stage, given)
        assert (found["a"], found["b"]) == ("a", "b")
        assert found["c"] == ("a" if key == "weights" else "c")


def identity_of(path: Path) -> dict[str, object]:
    settings = load_job(path).settings.model_dump(mode="json")
    return {"settings": settings, "stage_versions": dict(VERSIONS), "weights": {}}


def test_changed_settings_are_refused_with_a_diff(tmp_path: Path) -> None:
    path = job_file(tmp_path, MINIMAL)
    identity = identity_of(path)
    check_identity(identity, load_job(path).settings, accept=False)
    check_identity(identity, load_job(path, ["runtime.actors=3"]).settings, accept=False)
    changed = load_job(path, ["abstract.debris=0.5"]).settings
    with pytest.raises(RefusedError, match=r"abstract.debris: 0.01 -> 0.5\n.*redone: abstract\."):
        check_identity(identity, changed, accept=False)
    check_identity(identity, changed, accept=True)


def test_a_newer_stage_is_refused(tmp_path: Path) -> None:
    path = job_file(tmp_path, MINIMAL)
    identity = identity_of(path)
    identity["stage_versions"] = VERSIONS | {"abstract": 0}
    with pytest.raises(RefusedError, match="stage abstract: version 0 -> "):
        check_identity(identity, load_job(path).settings, accept=False)


def test_the_layout_of_the_folder_cannot_change(tmp_path: Path) -> None:
    path = job_file(tmp_path, MINIMAL)
    changed = load_job(path, ["dataset.shard_size=8"]).settings
    with pytest.raises(RefusedError, match="shard_size"):
        check_identity(identity_of(path), changed, accept=True)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a: &a [*a]\n", "not valid YAML|a mapping|unknown key"),
        (MINIMAL + "seed: 1\nseed: 2\n", r"line 4: seed stands in line 3 already"),
        ("dataset: {root: d, categories: [03001627]}\nout: x\n", "quote synsets"),
        ("dataset: {root: d}\nout: d/run\n", r"line 2: out lies inside dataset.root"),
        (MINIMAL + "variants:\n  main: {}\n  b: {abstract.x: 3}\n", r"line 5: variants.b: unknown"),
        (MINIMAL + "variants: {main: {}, v1.0: {}}\n", r"variant 'v1.0': use letters"),
        (
            MINIMAL + "variants: {main: {}, no: {}}\n",
            r"line 3: .* key no as text: put it",
        ),
        (
            MINIMAL + "variants: {main: {}, b: {preset: [paper]}}\n",
            r"b: preset: there are best and",
        ),
        (MINIMAL + "variants: {main: {}, b: {report.pictures: 1}}\n", "share .* and report"),
        (MINIMAL + "training.turn: 3\n", r"line 3: unknown key training.turn; .*{turn: ...}"),
        (MINIMAL + "training: {betas: [0.9, 1]}\n", r"line 3: training.betas.1: .* less than 1"),
        (
            MINIMAL + "training: {losses: {fit1: 0, fit2: 0, symmetry: 0, occupancy: 0}}\n",
            "nothing is trained",
        ),
    ],
)
def test_mistakes_are_met_when_the_job_is_read(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(JobError, match=says):
        load_job(job_file(tmp_path, text))


def test_one_category_needs_no_list(tmp_path: Path) -> None:
    job = load_job(job_file(tmp_path, "dataset: {root: d, categories: chair}\nout: x\n"))
    assert job.settings.dataset.categories == ("chair",)


PLUS = """preset: paper
training:
  epochs: 9
  losses: {separation: 3}
variants:
  main: {}
  plus: {preset: best}
  fitted: {preset: best, abstract.fit: true, training.burn_in: 2}
"""


def test_a_variant_takes_a_preset_of_its_own(tmp_path: Path) -> None:
    job = load_job(job_file(tmp_path, MINIMAL + PLUS), ["abstract.fit=false"])
    best = load_job(job_file(tmp_path, MINIMAL)).settings
    variants = job.variants()
    assert variants["main"].network.hidden == 64
    plus = variants["plus"]
    assert plus.network == best.network
    assert plus.training.losses.occupancy == best.training.losses.occupancy
    # What the file and --set say stands above either preset, the variant's own words above all.
    assert (plus.training.epochs, plus.training.losses.separation) == (9, 3)
    assert not plus.abstract.fit
    assert plus.abstract.iterations == best.abstract.iterations
    assert variants["fitted"].abstract.fit
    assert variants["fitted"].training.burn_in == 2
    # Run folders keep the values, whatever later versions' presets are.
    assert job.settings.variants["plus"]["training.schedule"] == "cosine"


def test_a_variant_may_take_the_papers_preset(tmp_path: Path) -> None:
    text = MINIMAL + "variants: {main: {}, paper: {preset: paper}}\n"
    job = load_job(job_file(tmp_path, text))
    paper = load_job(job_file(tmp_path, MINIMAL + "preset: paper\n")).settings
    found = job.variants()["paper"]
    for group in ("network", "training", "difference", "abstract"):
        assert getattr(found, group) == getattr(paper, group)


def test_a_groups_override_stands_above_a_variants_preset(tmp_path: Path) -> None:
    text = MINIMAL + "preset: paper\nvariants: {main: {}, plus: {preset: best}}\n"
    job = load_job(job_file(tmp_path, text), ["training.losses={occupancy: 2, separation: 1}"])
    assert job.variants()["plus"].training.losses.occupancy == 2


def test_a_variants_group_is_merged(tmp_path: Path) -> None:
    text = MINIMAL + "training: {batch_size: 4}\nvariants: {main: {}, b: {training: {epochs: 3}}}\n"
    variant = load_job(job_file(tmp_path, text)).variant("b")
    assert variant.training.epochs == 3
    assert variant.training.batch_size == 4


def test_an_empty_group_says_nothing(tmp_path: Path) -> None:
    text = "variants: {main: {}, paper: {preset: paper}}\n"
    plain = load_job(job_file(tmp_path, MINIMAL + text)).variants()["paper"]
    found = load_job(job_file(tmp_path, MINIMAL + "abstract: {}\n" + text)).variants()["paper"]
    assert found == plain
    assert not found.abstract.fit


def test_what_a_variant_says_last_stands_whatever_the_order_of_keys(tmp_path: Path) -> None:
    """run.json has its keys sorted: groups come before the dotted keys into them."""
    text = "variants: {main: {}, b: {preset: paper, training: {schedule: cosine, turn: 3}}}\n"
    job = load_job(job_file(tmp_path, MINIMAL + text), ["variants.b.training.turn=5"])
    training = job.variant("b").training
    assert (training.schedule, training.turn, training.burn_in) == ("cosine", 5, 0)
    stored = json.loads(json.dumps(job.settings.model_dump(mode="json"), sort_keys=True))
    again = with_overrides(replace(job, settings=Settings.model_validate(stored)), [])
    assert again.variants() == job.variants()
    again = with_overrides(again, ["variants.b.training.turn=7"])
    assert again.variant("b").training.turn == 7


def test_a_groups_override_leaves_a_variants_preset_its_other_settings(tmp_path: Path) -> None:
    text = MINIMAL + "variants: {main: {}, b: {preset: paper}}\n"
    training = load_job(job_file(tmp_path, text), ["training={epochs: 3}"]).variant("b").training
    assert (training.epochs, training.schedule) == (3, "constant")


def test_a_variants_paths_are_absolute(tmp_path: Path) -> None:
    text = "variants: {main: {weights: shipped}, a: {weights: w}, b: {training: {init_from: w}}}\n"
    variants = load_job(job_file(tmp_path, MINIMAL + text)).settings.variants
    here = str(Path("w").absolute())
    assert variants == {
        "main": {"weights": "shipped"},
        "a": {"weights": here},
        "b": {"training.init_from": here},
    }


def test_weights_that_nothing_reads_are_no_matter(tmp_path: Path) -> None:
    (tmp_path / "positive.safetensors").write_text("a")
    (tmp_path / "negative.safetensors").write_text("b")
    for key in ("weights", "training.init_from"):
        changes = [f"{key}={tmp_path}", "abstract.negatives=false"]
        given = given_weights(load_job(job_file(tmp_path, MINIMAL), changes))
        assert [name.rpartition("/")[2] for name in given] == ["positive"]


def test_aliases_give_what_they_stand_for(tmp_path: Path) -> None:
    text = MINIMAL + "training: &t {epochs: 3}\nvariants: {main: {}, b: {training: {<<: *t}}}\n"
    assert load_job(job_file(tmp_path, text)).variant("b").training.epochs == 3


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "training: {batch_size: 2, workers: 3}\n",
            "line 3: training.batch_size: 2 is less than a shape for each of the 3 workers",
        ),
        (
            "training: {init_from: shipped}\nvariants: {main: {}, b: {network.positives: 5}}\n",
            r"line 3: training.init_from: .* network.positives is 5, theirs 12 \(variant b\)",
        ),
        ("network: {start: octants}\n", "line 3: network.start: octants needs .*positives is 12"),
        (
            "network: {positives: 8, negatives: 4, start: octants}\n",
            "line 3: network.start: octants needs .*negatives is 4",
        ),
        (
            "training: {init_from: shipped}\nnetwork: {negatives: 4}\n",
            "line 3: training.init_from: .* network.negatives is 4, theirs 8",
        ),
        (
            "training: {init_from: shipped}\n"
            "variants: {main: {}, b: {training.init_from: /nowhere}}\n",
            "line 4: variants.b: training.init_from: there is no positive.safetensors in /nowhere",
        ),
    ],
)
def test_networks_that_cannot_be_are_refused_at_once(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(JobError, match=says):
        check_networks(load_job(job_file(tmp_path, MINIMAL + text)))


def test_networks_that_are_not_trained_may_be_anything(tmp_path: Path) -> None:
    text = "weights: shipped\nnetwork: {negatives: 4, start: octants}\n"
    check_networks(load_job(job_file(tmp_path, MINIMAL + text)))


def test_a_preset_is_settled_once_a_job_is_read(tmp_path: Path) -> None:
    with pytest.raises(JobError, match="--set preset: its values are settled already"):
        with_overrides(load_job(job_file(tmp_path, MINIMAL)), ["preset=paper"])


def test_missing_weights_are_named(tmp_path: Path) -> None:
    job = load_job(job_file(tmp_path, MINIMAL + "weights: nowhere\n"))
    with pytest.raises(JobError, match=r"line 3: weights: there is no positive.safetensors"):
        check_networks(job)
