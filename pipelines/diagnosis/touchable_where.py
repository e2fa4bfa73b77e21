"""Where every channel of every run is missed, in a figure whose cells choose what the time histories show."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pipelines.diagnosis import figures
from pipelines.diagnosis.results import Diagnosis
from pipelines.diagnosis.touchable_histories import GROUPS, by_misfit
from pipelines.report.figure import ReportFigure
from pipelines.report.interactive.misfit_map import MisfitMap, MissedChannel, MissedRun
from pipelines.report.style import WORK_COLOURS
from sloshlab.identification.mismatch import ChannelMismatch, mismatches
from sloshlab.identification.observations import Observation

FloatArray = NDArray[np.float64]
Readings = Mapping[str, Mapping[str, FloatArray]]
HISTORIES: Final = "time_histories"
"""Name of the figure that a cell points at."""
_N_COLOURS: Final = 64
_CAPTION: Final = (
    "Where every run and channel is missed: squares of the weighted residuals beyond their expectation, per block "
    "and band, before and after. A cell, or a stretch of the list, chooses its run, channel and time in the "
    "figure of the time histories."
)


def where(name: str, diagnosis: Diagnosis) -> ReportFigure:
    """The channel that is missed most; on a screen every channel of every run."""
    still = figures.where(name, diagnosis)
    return dataclasses.replace(still, touch=misfit_map(diagnosis))


def misfit_map(diagnosis: Diagnosis) -> MisfitMap:
    """Runs and channels in the order of the time histories."""
    import matplotlib
    from matplotlib.colors import to_hex

    found = diagnosis.findings
    models = {"baseline retuned": found.readings(found.retuned)}
    if diagnosis.after is not None:
        models[figures.extended_label(diagnosis)] = found.readings(diagnosis.after)
    groups = zip(GROUPS, (found.held_out, found.fitting), strict=True)
    runs = [
        _missed_run(observed, group, list(models.values()))
        for group, them in groups
        for observed in by_misfit(diagnosis, them)
        if observed
    ]
    shades = matplotlib.colormaps[WORK_COLOURS]
    colours = tuple(to_hex(shades(share)) for share in np.linspace(0, 1, _N_COLOURS))
    label = "log₁₀(1 + misfit beyond noise)"
    return MisfitMap("Where the misfit is", label, tuple(models), tuple(runs), colours, HISTORIES, _CAPTION)


def _missed_run(observed: Sequence[Observation], group: str, models: Sequence[Readings]) -> MissedRun:
    by_model = [mismatches([observed], readings) for readings in models]
    run = observed[0].run
    # blocks count from the first sample, time histories show the times of the recording
    start_s = float(run.recording["time"].values[0])
    return MissedRun(run.name, group, tuple(_missed_channel(of, start_s) for of in zip(*by_model, strict=True)))


def _missed_channel(of_models: Sequence[ChannelMismatch], start_s: float) -> MissedChannel:
    before = of_models[0]
    n_shown = figures.highest_missed_band(before) + 1
    misfit = tuple(mismatch.excess[:, :n_shown] for mismatch in of_models)
    return MissedChannel(before.channel, start_s + before.time_s, before.frequency_hz[:n_shown], misfit)
