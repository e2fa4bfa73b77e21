"""Works in a cycle against time integrals, growth of roots (V12) and simulations (V13)."""

from __future__ import annotations

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
import xarray as xr
from small_wings import small_wing

from sloshlab.aeroelastic.energy import energy_of_mode, work_of_dampers, work_of_forces
from sloshlab.aircraft.beam_wing import wing_model
from sloshlab.aircraft.limit_cycle import Settling, followed, settle
from sloshlab.aircraft.linear_flight import LinearFlight, linear_flight
from sloshlab.aircraft.model import AircraftModel
from sloshlab.aircraft.oscillation_measures import damping_between_peaks, limit_cycle_of
from sloshlab.aircraft.wing_energy import CriticalMode, EnergyMap, TankWork

RANDOM = np.random.default_rng(5)


def complex_matrix(n: int) -> np.ndarray:
    return RANDOM.normal(size=(n, n)) + 1j * RANDOM.normal(size=(n, n))


def test_work_is_the_time_integral_of_force_times_velocity() -> None:
    n, omega, amplitude = 3, 7.0, 0.2
    shape, forces = complex_matrix(n)[0], complex_matrix(n)
    time = np.linspace(0.0, 2 * pi / omega, 20001)
    turn = np.exp(1j * omega * time)[:, None]
    velocity = np.real(1j * omega * amplitude * shape * turn)
    force = np.real(amplitude * (forces @ shape) * turn)
    integral = np.trapezoid((force * velocity).sum(axis=1), time)
    assert amplitude**2 * work_of_forces(shape, forces) == pytest.approx(integral, rel=1e-7)
    damping = RANDOM.normal(size=(n, n))
    taken = -np.trapezoid((velocity * (velocity @ (damping + damping.T))).sum(axis=1), time)
    assert amplitude**2 * work_of_dampers(shape, damping + damping.T, omega) == pytest.approx(taken, rel=1e-7)


def test_growth_is_the_work_over_twice_the_energy_near_neutral() -> None:
    """V12: 2σ times the energy of the mode per cycle = L_aero + L_damp, root and works by different routes."""
    mass, damping = np.diag([2.0, 3.0]), np.diag([0.3, 0.2])
    stiffness = np.array([[200.0, -5.0], [-5.0, 330.0]])

    def forces(omega: float) -> np.ndarray:
        # lagging forces of a two-mode flutter, a function of the frequency
        lag = 1j * omega / (1j * omega + 15.0)
        return np.array([[8.0 - 2.0 * lag, 62.0 + 3 * lag], [-24.0 * lag, 90.0 - 5.0 * lag]])

    s = 0.0 + 10j
    for _ in range(200):
        matrix = np.block([
            [np.zeros((2, 2)), np.eye(2)],
            [-np.linalg.solve(mass, stiffness - forces(s.imag)), -np.linalg.solve(mass, damping)],
        ])  # fmt: skip
        values, vectors = np.linalg.eig(matrix)
        place = int(np.argmin(np.abs(values - s)))
        s, shape = complex(values[place]), vectors[:2, place]
    work = work_of_forces(shape, forces(s.imag)) + work_of_dampers(shape, damping, s.imag)
    assert abs(s.real) < 0.05 * s.imag
    assert abs(s.real) > 1e-3
    gained = 2 * s.real * energy_of_mode(shape, mass, s.imag) * 2 * pi / s.imag
    assert work == pytest.approx(gained, rel=0.02)


def law(omega_bar: np.ndarray, u_bar: np.ndarray) -> np.ndarray:
    """W̄ that rises from a threshold, has a largest value and falls."""
    level = u_bar * omega_bar**2
    return 1.2 * np.exp(-(((np.log(np.maximum(level, 1e-9) / 2.5)) / 0.7) ** 2))


def map_of_law() -> xr.DataArray:
    omega_bar, u_bar = np.linspace(1.6, 6.6, 101), np.linspace(0.004, 0.6, 300)
    values = law(omega_bar[:, None], u_bar[None, :])
    return xr.DataArray(values, {"omega_bar": omega_bar, "u_bar": u_bar}, ("omega_bar", "u_bar"))


def test_the_liquid_takes_what_the_map_says_and_nothing_is_made_up_beyond_it() -> None:
    model, w_bar = wing_model(small_wing()), map_of_law()
    measured = w_bar.where((w_bar.u_bar > 0.05) & (w_bar.u_bar < 0.4))
    omega = 4.0 * sqrt(9.81 / 0.3)
    tank = model.tanks[0]
    shape = np.array([1.0, 0.2j, 0.0, 0.0])
    amplitude = np.array([0.1 / abs(tank.motion[2] @ shape) * 0.3])
    work, is_below = TankWork(model, measured).of_tanks(omega, shape, amplitude)
    expected = -tank.box.liquid_mass_kg * (omega * 0.03) ** 2 * law(np.array(4.0), np.array(0.1))
    assert work[0, 0] == pytest.approx(float(expected), rel=1e-3)
    assert not is_below[0, 0]
    assert np.isnan(TankWork(model, measured).of_motion(omega, shape, 10 * amplitude)).all()
    assert np.isnan(TankWork(model, measured).of_motion(omega, shape, 0.01 * amplitude)).all()
    assert np.isnan(TankWork(model, measured).of_motion(20 * omega, shape, amplitude)).all()


class QuasiSteadyDamper:
    """−c(a) u̇ with c of the map at the amplitude a of the last two cycles: no memory else."""

    def __init__(self, mass_kg: float, height_m: float, omega_rad_per_s: float) -> None:
        self.sampling_rate_hz = 30 * omega_rad_per_s / (2 * pi)
        self._mass, self._height, self._omega = mass_kg, height_m, omega_rad_per_s
        self.begin()

    def begin(self) -> None:
        self._past = np.zeros(60)
        self._force = 0.0

    def step(self, velocity_m_per_s: float) -> np.ndarray:
        self._past = np.append(self._past[1:], velocity_m_per_s)
        amplitude = sqrt(2) * self._past.std() / self._omega
        omega_bar = self._omega / sqrt(9.81 / self._height)
        w_bar = float(law(np.array(omega_bar), np.array(amplitude / self._height)))
        damping = self._mass * self._omega * w_bar / pi
        # velocity now, and at the next instant by its course so far
        ahead = 3 * self._past[-1] - 3 * self._past[-2] + self._past[-3]
        now, then = -damping * velocity_m_per_s, -damping * ahead
        return np.array([now, then - now, 0.0, 0.0])

    @property
    def runs_away(self) -> bool:
        return False


def growing_wing(ratio: float) -> LinearFlight:
    """A wing in vacuum whose first mode grows with a damping ratio below zero, which stands for the air."""
    model = wing_model(small_wing(wing={"n_modes": 2, "root_bending_stiffness_n_m2": 2e7}))
    ratios = np.array([ratio, 0.05])
    flight = linear_flight(AircraftModel(model.name, model.structure, model.tanks, ratios), "frozen")
    # a wind that pushes the first mode, to begin with
    of_wind = flight.of_wind.copy()
    of_wind[2, 0] = 50.0
    return replace(flight, of_wind=of_wind)


def balanced_amplitude(flight: LinearFlight, ratio: float) -> list[tuple[float, bool]]:
    """Amplitudes of the tip at which the works add up to zero."""
    model = flight.model
    mass = model.frozen_mass_matrix
    squares, vectors = np.linalg.eig(np.linalg.solve(mass, model.structure.stiffness_matrix))
    first = int(np.argmin(squares))
    omega, tip = sqrt(float(squares[first])), model.structure.motion_at(model.structure.nodes[-1])[2]
    shape = vectors[:, first] / (tip @ vectors[:, first])
    amplitude = np.linspace(1e-3, 0.6, 1200)
    growth = model.damping_matrix.copy()
    growth[0, 0], growth[1, 1] = model.damping_matrix[0, 0], 0.0
    aero = amplitude**2 * work_of_dampers(shape.astype(complex), growth, omega)
    rest = np.diag([0.0, model.damping_matrix[1, 1]])
    damping = amplitude**2 * work_of_dampers(shape.astype(complex), rest, omega)
    slosh = TankWork(model, map_of_law()).of_motion(omega, shape.astype(complex), amplitude)
    mode = CriticalMode(np.array([1.0]), np.array([1j * omega]), shape[None].astype(complex))
    works = EnergyMap(mode, amplitude, aero[None], damping[None], slosh[None])
    return [(a, is_stable) for _, a, is_stable in works.limit_cycles()]


@pytest.fixture(scope="module")
def simulated() -> dict[str, object]:
    ratio = -0.01
    flight = growing_wing(ratio)
    omega = float(np.abs(np.linalg.eigvals(flight.matrix)).min())
    node = flight.model.structure.nodes[-1]
    row = flight.displacement_at(node)

    def ended(share: float) -> object:
        tanks = {
            tank.name: QuasiSteadyDamper(tank.box.liquid_mass_kg, tank.box.height_m, omega)
            for tank in flight.model.tanks
        }
        start = np.zeros(flight.n_states)
        start[0] = share / row[0]
        settling = Settling(stretch_s=14.0, longest_s=42.0, output_step_s=0.02)
        return settle(flight, tanks, node, settling, state=start).point

    return {"flight": flight, "ratio": ratio, "ended": ended, "omega": omega}


def test_the_energy_balance_is_where_simulations_end(simulated: dict[str, object]) -> None:
    """V13: 5 %, away from a fold."""
    cycles = balanced_amplitude(simulated["flight"], simulated["ratio"])  # type: ignore[arg-type]
    stable = [a for a, is_stable in cycles if is_stable]
    point = simulated["ended"](0.1)  # type: ignore[operator]
    assert len(stable) == 1
    assert point.cycle.is_converged
    assert point.cycle.amplitude == pytest.approx(stable[0], rel=0.05)


def test_beyond_the_unstable_balance_motion_grows(simulated: dict[str, object]) -> None:
    cycles = balanced_amplitude(simulated["flight"], simulated["ratio"])  # type: ignore[arg-type]
    (unstable,) = [a for a, is_stable in cycles if not is_stable]
    point = simulated["ended"](1.25 * unstable)  # type: ignore[operator]
    assert point.cycle.amplitude > 1.5 * unstable
    assert simulated["ended"](0.75 * unstable).cycle.amplitude < unstable  # type: ignore[operator]


def test_continuation_finds_onset_and_keeps_the_limit_cycle() -> None:
    ratios = {1.0: 0.01, 2.0: -0.005, 3.0: -0.01}
    flights = {speed: growing_wing(ratio) for speed, ratio in ratios.items()}
    omega = float(np.abs(np.linalg.eigvals(flights[2.0].matrix)).min())
    node = flights[2.0].model.structure.nodes[-1]
    tanks = {
        tank.name: QuasiSteadyDamper(tank.box.liquid_mass_kg, tank.box.height_m, omega)
        for tank in flights[2.0].model.tanks
    }
    settling = Settling(stretch_s=14.0, longest_s=56.0, vanished_m=1e-3, output_step_s=0.02)
    down, state = followed(
        lambda speed: flights[speed], tanks, node, [3.0, 2.0, 1.0], settling,
        first_gust=lambda time: np.where(time < 0.1, 4.0, 0.0),
    )  # fmt: skip
    assert [point.is_alive for point in down] == [True, True, False]
    assert state is None
    assert down[0].cycle.is_converged
    assert down[0].cycle.amplitude > down[1].cycle.amplitude
    expected = [a for a, is_stable in balanced_amplitude(flights[2.0], ratios[2.0]) if is_stable]
    assert down[1].cycle.amplitude == pytest.approx(expected[0], rel=0.05)


def test_peaks_tell_damping_and_limit_cycle() -> None:
    time = np.arange(0.0, 10.0, 0.005)
    zeta, omega = 0.03, 20.0
    decay = np.exp(-zeta * omega * time) * np.cos(omega * sqrt(1 - zeta**2) * time)
    found = damping_between_peaks(time, decay)
    assert found.damping_ratio[:10] == pytest.approx(zeta, rel=2e-3)
    # grown from 0.01 to 0.05, which it keeps
    size = 0.05 / np.sqrt(1 + 24 * np.exp(-4.0 * time))
    cycle = limit_cycle_of(time, size * np.sin(omega * time))
    assert cycle.is_converged
    assert cycle.amplitude == pytest.approx(0.05, rel=1e-3)
    assert cycle.frequency_rad_per_s == pytest.approx(omega, rel=1e-3)
    assert not limit_cycle_of(time, decay).is_converged
    assert limit_cycle_of(time, decay).growth_per_s == pytest.approx(-zeta * omega, rel=0.01)
