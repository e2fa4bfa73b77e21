"""A hidden effect: how it changes the laboratory, and what is true of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from sealed_trial.laboratory.prescribed_motion import Motion

FloatArray = npt.NDArray[np.float64]
Signals = dict[str, FloatArray]
Distortion = Callable[[Signals, float, int], Signals]
"""From perfect signals, sampling rate and number of a run to its signals as a faulty chain would pass them on."""


@dataclass(frozen=True)
class Scales:
    """How large everything is in the strongest run without anything hidden.

    Attributes
    ----------
    displacement_m, velocity_m_per_s : float
        Peak, relative to the base where there is a structure.
    acceleration_g : float
        Peak of the tank.
    stiffness_n_per_m, mass_kg, rate_rad_per_s : float
        Of the first mode; on the shaker mass and rate of the carried tank and its motion.
    liquid_mass_kg, room_m : float
        Mass of the liquid, free height above it.
    length_m : float
        Of the beam, else 0.
    rms, peak : dict
        Of every channel.
    """

    displacement_m: float
    velocity_m_per_s: float
    acceleration_g: float
    stiffness_n_per_m: float
    mass_kg: float
    rate_rad_per_s: float
    liquid_mass_kg: float
    room_m: float
    length_m: float
    rms: dict[str, float]
    peak: dict[str, float]

    @property
    def force_n(self) -> float:
        """Restoring force at the peak [N]."""
        return self.stiffness_n_per_m * self.displacement_m

    @property
    def damping_n_s_per_m(self) -> float:
        """Damping of 2 % of critical."""
        return 0.04 * self.mass_kg * self.rate_rad_per_s


@dataclass(frozen=True)
class Change:
    """An effect of one magnitude.

    Attributes
    ----------
    parameters : dict
        True values under the names of the vocabulary.
    kernel : dict
        The kernel's parameters.
    compliance_rad_per_n_m : float
        Of the base's rotation.
    relaxation_exponent : float
    distortion, late_distortion : callable or None
        Of the signals before, and after noise was added.
    obeyed : callable or None
        From the commanded motion of a base to what it does.
    of_runs : tuple of dict
        Kernel parameters of each run, what happens outside knowing nothing of when a recording begins.
    """

    parameters: dict[str, float]
    kernel: dict[int, float] = field(default_factory=dict)
    compliance_rad_per_n_m: float = 0.0
    relaxation_exponent: float = 0.0
    distortion: Distortion | None = None
    late_distortion: Distortion | None = None
    obeyed: Callable[[Motion], Motion] | None = None
    of_runs: tuple[dict[int, float], ...] = ()

    def kernel_of_run(self, number: int) -> dict[int, float]:
        """Kernel parameters of a run alone; more runs than are stated begin anew."""
        return self.of_runs[number % len(self.of_runs)] if self.of_runs else {}

    def distorted(self, runs: Sequence[Signals], rate_hz: float, *, late: bool = False) -> list[Signals]:
        """All runs as the chain passes them on, before noise or after it."""
        distortion = self.late_distortion if late else self.distortion
        if distortion is None:
            return list(runs)
        return [distortion(run, rate_hz, number) for number, run in enumerate(runs)]


@dataclass(frozen=True)
class DrawnEffect:
    """An effect whose every detail is drawn but its magnitude.

    Attributes
    ----------
    name, block : str
    change : callable
        Takes the magnitude; 1 is of a usual size.
    channel : str
        Of a sensor's effect, else empty.
    least, most : float
        Of the magnitude.
    description : str
        Of physics outside the vocabulary.
    essential : callable or None
        The part without which it would be a simpler effect; it has to show alone too.
    """

    name: str
    block: str
    change: Callable[[float], Change]
    channel: str = ""
    least: float = 1e-4
    most: float = 1e3
    description: str = ""
    essential: Callable[[float], Change] | None = None


Draw = Callable[[Scales, np.random.Generator], DrawnEffect]


@dataclass(frozen=True)
class HiddenEffect:
    """A kind of effect and where it can be told from others.

    Attributes
    ----------
    name, block : str
    draw : callable
        From scales and a generator.
    kinds : tuple of str
        Rigs that can have it.
    needs_levels, needs_frequencies : bool
        A plan without them cannot tell it from other effects.
    needs_driven_base : bool
    tank_model : str
        'frozen' or 'viscous' where only that baseline leaves it out, else empty.
    is_friction : bool
        Left out of rigs whose baseline has dry friction already.
    """

    name: str
    block: str
    draw: Draw
    kinds: tuple[str, ...]
    needs_levels: bool = False
    needs_frequencies: bool = False
    needs_driven_base: bool = False
    tank_model: str = ""
    is_friction: bool = False
