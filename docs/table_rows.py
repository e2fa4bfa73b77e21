"""Hook of mkdocs: lines of a table may be short though its cells are long.

A row whose first cell begins with … goes on with the row above. Markdown knows one line per row only.
"""

from __future__ import annotations

import re

__all__ = ["joined_rows", "on_page_markdown"]

CELL_BORDER = re.compile(r"(?<!\\)\|")


def on_page_markdown(markdown: str, **_: object) -> str:
    """Called by mkdocs with the text of every page."""
    return joined_rows(markdown)


def joined_rows(markdown: str) -> str:
    """The same page with continued rows in the row above; code blocks stay as they are."""
    lines: list[str] = []
    in_code = False
    for line in markdown.split("\n"):
        in_code ^= line.startswith("```")
        if line.startswith("| …") and not in_code and lines and lines[-1].startswith("|"):
            lines[-1] = _joined(lines[-1], line)
        else:
            lines.append(line)
    return "\n".join(lines)


def _joined(row: str, continuation: str) -> str:
    above, below = ([cell.strip() for cell in CELL_BORDER.split(text)[1:-1]] for text in (row, continuation))
    below[0] = below[0].removeprefix("…").strip()
    cells = [_joined_cells(*pair) for pair in zip(above, below, strict=True)]
    return f"| {' | '.join(cells)} |"


def _joined_cells(above: str, below: str) -> str:
    """A sentence or list goes on after a comma or with a bracket; anything else starts a line."""
    if not above or not below:
        return above or below
    return above + (" " if above.endswith(",") or below.startswith("(") else "<br>") + below
