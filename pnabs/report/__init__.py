"""Tables, pictures and the page of a run, from plain data."""

from __future__ import annotations

from .choice import pictured
from .compare import build_tables
from .data import GalleryItem, Quarantined, ReportData, StageTiming, empty_mesh
from .page import render_page, write_page
from .pictures import View
from .tables import Tables
from .text import render_text

__all__ = [
    "GalleryItem",
    "Quarantined",
    "ReportData",
    "StageTiming",
    "Tables",
    "View",
    "build_tables",
    "empty_mesh",
    "pictured",
    "render_page",
    "render_text",
    "write_page",
]
