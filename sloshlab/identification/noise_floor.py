"""The noise floor: variance of each coefficient by sensors, by the noise of drives, and by the scatter of
repeats."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from sloshlab.errors import SloshlabError
from sloshlab.identification.case import Case, CaseRun
from sloshlab.identification.diagnosed_model import DiagnosedModel
from sloshlab.identification.drive_noise import NoiseSpectrum, noise_spectrum
from sloshlab.identification.free_run_fit import fitted
from sloshlab.identification.free_run_problem import FreeRunFit, FreeRunProblem
from sloshlab.identification.observations import (
    IGNORED_VARIANCE,
    Observation,
    observations,
    slow_displacements,
    with_scatter,
    with_typical_scatter,
    within_informative_bands,
)
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics.extension import NOTHING

FloatArray = NDArray[np.float64]
_N_NOISE_DRAWS: Final = 4
"""Simulations with other noise, over which squares are averaged."""
N_BLOCKS: Final = 9
"""Over which squares are averaged: noise through a resonance is steady."""
_DOMINANT_NOISE_RATIO: Final = 1.0
"""Variance by the noise of drives over that of the sensor itself, from which the former dominates."""
_SLOW_DISPLACEMENT_ERROR: Final = 3.0
"""Standard deviations by noise to which a slow displacement is known after the removal of drift."""
_RELATIVE_REACH: Final = 0.05
"""Of a frequency, by which a resonance may be elsewhere: twice the bound of a mode, as an effect moves it, too."""


def weighted_observations(case: Case, model: DiagnosedModel) -> dict[str, list[Observation]]:
    """Observations of all runs, weighted by the scatter of repeats about a retuned baseline.

    Parameters
    ----------
    case : Case
    model : DiagnosedModel

    Returns
    -------
    dict of list of Observation
        Per run.
    """
    plain = {run.name: observations(run, model.compared(run), model.driving(run)) for run in case.runs}
    # A first fit only shows where the simulation is; its weights must not depend on the noise that is sought here.
    fit, _ = fitted(
        FreeRunProblem(model, [_with_inflated_variance(plain[run.name]) for run in case.runs]),
        model.believed,
        n_iterations=5,
    )
    raw = {name: _raw_residual(model, observed, fit) for name, observed in plain.items()}
    # From here on the noise of drives is added explicitly, so that slow displacements keep their information.
    if isinstance(model, RigModel):
        plain = {
            run.name: observations(run, model.compared(run), model.driving(run), knows_noise_of_drive=True)
            for run in case.runs
        }
    sensors = {name: _with_simulated(observed, raw[name]) for name, observed in plain.items()}
    # The noise of drives goes in before the scatter of repeats, as a lower limit to it: a resonance passes that
    # noise in a band so narrow that two repeats tell little of it.
    noise, draws = _noise_of_drives(case, model, sensors, fit)
    plain = {
        name: [
            replace(
                _with_noise_of_drive(observation, noise, model.driving(observation.run)),
                of_drive=draws.get((observation.run.name, observation.channel)),
            )
            for observation in observed
        ]
        for name, observed in sensors.items()
    }
    weighted = dict(plain)
    repeated: list[Observation] = []
    alone: list[CaseRun] = []
    for test in case.tests():
        # A test that was not repeated has to wait for the scatter of all that were.
        if len(test) < 2:
            alone += test
            continue
        group = [plain[run.name] for run in test]
        for run, observed in zip(test, with_scatter(group, [raw[run.name] for run in test]), strict=True):
            weighted[run.name] = observed
            repeated += observed
    for run in alone:
        weighted[run.name] = with_typical_scatter(plain[run.name], repeated)
    return {
        name: within_informative_bands(
            [
                # Judged by the final variance: whether something stands out of the noise depends on all of it.
                _ignored_where_drive_noise_dominates(observation, of_sensor, noise, model.driving(observation.run))
                for observation, of_sensor in zip(observed, sensors[name], strict=True)
            ]
        )
        for name, observed in weighted.items()
    }


def _noise_of_drives(
    case: Case, model: DiagnosedModel, plain: dict[str, list[Observation]], fit: FreeRunFit
) -> tuple[dict[tuple[str, str], FloatArray], dict[tuple[str, str], FloatArray]]:
    """Mean square that the noise of driving accelerometers adds to each coefficient, and draws of what it adds.

    Both per run and channel; draws have the shape (n_draws, n_blocks, n_bands), and those of all channels of a run
    are of the same noise of all accelerometers that drive it.

    At a resonance it is narrow, and two repeats estimate it to a factor of two or three only. It is computed by
    simulations whose drive has as much noise once more, with the spectrum that repeats tell
    (`noise_spectrum`). Of several that drive together each may have to do so alone, beside an effect on
    the others, and the noisiest counts.
    """
    # A twin of a user's own cannot be asked what the noise of its drive makes of its channels.
    if not isinstance(model, RigModel) or case.rig is None:
        return {}, {}
    squares: dict[tuple[str, str], FloatArray] = {}
    draws: dict[tuple[str, str], FloatArray] = {}
    spectrum_of = {
        name: noise_spectrum(case.tests(), name)
        for run in case.runs
        for name in model.driving(run)
        if not run.is_free
    }
    for run in case.runs:
        driving = model.driving(run)
        # In free runs nothing drives.
        if run.is_free or not plain[run.name]:
            continue
        for kept in driving:
            # An effect on a sensor leaves the drive to the others, against whose noise its gain must count.
            recording = run.recording.drop_vars([name for name in driving if name != kept])
            kept_alone = replace(run, recording=recording)
            drawn = _propagated_noise(case, kept_alone, {kept: spectrum_of[kept]}, plain=plain, fit=fit)
            for place, added in drawn.items():
                # The maximum, not the sum: one sensor at a time drives alone.
                square = _over_bands_of_a_resonance(np.mean(added**2, axis=0))
                squares[place] = np.maximum(squares.get(place, 0.0), square)
        spectra = {name: spectrum_of[name] for name in driving}
        draws |= _propagated_noise(case, run, spectra, plain=plain, fit=fit)
    return squares, draws


def _with_noise_of_drive(
    observation: Observation, noise: Mapping[tuple[str, str], FloatArray], driving: Sequence[str]
) -> Observation:
    """An observation of a sensor with the noise of drives in its variance.

    Integration of an accelerometer removes slow displacements of the base with its drift; what is left is known to
    a few times its noise only.
    """
    variance = observation.variance + noise.get((observation.run.name, observation.channel), 0.0)
    return replace(
        observation,
        variance=np.where(slow_displacements(observation, driving), _SLOW_DISPLACEMENT_ERROR**2, 1.0) * variance,
    )


def _ignored_where_drive_noise_dominates(
    observation: Observation,
    of_sensor: Observation,
    noise: Mapping[tuple[str, str], FloatArray],
    driving: Sequence[str],
) -> Observation:
    """An observation that is ignored where the noise of drives dominates and nothing stands out of it.

    There a simulation shows noise that the recording has not: a fit would lessen it by more damping, less
    participation, and a frequency beyond the bands that are compared. All noise of one that drives is that of a
    drive. Compared with the others it would count, and beside an effect on these, where it drives alone, not.
    """
    is_noise = (observation.channel in driving) | np.asarray(
        noise.get((observation.run.name, observation.channel), 0.0) > _DOMINANT_NOISE_RATIO * of_sensor.variance
    )
    ignored = is_noise & ~observation.informative
    variance = np.where(ignored, IGNORED_VARIANCE, 1.0) * observation.variance
    return replace(observation, variance=variance, ignored=ignored)


def _propagated_noise(
    case: Case,
    run: CaseRun,
    driving: Mapping[str, NoiseSpectrum],
    *,
    plain: dict[str, list[Observation]],
    fit: FreeRunFit,
) -> dict[tuple[str, str], FloatArray]:
    """What draws of the noise of driving accelerometers add to each coefficient of the residual of every channel.

    A driving accelerometer that is compared, too, has its own noise in its residual beside what all of it makes of
    the simulation.
    """
    if case.rig is None or any(run.recording[name].attrs["quantity"] != "acceleration" for name in driving):
        return {}
    drawn: dict[tuple[str, str], list[FloatArray]] = {}
    with suppress(SloshlabError):
        # The recorded drive has its noise already, in a draw that nobody knows. As much noise once more changes
        # the simulation by as much, on average.
        noise_free = _readings(case, run, fit)
        # Fixed seeds: the same case gives the same answer.
        for seed in range(_N_NOISE_DRAWS):
            generator = np.random.default_rng(seed)
            noise = {name: spectrum.drawn(run, name, generator) for name, spectrum in driving.items()}
            noisier = run.recording.assign(
                {name: run.recording[name].copy(data=run.recording[name].values + noise[name]) for name in noise}
            )
            noisy = _readings(case, replace(run, recording=noisier), fit)
            for observation in plain[run.name]:
                name = observation.channel
                if name in noisy and (name not in driving or len(driving) > 1):
                    added = observation.of(noise_free[name]) - observation.of(noisy[name])
                    if name in noise:
                        added = added + observation.of(noise[name])
                elif name not in run.recording.data_vars:
                    # A sensor that was left out of the drive is compared with the motion of the one kept, and so
                    # with its noise.
                    [added] = (-observation.of(own) for own in noise.values())
                else:
                    continue
                drawn.setdefault((run.name, name), []).append(added)
    return {place: np.stack(draws) for place, draws in drawn.items()}


def _over_bands_of_a_resonance(square: FloatArray) -> FloatArray:
    """Mean squares over some blocks, of each band the largest within which its resonance may lie.

    Noise through a resonance is steady and narrow; where the resonance is, only the fit will tell, and neither
    bands of too little nor of too much variance must attract it.
    """
    # A smear over neighbouring bands instead was tried: fits moved modes out of the compared bands, damped them
    # and lessened their share in the motion of the base.
    steady = uniform_filter(square, (N_BLOCKS, 1), mode="nearest")
    bands = np.arange(square.shape[1])
    reach = np.ceil(_RELATIVE_REACH * (bands + 0.5)).astype(int)
    return np.stack(
        [steady[:, max(k - n, 0) : k + n + 1].max(axis=1) for k, n in zip(bands, reach, strict=True)], 1
    )


def _readings(case: Case, run: CaseRun, fit: FreeRunFit) -> dict[str, FloatArray]:
    assert case.rig is not None
    # A model of its own, as drives are cached by the name of a run and this run has another drive.
    return RigModel(case.rig, case.folder, [run]).simulate(run, fit.values, NOTHING)


def _with_inflated_variance(observed: Sequence[Observation]) -> list[Observation]:
    """With five per cent of each channel's RMS added to its noise: the first fit must not depend on unknown
    noise.
    """
    return [
        replace(observation, variance=observation.variance + (0.05**2) * float(np.mean(observation.spectra**2)))
        for observation in within_informative_bands(observed)
    ]


def _with_simulated(observed: Sequence[Observation], raw: Mapping[str, FloatArray]) -> list[Observation]:
    """Observations with what is simulated of them, where it is."""
    return [
        replace(observation, simulated=observation.spectra - raw[observation.channel])
        if observation.channel in raw
        else observation
        for observation in observed
    ]


def _raw_residual(
    model: DiagnosedModel, observed: Sequence[Observation], fit: FreeRunFit
) -> dict[str, FloatArray]:
    if not observed:
        return {}
    try:
        readings = model.simulate(observed[0].run, fit.values, NOTHING)
    except SloshlabError:
        return {}
    return {
        observation.channel: observation.residual(readings[observation.channel]) * np.sqrt(observation.variance)
        for observation in observed
    }
