"""Text tables: alignment, blocks, and names that try to harm."""

from __future__ import annotations

import numpy as np
import pytest
from rich.cells import cell_len

from pnabs.report import build_tables, render_text
from pnabs.report.tables import Row
from pnabs.report.text import cell, plain


def tables(row, table, categories, **figures):
    rows = [row(name, **figures) for name in categories for _ in range(5)]
    return build_tables({"main": table(rows)}, np.random.default_rng(0))


def block(text, title):
    lines = text.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(title))
    end = lines.index("", start) if "" in lines[start:] else len(lines)
    return lines[start + 1 : end]


def test_columns_are_right_aligned_under_their_names(row, table):
    text = render_text(tables(row, table, ["chair", "airplane"], iou_64=0.5), width=120)
    assert text.startswith("Figures cover the test models.\n\n")
    head, models, cropped, *_ = block(
        text, "IoU at 64³, for the paper's tables, % (higher is better)"
    )
    interval = ["95", "%", "interval"]
    assert head.split() == ["airplane", "chair", "average", *interval, "all", "models"]
    for name, count in (("airplane", "5"), ("chair", "5")):
        end = head.index(name) + len(name)
        assert models[:end].endswith(" " + count)
        assert cropped[:end].endswith(" 50.00")
    assert cropped[: head.index("average") + 7].endswith(" 50.00")
    assert cropped.startswith("result ")
    assert cropped.endswith(" 50.00 to 50.00       50.00")


def test_all_lines_keep_to_the_width_and_each_category_appears_once(row, table):
    names = [f"category{i:02d}" for i in range(30)]
    text = render_text(tables(row, table, names), width=80)
    assert max(map(cell_len, text.splitlines())) <= 80
    iou = text[text.index("IoU at 32³") : text.index("IoU at 64³")]
    assert [iou.count(name) for name in names] == [1] * 30
    # Every block repeats the labels, the last one closes with the average.
    assert iou.count("its positives, not cropped") > 3
    assert iou.count("average  ") == 1
    assert iou.count("all models\n") == 1


def test_a_name_wider_than_the_terminal_still_has_its_column(row, table):
    text = render_text(tables(row, table, ["x" * 90, "b"]), width=60)
    assert "x" * 90 in text


def test_wide_characters_count_as_two_cells(row, table):
    text = render_text(tables(row, table, ["椅子椅子椅子", "b"]), width=120)
    head, _, cropped, *_ = block(text, "IoU at 64³")
    end = cell_len(head[: head.index("椅子椅子椅子") + 6])
    second = cropped.index("50.00", cropped.index("50.00") + 5)
    assert cell_len(cropped[: second + 5]) == end


def test_escape_sequences_and_line_breaks_in_names_are_shown_not_obeyed(row, table):
    text = render_text(tables(row, table, ["evil\x1b[2J\n\u202eb"]), width=100)
    assert "evil\\x1b[2J\\n\\u202eb" in text
    assert "\x1b" not in text
    assert "\u202e" not in text


@pytest.mark.parametrize(
    ("role", "value", "expected"),
    [
        ("cropped", 12.345, "12.35"),
        ("cropped", None, "-"),
        ("difference", 0.5, "+0.50"),
        ("difference", -0.5, "-0.50"),
        ("difference", -0.001, "0.00"),
    ],
)
def test_cells(role, value, expected):
    assert cell(value, Row("label", "main", role, (), (), None)) == expected


def test_plain_leaves_printable_names_alone():
    assert plain("Stühle 椅子 <b>") == "Stühle 椅子 <b>"
    assert plain("a\tb\u200b") == "a\\tb\\u200b"


def test_no_models_at_all(row, table):
    empty = build_tables({"main": table([])}, np.random.default_rng(0))
    text = render_text(empty)
    assert text.startswith("Figures cover the test models.\n\nCounts\n")
    assert block(text, "Counts")[1].split() == ["models", "0"]
