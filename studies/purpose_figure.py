"""What the program is for, in one picture: ``python -m studies.purpose_figure [FOLDER]``.

The ready-made case of the demonstration is diagnosed, and drawn on a run that nothing was fitted to: the
simulation before and after, its error, and the sentence of the verdict. Nothing in the picture is typed by hand.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import xarray as xr

import sloshlab as sl
from pipelines.report.style import DISTINCT_COLOURS, NEUTRAL_COLOUR, drawing_style, new_figure, png_bytes
from sloshlab.atomic_file import write_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FILE_NAME: Final = "purpose.png"
CASE: Final = Path(__file__).resolve().parents[1] / "raw_data" / "cases" / "friction" / "case"
_CHANNEL: Final = "displacement_tank"
_SHOWN_S: Final = 1.6
_BEFORE, _AFTER = DISTINCT_COLOURS[1], DISTINCT_COLOURS[2]


def missed_most(history: xr.Dataset) -> slice:
    """Samples of the stretch of `_SHOWN_S` in which the retuned simulation misses the channel most.

    Parameters
    ----------
    history : xarray.Dataset
        One run of `CaseVerdict.histories`.

    Returns
    -------
    slice
    """
    channel = history[_CHANNEL]
    missed = (channel.sel(model="retuned") - channel.sel(model="recorded")).values
    n_samples = round(_SHOWN_S / float(history["time"].diff("time").mean()))
    energy = np.convolve(np.nan_to_num(missed) ** 2, np.ones(n_samples), mode="valid")
    return slice(int(energy.argmax()), int(energy.argmax()) + n_samples)


def purpose_figure(verdict: sl.CaseVerdict) -> Figure:
    """Before above after, the errors at their side, the sentence below.

    Parameters
    ----------
    verdict : CaseVerdict
    """
    histories = verdict.histories()
    unseen = next(node for node in histories.children.values() if node.attrs["held_out"]).to_dataset()
    part = unseen.isel(time=missed_most(unseen))
    figure = new_figure(4.6)
    grid = figure.add_gridspec(3, 2, width_ratios=(2.2, 1.0), height_ratios=(1.0, 1.0, 0.34))
    before = figure.add_subplot(grid[0, 0])
    after = figure.add_subplot(grid[1, 0], sharex=before, sharey=before)
    _draw(before, part, "retuned", _BEFORE, "simulated, its numbers retuned")
    _draw(after, part, "extended", _AFTER, "simulated, with what was found")
    before.tick_params(labelbottom=False)
    before.set_title("a run that nothing was fitted to")
    after.set_xlabel("time [s]")
    _draw_errors(figure.add_subplot(grid[:2, 1]), verdict.fit)
    _draw_sentence(figure.add_subplot(grid[2, :]), verdict.headline)
    return figure


def _draw(axes: Axes, part: xr.Dataset, model: str, colour: str, label: str) -> None:
    time, channel = part["time"].values, 1e3 * part[_CHANNEL]
    axes.plot(time, channel.sel(model="recorded"), color="#b8c4d0", lw=3.0, label="recorded")
    axes.plot(time, channel.sel(model=model), color=colour, lw=1.2, label=label)
    axes.set(ylabel="position [mm]", xlim=(time[0], time[-1]))
    axes.margins(y=0.35)
    axes.legend(loc="upper right", ncols=2, frameon=False, fontsize=8)


def _draw_errors(axes: Axes, fit: Mapping[str, Any]) -> None:
    errors = {
        "as\nbelieved": (fit["heldout_before"], NEUTRAL_COLOUR),
        "numbers\nretuned": (fit["heldout_retuned"], _BEFORE),
        "with what\nwas found": (fit["heldout_after"], _AFTER),
    }
    for place, (error, colour) in enumerate(errors.values()):
        axes.bar(place, error, color=colour, width=0.6)
        # beside the line of the noise a number could not be read
        axes.annotate(f"{error:.1f}", (place, max(error, 1.0)), (0, 3), textcoords="offset points", ha="center")
    axes.axhline(1.0, color="black", lw=0.8, ls="--", label="noise")
    axes.legend(loc="upper right")
    axes.set(title="its error over the noise", xticks=range(3), xticklabels=list(errors))
    axes.margins(y=0.12)


def _draw_sentence(axes: Axes, headline: str) -> None:
    axes.axis("off")
    text = headline.replace(". ", ".\n")
    box = {"boxstyle": "round,pad=0.6", "fc": "#eef2f6", "ec": _AFTER}
    axes.text(0.5, 0.6, text, ha="center", va="center", fontsize=9.5, bbox=box, transform=axes.transAxes)


def main(folder: Path = Path("docs/images")) -> Path:
    """Diagnose the case and write the figure; returns its path."""
    verdict = sl.diagnose(CASE)
    with drawing_style():
        data = png_bytes(purpose_figure(verdict))
    path = folder / FILE_NAME
    write_bytes(path, data)
    return path


if __name__ == "__main__":
    print(main(*map(Path, sys.argv[1:])))
