"""Where samples come from, written as one line: ``scheme:target?option=value&…``.

The scheme names a backend, found by the entry-point group ``sloshlab.sources``; nothing of a backend is
imported before it is asked for. Options are read through `URLOptions`, so that a misspelt one is an
error and not a silent default.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from typing import Final
from urllib.parse import unquote

from acquisition.sources.interface import Source, SourceURL
from sloshlab.errors import SourceError
from sloshlab.registry import Registry

BACKENDS: Final[Registry[Callable[[SourceURL], Source]]] = Registry(
    "backend",
    group="sloshlab.sources",
    error=SourceError,
    remedy="check the word before the colon, or install the package that brings the backend",
)
"""By the scheme of a URL: classes or functions that make a source of it."""
for _scheme, _backend in {
    # as text: a backend and its libraries are loaded when a URL asks for them
    "can": "acquisition.sources.can_source:CanSource",
    "file": "acquisition.sources.file_source:FileSource",
    "serial": "acquisition.sources.serial_source:SerialSource",
    "sim": "acquisition.sources.simulated_source:SimulatedSource",
}.items():
    BACKENDS.declare(_scheme, _backend)

LONGEST_URL: Final = 4096
"""Characters; longer ones are refused."""

_SCHEME = re.compile(r"[a-z][a-z0-9_+.-]{0,31}")
_DEVICE = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
_YES_NO = {"yes": True, "no": False}


def parse_url(text: str) -> SourceURL:
    """Take a URL apart; the backend and its options are not looked at.

    Parameters
    ----------
    text : str
        ``scheme:target?option=value&…``. The first colon ends the scheme, the first question mark the
        target. Target and options may be percent-encoded: ``%3F`` is a question mark, ``%26`` an
        ampersand, ``%25`` a per cent sign.

    Returns
    -------
    SourceURL

    Raises
    ------
    SourceError
        If it has no scheme, or an option has no value or stands twice.

    Examples
    --------
    >>> url = parse_url("serial:socket://127.0.0.1:7000?device=daq")
    >>> url.scheme, url.target, dict(url.options)
    ('serial', 'socket://127.0.0.1:7000', {'device': 'daq'})
    """
    # a URL is quoted in errors and stored in recordings: no control characters reach either
    if len(text) > LONGEST_URL or not text.isprintable():
        got = f"{len(text)} characters" if len(text) > LONGEST_URL else repr(text)
        raise SourceError("source", got=got, allowed=f"≤ {LONGEST_URL} printable characters on one line")
    scheme, colon, rest = text.partition(":")
    if not colon or not _SCHEME.fullmatch(scheme):
        raise SourceError(
            f"source {text!r}",
            got="no scheme",
            allowed="scheme:target, for example serial:/dev/ttyUSB0",
            remedy=f"write file:{text} to play a recording",
        )
    # no urlsplit: a target is a path, a port or a URL of its own, whose slashes and colons are its own business
    target, _, query = rest.partition("?")
    return SourceURL(text, scheme, unquote(target), _parsed_options(text, query))


def open_source(text: str) -> Source:
    """The source that a URL names, not yet opened: use it as a context manager.

    Parameters
    ----------
    text : str
        As for `parse_url`.

    Returns
    -------
    Source
        Of the backend whose entry point has the scheme's name.

    Raises
    ------
    SourceError
        If the URL is malformed, no backend or more than one has the scheme, or the backend cannot be
        imported or refuses target or options.
    """
    url = parse_url(text)
    return BACKENDS.named(url.scheme, asked_for=f"source {url.text}")(url)


def _parsed_options(text: str, query: str) -> dict[str, str]:
    options: dict[str, str] = {}
    for part in filter(None, query.split("&")):
        name, equals, value = part.partition("=")
        if not name or not equals or name in options:
            raise SourceError(
                f"source {text}",
                got=f"option {name!r} twice" if name in options else f"{part!r}",
                allowed="option=value, each option once, joined by &",
            )
        options[name] = unquote(value)
    return options


class URLOptions:
    """The options of a URL, read one by one; what nobody asked for is refused.

    Parameters
    ----------
    url : SourceURL

    Examples
    --------
    >>> options = URLOptions(parse_url("sim:shaker_sweep?duration_s=60&real_time=no"))
    >>> options.number("duration_s", 240.0, lowest=5, highest=7200), options.yes("real_time", True)
    (60.0, False)
    >>> options.refuse_others()
    """

    def __init__(self, url: SourceURL) -> None:
        self._url = url
        self._known: list[str] = []

    def text(self, name: str, default: str | None = None) -> str | None:
        """The option as it stands, or the default."""
        self._known.append(name)
        return self._url.options.get(name, default)

    def choice(self, name: str, default: str, allowed: Iterable[str]) -> str:
        """One of the allowed words."""
        value, words = self.text(name, default) or "", tuple(allowed)
        if value not in words:
            raise self.error(name, value, ", ".join(words))
        return value

    def yes(self, name: str, default: bool) -> bool:
        """``yes`` or ``no``."""
        return _YES_NO[self.choice(name, "yes" if default else "no", _YES_NO)]

    def number(self, name: str, default: float, *, lowest: float, highest: float) -> float:
        """A finite number within limits, both allowed."""
        text = self.text(name)
        if text is None:
            return default
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        # false for values that are not numbers, too
        if not lowest <= value <= highest:
            raise self.error(name, text, f"a number, {lowest:g} … {highest:g}")
        return value

    def integer(self, name: str, default: int, *, lowest: int, highest: int) -> int:
        """A whole number within limits, both allowed."""
        text = self.text(name)
        if text is None:
            return default
        # by a pattern: Python's int takes underscores, digits of other scripts and numbers of any length
        if not re.fullmatch(r"[+-]?[0-9]{1,18}", text) or not lowest <= int(text) <= highest:
            raise self.error(name, text, f"a whole number, {lowest} … {highest}")
        return int(text)

    def device(self, default: str) -> str:
        """Option ``device``: a short name; the default is made into one."""
        made = re.sub(r"[^A-Za-z0-9_.-]+", "_", default).lstrip("_.-")[:64] or self._url.scheme
        name = self.text("device", made) or ""
        if not _DEVICE.fullmatch(name):
            raise self.error(
                "device", name, "up to 64 letters, digits, '_', '.', '-', beginning with one of the former two"
            )
        return name

    def refuse_others(self) -> None:
        """Refuse options that have not been read.

        Raises
        ------
        SourceError
        """
        for name, value in self._url.options.items():
            if name not in self._known:
                raise self.error(name, value, f"options {', '.join(sorted(set(self._known)))}")

    def error(self, name: str, got: str, allowed: str) -> SourceError:
        """The error that says that an option cannot be used."""
        return SourceError(f"source {self._url.text}: {name}", got=repr(got)[:80], allowed=allowed)
