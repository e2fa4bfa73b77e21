"""Before and after in a figure that can be touched: every run and channel, every model switched on and off."""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pipelines.diagnosis import figures
from pipelines.diagnosis.results import Diagnosis
from pipelines.report.figure import ReportFigure
from pipelines.report.interactive.contents import Channel, Histories, Line, Role, Run
from pipelines.report.interactive.spectra import power_densities
from sloshlab.diagnosis.inference.scored_model import ScoredModel
from sloshlab.identification.observations import Observation

FloatArray = NDArray[np.float64]
_RECORDED: Final = "recorded"
_BELIEVED: Final = "as believed"
_RETUNED: Final = "baseline retuned"
GROUPS: Final = ("held out: chose nothing", "fitted")
_CAPTION: Final = (
    "Every run and channel, recorded and simulated; below, what the recording has beyond each of them, and power "
    "densities after Welch. Shown first is the run that is missed most, in the cycles that the retuned baseline "
    "misses most; panels over time zoom together. The mean is taken off where it means nothing. Releases and "
    "offsets are those of the fit, or believed where the run was not fitted."
)


def time_histories(name: str, diagnosis: Diagnosis) -> ReportFigure:
    """The figure of the run that is missed most; on a screen every run and channel."""
    still = figures.time_histories(name, diagnosis)
    return dataclasses.replace(still, touch=histories_of(diagnosis))


def histories_of(diagnosis: Diagnosis) -> Histories:
    """All runs, held-out ones first, with all channels: recorded, believed, retuned, and with what was found."""
    found = diagnosis.findings
    groups = zip(GROUPS, (found.held_out, found.fitting), strict=True)
    runs = [
        _run(diagnosis, observed, group)
        for group, them in groups
        for observed in by_misfit(diagnosis, them)
        if observed
    ]
    return Histories("Recorded and simulated", tuple(runs), _CAPTION)


def by_misfit(diagnosis: Diagnosis, runs: list[list[Observation]]) -> list[list[Observation]]:
    """Runs with the one first that the retuned baseline misses most, and so their channels.

    Channels on which what was found acts come before all others.
    """
    found, named = diagnosis.findings, figures.named_channels(diagnosis)
    readings = found.readings(found.retuned)

    def missed(observation: Observation) -> float:
        return float((observation.residual(readings[observation.run.name][observation.channel]) ** 2).sum())

    ordered = sorted(runs, key=lambda run: -sum(missed(observation) for observation in run))
    return [sorted(run, key=lambda each: (each.channel not in named, -missed(each))) for run in ordered]


def _run(diagnosis: Diagnosis, observed: list[Observation], group: str) -> Run:
    run, found = observed[0].run, diagnosis.findings
    models: dict[str, tuple[Role, ScoredModel]] = {
        _BELIEVED: ("believed", found.believed),
        _RETUNED: ("before", found.retuned),
    }
    if diagnosis.after is not None:
        models[figures.extended_label(diagnosis)] = ("after", diagnosis.after)
    readings = {
        label: (role, figures.simulated_channels(diagnosis, model, run)) for label, (role, model) in models.items()
    }
    channels = []
    for observation in observed:
        of_models = {label: (role, reading[observation.channel]) for label, (role, reading) in readings.items()}
        channels.append(channel_of(observation, of_models, diagnosis.findings.surroundings.frequency_hz))
    return Run(run.name, group, tuple(channels))


def channel_of(
    observation: Observation, readings: dict[str, tuple[Role, FloatArray]], frequency_hz: float
) -> Channel:
    """One channel of one run in handy units.

    Parameters
    ----------
    observation : Observation
    readings : dict
        By their labels the roles and what each model reads, shape (n,).
    frequency_hz : float
        Of the motion: so long are the cycles that are shown first.
    """
    run, channel = observation.run, observation.channel
    recorded = np.asarray(run.recording[channel].values, np.float64)
    time = np.asarray(run.recording["time"].values, np.float64)
    factor, unit = figures.handy_units(run, channel)
    lines = [Line(_RECORDED, "recorded", factor * recorded)]
    for label, (role, values) in readings.items():
        shown = factor * comparable(observation, recorded, values)
        lines.append(Line(label, role, shown, begins_hidden=role == "believed"))
    retuned = next(line for line in lines if line.label == _RETUNED)
    stretch = figures.stretch_missed_most(time, frequency_hz, lines[0].values - retuned.values)
    frequency, spectra = power_densities(lines, run.attributes.sampling_rate_hz)
    return Channel(
        channel,
        unit,
        time,
        tuple(lines),
        difference_to=_RECORDED,
        frequency_hz=frequency,
        spectra=spectra,
        spectrum_label=f"density [({unit})²/Hz]",
        view_s=(float(time[stretch][0]), float(time[stretch][-1])),
    )


def comparable(observation: Observation, recorded: FloatArray, simulated: FloatArray) -> FloatArray:
    """A simulation as it is judged: NaN where it is not, and on the recording's mean where that says nothing."""
    shown = np.where(observation.known, simulated, np.nan)
    return shown if observation.keeps_mean else shown + float(np.nanmean(recorded - shown))
