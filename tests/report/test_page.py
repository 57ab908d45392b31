"""The page: whole, self-contained, and safe against the names it shows."""

from __future__ import annotations

import base64
import io
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from pnabs.report import Quarantined, StageTiming, build_tables, render_page, write_page
from pnabs.report.view import QUARANTINE_ROWS, WIDE, duration, grids

VOID = {"meta", "img", "link", "br", "hr", "input", "line", "circle", "path"}
HOSTILE = '</td><script>alert("x")</script><img src=http://evil.example/a.png>'


class Page(HTMLParser):
    """Elements with their attributes, the text, and whether tags are balanced."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.open, self.texts, self.ids = [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data.strip())

    def all(self, tag):
        return [attrs for name, attrs in self.elements if name == tag]


def check_self_contained(text):
    page = Page(text)
    assert page.open == []
    tags = {tag for tag, _ in page.elements}
    assert not tags & {"script", "link", "iframe", "object", "embed", "base", "form"}
    for _, attrs in page.elements:
        for name, value in attrs.items():
            assert not name.startswith("on")
            if name == "src":
                assert value.startswith("data:image/webp;base64,")
            if name in ("href", "xlink:href", "srcset", "action"):
                assert value.startswith("#")
    style = re.search(r"<style>(.*?)</style>", text, flags=re.S)[1]
    assert "@import" not in style
    assert "url(" not in style
    return page


def test_page_is_self_contained_and_its_links_lead_somewhere(report):
    text = render_page(report())
    page = check_self_contained(text)
    ids = [attrs["id"] for _, attrs in page.elements if "id" in attrs]
    assert len(ids) == len(set(ids))
    assert {attrs["href"][1:] for attrs in page.all("a")} <= set(ids)
    policy = [m["content"] for m in page.all("meta") if "http-equiv" in m]
    assert policy == ["default-src 'none'; style-src 'unsafe-inline'; img-src data:"]
    assert "http" not in re.sub(r"data:[^\"]*|http-equiv", "", text)
    assert "prefers-color-scheme: dark" in text


def test_hostile_names_and_reasons_are_shown_as_text(report):
    data = report(
        category=HOSTILE,
        model_id=HOSTILE,
        names={HOSTILE: HOSTILE},
        title=HOSTILE,
        curves={(HOSTILE, HOSTILE): [{"epoch": 1, HOSTILE: 1.0}]},
        quarantine=[Quarantined(HOSTILE, HOSTILE, HOSTILE, HOSTILE, HOSTILE)],
        timings=[StageTiming(HOSTILE, 1.0, 1, 0)],
        settings_yaml=HOSTILE,
        versions={HOSTILE: HOSTILE},
        fingerprint=HOSTILE,
        command=HOSTILE,
    )
    text = render_page(data)
    page = check_self_contained(text)
    assert "<script" not in text
    assert page.texts.count(HOSTILE) > 10


def test_control_characters_are_spelled_out(report):
    text = render_page(report(model_id="a\x1b[31m\u202eb"))
    assert "\x1b" not in text
    assert "\u202e" not in text
    assert "a\\x1b[31m\\u202eb" in text


def test_gallery_has_four_pictures_a_model_and_its_counts(report):
    page = Page(render_page(report()))
    pictures = page.all("img")
    assert len(pictures) == 8
    sizes = set()
    for attrs in pictures:
        content = base64.b64decode(attrs["src"].partition(",")[2], validate=True)
        image = Image.open(io.BytesIO(content))
        assert image.format == "WEBP"
        sizes.add(image.size)
    assert len(sizes) == 1
    assert pictures[0]["alt"] == "original of m0"
    for chip in ("6 predicted", "1 too deep", "1 apart", "1 suppressed", "3 kept"):
        assert page.texts.count(chip) == 1
    assert "+10.0 on 40.0 % without negatives" in page.texts
    # A model without figures still has its pictures.
    assert "\N{EN DASH} predicted" in page.texts


def test_headline_figures(report):
    page = Page(render_page(report()))
    for text in ("6 of 7", "1 crash", "50.00 %", "+10.00", "12.00", "70.00 %", "3.00"):
        assert text in page.texts


def test_headline_without_a_large_category_is_the_mean_over_all_models(report, row, table):
    rows = {"main": table([row("a", iou_64=0.5), row("b", iou_64=0.7)])}
    tables = build_tables(rows, np.random.default_rng(0))
    page = Page(render_page(report(rows=rows, tables=tables, gallery=())))
    assert "60.00 %" in page.texts
    assert "positives only: 40.00 %, mean over all models" in page.texts


def test_tables_are_turned_when_there_are_many_categories(row, table):
    many = [f"c{i:02d}" for i in range(WIDE + 1)]
    for names, turned in ((many, True), (many[:-1], False)):
        rows = {"main": table([row(name, iou_64=0.5) for name in names for _ in range(5)])}
        grid = grids(build_tables(rows, np.random.default_rng(0)), ["iou_64"])[0]
        labels = [label for label, _, _ in grid.lines]
        assert ("c00 (5)" in labels) is turned
        assert ("positives only" in labels) is not turned
        assert {len(cells) for _, _, cells in grid.lines} == {len(grid.head)}
        cells = {
            (label, head): cell.text
            for label, _, line in grid.lines
            for (head, _), cell in zip(grid.head, line, strict=True)
        }
        key = ("c03 (5)", "positives only") if turned else ("positives only", "c03")
        assert cells[key] == "40.00"
        assert "50.00 to 50.00" in cells.values()


def test_variants_stand_side_by_side_and_have_their_own_curves(report, row, table):
    rows = [row("a", f"m{i}", iou_32=0.6 + i / 100) for i in range(6)]
    worse = [row("a", f"m{i}", iou_32=0.5 + i / 100) for i in range(6)]
    tables = build_tables({"main": table(rows), "plain": table(worse)}, np.random.default_rng(0))
    record = {"epoch": 0, "total": 1.0, "iou_32": 0.5}
    curves = {(name, "positive-initial"): [record] for name in ("main", "plain")}
    page = render_page(report(tables=tables, rows={"main": table(rows)}, curves=curves))
    section = page.partition('<section id="variants">')[2].partition("</section>")[0]
    assert "main minus plain" in section
    assert "+10.00" in section
    for title in ("main: positive-initial", "plain: validation models"):
        assert f">{title}</text>" in page
    assert 'id="variants"' not in render_page(report())


def test_long_lists_of_failures_are_cut_and_the_rest_counted(report):
    item = Quarantined("ingest", "bus", "b", "crash", "signal 11")
    text = render_page(report(quarantine=[item] * (QUARANTINE_ROWS + 7)))
    assert text.count("<td>signal 11</td>") == QUARANTINE_ROWS
    assert "And 7 more" in text
    assert f"<b>{QUARANTINE_ROWS + 7}</b>" in text


def test_sections_without_content_are_left_out(report):
    text = render_page(report(gallery=(), curves={}, quarantine=(), timings=(), settings_yaml=""))
    for anchor in ("gallery", "training", "timings"):
        assert f"#{anchor}" not in text
    assert "No model fell out." in text
    assert "<pre><code>pnabs run job.yaml</code></pre>" in text


def test_run_without_any_covered_model(report, table, row):
    rows = {"main": table([row("a", split="train")])}
    tables = build_tables(rows, np.random.default_rng(0), split="test")
    check_self_contained(render_page(report(rows=rows, tables=tables, gallery=())))


def test_timings_show_time_memory_and_rate(report):
    page = Page(render_page(report()))
    for text in ("2 h 01 min", "512 MiB", "1038 s"):
        assert text in page.texts


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0, "0.0 s"),
        (59.94, "59.9 s"),
        (200, "3 min 20 s"),
        (3599.7, "1 h 00 min"),
        (7500, "2 h 05 min"),
    ],
)
def test_durations(seconds, text):
    assert duration(seconds) == text


def test_the_same_data_give_the_same_page(report):
    assert render_page(report()) == render_page(report())


def test_write_page_replaces_the_earlier_one_and_leaves_nothing_beside(report, tmp_path):
    path = tmp_path / "report" / "index.html"
    write_page(report(), path)
    write_page(report(title="Second"), path)
    assert "<h1>Second</h1>" in path.read_text(encoding="utf-8")
    assert [p.name for p in path.parent.iterdir()] == ["index.html"]
