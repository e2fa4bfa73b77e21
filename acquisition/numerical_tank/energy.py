"""Where the energy goes: an account in which every term is measured on its own.

Per metre of the tank's depth, in the frame of the tank. What the residual does not contain was
computed from the term itself, never as a difference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank.liquid_state import LiquidState

TERMS: Final = (
    "tank_work",
    "viscosity",
    "density_diffusion",
    "packing",
    "shift",
)
"""Order of the sums that the compiled loop keeps."""
(TANK_WORK, VISCOSITY, DENSITY_DIFFUSION, PACKING, SHIFT) = range(len(TERMS))


@dataclass(frozen=True)
class EnergyAccount:
    """Energies [J/m] since the start of a run; losses are positive when energy leaves the liquid.

    Attributes
    ----------
    kinetic_j_per_m, potential_j_per_m, elastic_j_per_m : float
        What the liquid has gained in its motion relative to the tank, its height and its compression.
    tank_work_j_per_m : float
        Work of the inertial force −m ü in the frame of the tank: what the shaker gave.
    viscosity_j_per_m, density_diffusion_j_per_m : float
        Taken away by the two dissipative terms of the equations.
    packing_j_per_m : float
        Elastic energy taken away by the packing correction; negative where it gives some.
    shift_j_per_m : float
        Potential energy taken away by shifting.
    """

    kinetic_j_per_m: float
    potential_j_per_m: float
    elastic_j_per_m: float
    tank_work_j_per_m: float
    viscosity_j_per_m: float
    density_diffusion_j_per_m: float
    packing_j_per_m: float
    shift_j_per_m: float

    @property
    def gained_j_per_m(self) -> float:
        """What the liquid has more than at the start."""
        return self.kinetic_j_per_m + self.potential_j_per_m + self.elastic_j_per_m

    @property
    def lost_j_per_m(self) -> float:
        """Sum of all losses."""
        return self.viscosity_j_per_m + self.density_diffusion_j_per_m + self.packing_j_per_m + self.shift_j_per_m

    @property
    def residual_j_per_m(self) -> float:
        """What nobody accounts for: gained + lost − given."""
        return self.gained_j_per_m + self.lost_j_per_m - self.tank_work_j_per_m

    @property
    def residual_share(self) -> float:
        """Residual over the largest term of the account; 0 where nothing happened."""
        largest = max(
            abs(self.tank_work_j_per_m),
            abs(self.lost_j_per_m),
            abs(self.kinetic_j_per_m),
            abs(self.potential_j_per_m),
            abs(self.elastic_j_per_m),
        )
        return self.residual_j_per_m / largest if largest > 0 else 0.0

    def __sub__(self, earlier: EnergyAccount) -> EnergyAccount:
        """Return the account of the time between two accounts of one run."""
        values = {f.name: getattr(self, f.name) - getattr(earlier, f.name) for f in fields(self)}
        return EnergyAccount(**values)


def stored_energy(
    state: LiquidState, mass_kg_per_m: float, impedance_kg_per_m2_s: float, g_m_per_s2: float
) -> tuple[float, float, float]:
    """Return kinetic, potential and elastic energy [J/m] of the liquid.

    Parameters
    ----------
    state : LiquidState
    mass_kg_per_m : float
        Mass of one particle.
    impedance_kg_per_m2_s : float
        ρ₀ c₀; the elastic energy is ½ m (p/(ρ₀ c₀))².
    g_m_per_s2 : float
        g.
    """
    kinetic = 0.5 * mass_kg_per_m * float(np.sum(state.vx_m_per_s**2 + state.vz_m_per_s**2))
    potential = mass_kg_per_m * g_m_per_s2 * float(np.sum(state.z_m))
    elastic = 0.5 * mass_kg_per_m * float(np.sum((state.pressure_pa / impedance_kg_per_m2_s) ** 2))
    return kinetic, potential, elastic


def account(
    stored_j_per_m: Sequence[float],
    sums: NDArray[np.float64],
    *,
    mass_kg_per_m: float,
    step_s: float,
    speed_of_sound_m_per_s: float,
    g_m_per_s2: float,
) -> EnergyAccount:
    """Turn the sums of the compiled loop into energies.

    Parameters
    ----------
    stored_j_per_m : sequence of float
        What the liquid gained: kinetic, potential, elastic.
    sums : ndarray, shape (5,)
        In the order of `TERMS`.
    mass_kg_per_m : float
        Mass of one particle.
    step_s : float
    speed_of_sound_m_per_s, g_m_per_s2 : float
        c₀ and g.
    """
    scale = np.full(len(TERMS), mass_kg_per_m)
    scale[[TANK_WORK, VISCOSITY]] *= step_s
    # both change s, whose energy is ½ m c₀² s²
    scale[[DENSITY_DIFFUSION, PACKING]] *= speed_of_sound_m_per_s**2
    # shifts change heights and no velocity: what they cost is potential energy alone
    scale[SHIFT] *= g_m_per_s2
    work, viscosity, diffusion, packing, shift = (float(value) for value in sums * scale)
    kinetic, potential, elastic = stored_j_per_m
    return EnergyAccount(kinetic, potential, elastic, work, viscosity, diffusion, packing, shift)
