"""The report as one HTML page that needs nothing beside itself.

Style, charts and pictures are inside of the file; it has no script, and its content security
policy forbids loading anything.  Jinja2 escapes every name and reason.
"""

from __future__ import annotations

from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from . import gallery, view
from .data import ReportData
from .pictures import NEGATIVE
from .tables import COMPARISON, MIN_MODELS
from .text import plain


def render_page(data: ReportData) -> str:
    """The page as text; the same data give the same text.

    Raises
    ------
    ValueError
        If the metrics lack columns.
    """
    environment = Environment(
        loader=PackageLoader("pnabs.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    style = Markup(environment.get_template("style.css").render(negative=NEGATIVE))
    chips, failed = view.failures(data)
    return environment.get_template("page.html").render(
        title=plain(data.title),
        style=style,
        split=plain(data.split),
        variants=[plain(name) for name in data.tables.variants],
        figures=view.headline(data),
        side_by_side=view.grids(data.tables, COMPARISON),
        without_negatives=[
            plain(name) for name in data.without_negatives if name != data.tables.variants[0]
        ],
        sections=view.sections(data.tables),
        counts=view.grids(data.tables, "counts"),
        resamples=data.tables.resamples,
        least=MIN_MODELS,
        charts=view.model_charts(data),
        gallery=gallery.cards_by_category(data),
        losses=view.loss_charts(data),
        failure_chips=chips,
        failures=failed,
        failures_left=len(data.quarantine) - len(failed),
        timings=view.timings(data.timings),
        settings=data.settings_yaml,
        versions=sorted((plain(name), plain(version)) for name, version in data.versions.items()),
        seed=data.seed,
        fingerprint=plain(data.fingerprint),
        command=plain(data.command),
    )


def write_page(data: ReportData, path: Path) -> None:
    """Write the page, replacing an earlier one at once or not at all.

    Parameters
    ----------
    data : ReportData
    path : Path
        For example RUN/report/index.html; its folder is made.

    Raises
    ------
    ValueError
        If the metrics lack columns.
    OSError
        If the file can't be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".partial")
    partial.write_text(render_page(data), encoding="utf-8", newline="\n")
    partial.replace(path)
