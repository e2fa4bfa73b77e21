r"""Noise by a liquid whose damping fluctuates: side bands of its force, in runs that were not repeated.

The force of a chaotic liquid is its damping times a velocity, and its damping is another one in every cycle. What
it differs by from its mean, σ f(t) ξ(t) with a ξ that is correlated over one cycle, has the power

.. math:: \sigma^2 \int |F(t, f')|^2 \frac{1}{\pi} \frac{\gamma}{\gamma^2 + (f - f')^2} df', \qquad
          \gamma = \frac{f'}{2\pi}

(a Lorentzian about every line f' of the force). Repeats tell σ by how much they scatter; what a test would show
that was not repeated is σ times what is simulated of it. Where no test was repeated, σ is what gives the mean of a
run the deviation that is believed of it: :math:`\sigma^2 = \sigma_\mathrm{run}^2 f T / 2`, as the mean over T of
what is correlated over 1/f has 2/(f T) of its variance.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from sloshlab.diagnosis.inference.places import PLACES_IN_A_BAND, TANK, transfers_of
from sloshlab.errors import SloshlabError
from sloshlab.identification.diagnosed_model import DiagnosedModel, Request
from sloshlab.identification.free_run_problem import FreeRunFit
from sloshlab.identification.observations import SCATTER_AVERAGED_OVER, Observation
from sloshlab.identification.rig_model import RigModel
from sloshlab.identification.rig_parameters import TOLERANCE_OF_FLUCTUATION, damps_as_liquid
from sloshlab.missing_physics.candidate import extension_of

FloatArray = NDArray[np.float64]


def with_fluctuation(
    model: DiagnosedModel, runs: Sequence[Sequence[Observation]], repeated: Collection[str], fit: FreeRunFit
) -> list[list[Observation]]:
    """Observations with the noise of a liquid whose damping fluctuates, as strong as repeats scatter.

    Parameters
    ----------
    model : DiagnosedModel
        What dissipates in a user's own twin is not known: it has no such noise.
    runs : sequence of sequences of Observation
        Per run.
    repeated : collection of str
        Names of the runs whose variance is the scatter of their repeats; they tell σ and stay as they are.
    fit : FreeRunFit
        Of the baseline.
    """
    same = [list(run) for run in runs]
    if not isinstance(model, RigModel):
        return same
    powers = [_powers(model, run, fit) if run and model.liquid_fluctuates(run[0].run) else [] for run in runs]
    told = [
        _strength_squared(observation, power)
        for run, of_run in zip(runs, powers, strict=True)
        if of_run and run[0].run.name in repeated
        for observation, power in zip(run, of_run, strict=True)
        if power.any()
    ]
    # The median, so that a burst in one of them does not set it.
    of_repeats = float(np.nanmedian(told)) if np.isfinite(told).any() else None
    return [
        [
            _noisier(each, power, _believed_squared(run) if of_repeats is None else of_repeats)
            for each, power in zip(run, of_run, strict=True)
        ]
        if of_run and run[0].run.name not in repeated
        else run
        for run, of_run in zip(same, powers, strict=True)
    ]


def _believed_squared(run: Sequence[Observation]) -> float:
    """σ² by what is believed of the mean of a run."""
    power = np.asarray(run[0].spectra ** 2)
    mean_hz = float((power @ run[0].frequencies_hz).sum() / power.sum())
    return TOLERANCE_OF_FLUCTUATION**2 * mean_hz * run[0].run.duration_s / 2


def _noisier(observation: Observation, power: FloatArray, strength_squared: float) -> Observation:
    fluctuation = _quiet(observation) + strength_squared * power
    return replace(observation, variance=np.maximum(observation.variance, fluctuation))


def _powers(model: RigModel, run: Sequence[Observation], fit: FreeRunFit) -> list[FloatArray]:
    """Power of the fluctuation in every channel for σ = 1, shape (n_blocks, n_bands); none if it does not run."""
    with suppress(SloshlabError):
        request = Request(run[0].run, fit.values, extension_of(fit.candidates, fit.values))
        simulation = model.whole_simulation(request)
        is_liquid = [damps_as_liquid(term) for term in simulation.twin.terms]
        spread = _spread(run[0].of(simulation.forces_n[:, is_liquid].sum(axis=1)) ** 2, run[0].frequencies_hz)
        gains = _mean_gains(model, run, fit)
        return [spread * gains[:, i] for i in range(len(run))]
    return []


def _mean_gains(model: RigModel, run: Sequence[Observation], fit: FreeRunFit) -> FloatArray:
    """Squared readings per force at the tank, shape (n_bands, n_channels); resonances are narrower than bands."""
    bands_hz = run[0].frequencies_hz
    within = (np.arange(PLACES_IN_A_BAND) + 0.5) / PLACES_IN_A_BAND - 0.5
    at_hz = bands_hz[:, None] + within * (bands_hz[1] - bands_hz[0])
    gains = np.abs(transfers_of(model, run, fit.values, at_hz.ravel())[TANK]) ** 2
    return np.asarray(gains.reshape(*at_hz.shape, len(run)).mean(axis=1))


def _spread(power: FloatArray, frequencies_hz: FloatArray) -> FloatArray:
    """Power of lines with a Lorentzian about each, which is correlated over one cycle of its line."""
    half_width = frequencies_hz / (2 * np.pi)
    shape = half_width[:, None] / (half_width[:, None] ** 2 + (frequencies_hz - frequencies_hz[:, None]) ** 2)
    # As much power as the line has, though the bands end.
    return np.asarray(power @ (shape / shape.sum(axis=1, keepdims=True)))


def _counted(observation: Observation) -> FloatArray:
    """Variance of what is not ignored; NaN elsewhere."""
    ignored = False if observation.ignored is None else observation.ignored
    return np.where(ignored, np.nan, observation.variance)


def _quiet(observation: Observation) -> FloatArray:
    """Variance of the stretches in which little moves, per band."""
    counted = _counted(observation)
    return np.asarray(np.nanmedian(np.where(np.isnan(counted).all(axis=0), observation.variance, counted), axis=0))


def _strength_squared(observation: Observation, power: FloatArray) -> float:
    """σ² by the scatter of repeats where most of it is none of quiet stretches; NaN where there is none."""
    quiet = _quiet(observation)
    beyond = _counted(observation) - quiet
    is_most = beyond > quiet
    # Scatter was averaged over neighbours. The median: a line and a resonance have no more say than side bands.
    ratios = beyond[is_most] / uniform_filter(power, SCATTER_AVERAGED_OVER, mode="nearest")[is_most]
    return float(np.median(ratios)) if ratios.size else float("nan")
