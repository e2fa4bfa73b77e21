"""Hook of mkdocs: pages of the gallery begin with their title, show what a script says, and find its figures."""

from __future__ import annotations

import re
from typing import Any

__all__ = ["on_page_markdown", "without_clutter"]

NOTE = re.compile(r"!!! note\n\n(?:    .*\n)+\n*")
SOURCES = re.compile(r' srcset="\.\./[^"]*"')
"""Where figures would lie if every page were a folder (`use_directory_urls`)."""
PROGRESS = re.compile(r"^[\w ]+, [\d hmins]+ so far.*\n", re.MULTILINE)


def on_page_markdown(markdown: str, page: Any, **_: object) -> str:
    """Called by mkdocs with the text of every page."""
    return without_clutter(markdown) if page.file.src_uri.startswith("generated/gallery/") else markdown


def without_clutter(markdown: str) -> str:
    """The same page without the note above its title, lines of progress, and second places of figures."""
    return SOURCES.sub("", PROGRESS.sub("", NOTE.sub("", markdown, count=1)))
