"""Computing what the pictures show: the liquid at chosen phases of a harmonic motion."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from acquisition.numerical_tank.forced_motion import HarmonicMotion
from acquisition.numerical_tank.liquid_state import LiquidState
from acquisition.numerical_tank.simulation import NumericalTank
from acquisition.virtual_laboratory.numerical_liquid import numerical_setup
from acquisition.virtual_laboratory.shaker import STROKE_LIMIT_M
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import InputError
from sloshlab.rig import Rig

LEVELS_G: Final = (0.5, 1.5, 3.0)
FREQUENCIES_HZ: Final = (6.0, 9.0, 13.0, 17.0)
"""The twelve conditions of Fig. 1.6 are all pairs of these."""
CYCLES_TO_WAIT: Final = {0.5: 60, 1.5: 20, 3.0: 15}
"""Cycles after which the liquid of a level shows what it does; surface waves below 1 g grow slowly."""
RISE_CYCLES: Final = 3
FRAMES_PER_CYCLE: Final = 24
"""Every frame is a whole number of steps."""


@dataclass(frozen=True)
class Shaking:
    """Harmonic vertical motion of the tank, ü = a₀ cos φ, as far as the stroke of the shaker allows.

    Attributes
    ----------
    level_g : float
        Acceleration amplitude that was asked for, over g.
    frequency_hz : float

    Examples
    --------
    >>> shaking = Shaking(3.0, 6.0)
    >>> round(shaking.amplitude_g, 2), round(shaking.displacement_amplitude_m, 4)
    (1.81, 0.0125)
    """

    level_g: float
    frequency_hz: float

    @property
    def omega_rad_per_s(self) -> float:
        """Circular frequency Ω."""
        return 2 * math.pi * self.frequency_hz

    @property
    def amplitude_g(self) -> float:
        """a₀/g: the level, or what the stroke limit leaves of it."""
        return min(self.level_g, STROKE_LIMIT_M * self.omega_rad_per_s**2 / GRAVITY_M_PER_S2)

    @property
    def displacement_amplitude_m(self) -> float:
        """u₀ = a₀/Ω²."""
        return self.amplitude_g * GRAVITY_M_PER_S2 / self.omega_rad_per_s**2

    def acceleration_g(self, phase_deg: float) -> float:
        """ü/g at a phase φ [degrees]."""
        return self.amplitude_g * math.cos(math.radians(phase_deg))

    def displacement_m(self, phase_deg: float) -> float:
        """u = −u₀ cos φ [m], upward positive."""
        return -self.displacement_amplitude_m * math.cos(math.radians(phase_deg))


@dataclass(frozen=True)
class Snapshot:
    """The liquid at one instant.

    Attributes
    ----------
    shaking : Shaking
    frame : int
        Instant, in frames since the motion began.
    liquid : LiquidState
        In the frame of the tank.
    spacing_m : float
        Mean distance of the particles.
    """

    shaking: Shaking
    frame: int
    liquid: LiquidState
    spacing_m: float

    @property
    def phase_deg(self) -> float:
        """Phase φ of the acceleration [degrees], from 0 up to 360."""
        return 360.0 * (self.frame % FRAMES_PER_CYCLE) / FRAMES_PER_CYCLE

    @property
    def cycles(self) -> float:
        """Cycles since the motion began."""
        return self.frame / FRAMES_PER_CYCLE


def snapshots(
    rig: Rig, shaking: Shaking, frames: Sequence[int], *, layers_per_height: int, seed: int
) -> Iterator[Snapshot]:
    """Shake a numerical tank from rest and yield the liquid at the given frames.

    Parameters
    ----------
    rig : Rig
        Tank and liquid.
    shaking : Shaking
        The amplitude is reached after `RISE_CYCLES`.
    frames : sequence of int
        Rising; `FRAMES_PER_CYCLE` of them make a cycle.
    layers_per_height : int
        Height of the tank over the distance of the particles.
    seed : int
        Of the disturbance at the start.

    Yields
    ------
    Snapshot

    Raises
    ------
    InputError
        If the frames do not rise or there is no such tank.
    InstabilityError
        If the computation cannot go on.
    """
    if any(later <= earlier for earlier, later in zip([-1, *frames], frames, strict=False)):
        raise InputError("frames", got=f"{list(frames)}"[:80], allowed="rising numbers from 0 on")
    rate_hz = shaking.frequency_hz * FRAMES_PER_CYCLE
    setup = numerical_setup(rig, layers_per_height=layers_per_height, seed=seed, sampling_rate_hz=rate_hz)
    tank, done = NumericalTank(setup), 0
    motion = HarmonicMotion(
        shaking.amplitude_g * GRAVITY_M_PER_S2, shaking.frequency_hz, RISE_CYCLES / shaking.frequency_hz
    )
    for frame in frames:
        if frame > done:
            tank.advance(motion(tank.times_s((frame - done) * setup.steps_per_sample)))
        done = frame
        yield Snapshot(shaking, frame, tank.state(), math.sqrt(setup.particle_volume_m2))
