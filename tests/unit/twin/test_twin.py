"""The twin's blocks: a user's force, open and closed loop, sensors, saving, and what it refuses."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from sloshlab.constants import GRAVITY_M_PER_S2
from sloshlab.errors import AnalysisError, InputError, RigError
from sloshlab.rig import Rig
from sloshlab.twin import preparation
from sloshlab.twin.excitation import Excitation, free, harmonic, harmonic_force, recorded, stepped_sine
from sloshlab.twin.law import VELOCITY, law
from sloshlab.twin.liquid_effects import LIQUID_DAMPING
from sloshlab.twin.sensors import Sensor
from sloshlab.twin.status import Status
from sloshlab.twin.storage import load_twin, save_twin
from sloshlab.twin.structure import Structure, modal_structure, single_degree_of_freedom
from sloshlab.twin.structure_forces import COULOMB_FRICTION, QUADRATIC_DRAG, VISCOUS_DAMPING
from sloshlab.twin.tank_forces import (
    BOUNCING_BALL,
    EFFECTIVE_MASS_MAP,
    LINEAR_RESPONSE,
    VISCOUS_MAP,
    table_of,
)
from sloshlab.twin.terms import ForceKind, Parameter, kind_named, register
from sloshlab.twin.twin import Twin

BALL = dict(radius_m=0.0244, stiffness_n_per_m=1103.0, damping_kg_per_s=13.04, hardening_per_m=74.04, beta=0.0017,
            liquid_mass_kg=0.18, height_m=0.06)  # fmt: skip
BEAM_RIG = """
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.3
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
[structure]
kind = "beam"
length_m = 0.74
width_m = 0.10
thickness_m = 0.01
frequencies_hz = [10.87, 78.31, 226.5]
damping_ratios = [0.0032, 0.0090, 0.0176]
modal_masses_kg = [0.8956, 1.0692, 0.9655]
tip_mode_shape = [1.0, 1.0, 1.0]
[twin]
tank_model = "viscous"
parameters = { damping_kg_per_s = 3.4 }
"""


@law
def _power_law(motion, parameters, memory, rates):  # type: ignore[no-untyped-def]
    return -parameters[0] * motion[VELOCITY] * abs(motion[VELOCITY])


OWN_DRAG = register(
    ForceKind("own_drag", ("structure",), (Parameter("drag_n_s2_per_m2", "N s2 m-2", 0.0, 1e3),), _power_law)
)


def sdof() -> Twin:
    return Twin(single_degree_of_freedom(2.241, 3808.8))


def beam() -> Structure:
    return modal_structure([10.0, 70.0, 200.0], [0.0] * 3, [1.0] * 3, mode_shape=[1.0] * 3)


def rubbing_twice() -> Twin:
    return sdof().with_term(COULOMB_FRICTION(force_n=0.4)).with_term(COULOMB_FRICTION(place="tank", force_n=0.1))


def run(twin: Twin) -> object:
    return twin.simulate(harmonic(1e-3, 1.0, 1.0, 99.0))


def w_bar_map(value: float) -> np.ndarray:
    return table_of(
        xr.DataArray(
            np.full((2, 3), value),
            coords={"omega_bar": [1.0, 6.0], "u_bar": [0.0, 1.0, 2.0]},
            dims=("omega_bar", "u_bar"),
        )
    )


def test_a_users_force_gives_what_the_same_force_built_in_gives() -> None:
    run = free(1.0, 1000.0)
    own = sdof().with_term(OWN_DRAG(drag_n_s2_per_m2=3.0)).simulate(run, initial_displacement_m=0.03)
    known = sdof().with_term(QUADRATIC_DRAG(drag_n_s2_per_m2=3.0)).simulate(run, initial_displacement_m=0.03)
    assert own.displacement_m.tobytes() == known.displacement_m.tobytes()
    assert kind_named("own_drag") is OWN_DRAG


def test_a_beam_with_a_viscous_tank_decays_as_appendix_e_says() -> None:
    """ζ = ζ₁ + c/(2 m ω) for one lightly damped mode; the modes differ by far in frequency."""
    twin = Twin.from_rig(Rig.from_toml_text(BEAM_RIG))
    result = twin.simulate(free(1.0, 20000.0), initial_displacement_m=0.005)
    first = result.modes[:, 0, 0]
    peaks = np.flatnonzero((first[1:-1] > first[:-2]) & (first[1:-1] >= first[2:])) + 1
    decrement = np.log(first[peaks[0]] / first[peaks[5]]) / (2 * np.pi * 5)
    omega = 2 * np.pi * 10.87
    assert decrement == pytest.approx(0.0032 + 3.4 / (2 * 0.8956 * omega), rel=0.01)


def test_a_copy_in_another_process_would_be_the_same_twin() -> None:
    twin = sdof().with_term(BOUNCING_BALL(**BALL))
    copied = copy.deepcopy(twin)
    assert copied.terms[0].kind is BOUNCING_BALL
    run = free(0.2, 2000.0)
    runs = [
        each_twin.simulate(run, initial_displacement_m=-0.06).displacement_m.tobytes()
        for each_twin in (twin, copied)
    ]
    assert runs[0] == runs[1]


@pytest.mark.parametrize("pulls", [0.0, 1.0])
def test_a_ball_bounces_as_its_contact_pulls_or_does_not(pulls: float) -> None:
    """Restitution of a spring and damper, the force cut off where it would pull or not.

    exp(−(β/ω)(π − atan(2βω/(ω² − β²)))) and exp(−πβ/ω) with β = c/2m, ω² = k/m − β²
    (Schwager and Pöschel 2007, doi:10.1007/s10035-007-0065-z), from the times of flight in a tank that was jerked.
    """
    mass, contact_rad_per_s, ratio = 0.1, 2 * np.pi * 300.0, 0.3
    beta, omega = ratio * contact_rad_per_s, contact_rad_per_s * np.sqrt(1 - ratio**2)
    ball = BOUNCING_BALL(
        radius_m=0.01, stiffness_n_per_m=mass * contact_rad_per_s**2, damping_kg_per_s=2 * mass * beta,
        hardening_per_m=0.0, beta=0.0, liquid_mass_kg=mass, height_m=2.0, contact_pulls=pulls,
    )  # fmt: skip
    rate_hz, jerk_s = 20_000.0, 0.02
    time = np.arange(round(2.0 * rate_hz)) / rate_hz
    moving, phase = time < jerk_s, np.pi * np.minimum(time, jerk_s) / jerk_s
    x = 0.05 * (phase - 0.5 * np.sin(2 * phase)) / np.pi
    v = np.where(moving, 0.05 * (1 - np.cos(2 * phase)) / jerk_s, 0.0)
    a = np.where(moving, 0.1 * np.pi * np.sin(2 * phase) / jerk_s**2, 0.0)
    alone = sdof().with_term(ball).tank_alone()
    run = alone.simulate(recorded(rate_hz, displacement=x, velocity=v, acceleration=a)).require_done()
    contact = run.forces_n[:, 0] - mass * GRAVITY_M_PER_S2
    assert pulls == (contact[time > jerk_s].max() > 1.0)
    touches = np.abs(contact) > 1e-2
    begins, ends = (np.flatnonzero(np.diff(touches.astype(int)) == sign) for sign in (1, -1))
    flights = [(b - e) / rate_hz for e, b in zip(ends, begins[begins > ends[0]], strict=False)]
    closed = np.exp(-np.pi * beta / omega)
    if not pulls:
        closed = np.exp(-beta / omega * (np.pi - np.arctan2(2 * beta * omega, omega**2 - beta**2)))
    assert flights[1] / flights[0] == pytest.approx(closed, rel=0.01)


def test_a_tank_alone_on_its_motion_repeats_the_closed_loop() -> None:
    closed = sdof().with_term(BOUNCING_BALL(**BALL)).simulate(free(1.0, 20000.0), initial_displacement_m=-0.05)
    measured = recorded(
        20000.0,
        displacement=closed.displacement_m,
        velocity=closed.velocity_m_per_s,
        acceleration=closed.acceleration_m_per_s2,
    )
    alone = closed.twin.tank_alone().simulate(measured)
    np.testing.assert_allclose(alone.forces_n[:10000, 0], closed.forces_n[:10000, 0], atol=2e-2)
    assert np.abs(closed.forces_n).max() > 5


def test_a_structure_alone_on_its_force_repeats_the_closed_loop() -> None:
    closed = (
        sdof()
        .with_term(VISCOUS_DAMPING(place="tank", damping_n_s_per_m=5.0))
        .simulate(free(1.0, 2000.0), initial_displacement_m=0.01)
    )
    alone = closed.twin.structure_alone().simulate(
        recorded(2000.0, force_n=closed.tank_force_n), initial_displacement_m=0.01
    )
    np.testing.assert_allclose(alone.displacement_m[:1900], closed.displacement_m[:1900], atol=2e-5)


def test_a_constant_map_of_work_is_the_damper_of_appendix_e() -> None:
    """(E.4) c = (m_l/π) Ω W̄ in harmonic motion, once the frequency is found."""
    tank = Twin(
        None, (VISCOUS_MAP(liquid_mass_kg=0.12, height_m=0.03, start_frequency_hz=8.0, table=w_bar_map(1.2)),)
    )
    result = tank.simulate(harmonic(0.003, 10.0, 4.0, 2000.0))
    last = result.time_s > 3
    c = 0.12 / np.pi * 2 * np.pi * 10.0 * 1.2
    rms = np.sqrt(np.mean((result.forces_n[last, 0] + c * result.velocity_m_per_s[last]) ** 2))
    assert rms < 0.05 * c * 0.003 * 2 * np.pi * 10 / np.sqrt(2)
    work = -(result.work_of_terms_j[-1, 0] - result.work_of_terms_j[-2001, 0]) / 10
    assert work == pytest.approx(1.2 * 0.12 * (0.003 * 2 * np.pi * 10) ** 2, rel=0.01)


def test_the_forces_of_a_map_come_late_where_liquid_breaks_up_late_and_fall_where_it_saturates() -> None:
    """Beside the same motion without: s = 1 − e^(−pt/τ) at a constant level, times (a_s/â)² or another power."""
    known = {"liquid_mass_kg": 0.12, "height_m": 0.03, "start_frequency_hz": 10.0, "table": w_bar_map(1.2)}
    level_g = 0.003 * (2 * np.pi * 10) ** 2 / 9.80665
    agitated = {"break_up_s": 0.5, "agitated_g": level_g, "calming_s": 1e9, "sharpness": 4.0, "averaging_s": 0.01}
    run = harmonic(0.003, 10.0, 4.0, 2000.0)
    for kind in (VISCOUS_MAP, EFFECTIVE_MASS_MAP):
        beyond = {"saturation_g": level_g / 2, "averaging_s": 1.0}
        plain, late, saturated, gradual = (
            Twin(None, (kind(**known, **numbers),)).simulate(run).forces_n[:, 0]
            for numbers in ({}, agitated, beyond, {**beyond, "saturation_exponent": 0.5})
        )
        time, large = np.arange(plain.size) / 2000.0, np.abs(plain) > 0.5 * np.abs(plain).max()
        share = late[large] / plain[large]
        # the running mean of 10 ms lets p swing about a half within the cycle
        assert np.abs(share - (1 - np.exp(-time[large] / 1.0)))[time[large] > 0.3].max() < 0.05
        assert np.abs(saturated[large] / plain[large] - 0.25)[time[large] > 3.5].max() < 0.03
        assert np.abs(gradual[large] / plain[large] - 0.5**0.5)[time[large] > 3.5].max() < 0.02


@pytest.mark.parametrize("rate_hz", [40.0, 64.0, 2000.0])
def test_liquid_that_breaks_up_at_once_has_nothing_to_follow(rate_hz: float) -> None:
    """At a low rate a state with a time constant of a millisecond would leave all bounds."""
    known = {"liquid_mass_kg": 0.12, "start_frequency_hz": 10.0}
    maps = (kind(**known, height_m=0.03, table=w_bar_map(1.2)) for kind in (VISCOUS_MAP, EFFECTIVE_MASS_MAP))
    for term in (*maps, LIQUID_DAMPING(**known, damping_n_s_per_m=2.0)):
        result = Twin(None, (term,)).simulate(harmonic(0.003, 10.0, 20.0, rate_hz))
        np.testing.assert_array_equal(result.memory[:, -1], 1.0)
        assert np.isfinite(result.memory).all()


def test_a_constant_map_of_effective_mass_shifts_the_frequency() -> None:
    """A force that depends on the acceleration is solved for: f = √(K/(M + β m_l))/2π."""
    term = EFFECTIVE_MASS_MAP(liquid_mass_kg=0.18, height_m=0.06, start_frequency_hz=6.5, table=w_bar_map(-0.8))
    result = sdof().with_term(term).simulate(free(1.0, 4000.0), initial_displacement_m=0.01)
    omega = np.sqrt(3808.8 / (2.241 - 0.8 * 0.18))
    np.testing.assert_allclose(result.displacement_m, 0.01 * np.cos(omega * result.time_s), atol=1e-7)


def test_a_model_in_discrete_time_sees_the_history_of_the_motion() -> None:
    tank = Twin(None, (LINEAR_RESPONSE(n_delays=3, table=[1.0, -2.0, 0.5]),))
    result = tank.simulate(harmonic(0.01, 3.0, 0.5, 200.0))
    v = result.velocity_m_per_s
    np.testing.assert_allclose(result.forces_n[10:, 0], (v[10:] - 2 * v[9:-1] + 0.5 * v[8:-2]), atol=1e-12)


def test_the_same_twin_twice_gives_the_same_bytes() -> None:
    twin = sdof().with_term(BOUNCING_BALL(**BALL)).with_term(COULOMB_FRICTION(force_n=0.37))
    runs = [twin.simulate(free(0.5, 10000.0), initial_displacement_m=-0.06) for _ in range(2)]
    assert runs[0].displacement_m.tobytes() == runs[1].displacement_m.tobytes()


def test_saved_loaded_and_saved_again_gives_the_same_bytes(tmp_path: Path) -> None:
    twin = Twin.from_rig(Rig.from_toml_text(BEAM_RIG)).with_term(
        VISCOUS_MAP(liquid_mass_kg=0.12, height_m=0.03, table=w_bar_map(1.2))
    )
    twin = twin.with_term(OWN_DRAG(drag_n_s2_per_m2=0.1)).with_sensor(Sensor("acceleration_tip", gain=1.01))
    save_twin(twin, tmp_path / "a.toml")
    save_twin(load_twin(tmp_path / "a.toml"), tmp_path / "b.toml")
    for suffix in (".toml", ".nc"):
        assert (tmp_path / "a").with_suffix(suffix).read_bytes() == (tmp_path / "b").with_suffix(
            suffix
        ).read_bytes()
    run = free(0.2, 5000.0)
    loaded = load_twin(tmp_path / "a.toml").simulate(run, initial_displacement_m=0.01)
    assert (
        loaded.displacement_m.tobytes() == twin.simulate(run, initial_displacement_m=0.01).displacement_m.tobytes()
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "sloshlab_twin: got None"),
        ("sloshlab_twin = 1", "no twin"),
        ("sloshlab_twin = 1\ncarried_mass_kg = 1.0\n[[terms]]\nname = 'nobody'\nplace = 'tank'", "force 'nobody'"),
        ("sloshlab_twin = 1\ncarried_mass_kg = 1.0\n[structure]\nmasses_kg = [1.0]", "no twin"),
        ("sloshlab_twin = 1\ncarried_mass_kg = 1.0\nhas_tables = true", "arrays beside it"),
        ("not = [toml", "not TOML"),
    ],
)
def test_files_that_are_no_twin_are_refused_in_one_line(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "t.toml").write_text(text)
    with pytest.raises(InputError) as error:
        load_twin(tmp_path / "t.toml")
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_an_unstable_twin_says_when_and_where() -> None:
    twin = sdof().with_term(VISCOUS_DAMPING(damping_n_s_per_m=-100.0))
    result = twin.simulate(free(5.0, 1000.0), initial_displacement_m=0.01)
    assert result.ending.status is Status.UNSTABLE
    # growth rate 100/(2 M): from 10 mm to 100 m in ln(1e4)/22.3 s
    assert result.ending.time_s == pytest.approx(np.log(1e4) / (100 / 2 / 2.241), rel=0.15)
    assert len(result.displacement_m) == round(result.ending.time_s * 1000)
    with pytest.raises(AnalysisError, match="mode 1 at t ="):
        result.require_done()


def test_a_ball_that_leaves_its_tank_is_reported() -> None:
    soft = BOUNCING_BALL(**{**BALL, "stiffness_n_per_m": 100.0, "hardening_per_m": 0.0, "damping_kg_per_s": 0.0})
    result = Twin(None, (soft,)).simulate(harmonic(0.05, 10.0, 1.0, 5000.0))
    assert result.ending.status is Status.FAULT
    with pytest.raises(AnalysisError, match="bouncing_ball: ball below the floor"):
        result.require_done()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: BOUNCING_BALL(**{**BALL, "radius_m": 0.031}), "less than half the tank's height"),
        (lambda: BOUNCING_BALL(**{**BALL, "stiffness_n_per_m": 1.0, "hardening_per_m": 0.0}), "carry"),
        (lambda: COULOMB_FRICTION(force_n=-1.0), "0 … 10000 N"),
        (lambda: COULOMB_FRICTION(), "got nothing"),
        (lambda: COULOMB_FRICTION(force=1.0), "parameter force"),
        (lambda: BOUNCING_BALL(place="structure", **BALL), "allowed: tank"),
        (lambda: free(0.0, 100.0), "duration_s"),
        (lambda: Excitation(-1.0, 10), "sampling_rate_hz"),
        (lambda: recorded(100.0, acceleration=[0.0, np.nan, 1.0]), "1 lost samples"),
        (lambda: recorded(100.0, acceleration=[0.0, 1.0], force_n=[1.0]), "one length"),
        (lambda: recorded(100.0), "one length"),
        (lambda: stepped_sine([5.0], [1.0, 2.0], dwell_s=1.0, change_s=1.0, sampling_rate_hz=100.0), "as many"),
        (lambda: Sensor("x", noise_std=-1.0), "noise_std"),
        (lambda: sdof().simulate(free(1.0, 100.0), initial_displacement_m=np.nan), "initial_displacement_m"),
        (lambda: run(sdof().with_term(BOUNCING_BALL(**{**BALL, "liquid_mass_kg": 3.0}))), "negative"),
        (lambda: Twin(beam()).simulate(free(2000.0, 20000.0)), "40000001 samples of 16 numbers, 4.8 GiB"),
        (lambda: run(Twin(modal_structure([1.0], [0.0], [1.0], mode_shape=[1.0]))), "base participation"),
        (lambda: run(rubbing_twice()), "at structure and tank while the base moves; allowed: one place"),
    ],
)  # fmt: skip
def test_contradictions_are_refused_in_one_line(make, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError) as error:
        make()
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_a_rig_whose_tank_model_is_not_complete_is_refused() -> None:
    text = BEAM_RIG.replace('tank_model = "viscous"', 'tank_model = "bouncing_ball"')
    with pytest.raises(RigError, match=r"twin\.parameters"):
        Twin.from_rig(Rig.from_toml_text(text))


def test_motion_of_the_stepped_sine_is_consistent_and_reaches_its_levels() -> None:
    excitation = stepped_sine([5.0, 8.0], [10.0, 20.0], dwell_s=1.0, change_s=0.5, sampling_rate_hz=4000.0)
    table = excitation.half_steps(1)
    step = 1 / 8000.0
    np.testing.assert_allclose(np.gradient(table[:, 0], step)[2:-2], table[2:-2, 1], atol=1e-4)
    np.testing.assert_allclose(np.gradient(table[:, 1], step)[2:-2], table[2:-2, 2], atol=1e-2)
    np.testing.assert_allclose(np.gradient(table[:, 3], step)[2:-2], table[2:-2, 4], rtol=1e-5)
    assert np.abs(table[4000:12000, 2]).max() == pytest.approx(10.0, rel=1e-3)
    assert np.abs(table[-8000:, 2]).max() == pytest.approx(20.0, rel=1e-3)


def test_sensors_read_with_gain_delay_high_pass_noise_and_range() -> None:
    rate, t = 1000.0, np.arange(4000) / 1000.0
    truth = np.sin(2 * np.pi * 20 * t)
    delayed = Sensor("x", gain=1.1, delay_s=0.0123).reading(truth, rate)
    np.testing.assert_allclose(delayed[200:-200], 1.1 * np.sin(2 * np.pi * 20 * (t - 0.0123))[200:-200], atol=1e-5)
    step = Sensor("x", high_pass_time_constant_s=0.5).reading(np.r_[0.0, np.ones(2000)], rate)
    np.testing.assert_allclose(step[1:], np.exp(-(np.arange(2000) + 0.5) / rate / 0.5), atol=2e-3)
    noisy = Sensor("x", noise_std=0.1).reading(np.zeros(20000), rate, generator=np.random.default_rng(1))
    assert noisy.std() == pytest.approx(0.1, rel=0.03)
    clipped = Sensor("x", range_min=-0.5, range_max=0.7).reading(truth, rate)
    assert (clipped.min(), clipped.max()) == (-0.5, 0.7)
    with pytest.raises(InputError, match="give a seed"):
        Sensor("x", noise_std=0.1).reading(truth, rate)


def test_channels_have_the_names_of_recordings_and_the_interface_force_balances() -> None:
    twin = Twin.from_rig(Rig.from_toml_text(BEAM_RIG)).with_sensor(Sensor("acceleration_tip", gain=2.0))
    result = twin.simulate(free(0.2, 2000.0), initial_displacement_m=0.005)
    channels = result.to_dataset()
    np.testing.assert_allclose(channels["acceleration_tip"], 2 * result.acceleration_m_per_s2)
    mass = 0.3 + 1000 * 0.5 * 0.0272 * 0.1172 * 0.0780
    expected = mass * result.acceleration_m_per_s2 + 3.4 * result.velocity_m_per_s
    np.testing.assert_allclose(channels["force_interface"], expected, atol=1e-10)


def test_one_stretch_or_many_give_the_same_bytes_and_tell_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(2)
    a = np.convolve(rng.standard_normal(400), np.ones(8) / 8, mode="same")
    motion = recorded(500.0, acceleration=30 * a, velocity=0.1 * a, displacement=0.001 * a)
    twin = sdof().with_term(BOUNCING_BALL(**BALL)).with_term(COULOMB_FRICTION(force_n=0.37))
    whole = twin.simulate(motion, n_substeps=10, initial_displacement_m=0.01)
    monkeypatch.setattr(preparation, "_HALF_STEPS_AT_ONCE", 20 * 37)
    told: list[tuple[int, int]] = []
    cut = twin.simulate(
        motion, n_substeps=10, initial_displacement_m=0.01, watch=lambda done, n: told.append((done, n))
    )
    assert whole.n_events > 3
    for name in ("modes", "places", "base_motion", "forces_n", "memory", "works_j", "events"):
        assert getattr(cut, name).tobytes() == getattr(whole, name).tobytes(), name
    assert told == [(min(1 + 37 * k, 400), 400) for k in range(1, 12)]


def test_an_external_force_is_part_of_the_balance_of_the_tank() -> None:
    """Push and structure together move the tank: F_interface = M a − f_ext."""
    twin = Twin(single_degree_of_freedom(2.0, 3000.0), carried_mass_kg=2.0)
    result = twin.simulate(harmonic_force(5.0, 3.0, 0.5, 2000.0))
    np.testing.assert_allclose(result.interface_force_n, -3000.0 * result.displacement_m, atol=1e-9)
    assert np.abs(result.external_force_n).max() == pytest.approx(5.0, rel=1e-4)
