"""What the pages name is there: commands and options, job files, pages, paths."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import click
import numpy as np
import pyarrow as pa
import pytest
import yaml

from pnabs import settings
from pnabs.cli import STAGES, main
from pnabs.model.losses import TERMS
from pnabs.renamed import RENAMED
from pnabs.report.tables import Tables
from pnabs.stages import errors
from pnabs.stages.job import load_job
from pnabs.stages.presets import PAPER
from pnabs.stages.verify import DAMAGE_EXIT_CODE
from pnabs.store.ledger import ModelVerdict, Record
from pnabs.store.metrics import SCHEMA
from pnabs.store.run import RunFolder
from pnabs.store.sealed import seal
from tests.docs.pages import DOCS, PAGES, block, blocks, prose

ROOT = DOCS.parent
LINES = [line for page in PAGES for code in blocks(page.name, "sh") for line in code.splitlines()]
COMMANDS = sorted({line for line in LINES if line.startswith("pnabs ")})
YAML = [code for page in PAGES for code in blocks(page.name, "yaml")]
JOBS = [code for code in YAML if code.startswith("dataset:")]


def settings_of(model: type[settings.Group], prefix: str = "") -> set[str]:
    """Dotted names of a group's settings, groups included."""
    found = set()
    for name, field in model.model_fields.items():
        found.add(prefix + name)
        if isinstance(field.annotation, type) and issubclass(field.annotation, settings.Group):
            found |= settings_of(field.annotation, f"{prefix}{name}.")
    return found


@pytest.mark.parametrize("line", COMMANDS)
def test_commands_and_options_exist(line: str) -> None:
    name, *arguments = shlex.split(line)[1:]
    command = main.commands[name]
    known = {option for item in command.params for option in (*item.opts, *item.secondary_opts)}
    assert {word for word in arguments if word.startswith("--")} <= known
    positional = [item for item in command.params if isinstance(item, click.Argument)]
    assert positional


@pytest.mark.parametrize("code", JOBS, ids=range(len(JOBS)))
def test_job_files_load(code: str, tmp_path: Path) -> None:
    path = tmp_path / "job.yaml"
    path.write_text(code)
    assert load_job(path).settings.out.is_absolute()


def test_there_are_commands_and_jobs_to_check() -> None:
    assert len(COMMANDS) >= 8
    assert len(JOBS) >= 4


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if "://" in target:
            continue
        name, _, anchor = target.partition("#")
        linked = DOCS / "pages" / name if name else page
        assert linked.is_file(), target
        if linked.suffix != ".md":
            continue
        headings = re.findall(r"^#+ (.*)$", prose(linked), re.MULTILINE)
        slugs = {re.sub(r"[\s]+", "-", re.sub(r"[^\w\s.-]", "", h).lower()) for h in headings}
        assert not anchor or anchor in {slug.replace(".", "") for slug in slugs}, target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_dotted_settings_exist(page: Path) -> None:
    known = settings_of(settings.Settings)
    if page.name == "settings.md":
        known |= set(RENAMED)
    groups = {name for name in known if "." not in name}
    for name in re.findall(r"`([a-z_0-9]+(?:\.[a-z_0-9]+)+)[:=`]", prose(page)):
        if name.partition(".")[0] in groups - {"report"} and not name.endswith(".safetensors"):
            illustrated = page.name == "extending.md" and name == "training.losses.overlap"
            assert name in known or illustrated, name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_of_the_repository_exist(page: Path) -> None:
    new = {
        f"pnabs/{name}.py"
        for name in re.findall(r"^`pnabs/([\w/]+)\.py`:$", page.read_text(), re.MULTILINE)
    }
    for name in re.findall(r"`((?:pnabs|jobs|cluster|docs)/[\w./-]+\.\w+)`", prose(page)):
        assert (ROOT / name).exists() or name in new, name


def test_every_page_is_in_the_navigation() -> None:
    nav = (DOCS / "mkdocs.yml").read_text()
    assert {page.name for page in PAGES} == set(re.findall(r": ([\w-]+\.md)$", nav, re.MULTILINE))


def test_stages_and_exit_codes() -> None:
    page = (DOCS / "pages/running.md").read_text()
    for stage in STAGES:
        assert f"\n| `{stage}` |" in page
    codes = {error.exit_code for error in (errors.RunError, errors.RefusedError)}
    codes |= {errors.TooManyFailedError.exit_code, errors.ShardsFailedError.exit_code, 0, 2}
    codes.add(DAMAGE_EXIT_CODE)
    assert {int(code) for code in re.findall(r"^\| (\d) \|", page, re.MULTILINE)} == codes


def test_metrics_columns_are_all_told() -> None:
    page = (DOCS / "pages/run-folder.md").read_text()
    section = page.partition("\n## metrics")[2].partition("\n## Ledger")[0]
    first = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    told = {name for cell in first for name in re.findall(r"`(\w+)`", cell)}
    assert told == set(SCHEMA.names)


def test_arrays_are_told_with_shape_and_type(tmp_path: Path) -> None:
    page = (DOCS / "pages/run-folder.md").read_text()
    job = settings.Settings(dataset=settings.Dataset(root=tmp_path), out=tmp_path)
    sizes = {
        str(job.ingest.surface_points): "`ingest.surface_points`",
        str(job.ingest.interior_points): "`ingest.interior_points`",
        str(job.ingest.preview_faces): "`ingest.preview_faces`",
    }
    for spec in RunFolder(tmp_path).fields(job).specs:
        shape = ", ".join(["n", *(sizes.get(str(side), str(side)) for side in spec.shape)])
        assert f"| `{spec.name}` | {shape} | {np.dtype(spec.dtype).name} |" in page


def test_the_ledger_example_is_what_is_written() -> None:
    example = json.loads(block("run-folder.md", "json", "pnabs/ledger"))
    models = tuple(ModelVerdict.from_json(model) for model in example["models"])
    fields = {name: example[name] for name in ("stage", "shard", "fingerprint", "outputs")}
    record = Record(models=models, **fields).to_json()
    assert {**record, "sha256": example["sha256"]} == example
    assert json.loads(seal(record)).keys() == example.keys()


def test_the_quarantine_example_has_the_fields_that_are_written(tmp_path: Path) -> None:
    ledger = RunFolder(tmp_path).ledger
    line = json.loads(block("datasets.md", "json", '"kind"'))
    verdict = ModelVerdict(line["model_id"], line["kind"], line["reason"], line["attempts"])
    ledger.commit(Record("ingest", f"{line['category']}-00000", "", (verdict,), {}))
    assert json.loads(ledger.quarantine("ingest")) == line


def test_tables_keys_are_told() -> None:
    page = (DOCS / "pages/run-folder.md").read_text().partition("\n## Report")[2]
    document = json.loads(Tables("test", ("main",), 1, ()).to_json())
    for key in document:
        assert f"`{key}`" in page


def test_losses_are_told() -> None:
    page = (DOCS / "pages/method.md").read_text()
    for name in TERMS:
        assert f"\n| `{name}` |" in page


def test_the_paper_preset_is_shown() -> None:
    (shown,) = blocks("settings.md", "yaml")
    assert yaml.safe_load(shown) == PAPER


def test_the_metrics_folder_reads_as_one_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from pnabs.store.metrics import write_metrics

    folder = tmp_path / "runs/meshes/variants/main/metrics"
    for number in range(2):
        entry = {"category": "a", "model_id": str(number), "split": "test", "status": "timeout"}
        write_metrics(tmp_path, folder / f"a-{number:05}.parquet", [entry])
    monkeypatch.chdir(tmp_path)
    names: dict[str, pa.Table] = {}
    exec(block("run-folder.md", "python", "read_table"), names)
    assert len(names["table"]) == 2
