"""The scripts of a page: the drawing library BokehJS, from the package that carries it, and our own.

They are carried compressed, a third of their size. A script of a few lines unpacks them as the page is opened and
adds them as one element, which the policy of the page allows by its hash.
"""

from __future__ import annotations

import base64
import gzip
from dataclasses import dataclass
from importlib import metadata, resources
from pathlib import Path
from typing import Final

from sloshlab.errors import MissingExtraError

EXTRA: Final = "interactive"
_LIBRARY: Final = ("bokeh.min.js", "bokeh-api.min.js")
_OWN: Final = ("drawing.js", "histories.js", "window_map.js", "charts.js", "misfit_map.js", "start.js")


@dataclass(frozen=True)
class Script:
    """What a page needs to draw.

    Attributes
    ----------
    starter : str
        Text of the element that runs first.
    carried : str
        What it unpacks and runs: base64 of the text by gzip (RFC 1952).
    text : str
        The same unpacked; empty, as the others, where nothing is drawn.
    """

    starter: str = ""
    carried: str = ""
    text: str = ""

    @property
    def elements(self) -> tuple[str, ...]:
        """Texts of the script elements that run."""
        return (self.starter, self.text) if self.text else ()

    @property
    def size(self) -> int:
        """Bytes that it takes of a page."""
        return len(self.starter.encode()) + len(self.carried)


def script() -> Script:
    """Library and our own files as one script.

    Raises
    ------
    MissingExtraError
        If the drawing library is not there.

    Notes
    -----
    The package is not imported, which would take longer than a report: its script is read as a file.
    """
    text = "\n".join([*_library(), _own()])
    carried = base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode("ascii")
    return Script(_file("starter.js"), carried, text)


def _library() -> list[str]:
    try:
        installed = metadata.distribution("bokeh")
        folder = Path(str(installed.locate_file("bokeh/server/static/js")))
        return [(folder / name).read_text(encoding="utf-8") for name in _LIBRARY]
    except (metadata.PackageNotFoundError, OSError) as error:
        raise MissingExtraError("bokeh", extra=EXTRA, purpose="zooming into figures") from error


def _own() -> str:
    """Our files within a function: they share no name with the library."""
    return "(() => {\n" + "\n".join(_file(name) for name in _OWN) + "})();\n"


def _file(name: str) -> str:
    """A file of ours, with the line ends that a browser makes before it compares hashes."""
    text = resources.files("pipelines.report.interactive").joinpath(name).read_text(encoding="utf-8")
    return text.replace("\r\n", "\n")
