"""The scripts of a page: the drawing library BokehJS, from the package that carries it, and our own."""

from __future__ import annotations

from importlib import metadata, resources
from pathlib import Path
from typing import Final

from sloshlab.errors import MissingExtraError

EXTRA: Final = "interactive"
_LIBRARY: Final = ("bokeh.min.js", "bokeh-api.min.js")
_OWN: Final = ("drawing.js", "histories.js", "window_map.js", "start.js")


def scripts() -> tuple[str, ...]:
    """Texts of the script elements, in their order.

    Raises
    ------
    MissingExtraError
        If the drawing library is not there.

    Notes
    -----
    The package is not imported, which would take longer than a report: its script is read as a file.
    """
    return (*(_safe(text) for text in _library()), _safe(_own()))


def _library() -> list[str]:
    try:
        installed = metadata.distribution("bokeh")
        folder = Path(str(installed.locate_file("bokeh/server/static/js")))
        return [(folder / name).read_text(encoding="utf-8") for name in _LIBRARY]
    except (metadata.PackageNotFoundError, OSError) as error:
        raise MissingExtraError("bokeh", extra=EXTRA, purpose="zooming into figures") from error


def _own() -> str:
    """Our files as one script, within a function: it shares no name with the library."""
    files = resources.files("pipelines.report.interactive")
    parts = [files.joinpath(name).read_text(encoding="utf-8") for name in _OWN]
    return "(() => {\n'use strict';\n" + "\n".join(parts) + "})();\n"


def _safe(text: str) -> str:
    """A script that does not end before its end: HTML ends it at the first closing tag, in strings, too.

    Line ends are as a browser makes them before it compares hashes.
    """
    plain = text.replace("\r\n", "\n").replace("\r", "\n")
    return plain.replace("</script", "<\\/script").replace("<!--", "<\\!--")
