"""What a sparse regression explains: latent forces and residuals of channels, with the columns of its terms.

Each term also has a response, what a unit of it adds to every channel through the retuned baseline, so that models
of all places are compared by one error.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sloshlab.identification.observations import Observation
from sloshlab.missing_force.force_inversion import frequencies_hz, in_frequency, in_time, response
from sloshlab.missing_force.latent_force import EITHER, LatentForce, channel_responses
from studies.rivals.baseline import RetunedBaseline
from studies.rivals.libraries import LIBRARIES, SENSOR, STRUCTURE, TANK, Motion, columns

FloatArray = NDArray[np.float64]
_MOST_SAMPLES: Final = 20000
"""Of a target: more of them are thinned out evenly."""


@dataclass(frozen=True, eq=False)
class Target:
    """What is regressed at one place.

    Attributes
    ----------
    place, channel : str
        Of `LIBRARIES`; the channel of a sensor.
    values : ndarray, shape (n,)
        Of the fitted runs, one after another.
    table : ndarray, shape (n, n_terms)
        Of the same samples.
    responses : list of ndarray, shape (n_rows, n_terms)
        Per run, what a unit of each term adds to all coefficients of its channels, in standard deviations of their
        noise.
    """

    place: str
    channel: str
    values: FloatArray
    table: FloatArray
    responses: list[FloatArray]


def targets_of(found: RetunedBaseline) -> Iterator[Target]:
    """The latent force at every place, and what every channel reads beyond the retuned baseline.

    Parameters
    ----------
    found : RetunedBaseline
    """
    for place in dict.fromkeys(force.place for forces in found.forces.values() for force in forces.forces):
        yield _of_force(found, place)
    for channel in dict.fromkeys(each.channel for run in found.runs for each in run):
        target = _of_channel(found, channel)
        if target is not None:
            yield target


def _of_force(found: RetunedBaseline, place: str) -> Target:
    """The latent force at a place; one that may be at either is sought in the structure."""
    at = STRUCTURE if place == EITHER else place
    terms = LIBRARIES[at]
    forces = {name: force for name, of_run in found.forces.items() if (force := of_run.at(place)) is not None}
    fitted = [run[0].run.name for run in found.fitting if run[0].run.name in forces]
    sizes = np.max([np.abs(forces[name].motion).max(axis=0) for name in fitted or forces], axis=0)
    largest = (float(sizes[0]), float(sizes[1]), float(sizes[2]))
    tables = {name: columns(terms, _motion_of(force, largest)) for name, force in forces.items()}

    def responses(run: Sequence[Observation]) -> FloatArray:
        name = run[0].run.name
        if name not in forces:
            return np.zeros((sum(each.spectra.size for each in run), len(terms)))
        shown = []
        for column in tables[name].T:
            unit = replace(forces[name], place=at, force_n=column, time_s=_times(forces[name], column.size))
            of_unit = _free_run_responses(found, run, unit)
            gains = {each.channel: found.values.get(f"gain of {each.channel}", 1.0) for each in run}
            parts = [_whitened(each, of_unit[each.channel] * gains[each.channel]) for each in run]
            shown.append(np.concatenate(parts))
        return np.stack(shown, axis=1)

    return Target(
        at,
        "",
        _thinned([forces[name].force_n for name in fitted]),
        # The force is not known near the ends of a run, but acts from its start.
        _thinned([tables[name][-forces[name].force_n.size :] for name in fitted]),
        [responses(run) for run in found.runs],
    )


def _of_channel(found: RetunedBaseline, channel: str) -> Target | None:
    """What a channel reads beyond the retuned baseline; None where no fitted run knows it."""
    observed = {run[0].run.name: each for run in found.runs for each in run if each.channel == channel}
    fitted = [run[0].run.name for run in found.fitting if run[0].run.name in observed]
    if not fitted:
        return None
    derived = {name: _derived(found.readings[name][channel], observed[name]) for name in observed}
    sizes = np.max([np.abs(derived[name]).max(axis=1) for name in fitted], axis=0)
    largest = (float(sizes[0]), float(sizes[1]), float(sizes[2]))
    terms, tables = LIBRARIES[SENSOR], {}
    for name, series in derived.items():
        time = np.arange(series.shape[1]) / observed[name].run.attributes.sampling_rate_hz
        tables[name] = columns(terms, Motion(series[0], series[1], series[2], time, largest))

    def responses(run: Sequence[Observation]) -> FloatArray:
        table = tables.get(run[0].run.name)
        parts = [
            np.stack([_whitened(each, column) for column in table.T], axis=1)
            if each.channel == channel and table is not None
            else np.zeros((each.spectra.size, len(terms)))
            for each in run
        ]
        return np.concatenate(parts)

    values, table = [], []
    for name in fitted:
        missed = found.forces[name].missed[channel]
        n = min(tables[name].shape[0], missed.size)
        # Lost samples and those before a release have no residual.
        known = missed[:n] != 0
        values.append(missed[:n][known])
        table.append(tables[name][:n][known])
    if not sum(part.size for part in values):
        return None
    return Target(SENSOR, channel, _thinned(values), _thinned(table), [responses(run) for run in found.runs])


def _motion_of(force: LatentForce, largest: tuple[float, float, float]) -> Motion:
    """The motion from the start of the run on."""
    x, v, a = np.concatenate([force.motion_before, force.motion]).T
    return Motion(x, v, a, np.arange(x.size) / force.run.attributes.sampling_rate_hz, largest)


def _free_run_responses(
    found: RetunedBaseline, run: Sequence[Observation], unit: LatentForce
) -> dict[str, FloatArray]:
    """What a force adds to every channel, with what the baseline's liquid damps of the motion that it adds."""
    forces = found.forces[run[0].run.name]
    shown = channel_responses(forces, run, found.case.rig, unit)
    damping, structure = _damping_of_liquid(found), forces.structure
    if structure is None or not damping:
        return shown
    n, rate = int(unit.run.recording.sizes["time"]), unit.run.attributes.sampling_rate_hz
    first = round((unit.time_s[0] - float(unit.run.recording["time"].values[0])) * rate)
    series = np.zeros(n)
    series[first : first + unit.force_n.size] = unit.force_n
    mobility = response(structure, structure.mode_shape, 1, frequencies_hz(n, rate))
    # v = Y (f − c v), with the mobility Y of the structure at the tank.
    damped = in_time(-damping * mobility / (1 + damping * mobility) * in_frequency(series), n)
    time = np.asarray(unit.run.recording["time"].values, np.float64)
    by_liquid = channel_responses(
        forces, run, found.case.rig, replace(unit, place=TANK, force_n=damped, time_s=time)
    )
    return {channel: shown[channel] + by_liquid[channel] for channel in shown}


def _damping_of_liquid(found: RetunedBaseline) -> float:
    """Of the baseline's viscous forces on the tank [N s/m]."""
    name = "damping_n_s_per_m"
    return sum(
        found.values.get(f"{term.name}.{name}", term.values[name])
        for term in found.model.twin.terms
        if term.place == TANK and name in term.values
    )


def _times(force: LatentForce, n: int) -> FloatArray:
    """Of the samples from the start of the run on."""
    return np.asarray(force.time_s[-1] - np.arange(n)[::-1] / force.run.attributes.sampling_rate_hz)


def _derived(reading: FloatArray, observation: Observation) -> FloatArray:
    """A reading, its derivative and its integral without drift, shape (3, n)."""
    rate = observation.run.attributes.sampling_rate_hz
    integral = np.cumsum(reading - reading.mean()) / rate
    time = np.linspace(-1.0, 1.0, reading.size)
    integral -= np.polynomial.polynomial.polyval(time, np.polynomial.polynomial.polyfit(time, integral, 2))
    return np.stack([reading, np.gradient(reading) * rate, integral])


def _whitened(observation: Observation, series: FloatArray) -> FloatArray:
    return np.asarray((observation.of(series) / np.sqrt(observation.variance)).ravel())


def _thinned(parts: Sequence[FloatArray]) -> FloatArray:
    joined = np.concatenate(parts)
    return joined[:: max(1, -(-joined.shape[0] // _MOST_SAMPLES))]
