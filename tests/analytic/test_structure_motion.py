"""A structure with a frozen liquid: free decay, friction, moved base and step in closed form."""

import math

import numpy as np
import pytest

from acquisition.numerical_tank.carried_tank import FrozenTank
from acquisition.numerical_tank.structures import Mode, Structure
from sloshlab.errors import InputError

TABLE_2_4 = ((10.87, 0.0032, 0.8956), (78.31, 0.0090, 1.0692), (226.5, 0.0176, 0.9655))
LIQUID_KG = 0.12433


def beam() -> Structure:
    modes = tuple(Mode.of_frequency(f, zeta, m, 1.0, 1.2) for f, zeta, m in TABLE_2_4)
    return Structure(modes, included_mass_kg=LIQUID_KG)


def free_decay(t: np.ndarray, start: float, f: float, zeta: float) -> np.ndarray:
    """x(t) = x₀ e^{−ζωt} (cos ω_d t + ζω/ω_d sin ω_d t)."""
    w = 2 * math.pi * f
    wd = w * math.sqrt(1 - zeta**2)
    return start * np.exp(-zeta * w * t) * (np.cos(wd * t) + zeta * w / wd * np.sin(wd * t))


def test_frozen_beam_decays_in_each_mode_as_table_2_4_says() -> None:
    """With the frozen liquid back at the tank the modes are those of the table, uncoupled."""
    tank = FrozenTank(LIQUID_KG, beam(), 2e-5)
    tank.deflect(-0.0146)
    history = tank.advance(np.zeros(25_000))
    k = [m * (2 * math.pi * f) ** 2 for f, _, m in TABLE_2_4]
    force = -0.0146 / sum(1 / kn for kn in k)
    for n, (f, zeta, _) in enumerate(TABLE_2_4):
        exact = free_decay(history.time_s, force / k[n], f, zeta)
        # the leapfrog's frequency is off by (ωΔt)²/24 = 3e-5 in the third mode, after 113 cycles 0.02 rad
        assert np.abs(history.modal_displacement_m[:, n] - exact).max() < 0.01 * abs(force / k[n])


def test_frequency_of_table_2_1() -> None:
    """2.061 kg and 0.18 kg of water on 3808.8 N/m: 6.56 Hz."""
    rig = Structure((Mode(2.061, 3808.8, 0.0, 1.0, 2.061),)).with_mass_at_tank(0.18)
    assert rig.natural_frequencies_hz()[0] == pytest.approx(6.56, abs=0.005)


def test_modes_without_the_liquid_are_those_of_the_lighter_system() -> None:
    """Two masses on two springs; modes measured with 0.3 kg more on the second one, which then leaves."""
    stiffness = np.array([[900.0, -400.0], [-400.0, 400.0]])
    heavy, light = np.diag([1.0, 0.8]), np.diag([1.0, 0.5])

    def frequencies(mass: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        scale = np.diag(1 / np.sqrt(np.diag(mass)))
        squares, vectors = np.linalg.eigh(scale @ stiffness @ scale)
        return np.sqrt(squares) / (2 * math.pi), scale @ vectors

    measured_hz, shapes = frequencies(heavy)
    shapes = shapes * [2.0, -3.0]  # any normalisation
    modes = []
    for n in range(2):
        mass, participation = float(shapes[:, n] @ heavy @ shapes[:, n]), float(heavy.diagonal() @ shapes[:, n])
        modes.append(Mode.of_frequency(measured_hz[n], 0.0, mass, shapes[1, n], participation))
    structure = Structure(tuple(modes), included_mass_kg=0.3)
    assert structure.natural_frequencies_hz() == pytest.approx(frequencies(light)[0], rel=1e-10)
    assert structure.participation_kg == pytest.approx(light.diagonal() @ shapes, rel=1e-12)
    assert structure.deflected(0.01) @ structure.shape_at_tank == pytest.approx(0.01)


def test_coulomb_friction_takes_4_f_over_k_per_cycle_and_then_holds() -> None:
    k, friction, start = 3808.8, 20.0, 0.064
    tank = FrozenTank(0.18, Structure((Mode(2.061, k, 0.0, 1.0, 2.061),), coulomb_force_n=friction), 1e-4)
    tank.deflect(start)
    history = tank.advance(np.zeros(14_000))
    u = history.tank_displacement_m
    peaks = u[1:-1][(u[1:-1] >= u[:-2]) & (u[1:-1] > u[2:]) & (u[1:-1] > 0.006)]
    expected = start - 4 * friction / k * np.arange(1, 3)
    assert peaks[:2] == pytest.approx(expected, abs=1e-5)
    # 64 mm = 6.09 · 2F/k: six half cycles, and the next would be shorter than F/k
    assert u[-1] == pytest.approx(start - 6 * 2 * friction / k, abs=2e-5)
    assert np.abs(history.tank_velocity_m_per_s[-3000:]).max() < 1e-14
    assert np.ptp(u[-3000:]) < 1e-15
    lost = 0.5 * k * (start**2 - u[-1] ** 2)
    assert tank.account().friction_j == pytest.approx(lost, rel=1e-4)


def test_guide_damping_is_viscous() -> None:
    """b at the tank: amplitude e^{−b t/2M}."""
    tank = FrozenTank(0.18, Structure((Mode(2.061, 3808.8, 0.0, 1.0, 2.061),), guide_damping_kg_per_s=1.58), 1e-4)
    tank.deflect(0.064)
    history = tank.advance(np.zeros(20_000))
    mass = 2.241
    w = math.sqrt(3808.8 / mass)
    exact = free_decay(history.time_s, 0.064, w / (2 * math.pi), 1.58 / (2 * mass * w))
    assert np.abs(history.tank_displacement_m - exact).max() < 1e-4 * 0.064


def test_moved_base_gives_the_frequency_response() -> None:
    """Relative to the base |q| = Γ a/|k − mΩ² + icΩ|, and the tank's acceleration is absolute (2.31)."""
    m, k, c, participation, a, omega = 0.9, 4000.0, 6.0, 1.2, 3.0, 60.0
    structure = Structure((Mode(m + 0.1, k, c, 1.0, participation + 0.1),), included_mass_kg=0.1)
    tank = FrozenTank(0.1, structure, 2e-4)
    time_s = tank.times_s(40_000)
    history = tank.advance(a * np.cos(omega * time_s))
    response = -(participation + 0.1) * a / (k - (m + 0.1) * omega**2 + 1j * c * omega)
    steady = time_s > 5
    exact = (response * np.exp(1j * omega * time_s)).real
    assert history.tank_displacement_m[steady] == pytest.approx(exact[steady], abs=2e-4 * abs(response))
    absolute = ((a - omega**2 * response) * np.exp(1j * omega * time_s)).real
    assert history.tank_acceleration_m_per_s2[steady] == pytest.approx(absolute[steady], abs=2e-3 * a)
    assert history.liquid_force_n[steady] == pytest.approx(-0.1 * absolute[steady], abs=2e-4 * a)


def test_step_converges_with_order_two() -> None:
    errors = []
    for step in (4e-4, 2e-4, 1e-4):
        tank = FrozenTank(LIQUID_KG, beam(), step)
        tank.deflect(0.01)
        history = tank.advance(np.zeros(round(0.1 / step)))
        k = [m * (2 * math.pi * f) ** 2 for f, _, m in TABLE_2_4]
        force = 0.01 / sum(1 / kn for kn in k)
        parts = [free_decay(history.time_s, force / kn, f, z) for kn, (f, z, _) in zip(k, TABLE_2_4, strict=True)]
        errors.append(np.abs(history.tank_displacement_m - np.sum(parts, axis=0)).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx([2.0, 2.0], abs=0.1)


def test_energy_account_of_the_structure_closes_to_rounding() -> None:
    """Everything at once: three modes, damping, guide, friction, moved base, deflected start."""
    modes = tuple(
        Mode.of_frequency(f, zeta, m, s, 1.2) for (f, zeta, m), s in zip(TABLE_2_4, (1, -0.7, 0.4), strict=True)
    )
    structure = Structure(modes, LIQUID_KG, coulomb_force_n=0.8, guide_damping_kg_per_s=0.5)
    tank = FrozenTank(LIQUID_KG, structure, 3e-4)
    tank.deflect(0.01)
    tank.advance(20 * np.random.default_rng(1).standard_normal(3000))
    account = tank.account()
    assert min(account.viscosity_j, account.friction_j) > 0.01
    assert abs(account.base_work_j) > 0.01
    assert abs(account.residual_share) < 1e-11


@pytest.mark.parametrize(
    ("make", "what"),
    [
        (lambda: Structure(()), "modes of the structure"),
        (lambda: Structure((Mode(1.0, 1.0, 0.0, 1.0, 1.0),), included_mass_kg=1.0), "modal masses without"),
        (lambda: Structure((Mode(-1.0, 1.0, 0.0, 1.0, 1.0),)), "mode 1, mass_kg"),
        (lambda: Structure((Mode(1.0, 0.0, 0.0, 1.0, 1.0),)), "mode 1, stiffness"),
        (lambda: Structure((Mode(1.0, 1.0, -0.1, 1.0, 1.0),)), "mode 1, damping"),
        (lambda: Structure((Mode(1.0, 1.0, 0.0, math.nan, 1.0),)), "mode 1, shape_at_tank"),
        (lambda: Structure((Mode(1.0, 1.0, 0.0, 0.0, 1.0),)), "mode shapes at the tank"),
        (lambda: Structure((Mode(1.0, 1.0, 0.0, 1.0, 1.0),), coulomb_force_n=-1.0), "coulomb_force_n"),
        (lambda: FrozenTank(-0.1, beam(), 1e-4), "mass of the frozen liquid"),
        (lambda: FrozenTank(0.1, beam(), 0.0), "step_s"),
        (lambda: FrozenTank(0.1, beam(), 1e-3), "time step for the structure"),
        (lambda: FrozenTank(0.1, beam(), 1e-4).deflect(math.inf), "initial displacement"),
        (lambda: FrozenTank(0.1, beam(), 1e-4).advance([math.nan]), "acceleration of the base"),
        (lambda: FrozenTank(0.1, beam(), 1e-4).advance([[0.0]]), "acceleration of the base"),
    ],
)
def test_impossible_structures_are_refused(make, what) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match=what):
        make()
