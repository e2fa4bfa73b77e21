"""What of a rig may be otherwise than its file says, and in which runs it counts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import (
    DAMPING,
    NOISE,
    OMEGA,
    RATE_HZ,
    decays,
    driven,
    effect,
    motion,
    rig,
    run_of,
    surroundings,
)
from scipy.signal import lfilter

from sloshlab.identification import integration_steps, rig_model
from sloshlab.identification.diagnosed_model import Request
from sloshlab.identification.release import samples_disturbed
from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, extension_of
from sloshlab.missing_physics.extension import NOTHING, Extension, SensorFault
from sloshlab.rig import Rig
from sloshlab.twin.rate_independent_forces import HYSTERESIS
from sloshlab.twin.structure_forces import COULOMB_FRICTION

assert effects.__all__
TANK_DAMPING = 1.5
STARTS_M, DURATION_S = (0.006, 0.018), 3.0
TIP = "acceleration_tip"
BEAM = """
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.33
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
[structure]
kind = "beam"
length_m = 0.74
width_m = 0.1
thickness_m = 0.01
frequencies_hz = [10.87, 78.31]
damping_ratios = [0.01, 0.01]
modal_masses_kg = [0.8956, 4.9]
tip_mode_shape = [1.0, 1.0]
[twin]
tank_model = "frozen"
"""


@pytest.fixture(scope="module")
def damped(tmp_path_factory: pytest.TempPathFactory) -> RigModel:
    """Two decays with moving liquid and one with frozen liquid, on a rig whose liquid is a damper."""
    folder = tmp_path_factory.mktemp("damped")
    _, x, _, a = motion(0.012, DURATION_S)
    channels = {"displacement_tank": x, TIP: a}
    frozen = run_of("frozen", channels, NOISE, 7, configuration="frozen", initial_displacement_m=0.012)
    return RigModel(rig(folder, TANK_DAMPING), folder, [*decays(STARTS_M, DURATION_S), frozen])


def fluctuations(model: RigModel) -> list[str]:
    return [parameter.name for parameter in model.parameters if parameter.name.startswith("damping of the liquid")]


def test_a_liquid_that_damps_has_a_number_in_every_run_in_which_it_moves(damped: RigModel, tmp_path: Path) -> None:
    assert fluctuations(damped) == ["damping of the liquid in decay_0", "damping of the liquid in decay_1"]
    assert fluctuations(RigModel(rig(tmp_path), tmp_path, decays(STARTS_M, 1.0))) == []


def test_the_liquid_may_damp_more_in_one_run_and_as_believed_in_the_others(damped: RigModel) -> None:
    """A fifth more of the liquid's damper beside that of the structure, in the run of that name alone."""
    values = {**damped.believed, "damping of the liquid in decay_1": 1.2}
    dampers = {"decay_0": DAMPING + TANK_DAMPING, "decay_1": DAMPING + 1.2 * TANK_DAMPING, "frozen": DAMPING}
    for run in damped.runs:
        read = damped.simulate(run, values, NOTHING)["displacement_tank"]
        start = run.attributes.initial_displacement_m
        assert start is not None
        _, expected, _, _ = motion(start, DURATION_S, damping=dampers[run.name])
        assert np.abs(read - expected).max() < 1e-4 * start
        as_believed = damped.simulate(run, damped.believed, NOTHING)["displacement_tank"]
        assert np.array_equal(read, as_believed) == (run.name != "decay_1")


def test_faults_go_by_the_clock_of_the_recording(damped: RigModel) -> None:
    """A later release does not make the mains later; what leaks from another channel is late with it."""
    run, late = damped.runs[0], {**damped.believed, "instant of release in decay_0": 0.0033}
    time_s = np.arange(run.recording.sizes["time"]) / RATE_HZ
    mains = np.cos(2 * np.pi * 50.0 * time_s)
    hum = SensorFault(TIP, lambda read, *_: read + mains, None, ("hum",))
    leak = SensorFault(
        "displacement_tank",
        lambda read, _, others, __: read + 0.1 * others[TIP],
        None,
        ("leak",),
        reads_others=True,
    )
    plain = damped.simulate(run, late, NOTHING)
    read = damped.simulate(run, late, Extension(faults=(hum, leak)))
    np.testing.assert_allclose(read[TIP] - plain[TIP], mains, atol=1e-9)
    np.testing.assert_allclose(read["displacement_tank"] - plain["displacement_tank"], 0.1 * plain[TIP], atol=1e-9)


def test_the_charge_of_a_sensor_is_not_that_of_a_release(tmp_path: Path) -> None:
    """A filter smears the leap of a release over samples that nothing is compared with; they tell no charge."""
    tau = 0.2
    kept = (2 * tau * RATE_HZ - 1) / (2 * tau * RATE_HZ + 1)
    [whole] = decays((0.012,), DURATION_S, noise={})
    truth = whole.recording[TIP].values
    passed = lfilter([(1 + kept) / 2, -(1 + kept) / 2], [1.0, -kept], truth)
    passed[:3] += 2.0 * passed[:3]
    displacement = whole.recording["displacement_tank"].values
    run = run_of(
        "decay_0", {"displacement_tank": displacement, TIP: passed}, NOISE, 1, initial_displacement_m=0.012
    )
    run.recording[TIP][:] = passed
    model = RigModel(rig(tmp_path), tmp_path, [run])
    high_pass = Candidate(effect("sensor.sensor_high_pass"), surroundings(model), TIP)
    extension = extension_of((high_pass,), {f"{high_pass.key}.time_constant_s": tau})
    read = model.simulate(run, model.believed, extension)[TIP]
    first = samples_disturbed(RATE_HZ)
    np.testing.assert_allclose(read[first:], passed[first:], atol=2e-3 * np.abs(truth).max())


def participations(model: RigModel) -> list[str]:
    return [parameter.name for parameter in model.parameters if parameter.name.startswith("base participation")]


def test_the_base_drives_the_modes_of_a_beam_by_shares_of_their_own(tmp_path: Path) -> None:
    """With one mode it is the gain of the sensor at the base; what is only released needs none."""
    assert participations(RigModel(rig(tmp_path), tmp_path, driven())) == ["base participation of mode 1"]
    (tmp_path / "beam.toml").write_text(BEAM, encoding="utf-8")
    beam = Rig.from_toml(tmp_path / "beam.toml")
    both = [f"base participation of mode {k}" for k in (1, 2)]
    assert participations(RigModel(beam, tmp_path, driven())) == both
    assert participations(RigModel(beam, tmp_path, decays((0.006,), 1.0))) == []


NORMAL = {
    "frequency of mode 1": (1.0, 0.02),
    "damping of mode 1": (1.0, 0.2),
    "modal mass of mode 1": (1.0, 0.01),
    "viscous_damping.damping_n_s_per_m": (TANK_DAMPING, 0.2 * TANK_DAMPING),
    f"gain of {TIP}": (1.0, 0.01),
}


def test_masses_frequencies_losses_and_gains_may_be_off_by_what_is_normal(damped: RigModel) -> None:
    """Believed value and tolerance, at most four of them; gains 1.25, and losses 1.25 above what is believed."""
    found = {parameter.name: parameter for parameter in damped.parameters}
    for name, (believed, tolerance) in NORMAL.items():
        low, high = found[name].bounds
        assert found[name].believed == pytest.approx(believed)
        assert found[name].tolerance == pytest.approx(tolerance)
        assert (believed - low) / tolerance == pytest.approx(1.25 if "gain" in name else 4.0)
        assert (high - believed) / tolerance == pytest.approx(1.25 if "gain" in name or "damping" in name else 4.0)
    for number in ("damping of the liquid", "release of", "instant of release", "offset of displacement_tank"):
        of_one_run = [parameter for name, parameter in found.items() if name.startswith(number)]
        assert len(of_one_run) >= 2
        assert {(known.most_below, known.most_above) for known in of_one_run} == {(4.0, 4.0)}
    assert found["damping of the liquid in decay_0"].tolerance == 0.05
    assert found["averaging of the recorder"].bounds == (0.0, 0.4)


def test_steps_of_a_release_follow_friction_and_the_highest_mode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are off by a thousandth of the peak from eight times as many; half as many by five times that."""
    file = tmp_path / "rig.toml"
    file.write_text(BEAM, encoding="utf-8")
    still = np.zeros(2048)
    run = run_of(
        "release",
        {"acceleration_tip": still, "displacement_tank": still},
        {},
        1,
        experiment="beam_free",
        sampling_rate_hz=1024.0,
        initial_displacement_m=0.01,
    )
    friction = COULOMB_FRICTION(force_n=1.8)

    def released(per_period: float) -> np.ndarray:
        monkeypatch.setattr(rig_model, "_STEPS_PER_PERIOD_OF_A_RELEASE", per_period)
        model = RigModel(Rig.from_toml(file), tmp_path, [run])
        return model.simulate(run, model.believed, Extension(terms=(friction,)))["acceleration_tip"]

    default = rig_model._STEPS_PER_PERIOD_OF_A_RELEASE
    found, fewer, truth = (released(steps) for steps in (default, 0.5 * default, 8 * default))
    peak = np.abs(truth).max()
    assert np.std(found - truth) < 1e-3 * peak
    assert np.std(fewer - truth) > 5 * np.std(found - truth)


SENSORS = {"acceleration_roof_1": 1.01, "acceleration_roof_2": 0.98, "acceleration_control": 0.99}
"""Gains of the sensors of a shaker."""


def shaken(folder: Path, noise: Mapping[str, float]) -> RigModel:
    """A tank that is moved by 20 sin ωt; its sensors have gains and noise."""
    (folder / "shaker.toml").write_text(BEAM.partition("[structure]")[0] + '[twin]\ntank_model = "frozen"\n')
    moved = 20.0 * np.sin(2 * np.pi * 10.0 * np.arange(1000) / 250.0)
    channels = {name: gain * moved for name, gain in SENSORS.items()}
    run = run_of("shaken", channels, noise, 1, experiment="shaker_sweep", acceleration_g=2.0)
    return RigModel(Rig.from_toml(folder / "shaker.toml"), folder, [run])


@pytest.mark.parametrize("faulty", ["", "acceleration_roof_1", "acceleration_control"])
@pytest.mark.parametrize("noise", [{}, {"acceleration_roof_1": 1.5e-3, "acceleration_roof_2": 5e-4}])
def test_gains_of_the_sensors_that_drive_say_how_far_the_tank_moved(
    tmp_path: Path, faulty: str, noise: dict[str, float]
) -> None:
    """With all of them, and where one has a fault of its own and the others drive: what is read is what was."""
    model = shaken(tmp_path, noise)
    [run] = model.runs
    values = {f"gain of {name}": gain for name, gain in SENSORS.items()}
    fault = SensorFault(faulty, lambda read, *_: 3.0 * read, None, ("sensor.tripled", faulty))
    extension = Extension(faults=(fault,)) if faulty else NOTHING
    read = model.simulate(run, values, extension)
    for name in SENSORS:
        expected = run.recording[name].values * (3.0 if name == faulty else 1.0)
        assert np.abs(read[name] - expected)[100:-100].max() < 1e-3 * np.abs(expected).max()
    assert not any(
        parameter.is_reading
        for parameter in model.parameters
        if parameter.name in values and parameter.name in driving(model)
    )


def test_a_lone_sensor_that_drives_has_a_gain_in_every_motion(tmp_path: Path) -> None:
    """It reads two per cent too much: the base, and all that it moves, moved as much less."""
    [run] = driven()
    model = RigModel(rig(tmp_path), tmp_path, [run])
    assert "gain of acceleration_root" in model.believed
    believed = model.simulate(run, model.believed, NOTHING)["acceleration_tip"]
    found = model.simulate(run, {**model.believed, "gain of acceleration_root": 1.02}, NOTHING)["acceleration_tip"]
    np.testing.assert_allclose(found, believed / 1.02, rtol=1e-6, atol=1e-9)
    decay = RigModel(rig(tmp_path), tmp_path, decays())
    assert not any("root" in name for name in decay.believed)


def test_sensors_drive_by_their_noise(tmp_path: Path) -> None:
    """A loud one beside a quiet one adds a hundredth of its noise, where the mean of both has half of it."""
    model = shaken(tmp_path, {"acceleration_roof_1": 1.0, "acceleration_roof_2": 0.1})
    [run] = model.runs
    read = model.simulate(run, {f"gain of {name}": gain for name, gain in SENSORS.items()}, NOTHING)
    true = SENSORS["acceleration_control"] * 20.0 * np.sin(2 * np.pi * 10.0 * np.arange(1000) / 250.0)
    assert np.std((read["acceleration_control"] - true)[100:-100]) == pytest.approx(0.1, rel=0.1)


def driving(model: RigModel) -> list[str]:
    return [f"gain of {name}" for name in model.driving(model.runs[0])]


def test_a_release_is_followed_by_its_own_speed(tmp_path: Path) -> None:
    """ω x₀ is the largest: eleven steps, which are sixteen, from three times as far as four that are enough."""
    model = RigModel(rig(tmp_path), tmp_path, decays())
    near, far = model.runs
    half = 0.5 * 11.0 * 2.0 * RATE_HZ / (OMEGA * 0.018)
    loop = HYSTERESIS(stiffness_n_per_m=500.0, beta_gamma=half, beta_delta=half)
    steps = [model._lane(Request(run, model.believed, Extension((loop,)))).n_substeps for run in (near, far)]
    assert steps == [4, 16]
    assert model._lane(Request(far, model.believed, NOTHING)).n_substeps < 4


@pytest.mark.parametrize(("rate_hz", "n"), [(64.0, 8), (400.0, 2), (512.0, 1)])
def test_forces_that_average_over_a_cycle_have_steps_enough_at_low_rates(
    tmp_path: Path, rate_hz: float, n: int
) -> None:
    model = shaken(tmp_path, {})
    assert integration_steps.steps_per_sample(model.twin, rate_hz) == n
