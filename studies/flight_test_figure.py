"""What a diagnosis of a flight test shows, in one picture: ``python -m studies.flight_test_figure [FOLDER]``.

A wing with more lift than believed flies in the virtual laboratory and is diagnosed. Drawn are a flight that
nothing was fitted to, before and after, and which block owns how much of the mismatch. Nothing in the picture is
typed by hand.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipelines.diagnosis.diagnose import diagnosed, opened_folder
from pipelines.diagnosis.results import Diagnosis
from pipelines.recording.virtual_flight import make_flight
from pipelines.report.style import DISTINCT_COLOURS, NEUTRAL_COLOUR, drawing_style, new_figure, png_bytes
from sloshlab.atomic_file import write_bytes

FILE_NAME: Final = "flight_tests.png"
MODEL: Final = Path(__file__).resolve().parents[1] / "docs" / "examples" / "flight_wing.toml"
HIDDEN: Final = "lift_gain=0.2"
_CHANNEL: Final = "acceleration_tip_rear"
_SHOWN_S: Final = 1.5
_FLIGHTS: Final = {"flight_gust": "a gust passage", "flight_pulse": "a pulse of the flap"}


def flight_test_figure(diagnosis: Diagnosis) -> Figure:
    """A run that chose nothing, before above after; shares of the blocks at their side; the sentence below.

    Parameters
    ----------
    diagnosis : Diagnosis
    """
    found = diagnosis.findings
    run = found.split.held_out[0]
    best = diagnosis.verdict.model or found.retuned
    recorded = np.asarray(run.recording[_CHANNEL].values, np.float64)
    retuned, extended = (found.readings(model)[run.name][_CHANNEL] for model in (found.retuned, best))
    n = round(_SHOWN_S * run.attributes.sampling_rate_hz)
    first = int(np.convolve((recorded - retuned) ** 2, np.ones(n), mode="valid").argmax())
    part = slice(first, first + n)
    time = np.asarray(run.recording["time"].values)[part]
    figure = new_figure(4.8)
    grid = figure.add_gridspec(3, 2, width_ratios=(1.9, 1.0), height_ratios=(1.0, 1.0, 0.3))
    before = figure.add_subplot(grid[0, 0])
    after = figure.add_subplot(grid[1, 0], sharex=before, sharey=before)
    _draw(before, time, recorded[part], retuned[part], DISTINCT_COLOURS[1], "simulated, its numbers retuned")
    _draw(after, time, recorded[part], extended[part], DISTINCT_COLOURS[2], "simulated, with what was found")
    # room for the legend above the peaks
    before.set_ylim(top=1.7 * float(recorded[part].max()))
    before.tick_params(labelbottom=False)
    before.set_title(f"{_FLIGHTS.get(run.attributes.experiment, run.name)} that nothing was fitted to")
    after.set_xlabel("time [s]")
    _draw_blocks(figure.add_subplot(grid[:2, 1]), diagnosis)
    words = figure.add_subplot(grid[2, :])
    words.axis("off")
    words.text(0.0, 0.4, diagnosis.verdict.headline, wrap=True, va="center", ha="left")
    return figure


def _draw(
    axes: Axes, time: np.ndarray, recorded: np.ndarray, simulated: np.ndarray, colour: str, label: str
) -> None:
    axes.plot(time, recorded, color=NEUTRAL_COLOUR, linewidth=2.4, label="recorded")
    axes.plot(time, simulated, color=colour, linewidth=1.2, label=label)
    axes.set_ylabel("tip [m/s²]")
    axes.legend(loc="upper center", fontsize="small")


def _draw_blocks(axes: Axes, diagnosis: Diagnosis) -> None:
    cut = diagnosis.examination.cut
    assert cut is not None
    blocks = sorted(cut.blocks, key=lambda block: block.share)
    shares = np.array([block.share for block in blocks])
    errors = np.array([[block.share - block.low, block.high - block.share] for block in blocks]).T
    axes.barh([block.block for block in blocks], 100 * shares, xerr=100 * errors, color=DISTINCT_COLOURS[0])
    axes.set_xlim(0, 105)
    axes.set_xlabel("explains of the mismatch, alone [%]")


def main(folder: Path) -> None:
    """Fly, diagnose, draw."""
    with tempfile.TemporaryDirectory() as temporary:
        case = Path(temporary) / "flight"
        make_flight(MODEL, case, seed=2, hide=HIDDEN)
        diagnosis = diagnosed(opened_folder(case, with_rig=False), command="studies.flight_test_figure")
        with drawing_style():
            write_bytes(folder / FILE_NAME, png_bytes(flight_test_figure(diagnosis)))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images"))
