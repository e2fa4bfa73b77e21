"""Sizes of the motion in a case, from which effects choose their start values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, cast

import numpy as np
from numpy.typing import NDArray
from scipy.signal import hilbert

from sloshlab.channel_names import ACCELERATION_ROOT
from sloshlab.identification.diagnosed_model import DiagnosedModel, ModelOfBlocks
from sloshlab.identification.free_run_problem import FreeRunFit, FreeRunProblem
from sloshlab.identification.observations import Observation
from sloshlab.missing_physics.candidate import Surroundings
from sloshlab.missing_physics.update_rates import update_rates_hz
from sloshlab.recording import channels
from sloshlab.rig import Rig

FloatArray = NDArray[np.float64]
_BASE: Final = ACCELERATION_ROOT
_LARGEST_COHERENCE: Final = 0.9
"""Squared coherence of a channel with the base from which both read one motion, with a gain and a delay."""
_MOST_PEAKS: Final = 3
"""Bands in which modes are sought."""
ACROSS_A_BAND: Final = (0.0, -0.4, 0.4, -0.8, 0.8)
"""Places in a band, in halves of its width from its middle: a resonance may be narrower than the band."""
_ONE_FREQUENCY: Final = 1.1
"""Of x_rms a_rms/v_rms², which is one for a harmonic motion, times the ratio of the frequencies of runs."""


def surroundings_of(problem: FreeRunProblem, fit: FreeRunFit, rig: Rig | None) -> Surroundings:
    """Sizes of the motion, from the retuned simulation of the fitting runs.

    Parameters
    ----------
    problem : FreeRunProblem
        Of the baseline alone.
    fit : FreeRunFit
    rig : Rig or None
        None where the twin is a user's own: effects that ask for it are not offered.
    """
    model, fitting = problem.model, problem.runs
    largest = np.zeros(3)
    frequencies, spreads = [], []
    for observed in fitting:
        run = observed[0].run
        place = model.motion(run, fit.values)
        largest = np.maximum(largest, np.abs(place).max(axis=0))
        rms = place.std(axis=0)
        # RMS of acceleration over that of velocity; of one frequency it is exact.
        frequencies.append(rms[2] / max(rms[1], 1e-12) / (2 * np.pi))
        # One for a harmonic motion and more for any other (Cauchy and Schwarz).
        spreads.append(rms[2] * rms[0] / max(rms[1] ** 2, 1e-300))
    return Surroundings(
        rig=cast(Rig, rig),
        twin=model.twin,
        displacement_m=float(largest[0]),
        velocity_m_per_s=float(largest[1]),
        acceleration_m_per_s2=float(largest[2]),
        frequency_hz=float(np.median(frequencies)),
        force_n=float(model.moving_mass_kg * largest[2]),
        channels=_sizes(fitting, model),
        driving=tuple(sorted({name for run in fitting for name in model.driving(run[0].run)})),
        sampling_rate_hz=fitting[0][0].run.attributes.sampling_rate_hz,
        longest_run_s=max(observed[0].run.duration_s for observed in fitting),
        blocks=model.blocks,
        peaks=_sizes(fitting, model, lambda values: np.nanmax(np.abs(values))),
        missed_hz=residual_peaks_hz(fitting, problem.residual(problem.theta_of(fit.values))),
        n_modes=0 if model.twin.structure is None else model.twin.structure.masses_kg.size,
        incoherent_with_base=_incoherent_with_base(fitting),
        has_one_frequency=max(spreads) * max(frequencies) / min(frequencies) < _ONE_FREQUENCY,
        runs=tuple(run.name for run in model.runs),
        update_rates_hz=_update_rates(fitting, float(np.max(frequencies))),
        own_effects=model.effects if isinstance(model, ModelOfBlocks) else (),
    )


def _update_rates(fitting: Sequence[Sequence[Observation]], frequency_hz: float) -> dict[str, tuple[float, ...]]:
    """Compared channels that look held, and rates of their updates."""
    recorded: dict[tuple[str, float], list[FloatArray]] = {}
    for observation in (observation for run in fitting for observation in run):
        key = observation.channel, observation.run.attributes.sampling_rate_hz
        values = np.asarray(observation.run.recording[observation.channel].values, np.float64)
        recorded.setdefault(key, []).append(values)
    found: dict[str, tuple[float, ...]] = {}
    for (channel, rate_hz), recordings in recorded.items():
        # a line at twice the frequency is the motion's own
        if rates := update_rates_hz(recordings, rate_hz, 2.5 * frequency_hz):
            found.setdefault(channel, rates)
    return found


def _incoherent_with_base(fitting: Sequence[Sequence[Observation]]) -> frozenset[str]:
    """Channels whose analytic signal is not coherent with that of the accelerometer of the base.

    Of all driven runs together: steady motion of one frequency has one such number, motion of several has not.
    """
    products: dict[str, list[FloatArray]] = {}
    for run in (observed[0].run for observed in fitting if not observed[0].run.is_free):
        if _BASE not in run.recording or not np.isfinite(run.recording[_BASE].values).any():
            continue
        base = _analytic(run.recording[_BASE].values)
        for name in channels(run.recording):
            if not np.isfinite(run.recording[name].values).any():
                continue
            own = _analytic(run.recording[name].values)
            # Sums over runs, not means of coherences: a gain and a delay have to be the same in all of them.
            part = np.array([np.vdot(base, own), np.vdot(base, base), np.vdot(own, own)])
            products.setdefault(name, []).append(part)
    sums = {name: np.abs(np.sum(parts, axis=0)) for name, parts in products.items()}
    return frozenset(name for name, (both, base, own) in sums.items() if both**2 < _LARGEST_COHERENCE * base * own)


def _analytic(values: FloatArray) -> NDArray[np.complex128]:
    return np.asarray(hilbert(np.nan_to_num(np.asarray(values, np.float64) - np.nanmean(values))))


def residual_peaks_hz(
    fitting: Sequence[Sequence[Observation]], residual: FloatArray, places: Sequence[float] = (0.0,)
) -> tuple[float, ...]:
    """Frequencies of the highest peaks of the weighted residuals, all runs and channels together.

    Parameters
    ----------
    fitting : sequence of sequences of Observation
    residual : ndarray, shape (n,)
        Of their coefficients.
    places : sequence of float
        In the band of each peak, in halves of its width from its middle.

    Returns
    -------
    tuple of float
        Hz, places of the highest peak first.
    """
    n_bands = max(observation.spectra.shape[1] for run in fitting for observation in run)
    power, count, first = np.zeros(n_bands), np.full(n_bands, 1e-300), 0
    frequencies = np.zeros(n_bands)
    for observation in (observation for run in fitting for observation in run):
        own = residual[first : first + observation.spectra.size].reshape(observation.spectra.shape)
        first += observation.spectra.size
        n = observation.spectra.shape[1]
        # Over the noise, so that channels of all units add up and one that shows a mode well counts most.
        power[:n] += (own**2).sum(axis=0)
        count[:n] += observation.spectra.shape[0]
        frequencies[:n] = observation.frequencies_hz
    mean = power / count
    beside = np.pad(mean, 1)
    peaks = np.flatnonzero((mean >= beside[:-2]) & (mean >= beside[2:]) & (frequencies > 0))
    highest = peaks[np.argsort(-mean[peaks])][:_MOST_PEAKS]
    half = 0.5 * float(frequencies[1] - frequencies[0]) if n_bands > 1 else 0.0
    return tuple(float(frequencies[k] + share * half) for k in highest for share in places)


def _sizes(
    fitting: Sequence[Sequence[Observation]],
    model: DiagnosedModel,
    size: Callable[[FloatArray], float] = np.nanstd,
) -> dict[str, float]:
    """Channels, compared and driving, with their size, the RMS by default."""
    found: dict[str, float] = {}
    for observed in fitting:
        run = observed[0].run
        for name in (*[observation.channel for observation in observed], *model.driving(run)):
            if name in channels(run.recording):
                found[name] = max(found.get(name, 0.0), float(size(run.recording[name].values)))
    return found
