"""What every force adds to a decay, by its readings alone: M a + C v + K x is the force that EFFECTS writes.

Displacement and acceleration are read, the velocity is the derivative of a spline through the displacement; forces
with a memory are integrated along this motion by scipy. Nothing of the twin's laws is used for what is expected.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import xarray as xr
from recorded_oscillators import DAMPING, LIQUID_KG, MASS_KG, OMEGA, RATE_HZ, RIG, STIFFNESS, decays, effect, rig
from recorded_oscillators import surroundings as surroundings_of
from scipy.interpolate import CubicSpline

from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, MissingForce, candidates, known_effects
from sloshlab.missing_physics.extension import NOTHING, Extension
from sloshlab.rig import Rig, Structure
from sloshlab.twin.liquid_effects import LIQUID_DAMPING
from sloshlab.twin.tank_forces import FADING_MASS

assert effects.__all__
G = 9.80665
TANK_DAMPING = 1.5
START_M, DURATION_S = 0.02, 2.0
Motion = Mapping[str, np.ndarray]
Series = Callable[[Motion], np.ndarray]


def along(m: Motion, rates: Callable[..., Any], start: tuple[float, ...]) -> np.ndarray:
    """States of a memory that the motion drives, shape (n_states, n): Runge–Kutta, four steps per sample."""
    n, step = 4, 0.25 / RATE_HZ
    fine = np.arange(2 * n * (m["t"].size - 1) + 1) * step / 2
    x, v, a = (CubicSpline(m["t"], m[name])(fine).tolist() for name in "xva")
    y = np.array(start)
    states = [y]
    for k in range(0, fine.size - 1, 2):
        k1 = np.array(rates(y, x[k], v[k], a[k]))
        k2 = np.array(rates(y + step / 2 * k1, x[k + 1], v[k + 1], a[k + 1]))
        k3 = np.array(rates(y + step / 2 * k2, x[k + 1], v[k + 1], a[k + 1]))
        k4 = np.array(rates(y + step * k3, x[k + 2], v[k + 2], a[k + 2]))
        y = y + step / 6 * (k1 + 2 * (k2 + k3) + k4)
        states.append(y)
    return np.stack(states[::n], axis=1)


def missing_mode(m: Motion) -> np.ndarray:
    omega, zeta, mass = 2 * np.pi * 9.0, 0.02, 0.05
    y = along(
        m,
        lambda y, x, v, a: [y[1], -(omega**2) * (y[0] - x) - 2 * zeta * omega * (y[1] - v)],
        (m["x"][0], 0.0),
    )
    return mass * (omega**2 * (y[0] - m["x"]) + 2 * zeta * omega * (y[1] - m["v"]))


def bouc_wen(m: Motion) -> np.ndarray:
    k, bg, bd, nu = 100.0, 80.0, -40.0, 1.6
    [z] = along(
        m,
        lambda z, x, v, a: [
            k * v - bg * abs(v) * abs(z[0]) ** (nu - 1) * z[0] - bd * v * abs(z[0]) ** nu,
        ],
        (0.0,),
    )
    return -z


def behind_play(m: Motion, up_n: float = 0.5, down_n: float = 0.5) -> np.ndarray:
    """A stop operator: the slider is at most half the play and F/k behind, and pulled by what exceeds the play."""
    play_m, k, behind = 0.004, 600.0, [0.0]
    for step in np.diff(m["x"]):
        behind.append(float(np.clip(behind[-1] + step, -0.5 * play_m - down_n / k, 0.5 * play_m + up_n / k)))
    e = np.array(behind)
    return -k * np.maximum(np.abs(e) - 0.5 * play_m, 0.0) * np.sign(e)


def relaxing_springs(m: Motion) -> np.ndarray:
    """−ηk Σ c (y − s x), ẏ = v − r y: eight rates about ω₀; c and s by loss and storage at ω₀."""
    loss, k = 0.02, MASS_KG * OMEGA**2
    rates = OMEGA * np.geomspace(10**-1.5, 16.0, 8)
    moduli = 1j * OMEGA / (1j * OMEGA + rates)
    y = along(m, lambda y, x, v, a: v - rates * y, (0.0,) * rates.size)
    return -loss * k / moduli.imag.sum() * (y.sum(axis=0) - moduli.real.sum() * m["x"])


def carried_oscillator(frequency_hz: float, mass: float, zeta: float, m: Motion) -> np.ndarray:
    omega = 2 * np.pi * frequency_hz
    y = along(
        m, lambda y, x, v, a: [y[1], -(omega**2) * (y[0] - x) - 2 * zeta * omega * (y[1] - v)], (m["x"][0], 0.0)
    )
    return mass * (omega**2 * (y[0] - m["x"]) + 2 * zeta * omega * (y[1] - m["v"]) + m["a"])


def cushion(m: Motion) -> np.ndarray:
    k, mass, h, zeta = 240.0, 0.05, 40.0, 0.05
    damper = 2 * zeta * np.sqrt(k * mass)

    def gas(s: Any, closing: Any) -> Any:
        return k * s / (1 - h * s) + damper * closing

    y = along(m, lambda y, x, v, a: [y[1], -gas(y[0] - x, y[1] - v) / mass], (m["x"][0], 0.0))
    return gas(y[0] - m["x"], y[1] - m["v"]) + mass * m["a"]


def wave(m: Motion) -> np.ndarray:
    omega, growth, force_n, zeta = 2 * np.pi * 3.1, 0.6, 1.5, 0.05
    y = along(
        m,
        lambda y, x, v, a: [
            y[1],
            -2 * zeta * omega * y[1] - omega**2 * ((1 + growth * a / G) * y[0] + y[0] ** 3),
        ],
        (1e-3, 0.0),
    )
    return force_n * y[0]


def level_g(m: Motion, averaging_s: float = 0.2, start: float = 1e-6 * OMEGA**2) -> np.ndarray:
    """Amplitude of a sine with the running mean square of a [g]."""
    [square] = along(m, lambda y, x, v, a: [(a**2 - y[0]) / averaging_s], (start,))
    return np.sqrt(2 * square) / G


VARYING = {
    "beta": 0.3,
    "beta_per_octave": -0.4,
    "beta_per_octave_squared": 0.8,
    "beta_per_doubling": 0.25,
    "beta_per_doubling_squared": 0.1,
    "beta_per_octave_and_doubling": -0.5,
}


def varying_mass(m: Motion) -> np.ndarray:
    """β of the frequency in octaves and the level in doublings; what `recorded_oscillators.surroundings` says."""
    hz, level_at_zero, averaging = OMEGA / (2 * np.pi), 0.5 * START_M * OMEGA**2 / G, 4 * np.pi / OMEGA
    v2, a2 = along(m, lambda y, x, v, a: (np.array([v**2, a**2]) - y) / averaging, (1e-6, 1e-6 * OMEGA**2))
    x = np.clip(np.log2(np.sqrt(a2 / v2) / (2 * np.pi) / hz), -2, 2)
    y = np.clip(np.log2(np.sqrt(2 * a2) / G / level_at_zero), -3, 3)
    beta = 0.3 - 0.4 * x + 0.8 * x**2 + 0.25 * y + 0.1 * y**2 - 0.5 * x * y
    return -beta * LIQUID_KG * m["a"]


MEMORYLESS: dict[str, tuple[dict[str, float], Series]] = {
    "structure.viscous_damping": ({"damping_n_s_per_m": 1.3}, lambda m: -1.3 * m["v"]),
    "structure.coulomb_friction": ({"force_n": 0.4}, lambda m: -0.4 * np.sign(m["v"])),
    "structure.asymmetric_friction": (
        {"force_up_n": 0.6, "force_down_n": 0.2},
        lambda m: np.where(m["v"] > 0, -0.6, 0.2),
    ),
    "structure.stribeck_friction": (
        {"coulomb_n": 0.2, "static_n": 0.5, "stribeck_velocity_m_per_s": 0.1},
        lambda m: -(0.2 + 0.3 * np.exp(-((m["v"] / 0.1) ** 2))) * np.sign(m["v"]),
    ),
    "structure.quadratic_drag": ({"drag_n_s2_per_m2": 0.8}, lambda m: -0.8 * m["v"] * np.abs(m["v"])),
    "structure.structural_damping": (
        {"loss_factor": 0.02},
        lambda m: -0.5 * np.pi * 0.02 * MASS_KG * OMEGA**2 * np.abs(m["x"]) * np.sign(m["v"]),
    ),
    "structure.linear_structural_damping": ({"loss_factor": 0.02, "creep_decades": 1.5}, relaxing_springs),
    "structure.hysteresis": (
        {"stiffness_n_per_m": 100.0, "beta_gamma": 80.0, "beta_delta": -40.0, "exponent": 1.6},
        bouc_wen,
    ),
    "structure.friction_behind_play": (
        {"force_n": 0.5, "play_m": 0.004, "stiffness_n_per_m": 600.0},
        behind_play,
    ),
    "structure.friction_behind_play_by_direction": (
        {"force_up_n": 0.7, "force_down_n": 0.3, "play_m": 0.004, "stiffness_n_per_m": 600.0},
        lambda m: behind_play(m, 0.7, 0.3),
    ),
    "structure.cubic_stiffness": ({"stiffness_n_per_m3": 3e5}, lambda m: -3e5 * m["x"] ** 3),
    "structure.quadratic_stiffness": ({"stiffness_n_per_m2": -9e3}, lambda m: 9e3 * m["x"] ** 2),
    "structure.stiffness_change": ({"stiffness_n_per_m": -150.0}, lambda m: 150.0 * m["x"]),
    "structure.clearance": (
        {"gap_m": 0.008, "stiffness_n_per_m": 500.0},
        lambda m: -500.0 * np.sign(m["x"]) * np.maximum(np.abs(m["x"]) - 0.008, 0.0),
    ),
    "structure.missing_mode": ({"frequency_hz": 9.0, "damping_ratio": 0.02, "participation": 0.05}, missing_mode),
    "structure.mass_error": ({"mass_kg": 0.11}, lambda m: -0.11 * m["a"]),
    "structure.constant_force": ({"force_n": -0.7}, lambda m: np.full(m["x"].size, -0.7)),
    "tank.viscous_damping": ({"damping_n_s_per_m": 1.3}, lambda m: -1.3 * m["v"]),
    "tank.coulomb_friction": ({"force_n": 0.4}, lambda m: -0.4 * np.sign(m["v"])),
    "tank.quadratic_drag": ({"drag_n_s2_per_m2": 0.8}, lambda m: -0.8 * m["v"] * np.abs(m["v"])),
    "tank.mass_error": ({"mass_kg": -0.03}, lambda m: 0.03 * m["a"]),
    "tank.effective_mass": ({"beta": 0.3}, lambda m: -0.3 * LIQUID_KG * m["a"]),
    "tank.fading_mass": (
        {"beta": 0.3, "fade_g": 2.5, "averaging_s": 0.2},
        lambda m: -0.3 * LIQUID_KG * m["a"] / (1 + (level_g(m, start=0.0) / 2.5) ** 2),
    ),
    "tank.varying_mass": (VARYING, varying_mass),
    "tank.liquid_loss": ({"rate_kg_per_s": 0.01}, lambda m: 0.01 * m["t"] * m["a"]),
    "tank.lateral_mode": (
        {"frequency_hz": 4.5, "mass_kg": 0.03, "damping_ratio": 0.05},
        lambda m: carried_oscillator(4.5, 0.03, 0.05, m),
    ),
    "tank.air_cushion": (
        {"stiffness_n_per_m": 240.0, "mass_kg": 0.05, "hardening_per_m": 40.0, "damping_ratio": 0.05},
        cushion,
    ),
    "tank.faraday_wave": (
        {"frequency_hz": 3.1, "growth": 0.6, "force_n": 1.5, "damping_ratio": 0.05},
        wave,
    ),
}


@pytest.fixture(scope="module")
def frozen(tmp_path_factory: pytest.TempPathFactory) -> RigModel:
    folder = tmp_path_factory.mktemp("frozen")
    return RigModel(rig(folder), folder, decays((START_M,), DURATION_S))


@pytest.fixture(scope="module")
def damped(tmp_path_factory: pytest.TempPathFactory) -> RigModel:
    folder = tmp_path_factory.mktemp("damped")
    return RigModel(rig(folder, TANK_DAMPING), folder, decays((START_M,), DURATION_S))


def moved(model: RigModel, key: str, numbers: Mapping[str, float]) -> dict[str, np.ndarray]:
    """The readings of a decay with an effect, as a motion."""
    return moved_by(
        model, NOTHING if not key else Candidate(effect(key), surroundings_of(model)).extension(numbers)
    )


def moved_by(model: RigModel, extension: Extension) -> dict[str, np.ndarray]:
    """The readings of a decay with an extension, as a motion."""
    readings = model.simulate(model.runs[0], model.believed, extension)
    x, a = readings["displacement_tank"], readings["acceleration_tip"]
    t = np.arange(x.size) / RATE_HZ
    return {"t": t, "x": x, "v": CubicSpline(t, x, bc_type=((1, 0.0), "not-a-knot")).derivative()(t), "a": a}


def added(m: Motion, tank_damping: float = 0.0) -> np.ndarray:
    """The force beyond mass, spring and dampers of the rig file."""
    return MASS_KG * m["a"] + (DAMPING + tank_damping) * m["v"] + STIFFNESS * m["x"]


def smooth(m: Motion) -> np.ndarray:
    """Samples away from the release, the reversals and the rest, where a spline knows the velocity."""
    fast = np.abs(m["v"]) > 0.1 * np.abs(m["v"]).max()
    return (
        fast
        & np.roll(fast, 2)
        & np.roll(fast, -2)
        & (np.arange(fast.size) > 3)
        & (np.arange(fast.size) < fast.size - 3)
    )


@pytest.mark.parametrize("key", MEMORYLESS)
def test_a_force_is_the_one_of_the_vocabulary(frozen: RigModel, key: str) -> None:
    numbers, expected = MEMORYLESS[key]
    m = moved(frozen, key, numbers)
    # the wave is chaotic: after a second its phase is that of rounding
    known = smooth(m) & (m["t"] < (0.95 if key == "tank.faraday_wave" else DURATION_S))
    force = expected(m)[known]
    # 2e-4 of the largest force of the spring holds what the spline makes of the velocity
    error = np.abs(added(m)[known] - force)
    assert error.max() < 0.03 * np.abs(force).max() + 2e-4 * STIFFNESS * START_M
    assert np.sqrt(np.mean(error**2)) < 0.02 * np.sqrt(np.mean(force**2))


@pytest.fixture(scope="module")
def with_interface(tmp_path_factory: pytest.TempPathFactory) -> RigModel:
    folder = tmp_path_factory.mktemp("interface")
    runs = decays(
        (START_M,), 1.0, lambda channels: {**channels, "force_interface": MASS_KG * channels["acceleration_tip"]}
    )
    return RigModel(rig(folder), folder, runs)


@pytest.mark.parametrize("key", MEMORYLESS)
def test_the_interface_feels_forces_of_the_tank_alone(with_interface: RigModel, key: str) -> None:
    """F = M a − Δf between structure and tank: a force of the structure acts on its other side."""
    numbers, expected = MEMORYLESS[key]
    extension = Candidate(effect(key), surroundings_of(with_interface)).extension(numbers)
    [run] = with_interface.runs
    readings = with_interface.simulate(run, with_interface.believed, extension)
    felt = MASS_KG * readings["acceleration_tip"] - readings["force_interface"]
    if key.startswith("structure"):
        assert np.abs(felt).max() < 1e-9
    else:
        m = moved(with_interface, key, numbers)
        known = smooth(m) & (m["t"] < 0.95)
        assert np.abs(felt - expected(m))[known].max() < 0.03 * np.abs(expected(m)[known]).max()


def test_nothing_added_is_no_force(frozen: RigModel) -> None:
    m = moved(frozen, "", {})
    assert np.abs(added(m)[smooth(m)]).max() < 2e-4 * STIFFNESS * START_M


def tracked_omega(m: Motion, averaging_s: float) -> np.ndarray:
    """Root of the running mean squares of a over v."""
    y = along(
        m,
        lambda y, x, v, a: [(v**2 - y[0]) / averaging_s, (a**2 - y[1]) / averaging_s],
        (1e-6, 1e-6 * OMEGA**2),
    )
    return np.sqrt(y[1] / y[0])


def test_sloshing_dissipates_beyond_its_threshold_and_less_beyond_its_peak(frozen: RigModel) -> None:
    """(m_l/π) Ω W̄ v; W̄ is 0 at 1.6 g, 2 at 1.6 g (1 + 0.4), and falls as 2b/(1 + b²) on both sides of it."""
    m = moved(
        frozen,
        "tank.liquid_sloshing",
        {"threshold_g": 1.6, "peak_w_bar": 2.0, "rise": 0.4, "averaging_s": 0.12},
    )
    level = level_g(m, 0.12)
    b = np.maximum(level / 1.6 - 1, 0.0) / 0.4
    expected = -LIQUID_KG / np.pi * tracked_omega(m, 0.12) * 2.0 * 2 * b / (1 + b**2) * m["v"]
    known = smooth(m)
    assert np.abs(added(m) - expected)[known].max() < 0.02 * np.abs(expected).max()
    assert (b[known] > 1.5).any()
    below = known & (level < 1.55)
    assert below.sum() > 50
    assert np.abs(added(m)[below]).max() < 2e-4 * STIFFNESS * START_M


def test_a_fading_mass_remembers_the_level_as_long_as_stated(frozen: RigModel) -> None:
    term = FADING_MASS(beta=0.5, liquid_mass_kg=LIQUID_KG, fade_g=1.5, averaging_s=0.8)
    m = moved_by(frozen, Extension(terms=(term,), key=tuple(term.values.items())))
    level = level_g(m, 0.8, start=0.0)
    expected = -0.5 * LIQUID_KG * m["a"] / (1 + (level / 1.5) ** 2)
    known = smooth(m)
    assert np.abs(added(m) - expected)[known].max() < 0.02 * np.abs(expected).max()
    assert level[known].min() < 1.0
    assert level[known].max() > 2.0


def test_saturation_makes_the_damping_of_the_liquid_fall_with_the_square(damped: RigModel) -> None:
    m = moved(damped, "tank.high_g_saturation", {"threshold_g": 2.2, "averaging_s": 0.12})
    level = level_g(m, 0.12)
    expected = -TANK_DAMPING * np.minimum(1.0, (2.2 / np.maximum(level, 1e-3)) ** 2) * m["v"]
    known = smooth(m)
    assert np.abs(added(m) - expected)[known].max() < 0.02 * np.abs(expected).max()
    assert (level[known] > 2.6).any()
    assert (level[known & (m["t"] > 1.0)] < 2.1).any()


@pytest.fixture(scope="module")
def with_maps(tmp_path_factory: pytest.TempPathFactory) -> RigModel:
    """The twin's liquid has W̄ = 1.8 everywhere and no effective mass."""
    folder = tmp_path_factory.mktemp("maps")
    grid = {"omega_bar": [1.0, 3.0], "u_bar": [0.0, 2.0]}
    constant = {name: (tuple(grid), np.full((2, 2), value)) for name, value in (("w_bar", 1.8), ("beta", 0.0))}
    xr.Dataset(constant, grid).to_netcdf(folder / "maps.nc")
    text = RIG.replace("TANK_MODEL", "viscous") + 'maps = "maps.nc"\nmetric = "map"\n'
    (folder / "rig.toml").write_text(text, encoding="utf-8")
    return RigModel(Rig.from_toml(folder / "rig.toml"), folder, decays((START_M,), DURATION_S))


@pytest.mark.parametrize("exponent", [0.6, 3.0])
def test_measured_work_falls_gradually_beyond_its_threshold(with_maps: RigModel, exponent: float) -> None:
    """−(m_l/π) Ω W̄ (a_s/â)ⁿ v beyond a_s, the map's −(m_l/π) Ω W̄ v below."""
    numbers = {"threshold_g": 2.2, "exponent": exponent, "averaging_s": 0.12}
    m = moved(with_maps, "tank.gradual_saturation", numbers)
    level = level_g(m, 0.12, start=0.0)
    share = np.minimum(1.0, (2.2 / np.maximum(level, 1e-3)) ** exponent)
    expected = -LIQUID_KG / np.pi * tracked_omega(m, 0.2) * 1.8 * share * m["v"]
    known = smooth(m) & (m["t"] > 0.3)  # what the map follows begins with a small motion of 10 Hz
    assert np.abs(added(m) - expected)[known].max() < 0.03 * np.abs(expected).max()
    assert (level[known] > 2.6).any()
    assert (level[known] < 2.1).any()


def test_a_gradual_saturation_is_of_measured_work_alone(
    frozen: RigModel, damped: RigModel, with_maps: RigModel
) -> None:
    """A damper that is fitted has no level from which it falls; sloshing with a peak describes what does."""
    sought = [
        "tank.gradual_saturation" in {candidate.key for candidate in candidates(surroundings_of(model))}
        for model in (frozen, damped, with_maps)
    ]
    assert sought == [False, False, True]


def built_up(level: np.ndarray, agitated_g: float, time_constant_s: float, calming_s: float) -> np.ndarray:
    """ṡ = p (1 − s)/τ − (1 − p) s/τ_calm, p = r⁴/(1 + r⁴), r the level over that which agitates."""
    violent = 1.0 / (1.0 + (agitated_g / np.maximum(level, 1e-3)) ** 4)
    built = np.zeros(level.size)
    for i in range(1, level.size):
        p = violent[i - 1]
        rate = p / time_constant_s + (1.0 - p) / calming_s
        rest = p / time_constant_s / rate
        built[i] = rest + (built[i - 1] - rest) * np.exp(-rate / RATE_HZ)
    return built


def test_a_delayed_break_up_builds_the_damping_of_the_liquid_up_and_it_stays(damped: RigModel) -> None:
    numbers = {"time_constant_s": 0.4, "agitated_g": 2.0, "averaging_s": 0.12, "sharpness": 4.0}
    m = moved(damped, "tank.breakup_delay", numbers)
    built = built_up(level_g(m, 0.12), 2.0, 0.4, np.inf)
    known = smooth(m)
    expected = -TANK_DAMPING * built * m["v"]
    assert np.abs(added(m) - expected)[known].max() < 0.03 * np.abs(expected).max()
    assert built[0] < 0.1
    assert built[-1] > 0.5


def test_a_liquid_may_calm_down_as_fast_as_it_breaks_up(frozen: RigModel) -> None:
    """A time of calming of its own, or that of the break-up where none is stated."""
    for stated, acting in ((0.0, 0.4), (0.1, 0.1)):
        term = LIQUID_DAMPING(
            damping_n_s_per_m=TANK_DAMPING, liquid_mass_kg=LIQUID_KG, break_up_s=0.4, agitated_g=2.0,
            averaging_s=0.12, calming_s=stated, sharpness=4.0,
        )  # fmt: skip
        m = moved_by(frozen, Extension(terms=(term,), key=tuple(term.values.items())))
        built = built_up(level_g(m, 0.12), 2.0, 0.4, acting)
        expected = -TANK_DAMPING * built * m["v"]
        assert np.abs(added(m) - expected)[smooth(m)].max() < 0.03 * np.abs(expected).max()
        assert built[-1] < 0.7 * built.max()


def test_the_damper_of_the_baseline_is_there_without_an_effect(damped: RigModel) -> None:
    m = moved(damped, "", {})
    assert np.abs(added(m, TANK_DAMPING)[smooth(m)]).max() < 2e-4 * STIFFNESS * START_M


def test_a_liquid_that_meets_the_ceiling_takes_energy_and_leaves_a_lighter_tank_in_flight(
    frozen: RigModel,
) -> None:
    numbers = {"gap_m": 0.0136, "stiffness_n_per_m": 2.4e3, "damping_kg_per_s": 3.6, "share": 0.6}
    m, before = moved(frozen, "tank.ceiling_impact", numbers), moved(frozen, "", {})
    force = added(m)
    # in flight the tank lacks the share that flies: Δf = 0.6 m_l (a + g)
    flying = smooth(m) & (m["a"] < -1.5 * G)
    assert np.median(np.abs(force[flying] - 0.6 * LIQUID_KG * (m["a"][flying] + G))) < 0.02 * LIQUID_KG * G
    assert np.sum(force * m["v"]) < 0
    late = m["t"] > 1.0
    assert np.abs(m["x"][late]).max() < 0.9 * np.abs(before["x"][late]).max()


def test_friction_behind_play_is_sought_in_rigs_and_machines_alike(frozen: RigModel) -> None:
    at = surroundings_of(frozen)
    machine = replace(at, rig=None, blocks=("structure", "sensor"))  # type: ignore[arg-type]
    for place in (at, machine):
        sought = {candidate.effect.known_as for candidate in candidates(place)}
        assert "friction_behind_play" in sought


def test_every_force_of_the_vocabulary_is_held_to_its_equation() -> None:
    held = {
        *MEMORYLESS,
        "tank.liquid_sloshing",
        "tank.high_g_saturation",
        "tank.gradual_saturation",
        "tank.breakup_delay",
        "tank.ceiling_impact",
        # their closed forms stand in test_external_force.py
        *(
            f"{block}.{name}"
            for block in ("structure", "tank")
            for name in ("external_force", "alternating_pulses", "harmonic_force")
        ),
    }
    built_in = [
        known_effect
        for known_effect in known_effects()
        if known_effect.extension.__module__.startswith("sloshlab.")
    ]
    assert {
        f"{effect.block}.{effect.name}" for effect in built_in if effect.block in ("structure", "tank")
    } == held


@pytest.mark.parametrize(("structure", "sought"), [("sdof", False), ("beam", True), (None, False)])
def test_a_lateral_mode_is_sought_where_the_tank_rocks_alone(
    frozen: RigModel, structure: str | None, sought: bool
) -> None:
    beam = Structure(
        kind="beam",
        frequencies_hz=(10.7,),
        damping_ratios=(0.01,),
        modal_masses_kg=(0.45,),
        tip_mode_shape=(1.0,),
    )
    at = surroundings_of(frozen)
    held = {"sdof": at.rig.structure, "beam": beam, None: None}[structure]
    there = candidates(replace(at, rig=at.rig.model_copy(update={"structure": held})))
    assert ("tank.lateral_mode" in {candidate.key for candidate in there}) == sought
    assert "tank.effective_mass" in {candidate.key for candidate in there}


def test_a_lateral_mode_is_sought_with_the_waves_of_the_box_too(frozen: RigModel) -> None:
    """Frequency by g k tanh(k h); mass c² m (h + g/ω²)² with m of SP-106 and 1.5/l for the turn of the tip."""
    beam = Structure(
        kind="beam", length_m=0.74, width_m=0.1, thickness_m=0.01, frequencies_hz=(6.0,), damping_ratios=(0.01,),
        modal_masses_kg=(1.9,), tip_mode_shape=(1.0,),
    )  # fmt: skip
    at = surroundings_of(frozen)
    at = replace(at, rig=at.rig.model_copy(update={"structure": beam}), frequency_hz=6.0)
    tank, fill = at.rig.tank, at.rig.liquid.fill_level * at.rig.tank.height_m
    [found] = [c for c in candidates(at) if c.key == "tank.lateral_mode"]
    for side in (tank.length_m, tank.width_m):
        k = np.pi / side
        omega = np.sqrt(9.81 * k * np.tanh(k * fill))
        mass = at.rig.liquid_mass_kg * 8 * np.tanh(k * fill) / (np.pi**2 * k * fill)
        height = fill * 0.5 - 2 * np.tanh(k * fill / 2) / k - (tank.height_m - fill) / 2
        expected = (1.5 / 0.74) ** 2 * mass * (height + 9.81 / omega**2) ** 2
        starts = [
            s
            for s in found.starts()
            if s["tank.lateral_mode.frequency_hz"] == pytest.approx(omega / (2 * np.pi), rel=1e-6)
        ]
        if expected < 3e-3 * at.rig.liquid_mass_kg:
            assert starts == []
        else:
            assert [s["tank.lateral_mode.mass_kg"] for s in starts] == [pytest.approx(expected, rel=0.06)]


@pytest.mark.parametrize(
    ("name", "limits"),
    [
        ("coulomb_friction", ("force_n",)),
        ("asymmetric_friction", ("force_up_n", "force_down_n")),
        ("stribeck_friction", ("coulomb_n", "static_n")),
        ("friction_behind_play", ("force_n",)),
    ],
)
def test_friction_begins_at_the_size_that_the_missing_force_has_where_it_slides(
    frozen: RigModel, name: str, limits: tuple[str, ...]
) -> None:
    """In one run it holds what little pushes, in the other one it slides: ±6 N, tapered at the ends."""
    generator, n = np.random.default_rng(1), 2000
    slides = 6.0 * np.sign(np.sin(np.arange(n) / 20.0)) + 0.1 * generator.standard_normal(n)
    slides[:200] = slides[-200:] = 0.0
    missing = {"holds": MissingForce(0.3 * generator.standard_normal(n)), "slides": MissingForce(slides)}
    friction = Candidate(effect(f"structure.{name}"), surroundings_of(frozen))
    own = friction.starts()
    found = friction.proposed(missing)
    assert len(found) == len(own)
    for start, as_shown in zip(own, found, strict=True):
        sizes = [as_shown[f"{friction.key}.{limit}"] for limit in limits]
        assert np.mean(sizes) == pytest.approx(6.0, rel=0.01)
        # what tells the directions apart, and other numbers, are those of the effect's own starts
        assert sizes[-1] / sizes[0] == pytest.approx(
            start[f"{friction.key}.{limits[-1]}"] / start[f"{friction.key}.{limits[0]}"]
        )
        others = start.keys() - {f"{friction.key}.{limit}" for limit in limits}
        assert {key: as_shown[key] for key in others} == {key: start[key] for key in others}
    assert friction.proposed({"rest": MissingForce(np.zeros(n))}) == []
