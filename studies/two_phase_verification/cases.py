"""Flows of liquid and gas whose outcome is known from elsewhere, each computed and compared.

No case knows anything of the tank on the shaker.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from acquisition.numerical_tank.tank import Box, LiquidColumn
from acquisition.two_phase_tank.setup import Fluids, GridNumerics, TwoPhaseSetup, Walls, filled_two_phase_tank
from acquisition.two_phase_tank.simulation import TwoPhaseTank
from studies.numerical_tank_verification.verification_cases import Finding
from studies.two_phase_verification.linear_theory import Layers

FloatArray = NDArray[np.float64]

G_M_PER_S2: Final = 9.81
_STILL: Final = GridNumerics(disturbance=0.0)
_SLIPPERY: Final = Walls(hold=False)
THICK: Final = Fluids(viscosity_m2_per_s=1e-4)
"""A liquid a hundred times as viscous as water."""


def rest(cells_per_height: int, duration_s: float) -> list[Finding]:
    """Let the half-filled tank of the shaker stand: the force is the weight and nothing moves.

    Parameters
    ----------
    cells_per_height : int
    duration_s : float
    """
    tank = TwoPhaseTank(filled_two_phase_tank(Box(0.1172, 0.0272, 0.078), 0.5, cells_per_height))
    height, volume = tank.centre_height_m(), tank.liquid_volume_m2()
    n = round(duration_s / tank.setup.step_s)
    tank.advance(np.zeros(n // 2))
    forces = tank.advance(np.zeros(n - n // 2)).vertical_n
    weight = tank.setup.fluid_mass_kg * G_M_PER_S2
    speed = max(float(np.abs(velocity).max()) for velocity in tank.velocities())
    name = f"rest, {cells_per_height} cells, {duration_s:g} s"
    return [
        Finding(name, "mean force / weight", forces.mean() / weight, -1.0, 1e-4),
        Finding(name, "scatter of the force / weight", forces.std() / weight, 0.0, 1e-4),
        Finding(name, "height of the centre of mass / at start", tank.centre_height_m() / height, 1.0, 1e-3),
        Finding(name, "volume of the liquid / at start − 1", tank.liquid_volume_m2() / volume - 1, 0.0, 1e-6),
        Finding(name, "largest speed / √(g h)", speed / math.sqrt(G_M_PER_S2 * 0.0136), 0.0, 0.01),
    ]


def wave_frequency(fluids: Fluids, k: float, liquid_m: float, gas_m: float) -> float:
    """Frequency [rad/s] of a standing wave between liquid and gas: Lamb (1932), art. 231 and 267.

    ω² = ((ρ₁ − ρ₂) g k + σ k³)/(ρ₁ coth kh₁ + ρ₂ coth kh₂)

    Parameters
    ----------
    fluids : Fluids
    k : float
        Wave number [1/m].
    liquid_m, gas_m : float
        Depths.
    """
    stiffness = (fluids.density_kg_per_m3 - fluids.gas_density_kg_per_m3) * G_M_PER_S2 * k
    stiffness += fluids.surface_tension_n_per_m * k**3
    inertia = fluids.density_kg_per_m3 / math.tanh(k * liquid_m)
    inertia += fluids.gas_density_kg_per_m3 / math.tanh(k * gas_m)
    return math.sqrt(stiffness / inertia)


def wave_tank(
    cells_per_height: int, mode: int, fluids: Fluids, start: float, level: float = 0.5
) -> tuple[TwoPhaseTank, float]:
    """Return a box of 100 mm × 100 mm with slippery walls, its surface deformed, and the wave number.

    Parameters
    ----------
    cells_per_height : int
    mode : int
        Half waves over the length.
    fluids : Fluids
    start : float
        k times the amplitude.
    level : float
        Of the liquid.
    """
    setup = filled_two_phase_tank(
        Box(0.1, 0.1), level, cells_per_height, fluids=fluids, walls=_SLIPPERY, numerics=_STILL
    )
    tank, k, n = TwoPhaseTank(setup), mode * math.pi / 0.1, setup.n_along
    # means of cos kx over the cells
    edges = np.sin(k * np.arange(n + 1) * setup.cell_m[0]) / k
    height = level * setup.n_up + start / k * np.diff(edges) / setup.cell_m[0] / setup.cell_m[1]
    tank.set_fractions(np.clip(height[:, None] - np.arange(setup.n_up), 0.0, 1.0))
    return tank, k


def amplitude(tank: TwoPhaseTank, k: float) -> float:
    """Amplitude [m] of cos kx in the surface.

    Parameters
    ----------
    tank : TwoPhaseTank
    k : float
    """
    dx, dz = tank.setup.cell_m
    x = (np.arange(tank.setup.n_along) + 0.5) * dx
    return float(2 * (tank.liquid_fraction.sum(axis=1) * dz * np.cos(k * x)).mean())


def history(tank: TwoPhaseTank, k: float, duration_s: float, acceleration: FloatArray | float = 0.0) -> FloatArray:
    """Return times [s] and amplitudes [m] after every step.

    Parameters
    ----------
    tank : TwoPhaseTank
    k : float
    duration_s : float
    acceleration : ndarray or float
        Of the tank, in every step.
    """
    n = round(duration_s / tank.setup.step_s)
    motion = np.broadcast_to(np.asarray(acceleration, float), (n,))
    rows = [(tank.time_s, amplitude(tank, k))]
    for value in motion:
        tank.advance([value])
        rows.append((tank.time_s, amplitude(tank, k)))
    return np.array(rows).T


def damped_cosine(course: FloatArray, omega: float, decay: float) -> tuple[float, float]:
    """Fit a e^{−γt} cos(ωt + φ); return ω [rad/s] and γ [1/s].

    Parameters
    ----------
    course : ndarray, shape (2, n)
        Times [s] and values.
    omega, decay : float
        Where the fit begins.
    """
    times_s, values = course

    def misfit(p: FloatArray) -> FloatArray:
        return np.asarray(p[0] * np.exp(-p[1] * times_s) * np.cos(p[2] * times_s + p[3]) - values)

    scale = np.abs(values).max()
    best = least_squares(misfit, [scale, decay, omega, 0.0], x_scale=[scale, omega, omega, 1.0])
    return float(best.x[2]), float(best.x[1])


def standing_wave(cells_per_height: int, mode: int = 1, n_periods: float = 6.0) -> list[Finding]:
    """Compare a small standing wave of a thick liquid with theory: two viscous layers, walls that slip.

    Parameters
    ----------
    cells_per_height : int
    mode : int
        Half waves over the length.
    n_periods : float
    """
    tank, k = wave_tank(cells_per_height, mode, THICK, 0.02)
    omega, viscous = Layers(THICK, k, 0.05, 0.05, G_M_PER_S2).free_wave()
    measured, decay = damped_cosine(history(tank, k, n_periods * 2 * math.pi / omega), omega, viscous)
    name = f"standing wave, mode {mode}, {cells_per_height} cells"
    return [
        Finding(name, "ω / theory", measured / omega, 1.0, 0.005),
        Finding(name, "decay rate / theory", decay / viscous, 1.0, 0.05),
        Finding(name, "energy residual", tank.account().residual_share, 0.0, 0.02),
    ]


def drop(cells_per_height: int, n_periods: float = 2.0) -> list[Finding]:
    """Let a cylinder of water oscillate without gravity: ω² = n (n² − 1) σ/((ρ₁ + ρ₂) R³), n = 2 (Lamb 1932).

    Parameters
    ----------
    cells_per_height : int
        Five of them are four radii.
    n_periods : float
    """
    fluids, radius = Fluids(viscosity_m2_per_s=1e-6), 0.01
    setup = TwoPhaseSetup(
        Box(0.04, 0.04),
        LiquidColumn(0.02, 0.02),
        cells_per_height,
        fluids,
        _SLIPPERY,
        _STILL,
        gravity_m_per_s2=0.0,
    )
    tank, n = TwoPhaseTank(setup), cells_per_height
    fine = (np.arange(10 * n) + 0.5) / (10 * n) * 0.04 - 0.02
    x, z = np.meshgrid(fine, fine, indexing="ij")
    angle = np.arctan2(z, x)
    inside = np.hypot(x, z) < radius * (1 + 0.03 * np.cos(2 * angle))
    tank.set_fractions(inside.reshape(n, 10, n, 10).mean(axis=(1, 3)))
    total = fluids.density_kg_per_m3 + fluids.gas_density_kg_per_m3
    omega = math.sqrt(6 * fluids.surface_tension_n_per_m / (total * radius**3))
    coarse = (np.arange(n) + 0.5) / n * 0.04 - 0.02
    weights = coarse[:, None] ** 2 - coarse[None, :] ** 2
    rows = [(0.0, float((tank.liquid_fraction * weights).sum()))]
    while tank.time_s < n_periods * 2 * math.pi / omega:
        tank.advance(np.zeros(2))
        rows.append((tank.time_s, float((tank.liquid_fraction * weights).sum())))
    measured, _ = damped_cosine(np.array(rows).T, omega, 0.02 * omega)
    name = f"drop, {cells_per_height / 4:g} cells per radius"
    return [Finding(name, "ω / √(6σ/((ρ₁ + ρ₂)R³))", measured / omega, 1.0, 0.02)]


def stuck_drop(cells_per_height: int) -> list[Finding]:
    """Pull a drop along the floor: its line holds as long as Δρ A a < σ (cos θ_r − cos θ_a) (Furmidge 1962).

    In the plane that is the balance of forces on the drop; the angles are 60° and 100°. Beyond, what is left
    accelerates it, and two pulls tell where that begins.

    Parameters
    ----------
    cells_per_height : int
        Of the box of 12.5 mm; the drop is a half circle of 5 mm at the start.
    """
    held, *sliding = (_drop_pulled(cells_per_height, share) for share in (0.8, 1.25, 1.5))
    slope = (sliding[1][1] - sliding[0][1]) / 0.25
    name = f"drop that sticks, {0.4 * cells_per_height:g} cells per radius"
    unit_m_per_s = math.sqrt(Fluids().surface_tension_n_per_m / (Fluids().density_kg_per_m3 * 0.005))
    return [
        Finding(name, "pulled by 0.8: speed / √(σ/(ρR))", held[0] / unit_m_per_s, 0.0, 0.01),
        Finding(name, "threshold Δρ A a / (σ (cos θ_r − cos θ_a))", 1.25 - sliding[0][1] / slope, 1.0, 0.05),
        Finding(name, "acceleration / what the line leaves", slope, 1.0, 0.05),
    ]


def _drop_pulled(cells_per_height: int, share: float) -> tuple[float, float]:
    """Speed [m/s] at the end, and acceleration over that which the line holds, of a drop pulled to the right."""
    box, radius_m, rise_s, held_s = Box(0.08, 0.0125), 0.005, 0.2, 0.25
    fluids = Fluids(viscosity_m2_per_s=1e-5)
    walls = Walls(hold=False, advancing_angle_deg=100.0, receding_angle_deg=60.0, line_sticks=True)
    setup = TwoPhaseSetup(
        box, LiquidColumn(0.01, 0.005), cells_per_height, fluids, walls, _STILL, gravity_m_per_s2=0.0
    )
    tank, (nx, nz) = TwoPhaseTank(setup), (setup.n_along, setup.n_up)
    x = (np.arange(10 * nx) + 0.5) / (10 * nx) * box.length_m - 0.025
    z = (np.arange(10 * nz) + 0.5) / (10 * nz) * box.height_m
    inside = np.hypot(x[:, None], z[None, :]) < radius_m
    tank.set_fractions(inside.reshape(nx, 10, nz, 10).mean(axis=(1, 3)))
    lighter = fluids.density_kg_per_m3 - fluids.gas_density_kg_per_m3
    angles = math.cos(math.radians(60.0)) - math.cos(math.radians(100.0))
    holds = fluids.surface_tension_n_per_m * angles / (lighter * tank.liquid_volume_m2())
    times_s = tank.times_s(round((rise_s + held_s) / setup.step_s))
    places = []
    for pull in share * holds * np.minimum(times_s / rise_s, 1.0):
        tank.advance([[-pull, 0.0]])
        places.append(float((tank.liquid_fraction.sum(axis=1) * (np.arange(nx) + 0.5)).sum()))
    course_m = np.array(places) / tank.liquid_fraction.sum() * setup.cell_m[0]
    used = times_s > rise_s + 0.1 * held_s
    fit = np.polyfit(times_s[used] - times_s[-1], course_m[used], 2)
    return float(fit[1]), float(2 * fit[0] / holds)


def dam_break(cells_per_height: int) -> list[Finding]:
    """Let a column collapse; its front reaches the wall at t √(g/H) ≈ 2.4 (Lobovský et al. 2014).

    Parameters
    ----------
    cells_per_height : int
        Of the box, which is twice as high as the column.
    """
    height = 0.3
    setup = TwoPhaseSetup(
        Box(5.366 * height, 2 * height), LiquidColumn(2 * height, height), cells_per_height, numerics=_STILL
    )
    tank, unit = TwoPhaseTank(setup), math.sqrt(height / G_M_PER_S2)
    # water has arrived when the lowest cell at the wall is half full
    while tank.liquid_fraction[-1, 0] < 0.5 and tank.time_s < 4 * unit:
        tank.advance(np.zeros(max(round(0.01 * unit / setup.step_s), 1)))
    name = f"dam break, {cells_per_height // 2} cells per height"
    return [
        Finding(name, "arrival of the front at the wall, t √(g/H)", tank.time_s / unit, 2.4, 0.15),
        Finding(name, "energy residual", tank.account().residual_share, 0.0, 0.02),
    ]


def faraday_threshold(cells_per_height: int, mode: int = 2) -> list[Finding]:
    """Shake a thick liquid at twice the frequency of a wave: where does the wave neither grow nor decay?

    The theory is that of Kumar & Tuckerman (1994) for two viscous layers. The tank goes with sin Ωt: a wave that
    is highest at the start is then the one that grows, and nothing of the one that decays is in it.

    Parameters
    ----------
    cells_per_height : int
    mode : int
        Half waves over the length.
    """
    k = mode * math.pi / 0.1
    omega0 = wave_frequency(THICK, k, 0.05, 0.05)
    rate = 2 * omega0
    expected = Layers(THICK, k, 0.05, 0.05, G_M_PER_S2).subharmonic_threshold(rate)
    measured = []
    levels = (0.6 * expected, 1.4 * expected)
    for level in levels:
        tank, _ = wave_tank(cells_per_height, mode, THICK, 0.01)
        n_periods = 8
        n = round(n_periods * 2 * math.pi / omega0 / tank.setup.step_s)
        times, values = history(tank, k, n * tank.setup.step_s, level * np.sin(rate * tank.times_s(n)))
        # amplitude of the part that goes with half of the frequency, in each period but the first two
        peaks = []
        for j in range(2, n_periods):
            used = (times >= j * 2 * math.pi / omega0) & (times < (j + 1) * 2 * math.pi / omega0)
            peaks.append(abs(np.mean(values[used] * np.exp(1j * omega0 * times[used]))))
        middles = np.arange(2, n_periods) * 2 * math.pi / omega0
        measured.append(float(np.polyfit(middles, np.log(peaks), 1)[0]))
    slope = (measured[1] - measured[0]) / (levels[1] - levels[0])
    name = f"Faraday waves, mode {mode}, {cells_per_height} cells"
    return [
        Finding(
            name, "threshold of the acceleration / theory", (levels[0] - measured[0] / slope) / expected, 1.0, 0.1
        )
    ]
