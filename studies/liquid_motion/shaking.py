"""A half-filled numerical tank shaken up and sideways at once: forces and centre by first harmonics."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank.simulation import NumericalTank
from acquisition.numerical_tank.tank import Box, filled_tank
from sloshlab.constants import GRAVITY_M_PER_S2

FloatArray = NDArray[np.float64]

TANK: Final = Box(length_m=0.1172, height_m=0.0272, depth_m=0.078)
FILL_LEVEL: Final = 0.5
LAYERS: Final = 12
N_CYCLES: Final = 26
N_AVERAGED: Final = 16
RISE_CYCLES: Final = 3
_PER_CYCLE: Final = 48
"""Looks at the liquid in a cycle."""


@dataclass(frozen=True)
class Shaking:
    """Harmonic motion ü = a cos Ωt, up and sideways in phase.

    Attributes
    ----------
    frequency_hz : float
    vertical_g, sideways_g : float
        Amplitudes of the acceleration over g.
    seed : int
        Of the disturbance at the start.
    """

    frequency_hz: float
    vertical_g: float
    sideways_g: float = 0.0
    seed: int = 0

    @property
    def omega_rad_per_s(self) -> float:
        """Ω."""
        return 2 * math.pi * self.frequency_hz

    def share(self, time_s: FloatArray) -> FloatArray:
        """cos Ωt, rising at the start."""
        return np.clip(time_s * self.frequency_hz / RISE_CYCLES, 0, 1) * np.cos(self.omega_rad_per_s * time_s)


@dataclass(frozen=True, eq=False)
class Shaken:
    """First harmonics over the averaged cycles; phasors of e^{iΩt} with ü = a.

    Attributes
    ----------
    shaking : Shaking
    vertical, sideways : complex
        Δf over m_l g, the force beyond that of frozen liquid, upward and to the right.
    centre : complex
        Displacement of the liquid's centre of mass relative to the tank, over h; upward.
    phase, centre_over_height : ndarray
        Of the last cycle: Ωt/2π, and the centre relative to its mean, over h.
    liquid_mass_kg : float
    """

    shaking: Shaking
    vertical: complex
    sideways: complex
    centre: complex
    phase: FloatArray
    centre_over_height: FloatArray
    liquid_mass_kg: float

    @property
    def u_over_height(self) -> complex:
        """Displacement of the tank over h: −a/Ω²."""
        shaking = self.shaking
        return complex(-shaking.vertical_g * GRAVITY_M_PER_S2 / shaking.omega_rad_per_s**2 / TANK.height_m)

    @property
    def by_force(self) -> tuple[float, float]:
        """β = Re[Δf̌/(m_l Ω² ǔ)] and W̄ = −π Im[…] (1.22, 1.30)."""
        # ü = −Ω² u: Δf/(m_l Ω² u) is −Δf/(m_l ü)
        ratio = -self.vertical / self.shaking.vertical_g
        return float(ratio.real), float(-math.pi * ratio.imag)

    @property
    def by_centre(self) -> tuple[float, float]:
        """β = Re[Δǔ_G/ǔ] and W̄ = −π Im[Δǔ_G/ǔ] (1.28–1.30)."""
        ratio = self.centre / self.u_over_height
        return float(ratio.real), float(-math.pi * ratio.imag)


def shaken(shaking: Shaking) -> Shaken:
    """Shake a tank from rest.

    Parameters
    ----------
    shaking : Shaking

    Raises
    ------
    InstabilityError
        If the computation cannot go on.
    """
    rate_hz = shaking.frequency_hz * _PER_CYCLE
    setup = filled_tank(TANK, FILL_LEVEL, LAYERS, seed=shaking.seed, sampling_rate_hz=rate_hz)
    tank, steps = NumericalTank(setup), setup.steps_per_sample
    mass = setup.liquid_mass_kg
    skipped = (N_CYCLES - N_AVERAGED) * _PER_CYCLE
    times, vertical, sideways, centre_times, centres = [], [], [], [], []
    for look in range(N_CYCLES * _PER_CYCLE):
        time = tank.times_s(steps)
        share = shaking.share(time)
        motion = GRAVITY_M_PER_S2 * np.stack([shaking.sideways_g * share, shaking.vertical_g * share], axis=1)
        forces = tank.advance(motion)
        if look >= skipped:
            times.append(time)
            vertical.append(forces.vertical_n / (mass * GRAVITY_M_PER_S2) + 1 + shaking.vertical_g * share)
            sideways.append(forces.horizontal_n / (mass * GRAVITY_M_PER_S2) + shaking.sideways_g * share)
            centre_times.append(tank.time_s)
            centres.append(float(tank.state().z_m.mean()) / TANK.height_m)
    time, looks, centre = np.concatenate(times), np.array(centre_times), np.array(centres)
    omega, last = shaking.omega_rad_per_s, slice(-_PER_CYCLE, None)
    return Shaken(
        shaking,
        first_harmonic(time, np.concatenate(vertical), omega),
        first_harmonic(time, np.concatenate(sideways), omega),
        first_harmonic(looks, centre, omega),
        np.asarray(looks[last] * shaking.frequency_hz),
        np.asarray(centre[last] - centre.mean()),
        mass,
    )


def first_harmonic(time_s: FloatArray, values: FloatArray, omega_rad_per_s: float) -> complex:
    """Phasor c of Re[c e^{iΩt}] within values, by least squares with a mean.

    Examples
    --------
    >>> time = np.linspace(0, 3, 500)
    >>> c = first_harmonic(time, 5 + 2 * np.cos(7 * time) + 3 * np.sin(7 * time), 7.0)
    >>> round(c.real, 6), round(c.imag, 6)
    (2.0, -3.0)
    """
    columns = np.stack(
        [np.ones_like(time_s), np.cos(omega_rad_per_s * time_s), np.sin(omega_rad_per_s * time_s)], 1
    )
    (_, cosine, sine), *_ = np.linalg.lstsq(columns, values, rcond=None)
    return complex(cosine, -sine)
