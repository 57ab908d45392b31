"""What the page says of the command is so."""

from __future__ import annotations

import re
from typing import get_args

import click

from pnabs.cli import main
from pnabs.evaluation.boxes import ARRAYS, OPTIONAL, REQUIRED
from pnabs.evaluation.output import COLUMNS
from pnabs.evaluation.run import FILES, HIDDEN
from pnabs.geometry.closed import NotExact
from tests.docs.pages import DOCS

PAGE = (DOCS / "pages/evaluate.md").read_text()


def test_every_column_is_told() -> None:
    told = set(re.findall(r"`(\w+)`", PAGE))
    units = {f"{name}_units" for name in ("out_max", "miss_99", "miss_max")}
    assert set(COLUMNS) - units <= told
    assert {reason for reason in get_args(NotExact) if reason} <= told


def test_the_form_of_boxes_is_told() -> None:
    section = PAGE.partition("\n### Boxes\n")[2].partition("\n### ")[0]
    assert {*REQUIRED, *OPTIONAL, *ARRAYS} <= set(re.findall(r"`(\w+)`", section))


def test_every_option_is_told() -> None:
    section = PAGE.partition("\n## Options\n")[2].partition("\n## ")[0]
    options = [one for one in main.commands["evaluate"].params if isinstance(one, click.Option)]
    for option in options:
        assert f"`{option.opts[0]}" in section, option.opts


def test_every_file_is_told() -> None:
    for name in (*FILES, HIDDEN):
        assert name in PAGE
