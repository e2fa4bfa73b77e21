"""What the numerical tank does not compute and a law of similarity disregards: wall layers and surface tension.

Both are estimated from the computed flow, after the fact:

wall layers
    The computed walls slip. A layer of an oscillating flow of speed U sin Ωt along a wall dissipates ½ρU² √(νΩ/2)
    per area and time (Landau & Lifshitz, Fluid Mechanics, § 24), that is ρ⟨u²⟩ √(νΩ/2) with the mean square.
    In similarity it falls with λ^(−3/4) = Re^(−1/2).
surface tension
    Surface that is made costs σ per area. If all the surface beyond that at rest were made anew twice in a cycle,
    and none of its energy came back, the work were 2σ(A − A₀). It falls with λ⁻² = 1/Bo. Drops smaller than the
    particles are not seen, and coalescing drops give energy back: an order of magnitude, not a bound.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.numerical_tank.simulation import NumericalTank
from acquisition.numerical_tank.tank import TankSetup
from studies.tank_scaling.similarity import SURFACE_TENSION_N_PER_M

_AT_SURFACE: Final = 0.2
"""h |Σ V ∇W| beyond which a particle is at a surface; less is disorder inside the liquid."""


@dataclass(frozen=True)
class LeftOut:
    """Work per cycle over m_l (Ω u₀)², or what it is made of.

    Attributes
    ----------
    wall_layers, surface_tension : float
    """

    wall_layers: float
    surface_tension: float


@dataclass(frozen=True)
class Look:
    """What an instant of the flow says.

    Attributes
    ----------
    wall_m4_per_s2 : float
        ∫ u² dA over all wetted walls, u along them.
    surface : float
        Σ V |∇C| [m] of the particles at a surface: in proportion to its length.
    """

    wall_m4_per_s2: float
    surface: float


def seen_in(tank: NumericalTank) -> Look:
    """Look at a tank: speeds along its walls and the extent of the surface.

    Parameters
    ----------
    tank : NumericalTank
    """
    setup, state = tank.setup, tank.state()
    spacing, depth = math.sqrt(setup.particle_volume_m2), setup.box.depth_m
    along_x, along_z = state.vx_m_per_s**2, state.vz_m_per_s**2
    # a particle beside a wall wets as much of it as it is wide
    level = (state.z_m < spacing) | (state.z_m > setup.box.height_m - spacing)
    upright = (state.x_m < spacing) | (state.x_m > setup.box.length_m - spacing)
    round_about = spacing * depth * (np.sum(along_x[level]) + np.sum(along_z[upright]))
    front_and_back = 2 * setup.particle_volume_m2 * np.sum(along_x + along_z)
    return Look(float(round_about + front_and_back), _surface(tank))


def _surface(tank: NumericalTank) -> float:
    n, particles = tank.setup.n_particles, tank.flow.particles
    gradient = np.hypot(particles.nx[:n], particles.nz[:n])
    at_surface = gradient * tank.setup.smoothing_length_m > _AT_SURFACE
    return tank.setup.particle_volume_m2 * float(np.sum(gradient[at_surface], dtype=float))


def work_left_out(
    looks: Sequence[Look], at_rest: Look, setup: TankSetup, omega_rad_per_s: float, unit_j: float
) -> LeftOut:
    """Work per cycle that the computation leaves out.

    Parameters
    ----------
    looks : sequence of Look
        Over whole cycles.
    at_rest : Look
        Of the same tank: its surface is flat, and its length that of the tank.
    setup : TankSetup
    omega_rad_per_s : float
    unit_j : float
        m_l (Ω u₀)².
    """
    layer = math.sqrt(setup.liquid.viscosity_m2_per_s * omega_rad_per_s / 2)
    mean_square = float(np.mean([look.wall_m4_per_s2 for look in looks]))
    period = 2 * math.pi / omega_rad_per_s
    in_layers = setup.liquid.density_kg_per_m3 * layer * mean_square * period
    flat = setup.box.length_m * setup.box.depth_m
    more = max(float(np.mean([look.surface for look in looks])) / at_rest.surface - 1, 0.0) * flat
    return LeftOut(in_layers / unit_j, 2 * SURFACE_TENSION_N_PER_M * more / unit_j)
