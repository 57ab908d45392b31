"""docs/pages/settings.md is what docs/reference.py writes, and tells the truth."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from types import ModuleType

import pytest
from pydantic import BaseModel

from pnabs import settings
from tests.docs.pages import DOCS


@pytest.fixture(scope="module")
def reference() -> ModuleType:
    spec = importlib.util.spec_from_file_location("reference", DOCS / "reference.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def leaves(model: type[BaseModel], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Dotted name and docstring of every setting."""
    for name, field in model.model_fields.items():
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, settings.Group):
            yield from leaves(inner, f"{prefix}{name}.")
        else:
            yield prefix + name, field.description or ""


def row(page: str, name: str) -> list[str]:
    (line,) = [line for line in page.splitlines() if line.startswith(f"| `{name}` |")]
    return [cell.strip() for cell in line.strip("|").split(" | ")]


def test_the_page_is_up_to_date(reference: ModuleType) -> None:
    stale = "docs/pages/settings.md is stale: run `python docs/reference.py`"
    assert reference.PAGE.read_text() == reference.render(), stale


def test_every_setting_has_a_docstring_and_a_row(reference: ModuleType) -> None:
    page = reference.render()
    for name, description in leaves(settings.Settings):
        assert description, f"{name} has no docstring"
        assert " ".join(description.split()) in row(page, name)[3], name


def test_values_and_defaults(reference: ModuleType) -> None:
    page = reference.render()
    assert row(page, "training.epochs")[1:3] == ["integer > 0", "`150`"]
    assert row(page, "network.channels")[1:3] == ["5 of: integer > 0", "`[8, 16, 32, 64, 128]`"]
    assert row(page, "ingest.solid.open")[1:3] == ["`fill`, `shell`", '`"fill"`']
    assert row(page, "dataset.root")[2] == "*needed*"
    assert row(page, "report.pictures")[1] == "integer ≥ 0"


def test_stages_that_a_setting_redoes(reference: ModuleType) -> None:
    page = reference.render()
    assert row(page, "seed")[4] == "all"
    assert row(page, "ingest.solid.open")[4] == "all"
    assert row(page, "training.losses.separation")[4] == "`train-negative`, `abstract`"
    assert row(page, "abstract.debris")[4] == "`abstract`"
    assert row(page, "runtime.actors")[4] == "–"
    assert row(page, "report.split")[4] == "–"
