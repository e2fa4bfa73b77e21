"""Damping of the first mode by the twins against that of the recordings: ζ(a) of decays, ζ₁ in random motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from pipelines.report.numbers import MISSING, signed, text
from pipelines.report.tables import Table
from pipelines.structure.figures_twin import pairs_of
from pipelines.structure.results import BeamExperiment, BeamRun, in_g
from sloshlab.modal.instantaneous_damping import InstantaneousDamping
from sloshlab.modal.pooled_decays import PooledDamping, pooled_damping

FloatArray = npt.NDArray[np.float64]

CYCLES_LEFT_OUT: Final = 2.0
"""After a release, while the liquid breaks up and no model of steady motion can hold."""
_METHOD: Final = 0
"""The logarithmic decrement, as in the source; it alone has a value per cycle."""
_MEASURED_REPEATS: Final = 2
_SCATTER_ALLOWED: Final = 0.3
"""Half a 90 % interval of the mean over ζ beyond which the repeats do not say what a model should meet."""


@dataclass(frozen=True)
class DecayComparison:
    """One twin against the mean of the repeated releases, at amplitudes that are met after the second cycle.

    Attributes
    ----------
    group : str
        The twin.
    amplitude_m_per_s2, measured, twin : ndarray, shape (n_amplitudes,)
        ζ at common amplitudes, rising.
    is_known : ndarray of bool, shape (n_amplitudes,)
        Where the repeats agree well enough with each other.
    """

    group: str
    amplitude_m_per_s2: FloatArray
    measured: FloatArray
    twin: FloatArray
    is_known: npt.NDArray[np.bool_]

    @property
    def deviation(self) -> FloatArray:
        """Relative deviation of the twin's ζ, shape (n_amplitudes,)."""
        return np.asarray(self.twin / self.measured - 1.0)


def decay_comparisons(experiment: BeamExperiment) -> list[DecayComparison]:
    """Compare every twin of a sloshing decay with the recordings; none where there is only one."""
    measured = _pooled(experiment, "sloshing")
    if measured is None:
        return []
    half = 0.5 * np.diff(measured.damping_ratio_interval, axis=0)[0] / np.abs(measured.damping_ratio)
    repeated = measured.n_repeats >= _MEASURED_REPEATS
    found = []
    for group in dict.fromkeys(run.group for run in experiment.free_runs if run.is_simulated):
        twin = _pooled(experiment, group)
        if twin is None:
            continue
        amplitude = measured.acceleration_amplitude_m_per_s2
        its_own = twin.acceleration_amplitude_m_per_s2
        inside = repeated & (amplitude >= its_own.min()) & (amplitude <= its_own.max() * (1 + 1e-9))
        if not inside.any():
            continue
        damping = np.interp(np.log(amplitude[inside]), np.log(its_own), twin.damping_ratio)
        known = half[inside] <= _SCATTER_ALLOWED
        found.append(DecayComparison(group, amplitude[inside], measured.damping_ratio[inside], damping, known))
    return found


def _pooled(experiment: BeamExperiment, group: str) -> PooledDamping | None:
    """Mean over the repeats, the cycles after the release left out."""
    readings = [
        _later(run.first_decay.readings[_METHOD], run)
        for run in experiment.free_runs
        if run.group == group and run.first_decay is not None
    ]
    readings = [reading for reading in readings if reading.used.any()]
    return pooled_damping(readings) if readings else None


def _later(reading: InstantaneousDamping, run: BeamRun) -> InstantaneousDamping:
    decay = run.first_decay
    assert decay is not None
    frequency = float(np.nanmedian(reading.frequency_hz))
    kept = reading.time_s >= decay.release.release_s + CYCLES_LEFT_OUT / frequency
    return InstantaneousDamping(
        reading.method,
        *(getattr(reading, name)[kept] for name in (
            "time_s", "acceleration_amplitude_m_per_s2", "damping_ratio", "damping_ratio_std", "frequency_hz",
            "frequency_hz_std", "coverage_factor", "trust",
        )),
    )  # fmt: skip


def decay_table(experiment: BeamExperiment) -> Table | None:
    """ζ at each amplitude, measured and by every twin, as the table behind Fig. 2.39."""
    found = decay_comparisons(experiment)
    if not found:
        return None
    amplitudes = sorted({float(a) for one in found for a in one.amplitude_m_per_s2}, reverse=True)
    rows = [_row(amplitude, found) for amplitude in amplitudes]
    rows.append(("largest deviation", "", *(_largest(one) for one in found)))
    rows.append(("RMS deviation", "", *(_rms(one) for one in found)))
    header = ("a [g]", "measured ζ₁ [%]", *(f"{one.group} [%]" for one in found))
    note = (
        f"Logarithmic decrement of the first mode from {CYCLES_LEFT_OUT:g} cycles after the release on, means "
        "over repeats within an eighth of a decade of amplitude; in parentheses the deviation of the twin. "
        "Amplitudes in brackets: half the 90 % interval of the measured mean is more than "
        f"{100 * _SCATTER_ALLOWED:.0f} % of it, so that the liquid itself does not repeat; the last rows leave "
        "them out."
    )
    return Table("Damping of decays, twins against recordings", header, tuple(rows), note)


def _row(amplitude: float, found: list[DecayComparison]) -> tuple[str, ...]:
    cells, measured, known = [], MISSING, False
    for one in found:
        at = np.flatnonzero(one.amplitude_m_per_s2 == amplitude)
        if not at.size:
            cells.append(MISSING)
            continue
        measured, known = text(100 * one.measured[at[0]]), bool(one.is_known[at[0]])
        cells.append(f"{text(100 * one.twin[at[0]])} ({signed(100 * one.deviation[at[0]], 2)} %)")
    shown = text(float(in_g(np.array(amplitude))), 3)
    return (shown if known else f"[{shown}]", measured, *cells)


def _largest(decay_comparison: DecayComparison) -> str:
    known = decay_comparison.deviation[decay_comparison.is_known]
    return f"{text(100 * float(np.abs(known).max()), 2)} %" if known.size else MISSING


def _rms(decay_comparison: DecayComparison) -> str:
    known = decay_comparison.deviation[decay_comparison.is_known]
    return f"{text(100 * float(np.sqrt(np.mean(known**2))), 2)} %" if known.size else MISSING


def random_table(experiment: BeamExperiment) -> Table | None:
    """ζ₁ of every twin at every level beside the measured one (Table 2.5)."""
    levels: list[tuple[BeamRun, dict[str, BeamRun]]] = [
        (measured, {run.group: run for run in simulated})
        for measured, simulated in pairs_of(experiment, experiment.random_runs)
        if _fitted(measured) is not None
    ]
    if not levels:
        return None
    groups = list(dict.fromkeys(group for _, simulated in levels for group in simulated))
    rows = []
    for group in groups:
        cells = [_random_cell(measured, simulated.get(group)) for measured, simulated in levels]
        rows.append((group, *cells))
    measured_cells = [text(100 * (_fitted(measured) or np.nan)) for measured, _ in levels]
    header = ("twin", *(f"ζ₁ at {measured.level_text} [%]" for measured, _ in levels))
    note = (
        "From the density of the tank's acceleration alone, in parentheses the deviation from the recording. The "
        "source's Table 2.5 has 2.70, 2.54 and 2.43 % measured, 2.20, 2.38 and 2.95 % by its NFIR model, 0.54, "
        "0.51 and 0.31 % frozen."
    )
    return Table(
        "Damping in random motion, twins against recordings", header, (("measured", *measured_cells), *rows), note
    )


def _fitted(run: BeamRun | None) -> float | None:
    fit = run.random.density_fit if run is not None and run.random is not None else None
    return None if fit is None else fit.damping_ratio


def _random_cell(measured: BeamRun, simulated: BeamRun | None) -> str:
    was, now = _fitted(measured), _fitted(simulated)
    return MISSING if was is None or now is None else f"{text(100 * now)} ({signed(100 * (now / was - 1), 2)} %)"
