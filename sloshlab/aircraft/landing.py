"""Landing of a wing: the fuselage accelerates upward; the wing feels its gear and its own inertia (3.17, 3.18).

    f = b ü_f,   b_n = ½ M_ac i₃·ψ_n(x_gear) − Σ material m i₃·ψ_n − Σ tanks m_l i₃·ψ_n(x_T)

The source prints the inertia of the material alone; the liquid falls and rises with the fuselage as well. Tanks
and their models move with fuselage and wing together. No recording is printed, so the input is a half sine and a
ringing, and results are qualitative.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from sloshlab.aeroelastic.rational_functions import RationalForces
from sloshlab.aeroelastic.state_space import total_mass
from sloshlab.aircraft.beam_wing import axis_places_m, span_nodes_m, wing_matrices
from sloshlab.aircraft.flight_stability import flight_system
from sloshlab.aircraft.linear_flight import LinearFlight, linear_flight
from sloshlab.aircraft.model import AircraftModel
from sloshlab.aircraft.wing_file import LandingSection, WingDescription
from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.lateral_sloshing.coupling import frozen_mass_matrix, rigid_motion

FloatArray = npt.NDArray[np.float64]
_UP: Final = 2
SLOW_RAD_PER_S: Final = 0.5
"""Below it the velocity of the fuselage is uniform motion, which moves no liquid: models of tanks do not see it,
as none was trained with it. A tenth of the slowest motion that the largest tank was identified for."""


def fuselage_acceleration_m_per_s2(landing: LandingSection, time_s: FloatArray) -> FloatArray:
    """Vertical acceleration of the fuselage, up: a half sine, then a decaying sine.

    Parameters
    ----------
    landing : LandingSection
    time_s : ndarray
        From touchdown.
    """
    t = np.asarray(time_s, dtype=np.float64)
    pulse = landing.pulse_g * np.sin(np.pi * t / landing.pulse_s)
    after = t - landing.pulse_s
    omega, zeta = 2 * np.pi * landing.ringing_hz, landing.ringing_damping_ratio
    ringing = -landing.ringing_g * np.exp(-zeta * omega * after) * np.sin(omega * np.sqrt(1 - zeta**2) * after)
    shape = np.where((t >= 0) & (after < 0), pulse, np.where(after >= 0, ringing, 0.0))
    return np.asarray(GRAVITY_M_PER_S2 * shape)


def fuselage_velocity_m_per_s(landing: LandingSection, time_s: FloatArray) -> FloatArray:
    """Its integral from touchdown, in closed form.

    Parameters
    ----------
    landing : LandingSection
    time_s : ndarray
        From touchdown.
    """
    t = np.asarray(time_s, dtype=np.float64)
    within = np.clip(t, 0.0, landing.pulse_s)
    pulse = landing.pulse_g * landing.pulse_s / np.pi * (1 - np.cos(np.pi * within / landing.pulse_s))
    after = np.maximum(t - landing.pulse_s, 0.0)
    omega, zeta = 2 * np.pi * landing.ringing_hz, landing.ringing_damping_ratio
    damped, decay = omega * np.sqrt(1 - zeta**2), zeta * omega
    # ∫ e^{−σt} sin ω_d t = [ω_d − e^{−σt}(ω_d cos ω_d t + σ sin ω_d t)]/ω², since σ² + ω_d² = ω²
    turned = damped * np.cos(damped * after) + decay * np.sin(damped * after)
    ringing = -landing.ringing_g * (damped - np.exp(-decay * after) * turned) / omega**2
    return np.asarray(GRAVITY_M_PER_S2 * (pulse + ringing))


def landing_forces_kg(described: WingDescription, model: AircraftModel, landing: LandingSection) -> FloatArray:
    """b of (3.18) with the liquid: generalised force per upward acceleration of the fuselage, shape (n_modes,).

    Parameters
    ----------
    described : WingDescription
    model : AircraftModel
        Of it.
    landing : LandingSection
    """
    structure = model.structure
    shapes = structure.shapes.reshape(structure.n_modes, -1)
    mass, _ = wing_matrices(described.wing, described.engine)
    upward = np.zeros(6)
    upward[_UP] = 1.0
    rigid = np.tile(upward, len(structure.nodes))
    material = shapes @ mass @ rigid
    liquid = sum(
        (tank.motion.T @ frozen_mass_matrix(tank.box, turn_rad=tank.turn_rad) @ upward for tank in model.tanks),
        np.zeros(structure.n_modes),
    )
    y = span_nodes_m(described.wing)
    nearest = int(np.argmin(np.abs(y - landing.gear_y_m)))
    arm = axis_places_m(described.wing, landing.gear_y_m) - structure.places_m[nearest]
    gear = (rigid_motion(arm) @ shapes.reshape(structure.n_modes, -1, 6)[:, nearest].T)[_UP]
    return np.asarray(landing.half_aircraft_mass_kg * gear - material - liquid)


def landing_flight(
    described: WingDescription,
    model: AircraftModel,
    air: RationalForces,
    landing: LandingSection,
) -> LinearFlight:
    """The wing as it lands: in place of w_g stands the velocity of the fuselage, in place of ẇ_g its acceleration.

    Parameters
    ----------
    described : WingDescription
    model : AircraftModel
        Of it.
    air : RationalForces
        On the modes, at the Mach number of the landing.
    landing : LandingSection

    Returns
    -------
    LinearFlight
        Two more states: velocity of the fuselage, and its slow part, which tanks do not feel.
    """
    own = linear_flight(
        model, "frozen", speed_m_per_s=landing.speed_m_per_s, air=air, density_kg_per_m3=landing.density_kg_per_m3
    )
    system = flight_system(model, air, "frozen", density_kg_per_m3=landing.density_kg_per_m3)
    forces = landing_forces_kg(described, model, landing)
    n = own.n_states
    matrix, of_wind = np.zeros((n + 2, n + 2)), np.zeros((n + 2, 2))
    matrix[:n, :n] = own.matrix
    matrix[n + 1, n], matrix[n + 1, n + 1] = SLOW_RAD_PER_S, -SLOW_RAD_PER_S
    of_wind[own.rates, 1] = np.linalg.solve(total_mass(system.structure, air, landing.density_kg_per_m3), forces)
    of_wind[n, 1] = 1.0
    n_tanks = len(model.tanks)
    of_fuselage = np.tile([1.0, -1.0], (n_tanks, 1))
    return replace(
        own,
        matrix=matrix,
        of_wind=of_wind,
        of_forces=np.vstack([own.of_forces, np.zeros((2, n_tanks))]),
        tank_velocity=np.hstack([own.tank_velocity, of_fuselage]),
    )
