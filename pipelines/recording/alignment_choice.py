"""How several devices are to be aligned, as it is typed: `--align` and `--redundant`."""

from __future__ import annotations

from collections.abc import Iterable

from acquisition.recorder.assembly import ALIGNMENTS, Align
from sloshlab.errors import InputError


def checked_align(text: str) -> Align:
    """The alignment that `text` names.

    Raises
    ------
    InputError
        If there is none of this name.

    Examples
    --------
    >>> checked_align("counter")
    'counter'
    """
    for known in ALIGNMENTS:
        if text == known:
            return known
    raise InputError("--align", got=repr(text)[:80], allowed=", ".join(ALIGNMENTS))


def channel_pairs(texts: Iterable[str]) -> tuple[tuple[str, str], ...]:
    """Names of redundant channels, from texts ``A:B``.

    Raises
    ------
    InputError
        If one is not ``A:B``.

    Examples
    --------
    >>> channel_pairs(["acceleration_control:acceleration_roof_1"])
    (('acceleration_control', 'acceleration_roof_1'),)
    """
    return tuple(_pair(text) for text in texts)


def _pair(text: str) -> tuple[str, str]:
    first, _, second = text.partition(":")
    if not first or not second or ":" in second or first == second:
        raise InputError("--redundant", got=repr(text)[:80], allowed="A:B, two different channels")
    return first, second
