"""Damping of the first mode by the twins against that of the recordings: ζ(a) of decays, ζ₁ in random motion."""

from __future__ import annotations

from typing import Final

import numpy as np

from pipelines.report.numbers import MISSING, signed, text
from pipelines.report.tables import Table
from pipelines.structure.figures_twin import pairs_of
from pipelines.structure.results import BeamExperiment, BeamRun, in_g
from sloshlab.modal.free_decay import FreeDecay
from sloshlab.modal.instantaneous_damping import InstantaneousDamping
from sloshlab.modal.pooled_decays import DampingDeviation, PooledDamping, damping_deviation, pooled_damping

CYCLES_LEFT_OUT: Final = 2.0
"""After a release, while the liquid breaks up and no model of steady motion can hold."""
_METHOD: Final = 0
"""The logarithmic decrement, as in the source; it alone has a value per cycle."""
_MEASURED_REPEATS: Final = 2
"""Releases at an amplitude, at least: with one the scatter of the liquid is not known."""
_SCATTER_ALLOWED: Final = 0.3
"""Half a 90 % interval of the mean over ζ beyond which the repeats do not say what a model should meet."""


def decay_comparisons(experiment: BeamExperiment) -> dict[str, DampingDeviation]:
    """Compare every twin of a sloshing decay with the mean of the repeated releases; none where there is only one.

    Returns
    -------
    dict of str to DampingDeviation
        By twin; from the third cycle after the release on.
    """
    measured = _pooled(experiment, "sloshing")
    if measured is None:
        return {}
    found = {}
    for group in dict.fromkeys(run.group for run in experiment.free_runs if run.is_simulated):
        twin = _pooled(experiment, group)
        deviation = (
            None
            if twin is None
            else damping_deviation(
                measured, twin, fewest_repeats=_MEASURED_REPEATS, largest_scatter=_SCATTER_ALLOWED
            )
        )
        if deviation is not None:
            found[group] = deviation
    return found


def _pooled(experiment: BeamExperiment, group: str) -> PooledDamping | None:
    """Mean over the repeats, the cycles after the release left out."""
    decays = [run.first_decay for run in experiment.free_runs if run.group == group]
    readings = [_later(decay) for decay in decays if decay is not None]
    readings = [reading for reading in readings if reading.used.any()]
    return pooled_damping(readings) if readings else None


def _later(decay: FreeDecay) -> InstantaneousDamping:
    reading = decay.readings[_METHOD]
    frequency = float(np.nanmedian(reading.frequency_hz))
    return reading.since(decay.release.release_s + CYCLES_LEFT_OUT / frequency)


def decay_table(experiment: BeamExperiment) -> Table | None:
    """ζ at each amplitude, measured and by every twin, as the table behind Fig. 2.39."""
    found = decay_comparisons(experiment)
    if not found:
        return None
    amplitudes = sorted({float(a) for twin in found.values() for a in twin.amplitude_m_per_s2}, reverse=True)
    rows = [_row(amplitude, list(found.values())) for amplitude in amplitudes]
    rows.append(("largest deviation", "", *(_share(twin.largest) for twin in found.values())))
    rows.append(("RMS deviation", "", *(_share(twin.rms) for twin in found.values())))
    header = ("a [g]", "measured ζ₁ [%]", *(f"{group} [%]" for group in found))
    note = (
        f"Logarithmic decrement of the first mode from {CYCLES_LEFT_OUT:g} cycles after the release on, means "
        "over repeats within an eighth of a decade of amplitude; in parentheses the deviation of the twin. "
        "Amplitudes in brackets: half the 90 % interval of the measured mean is more than "
        f"{100 * _SCATTER_ALLOWED:.0f} % of it, so that the liquid itself does not repeat; the last rows leave "
        "them out."
    )
    return Table("Damping of decays, twins against recordings", header, tuple(rows), note)


def _row(amplitude: float, twins: list[DampingDeviation]) -> tuple[str, ...]:
    cells, measured, known = [], MISSING, False
    for twin in twins:
        at = np.flatnonzero(twin.amplitude_m_per_s2 == amplitude)
        if not at.size:
            cells.append(MISSING)
            continue
        measured, known = text(100 * twin.measured[at[0]]), bool(twin.is_known[at[0]])
        cells.append(f"{text(100 * twin.model[at[0]])} ({signed(100 * twin.relative[at[0]], 2)} %)")
    shown = text(float(in_g(np.array(amplitude))), 3)
    return (shown if known else f"[{shown}]", measured, *cells)


def _share(deviation: float) -> str:
    return f"{text(100 * deviation, 2)} %" if np.isfinite(deviation) else MISSING


def random_table(experiment: BeamExperiment) -> Table | None:
    """ζ₁ of every twin at every level beside the measured one (Table 2.5)."""
    levels: list[tuple[BeamRun, dict[str, BeamRun]]] = [
        (measured, {run.group: run for run in simulated})
        for measured, simulated in pairs_of(experiment, experiment.random_runs)
        if fitted_damping(measured) is not None
    ]
    if not levels:
        return None
    groups = list(dict.fromkeys(group for _, simulated in levels for group in simulated))
    rows = []
    for group in groups:
        cells = [_random_cell(measured, simulated.get(group)) for measured, simulated in levels]
        rows.append((group, *cells))
    measured_cells = [text(100 * (fitted_damping(measured) or np.nan)) for measured, _ in levels]
    header = ("twin", *(f"ζ₁ at {measured.level_text} [%]" for measured, _ in levels))
    note = (
        "From the density of the tank's acceleration alone, in parentheses the deviation from the recording. The "
        "source's Table 2.5 has 2.70, 2.54 and 2.43 % measured, 2.20, 2.38 and 2.95 % by its NFIR model, 0.54, "
        "0.51 and 0.31 % frozen."
    )
    return Table(
        "Damping in random motion, twins against recordings", header, (("measured", *measured_cells), *rows), note
    )


def fitted_damping(run: BeamRun | None) -> float | None:
    """ζ₁ from the density of the tank's acceleration alone; None where no mode was found in it."""
    fit = run.random.density_fit if run is not None and run.random is not None else None
    return None if fit is None else fit.damping_ratio


def _random_cell(measured: BeamRun, simulated: BeamRun | None) -> str:
    was, now = fitted_damping(measured), fitted_damping(simulated)
    return MISSING if was is None or now is None else f"{text(100 * now)} ({signed(100 * (now / was - 1), 2)} %)"
