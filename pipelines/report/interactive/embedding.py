"""Which figures of a page can be touched, and what the page has to carry for it."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, Protocol

from pipelines.report.interactive.contents import Touchable
from pipelines.report.interactive.packed import safe_json
from pipelines.report.interactive.script import Script, script
from sloshlab.errors import MissingExtraError

LARGEST_PAGE_BYTES: Final = 6_000_000
"""Goes into a mail, and opens at once on a telephone."""
_TEXT_BYTES: Final = 150_000
"""Kept free for the text and the tables of a page."""


class Figure(Protocol):
    """A figure as the page takes it."""

    @property
    def name(self) -> str:
        """Stem of its file name."""
        ...

    @property
    def png(self) -> bytes:
        """The image that is printed."""
        ...

    @property
    def touch(self) -> Touchable | None:
        """What can be touched instead of it."""
        ...


@dataclass(frozen=True)
class Embedded:
    """What a page carries so that its figures can be touched.

    Attributes
    ----------
    contents : dict
        JSON, safe within a script element, by names of figures.
    script : Script
        Empty where no figure can be touched.
    remark : str
        What a reader should know of it.
    """

    contents: dict[str, str] = field(default_factory=dict)
    script: Script = field(default_factory=Script)
    remark: str = ""


def embedded(figures: Sequence[Figure], largest_bytes: int = LARGEST_PAGE_BYTES) -> Embedded:
    """Contents of the figures that can be touched, as many as the page has room for.

    Without the drawing library, and for what finds no room, figures stand still, and the page says so.

    Parameters
    ----------
    figures : sequence of Figure
        All of the page.
    largest_bytes : int
        Of the whole page.
    """
    wanted = {figure.name: figure.touch for figure in figures if figure.touch is not None}
    if not wanted:
        return Embedded()
    try:
        needed = script()
    except MissingExtraError as error:
        return Embedded(remark=f"The figures of this page stand still: {error}.")
    contents = {name: safe_json(touch.plain()) for name, touch in wanted.items()}
    still = sum(len(base64.b64encode(figure.png)) for figure in figures)
    room = largest_bytes - _TEXT_BYTES - still - needed.size
    left_out = 0
    while contents and sum(len(content.encode()) for content in contents.values()) > room:
        # the largest first, so that as many as possible stay
        contents.pop(max(contents, key=lambda name: len(contents[name])))
        left_out += 1
    stands = "stands" if left_out == 1 else "stand"
    words = "" if not left_out else f" {left_out} of them {stands} still, as the page would be too large."
    if not contents:
        return Embedded(remark="The figures of this page stand still: it would be too large otherwise.")
    return Embedded(contents, needed, _HOW + words)


_HOW: Final = (
    "Figures with controls can be zoomed: draw a box, or use the keys that a reader of the screen names; on paper "
    "and where no script runs they are images. They are drawn by BokehJS (BSD-3-Clause), which the page carries; "
    "the page fetches nothing."
)
