"""Small waves between two viscous fluids in a box whose walls slip, without any expansion in the viscosity.

A mode cos kx of the interface that goes with e^{st} moves each fluid by a potential and a vortical part,
w = A sinh kz + B sinh mz with m² = k² + s/ν; both velocities and the shear stress are continuous, and what is left
of the normal stress is the response to an interface raised by one (Lamb 1932, art. 349, with a second fluid and
floors that slip; Kumar & Tuckerman 1994, J. Fluid Mech. 279, 49). Lamb's decay rate 2νk² is its first term:
the next one is smaller by √(νk²/2ω) only, which are 5 % where νk²/ω is 0.006.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from acquisition.two_phase_tank.setup import Fluids

_HARMONICS = 8


@dataclass(frozen=True)
class Layers:
    """Two layers of fluid between floors that slip.

    Attributes
    ----------
    fluids : Fluids
    wave_number_per_m : float
    liquid_m, gas_m : float
        Depths.
    gravity_m_per_s2 : float
    """

    fluids: Fluids
    wave_number_per_m: float
    liquid_m: float
    gas_m: float
    gravity_m_per_s2: float = 9.81

    def normal_stress(self, rate_per_s: complex) -> complex:
        """Return what pushes an interface back that is raised by e^{st} cos kx, per height [Pa/m].

        Parameters
        ----------
        rate_per_s : complex
            s; not zero.
        """
        s, k, f = rate_per_s, self.wave_number_per_m, self.fluids
        rho = np.array([f.density_kg_per_m3, f.gas_density_kg_per_m3])
        nu = np.array([f.viscosity_m2_per_s, f.gas_viscosity_m2_per_s])
        depth, mu = np.array([self.liquid_m, self.gas_m]), rho * nu
        m = np.sqrt(k * k + s / nu + 0j)
        # slopes at the interface, towards the own floor positive, of parts that are one there
        potential, vortical = k / np.tanh(k * depth), m / np.tanh(m * depth)
        equations = np.array(
            [
                [1, 1, 0, 0],
                [0, 0, 1, 1],
                [potential[0], vortical[0], potential[1], vortical[1]],
                [2 * mu[0] * k**2, mu[0] * (m[0] ** 2 + k**2), -2 * mu[1] * k**2, -mu[1] * (m[1] ** 2 + k**2)],
            ]
        )
        a = np.linalg.solve(equations, np.array([s, s, 0, 0], complex)).reshape(2, 2)
        slope = a[:, 0] * potential + a[:, 1] * vortical
        # pressure of the potential part, ρ s w'/k², and 2μ w' of both; the gas with the other sign
        pushed = rho * s * a[:, 0] * potential / k**2 + 2 * mu * slope
        weight = (rho[0] - rho[1]) * self.gravity_m_per_s2 + f.surface_tension_n_per_m * k**2
        return complex(pushed.sum() + weight)

    def free_wave(self) -> tuple[float, float]:
        """Return frequency [rad/s] and decay rate [1/s] of the wave that nothing drives."""
        f, k = self.fluids, self.wave_number_per_m
        stiffness = (f.density_kg_per_m3 - f.gas_density_kg_per_m3) * self.gravity_m_per_s2 * k
        stiffness += f.surface_tension_n_per_m * k**3
        inertia = f.density_kg_per_m3 / np.tanh(k * self.liquid_m)
        inertia += f.gas_density_kg_per_m3 / np.tanh(k * self.gas_m)
        omega, decay = float(np.sqrt(stiffness / inertia)), 2 * f.viscosity_m2_per_s * k**2

        def left_over(scaled: NDArray[np.float64]) -> list[float]:
            found = self.normal_stress(complex(-scaled[1] * decay, scaled[0] * omega))
            return [found.real, found.imag]

        found = root(left_over, [1.0, 1.0], tol=1e-12)
        return float(found.x[0] * omega), float(found.x[1] * decay)

    def subharmonic_threshold(self, omega_rad_per_s: float) -> float:
        """Acceleration [m/s²] of a tank shaken with ω from which on a wave of half the frequency grows.

        Of its series with frequencies (n + ½) ω each term answers to its neighbours,
        2 D((n + ½) iω) ζₙ = −a (ρ₁ − ρ₂) (ζₙ₋₁ + ζₙ₊₁): a is the least positive eigenvalue.

        Parameters
        ----------
        omega_rad_per_s : float
        """
        n = np.arange(-_HARMONICS, _HARMONICS)
        own = np.array([self.normal_stress(1j * (float(j) + 0.5) * omega_rad_per_s) for j in n])
        jump = self.fluids.density_kg_per_m3 - self.fluids.gas_density_kg_per_m3
        neighbours = np.eye(n.size, k=1) + np.eye(n.size, k=-1)
        # ζ = a (−Δρ/2D) (neighbours) ζ
        values = 1 / np.linalg.eigvals(-0.5 * jump / own[:, None] * neighbours)
        real = values[(np.abs(values.imag) < 1e-6 * np.abs(values)) & (values.real > 0)]
        return float(real.real.min())
