"""Flows whose outcome is known from elsewhere, each computed and compared.

Every case returns findings: what was measured, what theory or a publication says, and how far apart
they may be. No case knows anything of the tank on the shaker; the numerical parameters were decided here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from acquisition.numerical_tank.forced_motion import HarmonicMotion, moved
from acquisition.numerical_tank.liquid_state import LiquidState
from acquisition.numerical_tank.simulation import NumericalTank
from acquisition.numerical_tank.tank import Box, Liquid, LiquidColumn, Numerics, TankSetup, filled_tank

FloatArray = NDArray[np.float64]

G_M_PER_S2: Final = 9.81
MARTIN_MOYCE_SQUARE: Final = (
    (0.41, 1.11), (0.84, 1.22), (1.19, 1.44), (1.43, 1.67), (1.63, 1.89), (1.83, 2.11), (1.98, 2.33), (2.20, 2.56),
    (2.32, 2.78), (2.51, 3.00), (2.65, 3.22), (2.83, 3.44), (2.98, 3.67), (3.11, 3.89), (3.33, 4.11),
)  # fmt: skip
"""T = t √(g/a) and Z = x/a of the front of a square column, a = 57.15 mm; Martin & Moyce (1952), Table 2."""


THICK: Final = Liquid(speed_of_sound_m_per_s=10.0, viscosity_m2_per_s=1e-4)
"""A liquid a hundred times as viscous as water."""


@dataclass(frozen=True)
class Finding:
    """One comparison.

    Attributes
    ----------
    case, quantity : str
        What was computed and what is compared.
    measured, expected : float
        In the same unit.
    tolerance : float
        Largest allowed |measured − expected|; infinite where the comparison only informs.
    """

    case: str
    quantity: str
    measured: float
    expected: float
    tolerance: float

    @property
    def met(self) -> bool:
        """Whether the difference is within the tolerance."""
        return bool(abs(self.measured - self.expected) <= self.tolerance)


def hydrostatic_rest(n_layers: int, duration_s: float, numerics: Numerics | None = None) -> list[Finding]:
    """Let a half-filled tank stand: the force is the weight, the pressure ρ g d, and nothing moves.

    Parameters
    ----------
    n_layers : int
        Layers of particles in the liquid.
    duration_s : float
    numerics : Numerics, optional
    """
    tank = NumericalTank(filled_tank(Box(0.1172, 0.0272), 0.5, 2 * n_layers, numerics=numerics))
    height = tank.state().z_m.mean()
    n = round(duration_s / tank.setup.step_s)
    tank.advance(np.zeros(n // 2))
    forces = tank.advance(np.zeros(n - n // 2)).vertical_n
    state, weight = tank.state(), tank.setup.liquid_mass_kg * G_M_PER_S2
    depth = tank.setup.column.height_m - state.z_m
    slope = np.polyfit(depth, state.pressure_pa, 1)[0] / (tank.setup.liquid.density_kg_per_m3 * G_M_PER_S2)
    name = f"rest, {n_layers} layers, {duration_s:g} s"
    speed = np.hypot(state.vx_m_per_s, state.vz_m_per_s).max()
    return [
        Finding(name, "mean force / weight", forces.mean() / weight, -1.0, 0.002),
        Finding(name, "scatter of the force / weight", forces.std() / weight, 0.0, 0.005),
        Finding(name, "pressure gradient / ρ g", float(slope), 1.0, 0.03),
        Finding(name, "height of the centre of mass / at start", state.z_m.mean() / height, 1.0, 0.01),
        Finding(name, "largest speed / √(g h)", speed / math.sqrt(G_M_PER_S2 * 0.0136), 0.0, 0.02),
    ]


def _wave_tank(
    n_layers: int, mode: int, numerics: Numerics | None, liquid: Liquid | None, seed: int = 0
) -> NumericalTank:
    """A square-ish liquid, twice as long as deep: 100 mm × 50 mm, kh = mode·π/2."""
    box = Box(0.1, 0.1)
    liquid = liquid or Liquid(speed_of_sound_m_per_s=10.0)
    return NumericalTank(filled_tank(box, 0.5, 2 * n_layers, liquid=liquid, numerics=numerics, seed=seed))


def _mode_shape(state: LiquidState, k: float, depth_m: float) -> tuple[FloatArray, FloatArray]:
    """Velocity of the potential flow of a standing wave, 1 at the surface."""
    x, z = state.x_m, np.minimum(state.z_m, 1.2 * depth_m)
    scale = np.sinh(k * depth_m)
    return -np.sin(k * x) * np.cosh(k * z) / scale, np.cos(k * x) * np.sinh(k * z) / scale


def _modal_velocity(state: LiquidState, k: float, depth_m: float) -> float:
    ux, uz = _mode_shape(state, k, depth_m)
    return float((state.vx_m_per_s * ux + state.vz_m_per_s * uz).sum() / (ux**2 + uz**2).sum())


def modal_history(
    tank: NumericalTank, mode: int, start_m_per_s: float, tank_acceleration_m_per_s2: float, times_s: FloatArray
) -> FloatArray:
    """Start a standing wave with a velocity and follow its modal velocity.

    Parameters
    ----------
    tank : NumericalTank
        Full over its length, at rest.
    mode : int
        Half waves over the length.
    start_m_per_s : float
        Modal velocity at the start: vertical velocity at the surface.
    tank_acceleration_m_per_s2 : float
        Constant vertical acceleration of the tank.
    times_s : ndarray
        When to look.

    Returns
    -------
    ndarray
        Modal velocity [m/s] at the steps nearest to the times.
    """
    k = mode * math.pi / tank.setup.box.length_m
    depth = tank.setup.column.height_m
    ux, uz = _mode_shape(tank.state(), k, depth)
    tank.set_velocity(start_m_per_s * ux, start_m_per_s * uz)
    history = []
    for time in times_s:
        n = max(round((time - tank.time_s) / tank.setup.step_s), 0)
        tank.advance(np.full(n, tank_acceleration_m_per_s2))
        history.append(_modal_velocity(tank.state(), k, depth))
    return np.array(history)


def _damped_cosine(times_s: FloatArray, values: FloatArray, omega: float) -> tuple[float, float]:
    """Fit a e^{−γt} cos(ωt + φ); return ω [rad/s] and γ [1/s]."""

    def misfit(p: FloatArray) -> FloatArray:
        return np.asarray(p[0] * np.exp(-p[1] * times_s) * np.cos(p[2] * times_s + p[3]) - values)

    scale = np.abs(values).max()
    best = least_squares(misfit, [scale, 0.02 * omega, omega, 0.0], x_scale=[scale, omega, omega, 1.0])
    return float(best.x[2]), float(best.x[1])


def standing_wave(
    n_layers: int,
    mode: int = 1,
    n_periods: float = 6.0,
    numerics: Numerics | None = None,
    liquid: Liquid | None = None,
) -> list[Finding]:
    """Compare a small standing wave with ω² = g k tanh kh and the decay 2νk² of a slipping tank.

    The liquid is a hundred times as viscous as water, so that its viscosity and not the numerics make the decay.

    Parameters
    ----------
    n_layers : int
        Layers of particles in the liquid, half as many as columns.
    mode : int
        Half waves over the length.
    n_periods : float
    numerics : Numerics, optional
    liquid : Liquid, optional
    """
    tank = _wave_tank(n_layers, mode, numerics, liquid or THICK)
    k, depth = mode * math.pi / 0.1, 0.05
    omega = math.sqrt(G_M_PER_S2 * k * math.tanh(k * depth))
    start = 0.02 * omega / k
    times = np.arange(0, n_periods * 2 * math.pi / omega, 2 * math.pi / omega / 24)
    history = modal_history(tank, mode, start, 0.0, times)
    measured, decay = _damped_cosine(times, history, omega)
    viscous = 2 * tank.setup.effective_viscosity_m2_per_s * k**2
    account = tank.account()
    name = f"standing wave, mode {mode}, {n_layers} layers"
    return [
        Finding(name, "ω / √(g k tanh kh)", measured / omega, 1.0, 0.02),
        Finding(name, "decay rate / ω", decay / omega, viscous / omega, 0.1 * viscous / omega),
        Finding(name, "energy residual / energy", account.residual_share, 0.0, 0.02),
    ]


def numerical_damping(n_layers: int, numerics: Numerics | None = None) -> list[Finding]:
    """Let a standing wave of water decay: what is more than 2νk² is made by the numerics.

    Parameters
    ----------
    n_layers : int
        Layers of particles in the liquid.
    numerics : Numerics, optional
    """
    water = Liquid(speed_of_sound_m_per_s=10.0)
    findings = standing_wave(n_layers, numerics=numerics, liquid=water)
    return [
        Finding(f"{finding.case}, water", finding.quantity, finding.measured, finding.expected, math.inf)
        for finding in findings
        if finding.quantity == "decay rate / ω"
    ]


def hanging_surface(n_layers: int, numerics: Numerics | None = None) -> list[Finding]:
    """Pull the tank down at 2 g: the liquid hangs on the floor and its surface grows as cosh √(g k tanh kh) t.

    The liquid can follow only if the floor can pull, as it does in reality, where the gas outside keeps
    the pressure far above that of vapour.

    Parameters
    ----------
    n_layers : int
        Layers of particles in the liquid.
    numerics : Numerics, optional
    """
    tank = _wave_tank(n_layers, 1, numerics, None)
    k, depth = math.pi / 0.1, 0.05
    rate = math.sqrt(G_M_PER_S2 * k * math.tanh(k * depth))
    times = np.linspace(0, 2.5 / rate, 26)
    history = modal_history(tank, 1, 0.004 * rate / k, -2 * G_M_PER_S2, times)

    def misfit(p: FloatArray) -> FloatArray:
        return np.asarray(np.log(np.abs(p[0]) * np.cosh(p[1] * times)) - np.log(np.maximum(history, 1e-9)))

    measured = float(least_squares(misfit, [history[0], rate]).x[1])
    state = tank.state()
    lowest = np.sort(state.z_m)[: tank.setup.n_columns].mean() / (depth / n_layers)
    name = f"hanging surface, {n_layers} layers"
    return [
        Finding(name, "growth rate / √(g k tanh kh)", measured / rate, 1.0, 0.05),
        Finding(name, "lowest layer above the floor / spacing", float(lowest), 0.5, 0.25),
    ]


def dam_break(n_layers: int, numerics: Numerics | None = None) -> list[Finding]:
    """Let columns collapse and compare their fronts with experiments.

    The column of Buchner and of Lobovský (twice as long as high, wall at 5.366 heights) reaches the wall
    at t √(g/H) ≈ 2.4. The square column of Martin & Moyce is 57 mm small and known to be slower than all
    inviscid computations; it is here for information.

    Parameters
    ----------
    n_layers : int
        Layers of particles in the column.
    numerics : Numerics, optional
    """
    name = f"dam break, {n_layers} layers"
    large = _column(0.3, 0.6, 5.366 * 0.3, n_layers, numerics)
    arrival = _arrival_time(large)
    square = _column(0.05715, 0.05715, 5 * 0.05715, n_layers, numerics)
    speed = _front_speed(square)
    published_t, published_z = np.array(MARTIN_MOYCE_SQUARE).T
    inner = (published_z >= 1.44) & (published_z <= 3.9)
    published_speed = np.polyfit(published_t[inner], published_z[inner], 1)[0]
    return [
        Finding(name, "arrival of the front at the wall, t √(g/H) (Lobovský 2014)", arrival, 2.4, 0.15),
        Finding(name, "front speed / √(g a) (Martin & Moyce 1952)", speed, float(published_speed), math.inf),
        Finding(name, "energy residual", large.account().residual_share, 0.0, 0.02),
    ]


def _column(
    height_m: float, length_m: float, box_m: float, n_layers: int, numerics: Numerics | None
) -> NumericalTank:
    """A column of liquid in a long box; sound ten times as fast as the liquid will be."""
    liquid = Liquid(speed_of_sound_m_per_s=20 * math.sqrt(G_M_PER_S2 * height_m))
    column = LiquidColumn(length_m, height_m)
    return NumericalTank(
        TankSetup(Box(box_m, 2 * height_m), column, height_m / n_layers, liquid, numerics or Numerics())
    )


def _front(tank: NumericalTank) -> float:
    """Where the liquid ends on the floor, over the height of the column."""
    spacing = math.sqrt(tank.setup.particle_volume_m2)
    return float((tank.state().x_m.max() + spacing / 2) / tank.setup.column.height_m)


def _arrival_time(tank: NumericalTank) -> float:
    """When the front reaches the wall, t √(g/H)."""
    unit = math.sqrt(tank.setup.column.height_m / G_M_PER_S2)
    wall = tank.setup.box.length_m / tank.setup.column.height_m
    while _front(tank) < wall - 0.02 and tank.time_s < 4 * unit:
        tank.advance(np.zeros(max(round(0.01 * unit / tank.setup.step_s), 1)))
    return tank.time_s / unit


def _front_speed(tank: NumericalTank) -> float:
    """Speed of the front over √(g a) while it is between 1.44 and 3.9 heights."""
    unit = math.sqrt(tank.setup.column.height_m / G_M_PER_S2)
    times, fronts = [0.0], [1.0]
    while fronts[-1] < 3.9 and times[-1] < 5:
        tank.advance(np.zeros(max(round(0.05 * unit / tank.setup.step_s), 1)))
        times.append(tank.time_s / unit)
        fronts.append(_front(tank))
    used = np.array(fronts) >= 1.44
    return float(np.polyfit(np.array(times)[used], np.array(fronts)[used], 1)[0])


def shaken_volume(
    acceleration_g: float,
    duration_s: float,
    layers_per_height: int = 16,
    numerics: Numerics | None = None,
    seed: int = 0,
) -> list[Finding]:
    """Shake a half-filled tank at 11.4 Hz, let it settle, and see whether all the liquid is still there.

    Parameters
    ----------
    acceleration_g : float
    duration_s : float
    layers_per_height : int
    numerics : Numerics, optional
    seed : int
    """
    box = Box(0.1172, 0.0272, 0.078)
    tank = NumericalTank(filled_tank(box, 0.5, layers_per_height, numerics=numerics, seed=seed))
    height = tank.state().z_m.mean()
    motion = HarmonicMotion(acceleration_g * G_M_PER_S2, 11.4, rise_s=0.25)
    momentum_start = tank.vertical_momentum_kg_m_per_s()
    impulse, time = 0.0, 0.0
    for block in moved(tank, motion, round(duration_s * 11.4) / 11.4, block_s=1.0):
        mass = tank.setup.liquid_mass_kg
        impulse += float(
            (-block.forces.vertical_n - mass * (G_M_PER_S2 + block.acceleration_m_per_s2)).sum()
            * tank.setup.step_s
        )
        time += block.time_s.size * tank.setup.step_s
    imbalance = tank.vertical_momentum_kg_m_per_s() - momentum_start - impulse
    weight = tank.setup.liquid_mass_kg * G_M_PER_S2
    account = tank.account()
    tank.advance(np.zeros(round(3.0 / tank.setup.step_s)))
    z, x = tank.state().z_m, tank.state().x_m
    inside = (z >= 0) & (z <= box.height_m) & (x >= 0) & (x <= box.length_m)
    name = f"shaken, {acceleration_g:g} g, {duration_s:g} s, h/{layers_per_height}"
    return [
        Finding(name, "settled height of the centre of mass / at start", float(z.mean() / height), 1.0, 0.02),
        Finding(name, "particles outside", float((~inside).sum()), 0.0, 0.0),
        Finding(name, "(wall force − momentum balance) / weight", imbalance / time / weight, 0.0, 1e-6),
        Finding(name, "energy residual", account.residual_share, 0.0, 0.05 if acceleration_g > 2 else 0.02),
    ]
