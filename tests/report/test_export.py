"""Tables as csv and LaTeX: read back, escaped, and with the best figures marked."""

from __future__ import annotations

import csv
import io
import re

import numpy as np
import pytest

from pnabs.report import build_tables
from pnabs.report.export import FIELDS, WIDE, latex
from pnabs.report.tables import MIN_MODELS, Tables


def compared(row, table, categories=("a", "b")):
    """Two variants with known figures; the second lacks a model of the last category."""
    first, other = [], []
    for category in categories:
        for i in range(MIN_MODELS):
            name = f"{category}{i}"
            first.append(row(category, name, volume_iou=0.5 + i / 100, cd_l1=20.0))
            other.append(row(category, name, volume_iou=0.4 + i / 100, cd_l1=10.0))
    other[-1] = row(categories[-1], other[-1]["model_id"], status="crash")
    rows = {"main": table(first), "plain": table(other)}
    return build_tables(rows, np.random.default_rng(0))


def test_csv_holds_every_figure_of_the_tables(row, table):
    tables = compared(row, table)
    text = tables.to_csv()
    lines = list(csv.DictReader(io.StringIO(text)))
    assert tuple(lines[0]) == FIELDS
    assert len(lines) == sum(
        len(t.rows) * (len(t.columns) + (1 if t.better is None else 2)) for t in tables.tables
    )
    found = {(line["table"], line["row"], line["scope"], line["category"]): line for line in lines}
    assert len(found) == len(lines)
    for own in tables.tables:
        for shown in own.rows:
            for column, models, value in zip(own.columns, shown.models, shown.values, strict=True):
                line = found[own.name, shown.label, "category", column.category]
                assert line["value"] == ("" if value is None else str(value))
                assert int(line["models"]) == models
                assert (line["unit"], line["role"]) == (own.unit, shown.role)
            line = found[own.name, shown.label, "all", ""]
            assert float(line["value"]) == shown.overall
            assert int(line["models"]) == sum(shown.models)


def test_csv_tells_intervals_and_how_many_models_an_average_covers(row, table):
    lines = list(csv.DictReader(io.StringIO(compared(row, table).to_csv())))
    (average,) = (
        line
        for line in lines
        if (line["table"], line["row"], line["scope"]) == ("volume_iou", "plain", "average")
    )
    # Of b only four have a figure, too few for an average.
    assert average["models"] == "5"
    assert float(average["value"]) == pytest.approx(42)
    assert 40 <= float(average["low"]) < 42 < float(average["high"]) <= 44


def test_csv_keeps_names_with_commas_quotes_and_line_breaks_apart(row, table):
    name = 'a,"b"\nc'
    tables = build_tables({"main": table([row(name)])}, np.random.default_rng(0))
    lines = list(csv.DictReader(io.StringIO(tables.to_csv())))
    assert {line["category"] for line in lines} == {'a,"b"\\nc', ""}
    assert all(None not in line and None not in line.values() for line in lines)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("plain words 1.5", "plain words 1.5"),
        ("a_b & 50 % of #1 $x {y}", r"a\_b \& 50 \% of \#1 \$x \{y\}"),
        (r"\input{x}", r"\textbackslash{}input\{x\}"),
        ("~^<>", r"\textasciitilde{}\textasciicircum{}\textless{}\textgreater{}"),
        ("64³", r"64\textsuperscript{3}"),
        ("[2cm] *", "{[}2cm] {*}"),
        ("a\nb", r"a\textbackslash{}nb"),
    ],
)
def test_latex_prints_names_as_they_are(text, expected):
    assert latex(text) == expected


def tabular(text, name):
    """The cells of a table in LaTeX by line, rules left out, and the comments above it."""
    start = text.index(f"% {name}\n")
    block = text[start : text.index("\\end{tabular}", start)]
    comments = [line for line in block.splitlines() if line.startswith("%")]
    lines = [line for line in block.splitlines() if line.endswith(r"\\")]
    return [[c.strip() for c in line[:-2].split(" & ")] for line in lines], comments


def test_latex_has_a_tabular_a_table_with_its_cells(row, table):
    tables = compared(row, table, ("a", "b_&%"))
    text = tables.to_latex()
    assert text.count(r"\begin{tabular}") == text.count(r"\end{tabular}") == len(tables.tables)
    assert text.count(r"\toprule") == text.count(r"\bottomrule") == len(tables.tables)
    lines, comments = tabular(text, "variants/volume_iou")
    span = r"95\,\% interval"
    assert lines[0] == ["", "a", r"b\_\&\%", "average", span, "all models", span]
    assert lines[1] == ["models", "5", "5", "", "", "", ""]
    assert {len(line) for line in lines} == {7}
    columns = re.findall(r"\\begin\{tabular\}\{(\w+)\}", text)
    assert "lrrrrrr" in columns
    labels = [line[0] for line in lines[2:]]
    assert labels == ["main", "plain", "main minus plain"]
    assert any(c.startswith("% Exact volume IoU, closed models, side by side") for c in comments)
    assert "% Counted as 0: plain: 1 failed (1 crash)." in comments


def test_latex_marks_the_best_figures_of_methods_side_by_side_alone(row, table):
    text = compared(row, table).to_latex()
    lines, _ = tabular(text, "variants/volume_iou")
    assert lines[2][1] == r"\textbf{52.00}"
    assert lines[3][1] == "42.00"
    lines, _ = tabular(text, "variants/cd_l1")
    assert [line[1] for line in lines[2:]] == ["20.00", r"\textbf{10.00}", "+10.00"]
    lines, _ = tabular(text, "volume_iou")
    assert not any("textbf" in cell for line in lines for cell in line)


def test_latex_has_true_minus_signs_and_dashes_where_nothing_is_known(row, table):
    rows = {
        name: table([row("a", f"m{i}", cd_l1=v) for i in range(5)])
        for name, v in (("main", 1.0), ("plain", 2.5))
    }
    lines, _ = tabular(build_tables(rows, np.random.default_rng(0)).to_latex(), "variants/cd_l1")
    assert lines[-1][1:4] == ["$-$1.50", "$-$1.50", "$-$1.50 to $-$1.50"]
    lost = [row("a"), row("b", status="crash")]
    lines, _ = tabular(
        build_tables({"main": table(lost)}, np.random.default_rng(0)).to_latex(), "cd_l1"
    )
    assert lines[2][:3] == ["result", "20.00", "--"]


def test_latex_lists_many_categories_downwards(row, table):
    names = [f"c{i:02d}" for i in range(WIDE + 1)]
    text = build_tables(
        {"main": table([row(name, f"{i}") for name in names for i in range(5)])},
        np.random.default_rng(0),
    ).to_latex()
    lines, _ = tabular(text, "volume_iou")
    assert lines[0] == ["", "models", "result"]
    assert lines[1] == ["c00", "5", "70.00"]
    assert [line[0] for line in lines[-4:]] == [
        *("average", r"95\,\% interval", "all models", r"95\,\% interval")
    ]
    assert len(lines) == 1 + len(names) + 4


def test_a_comment_cannot_be_left_by_a_name(row, table):
    hostile = "x\n\\input{secret}\r\u2028y"
    tables = build_tables(
        {"main": table([row(hostile, f"{i}") for i in range(4)])}, np.random.default_rng(0)
    )
    for line in tables.to_latex().splitlines():
        assert "\\input" not in line or line.startswith("%") or "textbackslash" in line
        assert not line.startswith("\\input")


def test_no_tables_are_still_files():
    nothing = Tables("test", ("main",), 1, ())
    assert nothing.to_csv() == ",".join(FIELDS) + "\n"
    assert "booktabs" in nothing.to_latex()
