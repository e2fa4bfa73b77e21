"""What drives a twin: motion of the base (or of the tank, where there is no structure), and a force on the tank.

The engine needs values at samples and half-way between them. Motions given by formula are evaluated there; a
recording is interpolated band-limited. Velocity and displacement of the same motion are given with it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi

import numpy as np
import numpy.typing as npt
from numba import njit

from sloshlab.conditioning.resampling import HALF_WIDTH, resampled
from sloshlab.errors import InputError
from sloshlab.twin.model import INPUTS, N_OF_BASE_MOTION

FloatArray = npt.NDArray[np.float64]
_DISPLACEMENT, _VELOCITY, _ACCELERATION, _PHASE, _FREQUENCY, _FORCE = range(len(INPUTS))


@dataclass(frozen=True, eq=False)
class Excitation:
    """Rate and length of a simulation, and its inputs.

    Attributes
    ----------
    sampling_rate_hz : float
        Rate of the output.
    n_samples : int
    inputs : callable or None
        Times [s] of the samples and of as many instants between each two, shape (n,) → array (n, 6):
        displacement, velocity, acceleration of the base, phase and frequency of the excitation, force on
        the tank. None where nothing drives.
    moves_base : bool
        Whether the base moves.
    factor : float
        Of the motion of the base, over that of `inputs`.
    """

    sampling_rate_hz: float
    n_samples: int
    inputs: Callable[[FloatArray], FloatArray] | None = None
    moves_base: bool = False
    factor: float = 1.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.sampling_rate_hz) and self.sampling_rate_hz > 0):
            raise InputError("sampling_rate_hz", got=str(self.sampling_rate_hz), allowed="> 0")
        # sizes are refused before memory is taken
        if not 2 <= self.n_samples <= 50_000_000:
            raise InputError("n_samples", got=str(self.n_samples), allowed="2 … 50000000")

    def half_steps(self, n_substeps: int, first: int = 0, stop: int | None = None) -> FloatArray:
        """Inputs at steps and half-way between, rows `first` … `stop` of (2 (n − 1) n_substeps + 1, 6).

        Without `factor`; empty where nothing drives.
        """
        if self.inputs is None:
            return np.empty((0, len(INPUTS)))
        last = 2 * (self.n_samples - 1) * n_substeps + 1 if stop is None else stop
        # instants from whole numbers, never by adding up steps, which would drift
        return np.ascontiguousarray(self.inputs(np.arange(first, last) / (2 * n_substeps * self.sampling_rate_hz)))

    def scaled(self, factor: float) -> Excitation:
        """The same with the motion of the base times a factor: what a sensor of another gain would have told."""
        # beside the inputs, not within them, so that simulations with many factors share one table
        return replace(self, factor=factor * self.factor)

    def at_start(self) -> FloatArray:
        """Inputs at the first sample, shape (6,)."""
        rows = self.half_steps(1, 0, 2)
        if not rows.size:
            return np.zeros(len(INPUTS))
        first: FloatArray = rows[0].copy()
        # force, phase and frequency are not read by the sensor of the base
        first[:N_OF_BASE_MOTION] *= self.factor
        return first


def _n_samples(duration_s: float, sampling_rate_hz: float) -> int:
    if not (np.isfinite(duration_s) and duration_s > 0):
        raise InputError("duration_s", got=str(duration_s), allowed="> 0")
    return round(duration_s * sampling_rate_hz) + 1


def free(duration_s: float, sampling_rate_hz: float) -> Excitation:
    """Nothing drives; the start does (deflection and release)."""
    return Excitation(sampling_rate_hz, _n_samples(duration_s, sampling_rate_hz))


def harmonic(amplitude_m: float, frequency_hz: float, duration_s: float, sampling_rate_hz: float) -> Excitation:
    """Base motion u = −u₀ cos φ, so that the acceleration is a₀ cos φ; it starts at the lowest point."""
    omega = 2 * pi * frequency_hz

    def inputs(time: FloatArray) -> FloatArray:
        return _motion(np.full(time.shape, amplitude_m), omega * time, np.full(time.shape, omega))

    return Excitation(sampling_rate_hz, _n_samples(duration_s, sampling_rate_hz), inputs, moves_base=True)


def harmonic_force(force_n: float, frequency_hz: float, duration_s: float, sampling_rate_hz: float) -> Excitation:
    """Force F sin φ on the tank, the base at rest."""
    omega = 2 * pi * frequency_hz

    def inputs(time: FloatArray) -> FloatArray:
        table = np.zeros((time.size, len(INPUTS)))
        table[:, _PHASE], table[:, _FREQUENCY] = omega * time, omega
        table[:, _FORCE] = force_n * np.sin(omega * time)
        return table

    return Excitation(sampling_rate_hz, _n_samples(duration_s, sampling_rate_hz), inputs)


def stepped_sine(
    frequencies_hz: Sequence[float],
    accelerations_m_per_s2: Sequence[float],
    *,
    dwell_s: float,
    change_s: float,
    sampling_rate_hz: float,
) -> Excitation:
    """Base motion that dwells at each frequency and acceleration, and goes smoothly from one to the next.

    Amplitude and frequency change by a quintic that starts and ends with zero slope and curvature. The first dwell
    is entered from rest over `change_s`.
    """
    if len(frequencies_hz) != len(accelerations_m_per_s2) or len(frequencies_hz) == 0:
        raise InputError(
            "stepped sine",
            got=f"{len(frequencies_hz)} frequencies, {len(accelerations_m_per_s2)} accelerations",
            allowed="as many of both, at least one",
        )
    omega = 2 * pi * np.asarray(frequencies_hz, dtype=np.float64)
    amplitude = np.asarray(accelerations_m_per_s2, dtype=np.float64) / omega**2
    # a change precedes each dwell
    starts = np.arange(omega.size) * (dwell_s + change_s)
    d_omega, d_amplitude = np.diff(omega, prepend=omega[0]), np.diff(amplitude, prepend=0.0)

    def inputs(time: FloatArray) -> FloatArray:
        u, rate, curvature = (np.zeros(time.shape) for _ in range(3))
        phase, frequency, chirp = omega[0] * time, np.full(time.shape, omega[0]), np.zeros(time.shape)
        for start, dw, da in zip(starts, d_omega, d_amplitude, strict=True):
            # the quintic has zero slope and curvature at both ends, so that the acceleration does not jump
            x = np.clip((time - start) / change_s, 0.0, 1.0)
            smooth, slope = x**3 * (10 - 15 * x + 6 * x**2), 30 * x**2 * (1 - x) ** 2
            u += da * smooth
            rate += da * slope / change_s
            curvature += da * 60 * x * (1 - x) * (1 - 2 * x) / change_s**2
            frequency += dw * smooth
            chirp += dw * slope / change_s
            after = np.maximum(time - start - change_s, 0.0)
            # the integral of the frequency in closed form: a summed phase would depend on the step
            phase += dw * (change_s * (2.5 * x**4 - 3 * x**5 + x**6) + after)
        return _motion(u, phase, frequency, rate=rate, curvature=curvature, chirp=chirp)

    duration = omega.size * (dwell_s + change_s)
    return Excitation(sampling_rate_hz, _n_samples(duration, sampling_rate_hz), inputs, moves_base=True)


def _motion(
    amplitude: FloatArray,
    phase: FloatArray,
    frequency: FloatArray,
    *,
    rate: FloatArray | float = 0.0,
    curvature: FloatArray | float = 0.0,
    chirp: FloatArray | float = 0.0,
) -> FloatArray:
    """Motion u = −A cos φ and its exact derivatives, given those of A and φ."""
    table = np.zeros((phase.size, len(INPUTS)))
    cosine, sine = np.cos(phase), np.sin(phase)
    table[:, _DISPLACEMENT] = -amplitude * cosine
    table[:, _VELOCITY] = -rate * cosine + amplitude * frequency * sine
    # with the terms of a changing A and φ: displacement, velocity and acceleration are those of one motion
    # exactly
    table[:, _ACCELERATION] = (amplitude * frequency**2 - curvature) * cosine + (
        2 * rate * frequency + amplitude * chirp
    ) * sine
    table[:, _PHASE], table[:, _FREQUENCY] = phase, frequency
    return table


def recorded(
    sampling_rate_hz: float,
    *,
    acceleration: npt.ArrayLike | None = None,
    velocity: npt.ArrayLike | None = None,
    displacement: npt.ArrayLike | None = None,
    force_n: npt.ArrayLike | None = None,
    phase_rad: npt.ArrayLike | None = None,
) -> Excitation:
    """Inputs from a recording: motion of the base, force on the tank, or both.

    Parameters
    ----------
    sampling_rate_hz : float
        Of the recording, and of the output.
    acceleration, velocity, displacement, force_n, phase_rad : array_like, shape (n_samples,)
        SI units; absent ones are zero. Give velocity and displacement too where the tank's force depends on
        its absolute motion: `sloshlab.conditioning.integration` makes them without drift.

    Raises
    ------
    InputError
        If nothing is given, lengths differ, or values are lost.
    """
    columns = {
        _ACCELERATION: acceleration,
        _VELOCITY: velocity,
        _DISPLACEMENT: displacement,
        _FORCE: force_n,
        _PHASE: phase_rad,
    }
    given = {
        column: np.asarray(values, dtype=np.float64) for column, values in columns.items() if values is not None
    }
    moves = any(column in given for column in (_ACCELERATION, _VELOCITY, _DISPLACEMENT))
    return _of_series(sampling_rate_hz, given, {column: INPUTS[column] for column in given}, moves_base=moves)


def recorded_for_equations(sampling_rate_hz: float, series: Mapping[str, npt.ArrayLike]) -> Excitation:
    """What state equations read of a recording, in the order of the series.

    Parameters
    ----------
    sampling_rate_hz : float
    series : mapping of str to array_like, shape (n_samples,)

    Raises
    ------
    InputError
        If lengths differ, or values are lost.
    """
    given = {len(INPUTS) + k: np.asarray(values, dtype=np.float64) for k, values in enumerate(series.values())}
    return _of_series(sampling_rate_hz, given, dict(zip(given, series, strict=True)), moves_base=False)


def _of_series(
    sampling_rate_hz: float, given: Mapping[int, FloatArray], names: Mapping[int, str], *, moves_base: bool
) -> Excitation:
    """Series by their column of the inputs, interpolated between their samples."""
    lengths = {values.shape for values in given.values()}
    if len(lengths) != 1 or len(next(iter(lengths))) != 1:
        raise InputError("recorded inputs", got=f"shapes {sorted(lengths)}", allowed="series of one length")
    for column, values in given.items():
        lost = int((~np.isfinite(values)).sum())
        if lost:
            raise InputError(
                f"recorded {names[column]}", got=f"{lost} lost samples", remedy="simulate a stretch without gaps"
            )

    n_columns = max(len(INPUTS), 1 + max(given))
    between = {column: _BandLimitedSeries(values) for column, values in given.items()}

    def inputs(time: FloatArray) -> FloatArray:
        table = np.zeros((time.size, n_columns))
        # instants are whole fractions of a sample, so that a few rows of weights serve all of them
        per_sample = round(1.0 / ((time[1] - time[0]) * sampling_rate_hz))
        first = round(time[0] * sampling_rate_hz * per_sample)
        for column, series in between.items():
            table[:, column] = series.at(first, time.size, per_sample)
        return table

    (shape,) = lengths
    return Excitation(sampling_rate_hz, shape[0], inputs, moves_base=moves_base)


def with_cached_inputs(excitation: Excitation) -> Excitation:
    """The excitation with a cache of its interpolated inputs, which every simulation of a run asks for again."""
    inputs = excitation.inputs
    if inputs is None:
        return excitation
    kept: dict[tuple[float, int, float], FloatArray] = {}

    def cached(time: FloatArray) -> FloatArray:
        key = (float(time[0]), time.size, float(time[-1]))
        if key not in kept:
            kept[key] = inputs(time)
        return kept[key]

    return replace(excitation, inputs=cached)


class _BandLimitedSeries:
    """Band-limited values of a series at instants between its samples; beyond the ends it is reflected there.

    The kernel of `resampled` at the few offsets that are needed is taken from its answer to a unit impulse.
    """

    def __init__(self, values: FloatArray) -> None:
        pad = min(HALF_WIDTH, values.size - 1)
        # reflected in the point at the end: value and slope go on; zeros would make a recording that starts at
        # rest ring
        before, after = 2 * values[0] - values[pad:0:-1], 2 * values[-1] - values[-2 : -pad - 2 : -1]
        self._padded = np.pad(np.concatenate([before, values, after]), HALF_WIDTH - pad, mode="edge")
        self._n_samples = values.size
        self._weights: dict[int, FloatArray] = {}

    def at(self, first: int, n: int, per_sample: int) -> FloatArray:
        """Values at instants `first` … `first + n` of `per_sample` per sample."""
        if per_sample not in self._weights:
            self._weights[per_sample] = _phases(per_sample)
        first_sample = first // per_sample
        last_sample = min((first + n - 1) // per_sample, self._n_samples - 1)
        stretch = self._padded[first_sample : last_sample + 1 + 2 * HALF_WIDTH]
        found = np.asarray(_weighted(stretch, self._weights[per_sample]))
        return found[first - first_sample * per_sample :][:n]


# no BLAS: its threads wait for each other where others use the cores
@njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator]
def _weighted(samples: FloatArray, weights: FloatArray) -> FloatArray:
    """Sums of each window of samples with each row of weights, one window after the other."""
    n_phases, width = weights.shape
    n_windows = samples.size - width + 1
    sums = np.empty(n_windows * n_phases)
    for i in range(n_windows):
        for phase in range(n_phases):
            # fastmath may reorder this sum, as all values are finite: lost samples were refused
            total = 0.0
            for j in range(width):
                total += samples[i + j] * weights[phase, j]
            sums[i * n_phases + phase] = total
    return sums


def _phases(per_sample: int) -> FloatArray:
    """Weights of the 2 · 24 + 1 samples around a sample, shape (per_sample, 2 · 24 + 1)."""
    centre, offsets = 3 * HALF_WIDTH, np.arange(-HALF_WIDTH, HALF_WIDTH + 1)
    impulse = np.zeros(2 * centre + 1)
    impulse[centre] = 1.0
    return np.stack([resampled(impulse, centre + i / per_sample - offsets) for i in range(per_sample)])
