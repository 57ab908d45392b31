"""The page: whole, self-contained, and safe against the names it shows."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import replace
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
    # A model without figures has its pictures alone.
    for chip in ("6 predicted", "1 too deep", "1 apart", "1 suppressed", "3 kept"):
        assert page.texts.count(chip) == 1
    facts = "8 positives, 3 negatives, connected pieces: 2 of the shape, 3 of the result, 4 bodies"
    assert f"{facts}, 100 faces" in page.texts


def gallery(report, **figures):
    """The caption of a model with other figures, as texts in order; `check` is the item's."""
    check = figures.pop("check", None)
    data = report()
    (item, _) = data.gallery
    changed = replace(item, row=item.row | figures, check=check)
    text = render_page(report(gallery=[changed]))
    page = Page(text[text.index('<div class="caption">') : text.index('<div class="pictures">')])
    return [line for line in page.texts if line], page


def test_caption_of_a_closed_model_tells_its_exact_volume_iou(report):
    texts, _ = gallery(report, volume_iou=0.776, iou_128=0.9, out_99=0.021, miss_99=0.034)
    assert texts[:2] == ["77.6 %", "exact volume IoU"]
    assert "out 2.1 %, miss 3.4 %" in texts
    assert not any("128" in line or "not closed" in line for line in texts)


def test_caption_of_another_model_tells_grid_and_coverage_and_why(report):
    figures = {"volume_iou": None, "iou_128": 0.651, "coverage": 0.92, "not_exact": "open"}
    texts, _ = gallery(report, **figures)
    assert texts[:4] == ["65.1 %", "IoU at 128³", "92.0 %", "coverage"]
    assert "original not closed" in texts
    assert not any("exact" in line for line in texts)


CHECK = {
    "closed": True,
    "two_manifold": True,
    "self_intersections": 0,
    "duplicate_vertices": 0,
    "unreferenced_vertices": 0,
    "degenerate_faces": 0,
    "components": 1,
    "within_bounds": True,
    "ok": True,
}


@pytest.mark.parametrize(
    ("figures", "verdict", "style"),
    [
        ({"check": CHECK}, "closed, two-manifold, within bounds", "gain"),
        ({"check": None}, "closed, two-manifold, within bounds", "gain"),
        ({"check_ok": False, "check": CHECK | {"closed": False}}, "not closed", "loss"),
        (
            {"check_ok": False, "check": CHECK | {"two_manifold": False, "self_intersections": 3}},
            "not two-manifold, 3 self intersections",
            "loss",
        ),
        (
            {"check_ok": False, "beyond": 0.012, "check": None},
            "leaves the bounding box of its input by 1.2 %",
            "loss",
        ),
        ({"check_ok": False, "check": None}, "failed its check", "loss"),
    ],
)
def test_caption_says_what_the_check_means_or_what_failed(report, figures, verdict, style):
    texts, page = gallery(report, **figures)
    assert f"result: {verdict}" in texts
    assert "passed" not in " ".join(texts)
    assert [a["class"] for a in page.all("p") if a.get("class") in ("gain", "loss")] == [style]


def test_a_result_that_was_not_checked_has_no_verdict(report):
    texts, page = gallery(report, check_ok=None)
    assert not any("manifold" in line for line in texts)
    assert not [a for a in page.all("p") if a.get("class") in ("gain", "loss")]
    texts, _ = gallery(report, check_ok=None, beyond=0.5)
    assert "result: leaves the bounding box of its input by 50.0 %" in texts


def test_headline_figures_name_their_models(report):
    page = Page(render_page(report()))
    for text in (
        "11 of 12",
        "1 crash",
        "exact volume IoU",
        "70.00 %",
        "IoU at 128³",
        "65.00 %",
        "85.00 %",
        "2.00 %",
        "3.00 %",
        "8.0 + 3.0",
    ):
        assert text in page.texts
    closed = "6 of 12 models are closed; 95 % interval 70.00 to 70.00; "
    assert f"{closed}average over categories 70.00 %" in page.texts
    assert any(text.startswith("5 of 12 models are not closed") for text in page.texts)


def test_no_figure_claims_to_be_the_gain_of_negatives(report):
    text = render_page(report())
    assert "without negatives" not in text
    assert "points of IoU" not in text
    assert "<code>abstract.negatives: false</code>" in text


def test_headline_without_a_large_category_is_the_mean_alone(report, row, table):
    rows = {"main": table([row("a", volume_iou=0.5), row("b", "n", volume_iou=0.7)])}
    tables = build_tables(rows, np.random.default_rng(0))
    page = Page(render_page(report(rows=rows, tables=tables, gallery=())))
    assert "60.00 %" in page.texts
    assert "2 of 2 models are closed" in page.texts


def test_models_that_are_not_closed_have_a_chart_of_their_own(report):
    text = render_page(report())
    charts = re.findall(r'<svg class="chart".*?</svg>', text, flags=re.S)
    titles = [re.search(r'aria-label="([^"]*)"', chart)[1] for chart in charts]
    assert titles[:2] == [
        "Closed models: exact volume IoU, %",
        "Models that are not closed: IoU at 128³, %",
    ]


def test_tables_stand_in_sections_and_the_main_ones_are_open(report):
    text = render_page(report())
    section = text.partition('<section id="tables">')[2].partition("</section>")[0]
    assert re.findall(r"<h3>(.*?)</h3>", section) == [
        "Exact volumes",
        "Grid and coverage",
        "Distances",
        "For the paper&#39;s tables",
    ]
    unfolded = re.findall(r'<details class="grid" open><summary>(.*?),', section)
    assert unfolded[:2] == ["Exact volume IoU", "IoU at 128³"]
    assert len(re.findall("<details", section)) == 17 > len(unfolded)


def test_tables_are_turned_when_there_are_many_categories(row, table):
    many = [f"c{i:02d}" for i in range(WIDE + 1)]
    for names, turned in ((many, True), (many[:-1], False)):
        rows = {"main": table([row(name, iou_64=0.5) for name in names for _ in range(5)])}
        grid = grids(build_tables(rows, np.random.default_rng(0)), "iou_64")[0]
        labels = [label for label, _, _ in grid.lines]
        assert ("c00 (5)" in labels) is turned
        assert ("its positives, not cropped" in labels) is not turned
        assert {len(cells) for _, _, cells in grid.lines} == {len(grid.head)}
        cells = {
            (label, head): cell.text
            for label, _, line in grid.lines
            for (head, _), cell in zip(grid.head, line, strict=True)
        }
        key = (
            ("c03 (5)", "its positives, not cropped")
            if turned
            else ("its positives, not cropped", "c03")
        )
        assert cells[key] == "40.00"
        assert "50.00 to 50.00" in cells.values()


def test_variants_stand_side_by_side_and_have_their_own_curves(report, row, table):
    rows = [row("a", f"m{i}", volume_iou=0.6 + i / 100) for i in range(6)]
    worse = [row("a", f"m{i}", volume_iou=0.5 + i / 100) for i in range(6)]
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
    assert "fitted without negatives" not in page


def test_a_variant_without_negatives_tells_what_they_gain(report, row, table):
    rows = [row("a", f"m{i}") for i in range(6)]
    tables = build_tables({"main": table(rows), "plain": table(rows)}, np.random.default_rng(0))
    shown = {"tables": tables, "rows": {"main": table(rows)}}
    text = render_page(report(**shown, without_negatives=["plain"]))
    assert "<q>plain</q> is fitted without negatives" in text
    assert "abstract.negatives" not in text
    hostile = render_page(report(**shown, without_negatives=["plain", HOSTILE]))
    check_self_contained(hostile)
    assert "are fitted without negatives" in hostile


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
    assert "No model failed." in text
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
