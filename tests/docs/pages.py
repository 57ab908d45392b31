"""The pages' text and the blocks of code in it."""

from __future__ import annotations

import re
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted((DOCS / "pages").glob("*.md"))

_FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(page: str, language: str) -> list[str]:
    """The fenced blocks of a language in a page, in order."""
    text = (DOCS / "pages" / page).read_text()
    return [code for name, code in _FENCE.findall(text) if name == language]


def block(page: str, language: str, containing: str) -> str:
    """The one block of a page that holds a text."""
    (found,) = [code for code in blocks(page, language) if containing in code]
    return found


def prose(page: Path) -> str:
    """A page's text without its blocks."""
    return _FENCE.sub("", page.read_text())
