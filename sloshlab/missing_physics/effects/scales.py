"""Sizes of a motion, in multiples of which effects state their ranges and starts.

m is the mass that moves, x, v and a are its largest displacement, velocity and acceleration, ω is the frequency of
most of the motion.
"""

from __future__ import annotations

from collections.abc import Callable
from math import pi

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.missing_physics.candidate import Surroundings

Scale = Callable[[Surroundings], float]


def force(at: Surroundings) -> float:
    """m a [N]."""
    return at.force_n


def damping(at: Surroundings) -> float:
    """m ω [N s/m]."""
    return at.moving_mass_kg * at.omega


def stiffness(at: Surroundings) -> float:
    """m ω² [N/m]."""
    return at.moving_mass_kg * at.omega**2


def secant_stiffness(at: Surroundings) -> float:
    """m a/x [N/m]: that of springs that share the force of a motion of several frequencies."""
    return at.force_n / at.displacement_m


def drag(at: Surroundings) -> float:
    """m a/v² [N s²/m²]."""
    return at.force_n / at.velocity_m_per_s**2


def quadratic_stiffness(at: Surroundings) -> float:
    """m a/x² [N/m²]."""
    return at.force_n / at.displacement_m**2


def cubic_stiffness(at: Surroundings) -> float:
    """m a/x³ [N/m³]."""
    return at.force_n / at.displacement_m**3


def mass(at: Surroundings) -> float:
    """m [kg]."""
    return at.moving_mass_kg


def displacement(at: Surroundings) -> float:
    """x [m]."""
    return at.displacement_m


def velocity(at: Surroundings) -> float:
    """v [m/s]."""
    return at.velocity_m_per_s


def acceleration_g(at: Surroundings) -> float:
    """a/g."""
    return at.acceleration_m_per_s2 / GRAVITY_M_PER_S2


def reciprocal_g(at: Surroundings) -> float:
    """g/a."""
    return 1.0 / acceleration_g(at)


def frequency(at: Surroundings) -> float:
    """ω/2π [Hz]."""
    return at.frequency_hz


def period(at: Surroundings) -> float:
    """2π/ω [s]."""
    return 1.0 / at.frequency_hz


def duration(at: Surroundings) -> float:
    """Of the longest run [s]."""
    return at.longest_run_s


def sampling_rate(at: Surroundings) -> float:
    """Of the recordings [Hz]."""
    return at.sampling_rate_hz


def cycle_in_a_run(at: Surroundings) -> float:
    """One over the longest run [Hz]: by as much a frequency slips by one cycle."""
    return 1.0 / at.longest_run_s


def liquid_mass(at: Surroundings) -> float:
    """m_l [kg]."""
    return at.rig.liquid_mass_kg


def liquid_force(at: Surroundings) -> float:
    """m_l a [N]."""
    return at.rig.liquid_mass_kg * at.acceleration_m_per_s2


def liquid_damping(at: Surroundings) -> float:
    """m_l a/v [N s/m]."""
    return liquid_force(at) / at.velocity_m_per_s


def liquid_drag(at: Surroundings) -> float:
    """m_l a/v² [N s²/m²]."""
    return liquid_force(at) / at.velocity_m_per_s**2


def liquid_stiffness(at: Surroundings) -> float:
    """m_l ω² [N/m]."""
    return at.rig.liquid_mass_kg * at.omega**2


def hardening(at: Surroundings) -> float:
    """ω²/a [1/m]."""
    return at.omega**2 / at.acceleration_m_per_s2


def loss_rate(at: Surroundings) -> float:
    """m_l in the longest run [kg/s]."""
    return at.rig.liquid_mass_kg / at.longest_run_s


def contact_damping(at: Surroundings) -> float:
    """2 m_l 2π · 50 Hz [kg/s]: critical for a contact as stiff as floors and ceilings of tanks are."""
    return 2 * at.rig.liquid_mass_kg * 2 * pi * 50.0


def contact_stiffness(at: Surroundings) -> float:
    """m_l (2π · 50 Hz)² [N/m]."""
    return at.rig.liquid_mass_kg * (2 * pi * 50.0) ** 2


def room(at: Surroundings) -> float:
    """Height above the liquid [m]."""
    return (1 - at.rig.liquid.fill_level) * at.rig.tank.height_m


def reading(at: Surroundings) -> float:
    """RMS of the channel, in its unit."""
    return at.reading


def peak(at: Surroundings) -> float:
    """Largest reading of the channel, in its unit."""
    return at.peaks.get(at.channel, 2.0 * at.reading)


def drift(at: Surroundings) -> float:
    """RMS of the channel in the longest run, in its unit per second."""
    return at.reading / at.longest_run_s


def clock(at: Surroundings) -> float:
    """A cycle in the longest run."""
    return 1.0 / (at.frequency_hz * at.longest_run_s)


def leak(at: Surroundings) -> float:
    """Ratio at which a leak is as large as the reading of the channel itself."""
    to, _, source = at.channel.partition("<")
    return at.channels.get(to, 1.0) / max(at.channels.get(source, 1.0), 1e-300)
