"""What the stage hands to the report: variants without negatives, and what a check found."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from pnabs import settings
from pnabs.formats import from_json
from pnabs.stages.report import _check, _without_negatives
from tests.docs.pages import block


@pytest.fixture
def job(tmp_path):
    def make(**abstract):
        dataset = settings.Dataset(root=tmp_path)
        return settings.Settings(dataset=dataset, out=tmp_path, abstract=abstract)

    return make


def test_a_variant_that_lacks_negatives_and_nothing_else_tells_what_they_gain(job):
    variants = {
        "main": job(),
        "fewer": job(boxes=8),
        "plain": job(negatives=False),
        "fewer-plain": job(negatives=False, boxes=8),
    }
    assert _without_negatives(variants) == ["plain"]


def test_a_main_variant_without_negatives_has_nothing_to_be_compared_with(job):
    assert _without_negatives({"main": job(negatives=False), "same": job(negatives=False)}) == []


def test_findings_of_a_failed_check_come_from_the_written_abstraction(tmp_path):
    context = SimpleNamespace(
        home=lambda stage, variant: SimpleNamespace(abstraction=lambda *name: tmp_path)
    )
    row = {"category": "a", "model_id": "m", "check_ok": False}
    assert _check(context, row) is None
    example = from_json(block("abstraction.md", "json", "pnabs/abstraction").encode())
    found = {**example.check, "closed": False, "ok": False}
    replace(example, check=found).save(tmp_path / "abstraction.json")
    assert _check(context, row) == found
    assert _check(context, row | {"check_ok": True}) is None
    (tmp_path / "abstraction.json").write_bytes(b"{")
    assert _check(context, row) is None
