"""The noise floor: variance of each coefficient by sensors, by the noise of drives, and by the scatter of
repeats."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter, uniform_filter1d

from sloshlab.conditioning.combined_channels import weights_by_noise
from sloshlab.errors import SloshlabError
from sloshlab.identification.case import Case, CaseRun
from sloshlab.identification.diagnosed_model import DiagnosedModel
from sloshlab.identification.drive_noise import NoiseSpectrum, noise_spectrum
from sloshlab.identification.free_run_fit import fitted
from sloshlab.identification.free_run_problem import TEMPERING, FreeRunFit, FreeRunProblem
from sloshlab.identification.observations import (
    IGNORED_VARIANCE,
    Observation,
    OtherDrive,
    observations,
    slow_displacements,
    with_scatter,
    with_typical_scatter,
    within_informative_bands,
)
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics.candidate import extension_of
from sloshlab.missing_physics.extension import NOTHING

FloatArray = NDArray[np.float64]
_OfChannels = dict[tuple[str, str], FloatArray]
"""Per run and channel."""
_N_NOISE_DRAWS: Final = 4
"""Simulations with other noise, over which squares are averaged."""
N_BLOCKS: Final = 9
"""Over which squares are averaged: noise through a resonance is steady."""
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
    noise, draws, without = _noise_of_drives(case, model, sensors, fit)
    plain = {
        name: [
            replace(
                _with_noise_of_drive(observation, noise, model.driving(observation.run)),
                of_drive=draws.get((observation.run.name, observation.channel)),
                other_drives=_other_drives(observation, without, model.driving(observation.run)),
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
                _ignored_where_drive_noise_counts(observation, noise, model.driving(observation.run))
                for observation in observed
            ]
        )
        for name, observed in weighted.items()
    }


def _noise_of_drives(
    case: Case, model: DiagnosedModel, plain: dict[str, list[Observation]], fit: FreeRunFit
) -> tuple[_OfChannels, _OfChannels, dict[str, dict[tuple[str, str], OtherDrive]]]:
    """Variance that the noise of driving accelerometers adds to each coefficient, and draws of what it adds.

    Draws have the shape (n_draws, n_blocks, n_bands), and those of all channels of a run are of the same noise of
    all accelerometers that drive it; last the same without one of several that drive together, by that one.

    At a resonance it is narrow, and two repeats estimate it to a factor of two or three only. It is computed by
    simulations whose drive has as much noise once more, with the spectrum that repeats tell
    (`noise_spectrum`).
    """
    # A twin of a user's own cannot be asked what the noise of its drive makes of its channels.
    if not isinstance(model, RigModel) or case.rig is None:
        return {}, {}, {}
    variances: _OfChannels = {}
    draws: _OfChannels = {}
    without: dict[str, dict[tuple[str, str], OtherDrive]] = {}
    spectrum_of = {
        name: noise_spectrum(case.tests(), name)
        for run in case.runs
        for name in model.driving(run)
        if not run.is_free
    }
    for run in case.runs:
        driving, observed = model.driving(run), plain[run.name]
        # In free runs nothing drives.
        if run.is_free or not observed:
            continue
        spectra = {name: spectrum_of[name] for name in driving}
        drawn = _propagated_noise(model, run, spectra, observed, fit)
        added = _added_variances(observed, drawn, driving)
        draws |= _shared(drawn, added, driving)
        variances |= added
        for left_out in driving if len(driving) > 1 else ():
            # An effect on a sensor leaves the drive to the others, against whose noise its gain must count.
            kept = [name for name in driving if name != left_out]
            others = replace(run, recording=run.recording.drop_vars(left_out))
            drawn = _propagated_noise(model, others, {name: spectra[name] for name in kept}, observed, fit)
            more = _added_variances(observed, drawn, kept)
            without.setdefault(left_out, {}).update(
                _beside_fault(observed, added, _shared(drawn, more, kept), more, left_out)
            )
    return variances, draws, without


def with_noise_through(
    model: DiagnosedModel,
    runs: Sequence[Sequence[Observation]],
    tests: Sequence[Sequence[str]],
    before: FreeRunFit,
    fit: FreeRunFit,
) -> list[list[Observation]]:
    """Observations with what the noise of drives makes of them beside a fit, where it is more than beside another.

    What is not linear in the motion makes more of it: a drag turns the slow error of an integrated velocity into
    side bands of all that moves. Observations stay the same objects where all that a model could gain by the
    difference is less than a nat, or where a simulation does not reach its end.

    Parameters
    ----------
    model : DiagnosedModel
        What the noise of its drive makes of a user's own twin is not known.
    runs : sequence of sequences of Observation
        Per run.
    tests : sequence of sequences of str
        Names of the runs of every test.
    before : FreeRunFit
        Beside which the noise of drives is in the observations.
    fit : FreeRunFit
    """
    if not isinstance(model, RigModel):
        return [list(run) for run in runs]
    by_name = {run.name: run for run in model.runs}
    grouped = [[by_name[name] for name in test if name in by_name] for test in tests]
    found: list[list[Observation]] = []
    for observed in runs:
        run, driving = observed[0].run, model.driving(observed[0].run)
        if run.is_free:
            found.append(list(observed))
            continue
        spectra = {name: noise_spectrum(grouped, name) for name in driving}
        drawn = [_propagated_noise(model, run, spectra, observed, each) for each in (before, fit)]
        known, added = (_added_variances(observed, of_fit, driving) for of_fit in drawn)
        draws = _shared(drawn[1], added, driving) if known and added else {}
        found.append(
            [
                _with_more_noise(each, added[place] - known[place], draws[place], driving)
                if (place := (run.name, each.channel)) in draws and place in known
                else each
                for each in observed
            ]
        )
    return found


def _with_more_noise(
    observation: Observation, more: FloatArray, draws: FloatArray, driving: Sequence[str]
) -> Observation:
    added = _slow_factors(observation, driving) * np.maximum(more, 0.0)
    if (added / observation.variance).sum() < 2.0 * TEMPERING:
        return observation
    least = observation.without_scatter
    return replace(
        observation,
        variance=observation.variance + added,
        without_scatter=None if least is None else least + added,
        of_drive=draws,
    )


def _added_variances(observed: Sequence[Observation], drawn: _OfChannels, driving: Sequence[str]) -> _OfChannels:
    """What the noise of those that drive adds to the variances of the channels of a run, as its draws say.

    Deviations of n readings from their mean are n - 1 independent ones. Of channels that drive together each gets
    their sum over n - 1 for its variance, which may be less than that of its sensor, so that all of them count as
    much as what tells one from the others, whichever is faulty.
    """
    found = {
        (each.run.name, each.channel): _over_bands_of_a_resonance(np.mean(of_channel**2, axis=0))
        for each in observed
        if (of_channel := drawn.get((each.run.name, each.channel))) is not None
    }
    together = [each for each in observed if each.channel in driving and (each.run.name, each.channel) in found]
    if 1 < len(together) == len(driving):
        pooled = sum(found[each.run.name, each.channel] for each in together) / (len(together) - 1)
        found |= {(each.run.name, each.channel): pooled - each.variance for each in together}
    return found


def _shared(drawn: _OfChannels, added: _OfChannels, driving: Sequence[str]) -> _OfChannels:
    """Draws of what channels share with a drive: deviations from the mean of those that drive share nothing.

    They have the power that is added to the variances, of which they would tell less than all otherwise.
    """
    shared = {}
    for place, of_channel in drawn.items():
        power = _steady(of_channel**2)
        is_shared = (power > 0) & (place[1] not in driving)
        ratio = np.divide(added[place], power, out=np.zeros(power.shape), where=is_shared)
        shared[place] = np.sqrt(ratio) * of_channel
    return shared


def _beside_fault(
    observed: Sequence[Observation], added: _OfChannels, drawn: _OfChannels, more: _OfChannels, left_out: str
) -> dict[tuple[str, str], OtherDrive]:
    """Noise of the channels of a run beside a fault, from what all and what the others add to variances."""
    found = {}
    faulty = next((each for each in observed if each.channel == left_out), None)
    for each in observed:
        place = (each.run.name, each.channel)
        if place not in added:
            continue
        # The others alone are no quieter than all together; four draws may say so.
        variance = np.maximum(more.get(place, 0.0) - added[place], 0.0)
        own = drawn.get(place, np.zeros((_N_NOISE_DRAWS, *each.spectra.shape)))
        told = np.zeros(each.spectra.shape)
        if faulty is not None and faulty is not each and (each.run.name, left_out) in drawn:
            reading = drawn[each.run.name, left_out]
            told = _steady(own * reading) / (_steady(reading**2) + faulty.variance)
        found[place] = OtherDrive(variance, own, told)
    return found


def _steady(drawn: FloatArray) -> FloatArray:
    """Mean over draws and neighbouring blocks."""
    return np.asarray(uniform_filter1d(drawn.mean(axis=0), N_BLOCKS, axis=0, mode="nearest"))


def _with_noise_of_drive(
    observation: Observation, noise: Mapping[tuple[str, str], FloatArray], driving: Sequence[str]
) -> Observation:
    """An observation of a sensor with the noise of drives in its variance.

    Integration of an accelerometer removes slow displacements of the base with its drift; what is left is known to
    a few times its noise only.
    """
    variance = observation.variance + noise.get((observation.run.name, observation.channel), 0.0)
    return replace(observation, variance=_slow_factors(observation, driving) * variance)


def _slow_factors(observation: Observation, driving: Sequence[str]) -> FloatArray:
    return np.where(slow_displacements(observation, driving), _SLOW_DISPLACEMENT_ERROR**2, 1.0)


def _other_drives(
    observation: Observation,
    without: Mapping[str, Mapping[tuple[str, str], OtherDrive]],
    driving: Sequence[str],
) -> dict[str, OtherDrive]:
    """Noise of an observation where one of several that drive is left out, by that one."""
    place, slow = (observation.run.name, observation.channel), _slow_factors(observation, driving)
    return {
        left_out: replace(of_channels[place], added=slow * of_channels[place].added)
        for left_out, of_channels in without.items()
        if place in of_channels
    }


def _ignored_where_drive_noise_counts(
    observation: Observation, noise: Mapping[tuple[str, str], FloatArray], driving: Sequence[str]
) -> Observation:
    """An observation that is ignored where nothing stands out and less noise of drives would be evidence.

    There a simulation shows noise that the recording has not: a fit would lessen it by more damping, less
    participation, a frequency beyond the bands that are compared, or a spring that isolates. All that it can gain
    by that is the share of the drive's noise in each variance; together these must be less than a nat. All noise
    of one that drives is that of a drive. Compared with the others it would count, and beside an effect on these,
    where it drives alone, not.
    """
    is_plain = ~observation.informative
    share = noise.get((observation.run.name, observation.channel), 0.0) / observation.variance
    is_noise = (observation.channel in driving) | np.asarray(share * is_plain.sum() > 2.0 * TEMPERING)
    ignored = is_noise & is_plain
    variance = np.where(ignored, IGNORED_VARIANCE, 1.0) * observation.variance
    return replace(observation, variance=variance, ignored=ignored)


def _propagated_noise(
    model: RigModel,
    run: CaseRun,
    driving: Mapping[str, NoiseSpectrum],
    observed: Sequence[Observation],
    fit: FreeRunFit,
) -> _OfChannels:
    """What draws of the noise of driving accelerometers add to each coefficient of the residual of every channel.

    A driving accelerometer that is compared, too, has its own noise in its residual beside what all of it makes of
    the simulation.
    """
    if any(run.recording[name].attrs["quantity"] != "acceleration" for name in driving):
        return {}
    drawn: dict[tuple[str, str], list[FloatArray]] = {}
    with suppress(SloshlabError):
        # The recorded drive has its noise already, in a draw that nobody knows. As much noise once more changes
        # the simulation by as much, on average.
        noise_free = _readings(model, run, fit)
        # Fixed seeds: the same case gives the same answer.
        for seed in range(_N_NOISE_DRAWS):
            generator = np.random.default_rng(seed)
            noise = {name: spectrum.drawn(run, name, generator) for name, spectrum in driving.items()}
            noisier = run.recording.assign(
                {name: run.recording[name].copy(data=run.recording[name].values + noise[name]) for name in noise}
            )
            noisy = _readings(model, replace(run, recording=noisier), fit)
            for observation in observed:
                name = observation.channel
                if name in noisy and (name not in driving or len(driving) > 1):
                    added = observation.of(noise_free[name]) - observation.of(noisy[name])
                    if name in noise:
                        added = added + observation.of(noise[name])
                elif name not in run.recording.data_vars:
                    # A sensor that was left out of the drive is compared with the motion of those kept, and so
                    # with the noise of their mean.
                    weights = weights_by_noise(run.recording, list(noise))
                    added = -observation.of(np.tensordot(weights, list(noise.values()), axes=1))
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


def _readings(model: RigModel, run: CaseRun, fit: FreeRunFit) -> dict[str, FloatArray]:
    # A model of its own, as drives are cached by the name of a run and this run has another drive.
    alone = RigModel(model.rig, model.folder, [run])
    return alone.simulate(run, fit.values, extension_of(fit.candidates, fit.values))


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
