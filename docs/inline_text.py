"""Hook of mkdocs: formulas become MathML, which browsers draw without a script; options keep their hyphens.

Formulas are written as TeX between dollar signs; pymdownx.arithmatex finds them.
"""

from __future__ import annotations

import html
import re

from latex2mathml.converter import convert

__all__ = ["on_page_content", "with_formulas", "with_whole_options"]

FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)
INLINE_CODE = re.compile(r"(?<!</span>)<code>([^<]*-[^<]*)</code>")
OPTION = re.compile(r"(?<![\w-])--?\w[\w-]*")


def on_page_content(content: str, **_: object) -> str:
    """Called by mkdocs with the HTML of every page."""
    return with_whole_options(with_formulas(content))


def with_formulas(content: str) -> str:
    """The same page with MathML in place of TeX; in a paragraph of its own it is a block."""

    def drawn(found: re.Match[str]) -> str:
        return convert(html.unescape(found[2]), display="block" if found[1] == "div" else "inline")

    return FORMULA.sub(drawn, content)


def with_whole_options(content: str) -> str:
    """The same page with the options of commands in one piece, in text and in tables."""

    whole = r'<span class="option">\g<0></span>'

    def kept(code: re.Match[str]) -> str:
        return f"<code>{OPTION.sub(whole, code[1])}</code>"

    return INLINE_CODE.sub(kept, content)
