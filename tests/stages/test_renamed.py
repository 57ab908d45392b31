"""Settings that were renamed: read by their old names with a warning, stored by their new ones."""

from __future__ import annotations

from pathlib import Path

import pytest

import pnabs
from pnabs.renamed import RENAMED, with_new_names
from pnabs.settings import Abstract, Settings, Training
from pnabs.stages.job import Job, JobError, load_job, with_overrides
from pnabs.stages.plan import VERSIONS, recipe_digest
from tests.docs.test_pages import settings_of

MINIMAL = "dataset: {root: data}\nout: runs/x\n"
PRICE = "abstract.price is called abstract.min_gain now; rename it"
BEGIN = "training.begin is called training.init_from now; rename it"


def read(folder: Path, text: str, *overrides: str) -> tuple[Job, list[str]]:
    """The job of a file, and what it warns of."""
    path = folder / "job.yaml"
    path.write_text(MINIMAL + text)
    said: list[str] = []
    return load_job(path, overrides, say=said.append), said


def test_old_names_lead_to_settings_that_there_are() -> None:
    known = settings_of(Settings)
    assert set(RENAMED.values()) <= known
    assert not known & set(RENAMED)


def test_old_names_in_a_file_are_read_with_a_warning(tmp_path: Path) -> None:
    text = "abstract:\n  boxes: 7\n  price: 0.02\ntraining: {begin: shipped}\n"
    job, said = read(tmp_path, text)
    file = tmp_path / "job.yaml"
    assert said == [f"{file}, line 5: {PRICE}", f"{file}, line 6: {BEGIN}"]
    assert (job.settings.abstract.boxes, job.settings.abstract.min_gain) == (7, 0.02)
    assert job.settings.training.init_from == "shipped"
    assert job.origins["abstract.min_gain"] == f"{file}:5"
    assert "abstract.price" not in job.origins
    new, silent = read(tmp_path, text.replace("price", "min_gain").replace("begin", "init_from"))
    assert silent == []
    assert new.settings == job.settings
    assert new.origins == job.origins
    for stage in VERSIONS:
        assert recipe_digest(stage, new.settings) == recipe_digest(stage, job.settings)


def test_without_a_taker_the_warning_is_pythons(tmp_path: Path) -> None:
    path = tmp_path / "job.yaml"
    path.write_text(MINIMAL + "abstract: {price: 0.02}\n")
    with pytest.warns(FutureWarning, match=f"line 3: {PRICE}") as found:
        load_job(path)
    assert [item.filename for item in found] == [__file__]


@pytest.mark.parametrize("override", ["abstract.price=0.02", "abstract={price: 0.02}"])
def test_old_names_in_overrides(tmp_path: Path, override: str) -> None:
    job, said = read(tmp_path, "abstract: {min_gain: 0.5, boxes: 7}\n", override)
    assert said == [f"--set {override}: {PRICE}"]
    assert (job.settings.abstract.boxes, job.settings.abstract.min_gain) == (7, 0.02)
    assert job.origins["abstract.min_gain"] == "--set"
    assert "abstract.price" not in job.origins
    said.clear()
    assert with_overrides(job, [override], said.append).settings == job.settings
    assert said == [f"--set {override}: {PRICE}"]


def test_an_override_by_the_new_name_replaces_the_files_old_one(tmp_path: Path) -> None:
    job, said = read(tmp_path, "abstract: {price: 0.5}\n", "abstract.min_gain=0.02")
    assert [line.partition(": ")[2] for line in said] == [PRICE]
    assert job.settings.abstract.min_gain == 0.02


@pytest.mark.parametrize(
    "changes", ["{abstract.price: 0.02}", "{abstract: {price: 0.02}}", "{abstract.min_gain: 0.02}"]
)
def test_old_names_in_variants(tmp_path: Path, changes: str) -> None:
    text = f"abstract: {{min_gain: 0.5}}\nvariants:\n  main: {{}}\n  b: {changes}\n"
    job, said = read(tmp_path, text)
    old = "price" in changes
    assert said == ([f"{tmp_path / 'job.yaml'}, line 6: {PRICE}"] if old else [])
    assert job.settings.variants == {"main": {}, "b": {"abstract.min_gain": 0.02}}
    assert job.variant("b").abstract.min_gain == 0.02
    override = "variants.b.abstract.price=0.03"
    job, said = read(tmp_path, text, override)
    assert said[-1] == f"--set {override}: {PRICE}"
    assert job.variant("b").abstract.min_gain == 0.03


def test_an_aliased_old_name_is_told_once_and_read_everywhere(tmp_path: Path) -> None:
    text = "training: &t {begin: shipped}\nvariants: {main: {}, b: {training: *t}}\n"
    job, said = read(tmp_path, text)
    assert said == [f"{tmp_path / 'job.yaml'}, line 3: {BEGIN}"]
    assert {one.training.init_from for one in job.variants().values()} == {"shipped"}
    assert job.settings.variants["b"] == {"training.init_from": "shipped"}


def test_a_wrong_value_by_an_old_name_names_its_line(tmp_path: Path) -> None:
    with pytest.raises(JobError, match=r"line 4: abstract.min_gain: .* \(got 2\)"):
        read(tmp_path, "abstract:\n  price: 2\n")


@pytest.mark.parametrize(
    ("text", "overrides", "says"),
    [
        ("abstract:\n  min_gain: 0.1\n  price: 0.1\n", [], "job.yaml, line 5: "),
        ("variants: {main: {},\n b: {abstract: {price: 1},\n abstract.min_gain: 1}}\n", [],
         "job.yaml, line 4: "),
        ("", ["abstract.price=1", "abstract.min_gain=1"], "--set abstract.price=1: "),
        ("", ["abstract.min_gain=1", "abstract={price: 1}"], "--set abstract={price: 1}: "),
    ],
)  # fmt: skip
def test_both_names_are_an_error(
    tmp_path: Path, text: str, overrides: list[str], says: str
) -> None:
    with pytest.raises(JobError) as refused:
        read(tmp_path, text, *overrides)
    assert says in str(refused.value)
    assert str(refused.value).endswith(
        "abstract.price is called abstract.min_gain now, which is given too: leave abstract.price "
        "out"
    )


def test_a_key_with_dots_in_a_file_is_still_refused(tmp_path: Path) -> None:
    with pytest.raises(JobError, match=r"line 3: unknown key abstract.price; dotted keys are for"):
        read(tmp_path, "abstract.price: 0.1\n")


def test_the_tree_itself_stays() -> None:
    tree = {"abstract": {"price": 1}, "variants": {"main": {"training.begin": "w"}}}
    new, found = with_new_names(tree)
    assert new == {
        "abstract": {"min_gain": 1},
        "variants": {"main": {"training.init_from": "w"}},
    }
    assert [item.old for item in found] == ["abstract.price", "training.begin"]
    assert tree == {"abstract": {"price": 1}, "variants": {"main": {"training.begin": "w"}}}
    assert with_new_names(new) == (new, [])


def test_library_calls_read_old_names(tmp_path: Path) -> None:
    given = {"abstract": {"price": 0.1}}
    for call in (
        lambda: pnabs.abstract(tmp_path / "none.obj", settings=given),
        lambda: pnabs.score(tmp_path / "none.obj", tmp_path / "none.off", settings=given),
    ):
        with (
            pytest.raises(FileNotFoundError),
            pytest.warns(FutureWarning, match=f"settings: {PRICE}") as found,
        ):
            call()
        assert [item.filename for item in found] == [__file__]
    both = {"abstract": {"price": 0.1, "min_gain": 0.1}}
    with pytest.raises(ValueError, match="which is given too: leave abstract.price out"):
        pnabs.abstract(tmp_path / "none.obj", settings=both)


def test_the_settings_themselves_know_new_names_alone() -> None:
    assert (Abstract().min_gain, Training().init_from) == (0.002, None)
