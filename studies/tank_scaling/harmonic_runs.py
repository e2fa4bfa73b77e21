"""One tank shaken at one point (ω̄, a₀): W̄ and β cycle by cycle, and what the computation leaves out.

W̄ is the work of the tank on the liquid in a cycle over m_l (Ω u₀)², β = −Re(Δf̌/ǔ̈)/m_l, as everywhere in the
project. Cycles begin where the velocity passes zero; steps that a boundary cuts count in part to both sides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.numerical_tank.forced_motion import HarmonicMotion, moved
from acquisition.numerical_tank.simulation import NumericalTank
from sloshlab.constants import GRAVITY_M_PER_S2
from studies.tank_scaling.similarity import SimilarTank
from studies.tank_scaling.uncomputed import LeftOut, seen_in, work_left_out

FloatArray = NDArray[np.float64]

RISE_CYCLES: Final = 3
WAITING_CYCLES: Final = 16
"""Left out at the start: the liquid breaks up within ten cycles or so."""
N_CYCLES: Final = 40
"""In all."""
LOOKS_PER_CYCLE: Final = 8
"""How often the particles are looked at for what is not computed."""


@dataclass(frozen=True)
class Point:
    """A condition without dimension, the same for every size.

    Attributes
    ----------
    omega_bar : float
        ω̄ = Ω/√(g/h).
    level_g : float
        Amplitude of the acceleration over g.
    """

    omega_bar: float
    level_g: float

    @property
    def froude_number(self) -> float:
        """Amplitude of v̄ = v/√(gh)."""
        return self.level_g / self.omega_bar

    @property
    def u_bar(self) -> float:
        """ū = u₀/h, amplitude of the displacement."""
        return self.level_g / self.omega_bar**2


POINTS: Final = (Point(3.8, 1.0), *(Point(omega, level) for omega in (2.7, 3.8, 5.7) for level in (1.5, 3.0, 5.0)))
"""ω̄ of flutter of the source's flying wing (2.6, 2.7 and 5.7) and where W̄ is largest (3.8)."""


@dataclass(frozen=True)
class HarmonicRun:
    """Which run.

    Attributes
    ----------
    point : Point
    tank : SimilarTank
    layers_per_height, seed : int
    n_cycles : int
    """

    point: Point
    tank: SimilarTank
    layers_per_height: int
    seed: int
    n_cycles: int = N_CYCLES

    @property
    def name(self) -> str:
        """Name without spaces, for files."""
        whole = "_all_scaled" if self.tank.scales_viscosity else ""
        return (
            f"omega_{self.point.omega_bar:g}_level_{self.point.level_g:g}g_size_{self.tank.size:g}{whole}"
            f"_layers_{self.layers_per_height}_seed_{self.seed}"
        )

    @property
    def work(self) -> float:
        """What it costs, over a cycle at ω̄ = 1: time grows with the cube of the layers."""
        return self.n_cycles / self.point.omega_bar * self.layers_per_height**3


@dataclass(frozen=True)
class HarmonicCycles:
    """What a run gave.

    Attributes
    ----------
    w_bar, beta : ndarray, shape (n_cycles,)
        Of every whole cycle after the waiting; the last one is not whole where the last step was rounded down.
    left_out : LeftOut
        Estimates of the work per cycle that the computation does not contain, over m_l (Ω u₀)².
    """

    w_bar: FloatArray
    beta: FloatArray
    left_out: LeftOut


def shaken(run: HarmonicRun) -> HarmonicCycles:
    """Compute a run.

    Parameters
    ----------
    run : HarmonicRun

    Raises
    ------
    InstabilityError
        If the computation cannot go on.
    """
    setup = run.tank.setup(run.layers_per_height, run.seed)
    omega = run.point.omega_bar / run.tank.time_scale_s
    period = 2 * math.pi / omega
    amplitude = run.point.level_g * GRAVITY_M_PER_S2
    motion = HarmonicMotion(amplitude, omega / (2 * math.pi), rise_s=RISE_CYCLES * period)
    tank = NumericalTank(setup)
    at_rest = seen_in(tank)
    forces, looks = [], []
    for block in moved(tank, motion, run.n_cycles * period, block_s=period / LOOKS_PER_CYCLE):
        forces.append(block.forces.vertical_n)
        if tank.time_s > WAITING_CYCLES * period:
            looks.append(seen_in(tank))
    dynamic = np.concatenate(forces) + setup.liquid_mass_kg * setup.gravity_m_per_s2
    w_bar, beta = cycles_of(dynamic, setup.step_s, omega, amplitude, setup.liquid_mass_kg)
    unit_j = setup.liquid_mass_kg * (amplitude / omega) ** 2
    left_out = work_left_out(looks, at_rest, setup, omega, unit_j)
    return HarmonicCycles(w_bar[WAITING_CYCLES:], beta[WAITING_CYCLES:], left_out)


def cycles_of(
    force_n: FloatArray, step_s: float, omega_rad_per_s: float, amplitude_m_per_s2: float, mass_kg: float
) -> tuple[FloatArray, FloatArray]:
    """W̄ and β of every whole cycle of ü = a cos Ωt.

    Parameters
    ----------
    force_n : ndarray, shape (n_steps,)
        F_S of the liquid on the tank without its weight, upward, in the middles of the steps.
    step_s, omega_rad_per_s, amplitude_m_per_s2, mass_kg : float
        Of the steps, Ω, a and m_l.

    Returns
    -------
    w_bar, beta : ndarray, shape (n_cycles,)
    """
    phase = omega_rad_per_s * (np.arange(force_n.size) + 0.5) * step_s
    # the force of the frozen liquid does no work in a whole cycle
    dynamic = force_n + mass_kg * amplitude_m_per_s2 * np.cos(phase)
    edges = np.arange(force_n.size + 1) * step_s
    n_cycles = int(edges[-1] * omega_rad_per_s / (2 * math.pi) + 1e-6)
    boundaries = np.arange(n_cycles + 1) * 2 * math.pi / omega_rad_per_s

    def per_cycle(rate: FloatArray) -> FloatArray:
        sums = np.concatenate([[0.0], np.cumsum(rate) * step_s])
        return np.diff(np.interp(boundaries, edges, sums))

    speed = amplitude_m_per_s2 / omega_rad_per_s
    work = -per_cycle(dynamic * speed * np.sin(phase))
    in_phase = per_cycle(dynamic * np.cos(phase)) * omega_rad_per_s / math.pi
    return work / (mass_kg * speed**2), -in_phase / (mass_kg * amplitude_m_per_s2)
