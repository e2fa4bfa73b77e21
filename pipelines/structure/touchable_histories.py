"""Every run of a structure in figures that can be touched: modes, forces, and what twins make of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from pathlib import PurePath
from typing import Final

import numpy as np
import numpy.typing as npt

from pipelines.report.figure import ReportFigure
from pipelines.report.interactive.contents import Channel, Histories, Line, Run
from pipelines.report.interactive.spectra import power_densities
from pipelines.structure import figures_signals
from pipelines.structure.results import BeamExperiment, BeamRun, in_g

FloatArray = npt.NDArray[np.float64]

_RECORDED: Final = "recorded"
_FIRST_CYCLES: Final = 14
_SHOWN_S: Final = 4.0
_CAPTION: Final = (
    "modal accelerations in the scale of the rig's tip values, accelerations of tank and root, and forces, with "
    "their power densities after Welch; means are taken out. Panels over time zoom together. Where twins were "
    "driven by a run, they are drawn with it, and what the recording has beyond them."
)


def modal_accelerations(name: str, experiment: BeamExperiment) -> ReportFigure:
    """The figure of the first runs; on a screen every free run and channel."""
    still = figures_signals.modal_accelerations(name, experiment)
    return dataclasses.replace(still, touch=histories_of(experiment, experiment.free_runs, "Free decays"))


def random_signals(name: str, experiment: BeamExperiment) -> ReportFigure:
    """The figure of the random runs; on a screen every channel of each."""
    still = figures_signals.random_signals(name, experiment)
    return dataclasses.replace(still, touch=histories_of(experiment, experiment.random_runs, "Random motion"))


def histories_of(experiment: BeamExperiment, runs: Sequence[BeamRun], title: str) -> Histories:
    """Recorded runs by their configuration with the twins that they drove; twins alone where nothing was recorded.

    Parameters
    ----------
    experiment : BeamExperiment
    runs : sequence of BeamRun
        Those to choose from.
    title : str
    """
    recorded = [run for run in runs if not run.is_simulated] or list(runs)
    shown = [Run(run.name, run.group, tuple(_channels(experiment, run, _twins_of(run, runs)))) for run in recorded]
    return Histories(title, tuple(shown), f"{title}, run by run: {_CAPTION}")


def _twins_of(recorded: BeamRun, runs: Sequence[BeamRun]) -> list[BeamRun]:
    """Twins that a run drove, sampled as it is."""
    return [
        run
        for run in runs
        if run is not recorded
        and run.simulated_from == PurePath(recorded.path.name).name
        and run.time_s.size == recorded.time_s.size
        and np.allclose(run.time_s, recorded.time_s)
    ]


def signals_of(experiment: BeamExperiment, run: BeamRun) -> dict[str, tuple[str, FloatArray]]:
    """Units and values of everything that is shown of a run, by its name."""
    found = {
        f"mode: {mode}": ("g", in_g(run.response.acceleration_m_per_s2[number]))
        for number, mode in enumerate(experiment.modes.names)
    }
    found["tank"] = ("g", in_g(run.tank_acceleration))
    if run.root_acceleration is not None:
        found["root"] = ("g", in_g(run.root_acceleration))
    if run.interface_force is not None:
        dynamic_n = experiment.total_mass_kg * run.tank_acceleration - run.interface_force
        found["force of the structure"] = ("N", run.interface_force)
        found["Δf of the liquid"] = ("N", dynamic_n)
    return found


def _channels(experiment: BeamExperiment, run: BeamRun, twins: Sequence[BeamRun]) -> Iterator[Channel]:
    of_twins = {twin.group: signals_of(experiment, twin) for twin in twins}
    for name, (unit, values) in signals_of(experiment, run).items():
        label = run.group if run.is_simulated else _RECORDED
        lines = [Line(label, "recorded" if of_twins else "before", values)]
        lines += [Line(group, "other", found[name][1]) for group, found in of_twins.items() if name in found]
        frequency_hz, densities = power_densities(lines, run.attributes.sampling_rate_hz)
        yield Channel(
            name,
            unit,
            run.time_s,
            tuple(lines),
            difference_to=_RECORDED if len(lines) > 1 else "",
            frequency_hz=frequency_hz,
            spectra=densities,
            spectrum_label=f"density [{unit}²/Hz]",
            view_s=_first_view(run),
        )


def _first_view(run: BeamRun) -> tuple[float, float]:
    """The first cycles of a decay, the first seconds of another run."""
    start, end = float(run.time_s[0]), float(run.time_s[-1])
    decay = run.first_decay
    length_s = _SHOWN_S if decay is None else decay.release.release_s + _FIRST_CYCLES / decay.release.frequency_hz
    return start, min(end, start + length_s)
