"""The virtual shaker: how the tank is moved.

The shaker controls acceleration: ü ≅ a₀ cos φ (1.12), with φ(0) = Ω_i/(R ln 2) for an octave sweep (1.13).
It has a stroke limit, and it does not keep its law exactly. Phase φ(t) and displacement amplitude A(t)
are smooth splines, and u = −A cos φ with its harmonics is differentiated exactly, so displacement,
velocity and acceleration belong together at any time, sampled or not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import InputError

FloatArray = NDArray[np.float64]
Law = Literal["octave", "linear", "stepped", "vfa", "constant"]

STROKE_LIMIT_M: Final = 0.0125
"""Of the electrodynamic shaker of the source."""
IMPACT_PHASE_RAD: Final = 1.35 * np.pi
"""Where in the cycle the liquid meets the roof: on the way down, soon after ü = −a₀."""

_LONGEST_STROKE_M = 0.5
# far finer than anything that the slow laws, wanders and ripples do
_KNOT_STEP_S = 0.05
# a power mean joins stroke limit and level smoothly: a corner of the amplitude would be a jump of the velocity
_JOIN_SHARPNESS = 20.0
_START_RAMP_S, _STOP_RAMP_S = 1.5, 1.0
_VFA_HALF_SWEEPS, _VFA_AMPLITUDE_HALF_SWEEPS = 5, 12
_VFA_LOWEST_G = 0.25


@dataclass(frozen=True)
class SweepPlan:
    """What the shaker is told to do.

    Attributes
    ----------
    acceleration_g
        Amplitude a₀/g where the stroke allows it; for a VFA run the highest one.
    law
        ``octave``, ``linear`` in frequency, ``stepped`` sine, ``vfa``: frequency and amplitude
        both go to and fro, at rates that fill the plane; or ``constant``: from rest at once to one
        frequency and amplitude.
    start_hz, stop_hz
        Frequencies at the beginning and the end; a downward sweep starts high. A VFA run starts at
        the lower one whatever the order.
    duration_s
        Length of the run, ramps included.
    n_steps
        Dwells of a stepped run.
    stroke_limit_m
        Largest displacement amplitude of the shaker.
    """

    acceleration_g: float
    law: Law = "octave"
    start_hz: float = 5.0
    stop_hz: float = 20.0
    duration_s: float = 240.0
    n_steps: int = 24
    stroke_limit_m: float = STROKE_LIMIT_M

    def __post_init__(self) -> None:
        for name in ("acceleration_g", "start_hz", "stop_hz"):
            if not 0 < getattr(self, name) < 1e4:
                raise InputError(f"sweep: {name}", got=f"{getattr(self, name):g}", allowed="> 0 and < 10000")
        if not 5 <= self.duration_s <= 7200:
            raise InputError("sweep: duration_s", got=f"{self.duration_s:g}", allowed="5 … 7200 s")
        if not 2 <= self.n_steps <= 1000:
            raise InputError("sweep: n_steps", got=str(self.n_steps), allowed="2 … 1000")
        if not 0 < self.stroke_limit_m <= _LONGEST_STROKE_M:
            raise InputError(
                "sweep: stroke_limit_m", got=f"{self.stroke_limit_m:g}", allowed=f"> 0 and ≤ {_LONGEST_STROKE_M:g}"
            )
        if self.law not in ("octave", "linear", "stepped", "vfa", "constant"):
            raise InputError("sweep: law", got=repr(self.law), allowed="octave, linear, stepped, vfa, constant")
        if self.law == "constant":
            _check_sudden_start(self)

    @property
    def rate_octave_per_s(self) -> float:
        """R of an octave sweep, negative downward."""
        return float(np.log2(self.stop_hz / self.start_hz)) / self.duration_s

    @property
    def initial_phase_rad(self) -> float:
        """φ(0): Ω_i/(R ln 2) for an octave sweep (1.13), 0 for the others."""
        if self.law != "octave" or self.start_hz == self.stop_hz:
            return 0.0
        return float(2 * np.pi * self.start_hz / (self.rate_octave_per_s * np.log(2)))

    def frequency_hz(self, time_s: FloatArray) -> FloatArray:
        """Nominal frequency."""
        share = np.clip(time_s / self.duration_s, 0.0, 1.0)
        if self.law == "linear":
            return self.start_hz + (self.stop_hz - self.start_hz) * share
        if self.law == "stepped":
            share = _stairs(share * self.n_steps, self.duration_s / self.n_steps) / (self.n_steps - 1)
        if self.law == "vfa":
            low, high = sorted((self.start_hz, self.stop_hz))
            return low * (high / low) ** _to_and_fro(share * _VFA_HALF_SWEEPS)
        return self.start_hz * (self.stop_hz / self.start_hz) ** share

    def level_g(self, time_s: FloatArray) -> FloatArray:
        """Nominal acceleration amplitude before the stroke limit."""
        if self.law != "vfa":
            return np.full(time_s.shape, self.acceleration_g)
        lowest = min(_VFA_LOWEST_G, self.acceleration_g)
        share = _to_and_fro(time_s / self.duration_s * _VFA_AMPLITUDE_HALF_SWEEPS)
        return lowest + (self.acceleration_g - lowest) * share


@dataclass(frozen=True)
class Imperfections:
    """How far the shaker misses its law; all zero is a perfect shaker."""

    start_phase_rad: float = 0.0
    frequency_error: float = 0.0
    phase_wander_rad: float = 0.0
    amplitude_ripple: float = 0.0
    harmonics: tuple[tuple[int, float, float], ...] = ()
    ramps: bool = False
    slow_seed: int = 0

    @classmethod
    def drawn(
        cls, generator: np.random.Generator, impact_phase_rad: float | None = IMPACT_PHASE_RAD
    ) -> Imperfections:
        """One run's imperfections.

        The blows of the liquid leave their phase in the harmonics of the shaker; where that phase is not
        known beforehand, `impact_phase_rad` is None and the harmonics have any phase.
        """
        # second harmonic up to 1.5 %, third up to 0.8 % of the acceleration
        orders = ((2, 0.015), (3, 0.008))
        return cls(
            start_phase_rad=float(generator.uniform(-np.pi, np.pi)),
            frequency_error=float(generator.uniform(-5e-5, 5e-5)),
            phase_wander_rad=float(generator.uniform(0.03, 0.08)),
            amplitude_ripple=float(generator.uniform(0.006, 0.010)),
            harmonics=tuple(
                (
                    order,
                    float(largest * generator.uniform(0.5, 1.0)),
                    _harmonic_phase(order, impact_phase_rad, generator),
                )
                for order, largest in orders
            ),
            ramps=True,
            slow_seed=int(generator.integers(2**31)),
        )


@dataclass(frozen=True)
class Kinematics:
    """The true motion at given times, upward positive; all arrays of one shape.

    Attributes
    ----------
    phase_rad, omega_rad_per_s, amplitude_m
        φ, Ω = φ̇ and u₀ ≥ 0 of the fundamental.
    rotor
        exp(jφ).
    fundamental_velocity, fundamental_acceleration
        u̇₁ and ü₁ of the fundamental alone [m/s, m/s²].
    displacement, velocity, acceleration
        u, u̇ and ü with all harmonics [m, m/s, m/s²].
    """

    phase_rad: FloatArray
    omega_rad_per_s: FloatArray
    amplitude_m: FloatArray
    rotor: NDArray[np.complex128]
    fundamental_velocity: FloatArray
    fundamental_acceleration: FloatArray
    displacement: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


@dataclass(frozen=True)
class Motion:
    """The true motion of the tank, upward positive, at any time.

    Attributes
    ----------
    phase, amplitude
        Splines of φ(t) [rad] and of the displacement amplitude of the fundamental A(t) [m].
    duration_s
        How long it lasts; nothing is known outside.
    harmonics
        (order h, ratio d_h of its acceleration to the fundamental's, phase θ_h [rad]): the
        acceleration holds d_h a₀ cos(hφ + θ_h).
    """

    phase: BSpline
    amplitude: BSpline
    duration_s: float
    harmonics: tuple[tuple[int, float, float], ...] = ()

    def at(self, time_s: FloatArray) -> Kinematics:
        """The motion at times within the run."""
        phi, omega, turn = (np.asarray(self.phase(time_s, nu=order)) for order in (0, 1, 2))
        size, size1, size2 = (np.asarray(self.amplitude(time_s, nu=order)) for order in (0, 1, 2))
        rotor = np.exp(1j * phi)
        fundamental: tuple[FloatArray, ...] = ()
        total: list[FloatArray] = []
        for order, ratio, angle in ((1, 1.0, 0.0), *self.harmonics):
            turned = rotor**order * (-ratio / order**2 * np.exp(1j * angle))
            parts = (
                size * turned.real,
                size1 * turned.real - order * omega * size * turned.imag,
                (size2 - (order * omega) ** 2 * size) * turned.real
                - order * (2 * omega * size1 + turn * size) * turned.imag,
            )
            fundamental = fundamental or parts
            total = [known + more for known, more in zip(total, parts, strict=True)] if total else list(parts)
        return Kinematics(phi, omega, np.maximum(size, 0.0), rotor, fundamental[1], fundamental[2], *total)


def shaken(plan: SweepPlan, imperfections: Imperfections | None = None) -> Motion:
    """The motion that the shaker makes of a plan.

    Parameters
    ----------
    plan : SweepPlan
        What it is told.
    imperfections : Imperfections, optional
        A perfect shaker without them: no ramps, law kept exactly, no harmonics.

    Returns
    -------
    Motion
        Its fundamental never exceeds the stroke limit. A sudden start is exact whatever the imperfections:
        it begins at the upper end of its acceleration, where the velocity is zero, and has no ramps.

    Examples
    --------
    >>> motion = shaken(SweepPlan(acceleration_g=6.0))
    >>> round(float(motion.at(np.array([0.0])).amplitude_m[0]), 4)
    0.0125
    """
    if plan.law == "constant":
        return _sudden_start(plan)
    faults = imperfections or Imperfections()
    slow = np.random.default_rng(faults.slow_seed)
    n_knots = max(int(np.ceil(plan.duration_s / _KNOT_STEP_S)) + 1, 12)
    time_s = np.linspace(0.0, plan.duration_s, n_knots)
    omega = 2 * np.pi * plan.frequency_hz(time_s) * (1 + faults.frequency_error)
    # the phase is the exact integral of the frequency's spline, no sum over samples
    turned = make_interp_spline(time_s, omega, k=5).antiderivative()(time_s)
    wander = faults.phase_wander_rad * _slow_noise(time_s, slow)
    phi = make_interp_spline(time_s, plan.initial_phase_rad + faults.start_phase_rad + turned + wander, k=5)
    # with its wander: level and stroke hold for the frequency that there really is
    omega_true = phi.derivative()(time_s)
    level = plan.level_g(time_s) * GRAVITY_M_PER_S2 * (1 + faults.amplitude_ripple * _slow_noise(time_s, slow))
    stroke = plan.stroke_limit_m * omega_true**2
    acceleration = (level**-_JOIN_SHARPNESS + stroke**-_JOIN_SHARPNESS) ** (-1 / _JOIN_SHARPNESS)
    if faults.ramps:
        acceleration = acceleration * _ramps(time_s, plan.duration_s)
    amplitude = make_interp_spline(time_s, acceleration / omega_true**2, k=5)
    return Motion(phi, amplitude, plan.duration_s, faults.harmonics)


def _sudden_start(plan: SweepPlan) -> Motion:
    """u = −A cos Ωt from t = 0 on: velocity and displacement are continuous, the acceleration jumps."""
    omega = 2 * np.pi * plan.start_hz
    time_s = np.linspace(0.0, plan.duration_s, 12)
    amplitude = plan.acceleration_g * GRAVITY_M_PER_S2 / omega**2
    return Motion(
        make_interp_spline(time_s, omega * time_s, k=5),
        make_interp_spline(time_s, np.full(time_s.size, amplitude), k=5),
        plan.duration_s,
    )


def _check_sudden_start(plan: SweepPlan) -> None:
    if plan.start_hz != plan.stop_hz:
        got = f"{plan.start_hz:g} and {plan.stop_hz:g} Hz"
        raise InputError("sudden start: start_hz and stop_hz", got=got, allowed="one frequency")
    stroke_m = plan.acceleration_g * GRAVITY_M_PER_S2 / (2 * np.pi * plan.start_hz) ** 2
    if stroke_m > plan.stroke_limit_m:
        highest_g = plan.stroke_limit_m * (2 * np.pi * plan.start_hz) ** 2 / GRAVITY_M_PER_S2
        raise InputError(
            "sudden start: stroke",
            got=f"{1e3 * stroke_m:.4g} mm for {plan.acceleration_g:g} g at {plan.start_hz:g} Hz",
            allowed=f"at most {1e3 * plan.stroke_limit_m:g} mm, that is {highest_g:.3g} g",
            remedy="less acceleration or a higher frequency",
        )


def _harmonic_phase(order: int, impact_phase_rad: float | None, generator: np.random.Generator) -> float:
    if impact_phase_rad is None:
        return float(generator.uniform(-np.pi, np.pi))
    return float(-order * impact_phase_rad + generator.uniform(-0.6, 0.6))


def _slow_noise(time_s: FloatArray, generator: np.random.Generator) -> FloatArray:
    """Smooth noise of unit variance, 0.02…0.3 Hz."""
    frequencies = generator.uniform(0.02, 0.3, 10)
    phases = generator.uniform(0, 2 * np.pi, 10)
    waves = np.cos(2 * np.pi * frequencies[:, None] * time_s + phases[:, None])
    return np.asarray(np.sqrt(2 / 10) * waves.sum(axis=0))


def _ramps(time_s: FloatArray, duration_s: float) -> FloatArray:
    up = np.clip(time_s / _START_RAMP_S, 0, 1)
    down = np.clip((duration_s - time_s) / _STOP_RAMP_S, 0, 1)
    return np.asarray(0.25 * (1 - np.cos(np.pi * up)) * (1 - np.cos(np.pi * down)))


def _to_and_fro(x: FloatArray) -> FloatArray:
    """A rounded triangle wave: 0 at even x, 1 at odd x, mostly straight between."""
    # 0.985 rounds the turns: at 1 it is a triangle with corners
    return np.asarray(0.5 - np.arcsin(0.985 * np.cos(np.pi * x)) / (2 * np.arcsin(0.985)))


def _stairs(x: FloatArray, dwell_s: float) -> FloatArray:
    """0, 1, 2, … with rounded risers at integer x, each about 0.4 s wide."""
    last = np.round(x.max())
    risers = np.arange(1, last)[:, None]
    return np.asarray((0.5 * (1 + np.tanh((x - risers) * dwell_s / 0.2))).sum(axis=0))
