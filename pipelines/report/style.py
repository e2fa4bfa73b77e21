"""Typography, colours and the bytes of a figure: one style, valid inside one context only."""

from __future__ import annotations

import contextlib
import functools
import io
import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FloatArray = npt.NDArray[np.float64]

DOTS_PER_INCH: Final = 160
_N_COLOURS: Final = 256
WIDTH_INCH: Final = 6.7
"""Width of a figure: the text width of an A4 page, so that fonts print at the size given here."""

_LEGEND_CHARACTERS: Final = 100
_HANDLE_CHARACTERS: Final = 8
"""Characters that fit beside each other above a figure, and what a legend handle takes of them."""

_RC: Final[dict[str, Any]] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.3,
    "lines.markersize": 3.5,
    "axes.unicode_minus": True,
    "text.parse_math": False,
    "savefig.facecolor": "white",
    "figure.facecolor": "white",
}

WORK_COLOURS: Final = "viridis"
ERROR_COLOURS: Final = "cividis"
SIGNED_COLOURS: Final = "PuOr_r"
REFERENCE_COLOUR: Final = "#d62728"
MODE_COLOUR: Final = "#ff2fd6"
ACCELERATION_COLOUR: Final = "#e07b00"
NEUTRAL_COLOUR: Final = "#3b5b7a"
DISTINCT_COLOURS: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8a6d00", "#56b4e9", "#000000")
"""Okabe and Ito's colours for lines that have no order, darkened where they would be faint on white."""
DISTINCT_MARKERS: Final = ("o", "s", "^", "D", "v", "P", "X")
REGIME_MARKS: Final = {
    "quiet": ("#9aa5b1", "o"),
    "Faraday": ("#0072b2", "^"),
    "impacts": ("#e69f00", "s"),
    "chaotic": ("#a3123a", "D"),
}


@contextlib.contextmanager
def drawing_style() -> Iterator[None]:
    """Draw inside this context: matplotlib's own defaults, then ours; both are undone at its end."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_RC)
        yield


def new_figure(height_inch: float, width_inch: float = WIDTH_INCH) -> Figure:
    """An empty figure that no global list of figures knows, so that nothing has to close it."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width_inch, height_inch), dpi=DOTS_PER_INCH, layout="constrained")


def png_bytes(figure: Figure) -> bytes:
    """The figure as PNG with a palette, a third of the size, and without date: same figure, same bytes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    height, width, _ = pixels.shape
    image = Image.fromarray(np.vstack([pixels, _swatches(width)]))
    reduced = image.quantize(_N_COLOURS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    buffer = io.BytesIO()
    reduced.crop((0, 0, width, height)).save(buffer, format="PNG", dpi=(DOTS_PER_INCH, DOTS_PER_INCH))
    return buffer.getvalue()


def _swatches(width: int) -> npt.NDArray[np.uint8]:
    """Rows of the colours of small marks: the palette is cut by area and would drop them; shape (24, width, 3)."""
    from matplotlib.colors import to_rgb

    regimes = [colour for colour, _ in REGIME_MARKS.values()]
    marks = [REFERENCE_COLOUR, MODE_COLOUR, ACCELERATION_COLOUR, NEUTRAL_COLOUR, *DISTINCT_COLOURS, *regimes]
    colours = np.round(255 * np.array([to_rgb(colour) for colour in marks])).astype(np.uint8)
    row = colours[np.arange(width) * len(marks) // width]
    return np.broadcast_to(row, (24, width, 3))


def negative_colours() -> Any:
    """Colours for negative values, dark for the most negative, without the black end."""
    import matplotlib
    from matplotlib.colors import ListedColormap

    return ListedColormap(matplotlib.colormaps["magma"](np.linspace(0.16, 0.97, 256)))


def ordered_colours(n: int) -> list[tuple[float, ...]]:
    """Colours for n lines that have an order, from dark to light, none too faint on white."""
    import matplotlib

    places = np.linspace(0.05, 0.82, n) if n > 1 else np.array([0.3])
    return [tuple(float(part) for part in matplotlib.colormaps["plasma"](place)) for place in places]


def plain(text: object, longest: int = 40) -> str:
    """Text from outside as a figure can show it: one line, not too long, glyphs the font has.

    Examples
    --------
    >>> plain("run\\n7"), plain("_hidden"), plain("x" * 60)
    ('run 7', ' _hidden', 'xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx…')
    """
    line = " ".join(str(text).split())
    # a missing glyph would be a warning and an empty box
    shown = "".join(letter if ord(letter) in _glyphs() else "?" for letter in line[:longest])
    if len(line) > longest:
        shown = shown[: longest - 1] + "…"
    # matplotlib leaves labels with a leading underscore out of legends
    return f" {shown}" if shown.startswith("_") else shown


@functools.cache
def _glyphs() -> frozenset[int]:
    from matplotlib.font_manager import FontProperties, findfont, get_font

    return frozenset(get_font(findfont(FontProperties(family=["DejaVu Sans"]))).get_charmap())


def file_stem(text: str, longest: int = 60) -> str:
    """Text as a part of a file name.

    Examples
    --------
    >>> file_stem("../Rig <1>.toml")
    'Rig_1_.toml'
    """
    return re.sub(r"[^A-Za-z0-9.-]+", "_", text).lstrip("._-")[:longest] or "unnamed"


def legend_columns(labels: Sequence[str], largest: int = 6) -> int:
    """Columns of a legend above a figure that its longest label leaves room for."""
    longest = max((len(label) for label in labels), default=1)
    return max(1, min(len(labels), largest, _LEGEND_CHARACTERS // (longest + _HANDLE_CHARACTERS)))
