"""One row per cycle: the loop integral, the phasors and the powers, in a single pass over the samples.

Symbols of the kernel: φ phase of the tank's acceleration within the cycle, F force on the tank
[N], a acceleration, v velocity of the tank (SI), d = m_i a - F the force that is left once the
inertia m_i of everything on the cells is removed (the dynamic sloshing force Δf).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from sloshlab.out_of_core import blocks, release
from sloshlab.quadrature import MARGIN_SAMPLES, STEP_WEIGHTS, boundary_weights

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
BoolArray = npt.NDArray[np.bool_]

# At 20 Hz and 512 samples per second the quadrature is 1 % off for the fifth harmonic already.
N_HARMONICS = 5
"""Harmonics 1 … 5 of the excitation frequency are kept."""

_CYCLES_AT_ONCE = 512
"""About a minute; their samples are in memory together."""
_WORK, _MEAN, _SQUARE, _HIGHEST, _LOWEST = 0, 1, 2, 3, 4
_N_SCALARS = 5
_fast: Final = njit(cache=True, nogil=True, fastmath={"contract", "nsz", "arcp"})


@dataclass(frozen=True)
class Cycles:
    """What every cycle of a sweep gave; all arrays have one entry per cycle.

    Attributes
    ----------
    start_s, stop_s : ndarray, shape (n,)
        Boundaries t_n, t_{n+1} [s].
    usable : ndarray of bool, shape (n,)
        False where a lost or clipped sample touches the cycle.
    work_j : ndarray, shape (n,)
        W = ∮ F u̇ dt [J], positive = dissipated.
    force_phasor, acceleration_phasor : ndarray, shape (n, 5)
        Complex amplitudes at Ω … 5Ω relative to the phase φ of the acceleration [N, m s-2].
    velocity_phasor : ndarray, shape (n,)
        Complex amplitude of u̇ at Ω [m s-1].
    subharmonic_phasor : ndarray, shape (n, 2)
        Contribution of this cycle to the amplitudes of d at Ω/2 and 3Ω/2 [N]; meaningful as the
        mean over an even number of consecutive cycles.
    dynamic_mean, dynamic_square, dynamic_highest, dynamic_lowest : ndarray, shape (n,)
        Mean [N], mean square [N²], largest and smallest value [N] of d over the cycle.
    inertia_kg : float
        m_i.
    velocity_is_measured : bool
        False if the velocity was integrated from the acceleration.
    """

    start_s: FloatArray
    stop_s: FloatArray
    usable: BoolArray
    work_j: FloatArray
    force_phasor: ComplexArray
    acceleration_phasor: ComplexArray
    velocity_phasor: ComplexArray
    subharmonic_phasor: ComplexArray
    dynamic_mean: FloatArray
    dynamic_square: FloatArray
    dynamic_highest: FloatArray
    dynamic_lowest: FloatArray
    inertia_kg: float
    velocity_is_measured: bool = False

    @cached_property
    def omega_rad_per_s(self) -> FloatArray:
        """Ω of each cycle [rad/s], shape (n,)."""
        # from the boundaries, not from the law: the shaker need not have kept it
        return 2 * np.pi / (self.stop_s - self.start_s)

    @cached_property
    def harmonic_work_j(self) -> FloatArray:
        """πγΩu₀² = ½ T Re(F₁ u̇₁*), the work of the fundamental alone [J], shape (n,)."""
        # F is the force on the tank and u̇ its velocity, so that what is dissipated is positive. (1.30) has the
        # other sign, which goes with the minus that (1.15) drops from (1.10).
        duration = self.stop_s - self.start_s
        return np.asarray(0.5 * duration * (self.force_phasor[:, 0] * self.velocity_phasor.conj()).real)

    def dynamic_power_and_peak(self, at: npt.NDArray[np.intp] | slice) -> tuple[FloatArray, FloatArray]:
        """Mean square [N²] and largest |d| [N] of chosen cycles, their common mean removed; shapes (n_chosen,).

        The mean of a single cycle is not removed: it is part of what repeats every second cycle.
        """
        mean = float(self.dynamic_mean[at].mean())
        # mean of (d − mean)² from moments that are kept; a difference of nearly equal numbers may come out below
        # zero
        power = self.dynamic_square[at] - 2 * mean * self.dynamic_mean[at] + mean**2
        peak = np.maximum(self.dynamic_highest[at] - mean, mean - self.dynamic_lowest[at])
        return np.maximum(power, 0.0), peak

    @cached_property
    def dynamic_phasor(self) -> ComplexArray:
        """Amplitudes of d at Ω … 5Ω [N], shape (n, 5)."""
        # (1.19): Δf = (M_dry + m_l) ü − F_ext.
        return np.asarray(self.inertia_kg * self.acceleration_phasor - self.force_phasor)


def evaluate_cycles(
    force: FloatArray,
    motion: FloatArray,
    boundaries_s: FloatArray,
    *,
    sampling_rate_hz: float,
    inertia_kg: float = 0.0,
    motion_is_velocity: bool = False,
    unusable: BoolArray | None = None,
) -> Cycles:
    """Evaluate every cycle between consecutive boundaries.

    The velocity is the integral of the acceleration over the cycle; the two constants of
    integration are set by asking that the tank's velocity returns after a cycle and has no mean.
    Both hold for a sweep to second order in the relative change per cycle.

    Parameters
    ----------
    force : ndarray, shape (n_samples,)
        Force on the tank, F_ext [N], upward positive; NaN where lost.
    motion : ndarray, shape (n_samples,)
        Acceleration [m s-2] or velocity [m s-1] of the tank; NaN where lost.
    boundaries_s : ndarray, shape (n_cycles + 1,)
        t_n with ü = a₀ cos φ, φ(t_n) = 2πn, counted from the first sample [s].
    sampling_rate_hz : float
        Sampling rate [Hz].
    inertia_kg : float
        Mass whose inertia is removed to get the dynamic force; it has no influence on the work.
    motion_is_velocity : bool
        True if `motion` is a velocity.
    unusable : ndarray of bool, shape (n_samples,), optional
        True where a sample must not be used (clipped, flagged). NaN samples need no flag.

    Returns
    -------
    Cycles
    """
    # Boundaries lie between samples. Rounded to samples they would open the loop by up to half a step at each
    # end.
    positions = np.asarray(boundaries_s, dtype=np.float64) * sampling_rate_hz
    # the quadrature takes samples from beyond the boundaries
    inside = (positions[:-1] >= MARGIN_SAMPLES + 1) & (positions[1:] <= force.size - MARGIN_SAMPLES - 2)
    long_enough = np.diff(positions) > 4
    # dn/dx at every boundary, for the phase within a cycle. Second order at the ends too: a sweep's phase is
    # quadratic.
    slope = np.gradient(np.arange(positions.size, dtype=np.float64), positions, edge_order=2)
    signals = _Signals(
        _read_only(force),
        _read_only(motion),
        _read_only(np.zeros(0, dtype=np.bool_) if unusable is None else unusable),
        1.0 / sampling_rate_hz,
        inertia_kg,
        motion_is_velocity,
    )
    n_cycles = positions.size - 1
    scalars = np.full((n_cycles, _N_SCALARS), np.nan)
    phasors = np.full((n_cycles, 2 * N_HARMONICS + 3), np.nan + 0j)
    for part in blocks(n_cycles, of=_CYCLES_AT_ONCE):
        _kernel(signals, positions, slope, inside & long_enough, part.start, part.stop, scalars, phasors)
        # of a shorter cycle than before, some samples are touched again
        touched = slice(max(int(positions[part.start]) - 8, 0), max(int(positions[part.stop]), 0))
        for array in (signals.force, signals.motion, signals.unusable):
            release(array[touched])
    return Cycles(
        start_s=np.asarray(boundaries_s[:-1]),
        stop_s=np.asarray(boundaries_s[1:]),
        # cycles that were not evaluated are NaN throughout
        usable=np.isfinite(scalars[:, _WORK]),
        work_j=scalars[:, _WORK],
        force_phasor=phasors[:, :N_HARMONICS],
        acceleration_phasor=phasors[:, N_HARMONICS : 2 * N_HARMONICS],
        velocity_phasor=phasors[:, 2 * N_HARMONICS],
        subharmonic_phasor=phasors[:, 2 * N_HARMONICS + 1 :],
        dynamic_mean=scalars[:, _MEAN],
        dynamic_square=scalars[:, _SQUARE],
        dynamic_highest=scalars[:, _HIGHEST],
        dynamic_lowest=scalars[:, _LOWEST],
        inertia_kg=inertia_kg,
        velocity_is_measured=motion_is_velocity,
    )


def _read_only(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The same samples as an array that cannot be written to.

    Numba compiles a loop for each of the two kinds of array, and each may round its sums differently: the same
    samples would have another last digit in a recording that is mapped from its file.
    """
    view = array.view()
    view.flags.writeable = False
    return view


class _Signals(NamedTuple):
    """Force and motion of the tank, and how they are to be read."""

    force: FloatArray
    motion: FloatArray
    unusable: BoolArray  # empty if no sample is flagged
    step_s: float
    inertia_kg: float
    motion_is_velocity: bool


class _Cycle(NamedTuple):
    """A cycle among the samples."""

    start: float  # in samples
    stop: float
    slope_start: float  # of the cycles counted over the part of this cycle that has gone by, at its ends
    slope_stop: float
    parity: int  # 1 for every second cycle


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _kernel(
    signals: _Signals,
    positions: FloatArray,
    slope: FloatArray,
    evaluable: BoolArray,
    first: int,
    stop: int,
    scalars: FloatArray,
    phasors: ComplexArray,
) -> None:
    """Evaluate cycles in [first, stop), each into its row."""
    for n in range(first, stop):
        if evaluable[n] and _complete(signals, positions[n], positions[n + 1]):
            cycle = _Cycle(
                positions[n],
                positions[n + 1],
                # 1 where the frequency is the mean one of the cycle
                slope[n] * (positions[n + 1] - positions[n]),
                slope[n + 1] * (positions[n + 1] - positions[n]),
                n % 2,
            )
            _evaluate_cycle(signals, cycle, scalars[n], phasors[n])


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _complete(signals: _Signals, start: float, stop: float) -> bool:
    """True if no sample that the cycle needs is lost or flagged."""
    # Without fastmath: under its assumption that there is no NaN the test below would be optimised away.
    force, motion, unusable = signals.force, signals.motion, signals.unusable
    first, last = int(np.ceil(start)) - MARGIN_SAMPLES, int(np.floor(stop)) + MARGIN_SAMPLES
    # a sum is finite if all its terms are; one test per cycle instead of two per sample
    total = 0.0
    for i in range(first, last + 1):
        total += force[i] + motion[i]
    if not np.isfinite(total):
        return False
    if unusable.size:
        for i in range(first, last + 1):
            if unusable[i]:
                return False
    return True


class _Integrals(NamedTuple):
    """Integrals over the time of a cycle; phasors over its phase, times half the duration."""

    work: float  # of F v
    force: float
    force_time: float  # of F t, t from the middle of the cycle
    velocity: float
    motion: float
    left: float  # of d
    left_square: float
    highest: float  # of d
    lowest: float
    velocity_1: complex  # of v at Ω
    time_1: complex  # of t at Ω
    half_1: complex  # of d at Ω/2
    half_3: complex  # of d at 3Ω/2


@_fast  # type: ignore[untyped-decorator]
def _phase(x: float, c_start: float, c_stop: float) -> tuple[float, float]:
    """φ/2π and its slope where a share x of a cycle has gone by.

    The cubic x + x (1-x) (c₀ (1-x) - c₁ x) with the measured slopes at both ends: continuous with the neighbouring
    cycles in value and slope, as Ω changes within the cycle.
    """
    bend = c_start * (1.0 - x) - c_stop * x
    turn = x + x * (1.0 - x) * bend
    return turn, 1.0 + (1.0 - 2.0 * x) * bend - x * (1.0 - x) * (c_start + c_stop)


@_fast  # type: ignore[untyped-decorator]
def _integrals(signals: _Signals, cycle: _Cycle, force_k: ComplexArray, motion_k: ComplexArray) -> _Integrals:
    """All integrals; those of force and motion at Ω … 5Ω are added to the two arrays."""
    # The flags of fastmath leave out "ninf", because `highest` and `lowest` start at infinity. Arrays leave the
    # tuple before the loop, in which counting their references would cost time.
    force, motion, motion_is_velocity = signals.force, signals.motion, signals.motion_is_velocity
    step_s, inertia_kg, start, stop = signals.step_s, signals.inertia_kg, cycle.start, cycle.stop
    p, q = int(np.ceil(start)), int(np.floor(stop))
    length = stop - start
    duration = length * step_s
    # A plain sum over whole steps; what the cut steps and the six-point rule add touches six samples at each
    # boundary.
    left, right = np.empty(6), np.empty(6)
    boundary_weights(p - start, left)
    boundary_weights(stop - q, right)
    c_start, c_stop = cycle.slope_start - 1.0, cycle.slope_stop - 1.0
    work = sum_force = sum_force_time = sum_velocity = sum_motion = 0.0
    sum_d = sum_d2 = 0.0
    highest, lowest = -np.inf, np.inf
    velocity_1 = time_1 = 0.0 + 0.0j
    half_1 = half_3 = 0.0 + 0.0j
    # any start will do: the mean of the velocity is taken out of every sum below
    velocity = 0.0
    # three samples beyond the cycle to each side, for the weights of the boundaries
    for i in range(p - 3, q + 4):
        weight = 1.0 if p <= i <= q else 0.0
        # added, not assigned: in a short cycle both boundaries touch the same sample
        if i <= p + 2:
            weight += left[i - p + 3]
        if i >= q - 2:
            weight += right[q + 3 - i]
        x = (i - start) / length
        turn, rate = _phase(x, c_start, c_stop)
        # One sine and one cosine per sample: e^{−jφ} is the square of e^{−jφ/2}, and the harmonics are its
        # powers.
        half_angle = np.pi * turn
        half = np.cos(half_angle) - 1j * np.sin(half_angle)
        unit = half * half
        # channels of 16 bits stay in single precision, which halves the memory traffic; the sums are double
        f, a = float(force[i]), float(motion[i])
        # the integral up to sample i; it is advanced to i + 1 after its use, at the end of this round
        v = a if motion_is_velocity else velocity
        # from the middle of the cycle, so that a linear term has no mean and both corrections below are
        # independent
        t = (x - 0.5) * duration
        w = weight * step_s
        # Phasors are integrals over φ, not over time: only over φ are mean and harmonics orthogonal while Ω
        # changes.
        w_phase = w * rate
        work += w * f * v
        sum_force += w * f
        sum_force_time += w * f * t
        sum_velocity += w * v
        sum_motion += w * a
        velocity_1 += w_phase * v * unit
        time_1 += w_phase * t * unit
        turning = unit
        for k in range(N_HARMONICS):
            force_k[k] += w_phase * f * turning
            motion_k[k] += w_phase * a * turning
            turning *= unit
        if not motion_is_velocity:
            # the same six-point rule as for the loop: symmetric, so that the velocity has no phase error
            velocity += step_s * (
                STEP_WEIGHTS[2] * (motion[i] + motion[i + 1])
                + STEP_WEIGHTS[1] * (motion[i - 1] + motion[i + 2])
                + STEP_WEIGHTS[0] * (motion[i - 2] + motion[i + 3])
            )
        # With a measured velocity the acceleration is known as phasors only, so that d is the whole force there.
        d = inertia_kg * a - f if not motion_is_velocity else -f
        sum_d += w * d
        sum_d2 += w * d * d
        half_1 += w_phase * d * half
        half_3 += w_phase * d * half * unit
        # samples beyond the boundaries count in the quadrature, but belong to the neighbouring cycles
        if p <= i <= q:
            highest, lowest = max(highest, d), min(lowest, d)
    return _Integrals(
        work, sum_force, sum_force_time, sum_velocity, sum_motion, sum_d, sum_d2, highest, lowest,
        velocity_1, time_1, half_1, half_3,
    )  # fmt: skip


@_fast  # type: ignore[untyped-decorator]
def _evaluate_cycle(signals: _Signals, cycle: _Cycle, scalars: FloatArray, phasors: ComplexArray) -> None:
    """Scalars and phasors of a cycle."""
    force_k = np.zeros(N_HARMONICS, dtype=np.complex128)
    motion_k = np.zeros(N_HARMONICS, dtype=np.complex128)
    of = _integrals(signals, cycle, force_k, motion_k)
    duration = (cycle.stop - cycle.start) * signals.step_s
    two_per_duration = 2.0 / duration
    # both constants of integration are corrected in the sums, so that the samples are gone through once
    # An accelerometer's offset makes the velocity run away; over a cycle of steady motion ü has no mean.
    drift = 0.0 if signals.motion_is_velocity else of.motion / duration
    mean_velocity = of.velocity / duration
    # ∮ F (v − v̄ − drift·t) dt by linearity. Static weight in F drops out too, as the corrected velocity has no
    # mean.
    scalars[_WORK] = of.work - mean_velocity * of.force - drift * of.force_time
    scalars[_MEAN] = of.left / duration
    scalars[_SQUARE] = of.left_square / duration
    scalars[_HIGHEST], scalars[_LOWEST] = of.highest, of.lowest
    # the mean of the velocity needs no correction here: a constant has no part at Ω
    velocity_1 = two_per_duration * (of.velocity_1 - drift * of.time_1)
    omega = 2.0 * np.pi / duration
    for k in range(N_HARMONICS):
        phasors[k] = two_per_duration * force_k[k]
        # e^{+jΩt}: a derivative is a factor jkΩ
        factor = 1j * omega * (k + 1) if signals.motion_is_velocity else 1.0 + 0.0j
        phasors[N_HARMONICS + k] = two_per_duration * motion_k[k] * factor
    phasors[2 * N_HARMONICS] = velocity_1
    # half a turn of Ω/2 passes in a cycle: what alternates has the other sign in every second one
    # The constant and the harmonics have the other sign in every second cycle then; only means over pairs are
    # free of them.
    sign = 1.0 - 2.0 * cycle.parity
    phasors[2 * N_HARMONICS + 1] = sign * two_per_duration * of.half_1
    phasors[2 * N_HARMONICS + 2] = sign * two_per_duration * of.half_3
