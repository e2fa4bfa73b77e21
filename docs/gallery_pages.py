"""Hook of mkdocs: pages of the gallery begin with their title and show only what a script says."""

from __future__ import annotations

import re
from typing import Any

__all__ = ["on_page_markdown", "without_clutter"]

NOTE = re.compile(r"!!! note\n\n(?:    .*\n)+\n*")
PROGRESS = re.compile(r"^[\w ]+, [\d hmins]+ so far.*\n", re.MULTILINE)


def on_page_markdown(markdown: str, page: Any, **_: object) -> str:
    """Called by mkdocs with the text of every page."""
    return without_clutter(markdown) if page.file.src_uri.startswith("generated/gallery/") else markdown


def without_clutter(markdown: str) -> str:
    """The same page without the note above its title, and without lines of progress in what was printed."""
    return PROGRESS.sub("", NOTE.sub("", markdown, count=1))
