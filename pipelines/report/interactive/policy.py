"""What a page of ours may do: draw what it carries, and nothing else."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence


def content_security_policy(scripts: Sequence[str], style: str) -> str:
    """The Content Security Policy of a page that carries everything it needs.

    Parameters
    ----------
    scripts : sequence of str
        Texts of the script elements that may run, no others; none may make code of text.
    style : str
        Text of the one style element. With scripts, styles are free: the drawing library writes its own as it
        draws. They can fetch nothing either.

    Notes
    -----
    W3C, Content Security Policy Level 3: a hash is of the text between the tags in UTF-8.

    Examples
    --------
    >>> content_security_policy([], "p { margin: 0 }").split("; ")[:3]
    ["default-src 'none'", "connect-src 'none'", 'img-src data:']
    """
    allowed = " ".join(hash_of(script) for script in scripts) or "'none'"
    styles = "'unsafe-inline'" if scripts else hash_of(style)
    return (
        f"default-src 'none'; connect-src 'none'; img-src data:; style-src {styles}; script-src {allowed}; "
        "base-uri 'none'; form-action 'none'; object-src 'none'"
    )


def hash_of(text: str) -> str:
    """The source expression of an element by its text."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode('ascii')}'"
