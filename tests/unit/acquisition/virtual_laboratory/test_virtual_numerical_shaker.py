"""Shaker runs whose liquid is computed, frozen or absent; the sudden start."""

import numpy as np
import pytest

from acquisition.numerical_tank.instability import STOPPED
from acquisition.virtual_laboratory.campaign import rig_text
from acquisition.virtual_laboratory.numerical_liquid import NumericalLiquid, numerical_setup
from acquisition.virtual_laboratory.sensors import Laboratory
from acquisition.virtual_laboratory.shaker import (
    STROKE_LIMIT_M,
    Imperfections,
    SweepPlan,
    shaken,
)
from acquisition.virtual_laboratory.shaker_run import virtual_shaker_run, write_virtual_run
from sloshlab.errors import InputError
from sloshlab.recording import read_recording
from sloshlab.rig import Rig

COARSE = NumericalLiquid(layers_per_height=8)


@pytest.fixture(scope="module")
def rig() -> Rig:
    return Rig.from_toml_text(rig_text(0.5))


def total_force_n(run):
    return (run["force_cell_1"] + run["force_cell_2"]).values


@pytest.mark.parametrize(("configuration", "liquid_share"), [("empty", 0.0), ("frozen", 1.0)])
@pytest.mark.parametrize("law", ["octave", "linear", "stepped"])
def test_without_moving_liquid_the_force_is_mass_times_acceleration(rig, configuration, liquid_share, law):
    """F = M ü with M = M_dry + m_l where the liquid is frozen; a perfect sensor errs by half a count."""
    run = virtual_shaker_run(
        rig, configuration=configuration, law=law, duration_s=6.0, imperfect=False, numerical=COARSE
    )
    mass_kg = 0.61 + liquid_share * 1000.0 * 0.5 * 0.0272 * 0.1172 * 0.078
    motion = shaken(SweepPlan(3.0, law, 5.0, 20.0, 6.0))
    expected = mass_kg * motion.at(run["time"].values).acceleration
    counts = sum(run[name].encoding["scale_factor"] for name in ("force_cell_1", "force_cell_2"))
    np.testing.assert_allclose(total_force_n(run), expected, atol=0.51 * counts)
    assert run.attrs["liquid"] == configuration
    assert "layers_per_height" not in run.attrs


def test_a_fill_level_that_no_law_knows_can_be_frozen_or_computed():
    rig = Rig.from_toml_text(rig_text(0.5).replace("fill_level = 0.50", "fill_level = 0.93"))
    with pytest.raises(InputError, match="fill"):
        virtual_shaker_run(rig, configuration="frozen", duration_s=5.0)
    run = virtual_shaker_run(rig, configuration="frozen", duration_s=5.0, numerical=COARSE)
    assert run.attrs["configuration"] == "frozen"


@pytest.fixture(scope="module")
def run_and_shares(rig):
    shares = []
    liquid = NumericalLiquid(layers_per_height=8, progress=shares.append)
    run = virtual_shaker_run(rig, duration_s=5.0, acceleration_g=2.0, seed=11, numerical=liquid)
    return run, shares


def test_a_computed_run_says_how_it_was_computed(rig, run_and_shares):
    run, shares = run_and_shares
    setup = numerical_setup(rig, layers_per_height=8, seed=11, sampling_rate_hz=512.0)
    assert run.sizes["time"] == 5 * 512
    assert run.attrs["liquid"] == "numerical_tank"
    assert run.attrs["layers_per_height"] == 8
    assert run.attrs["n_particles"] == setup.n_particles == 4 * 34
    assert run.attrs["speed_of_sound_m_per_s"] == setup.liquid.speed_of_sound_m_per_s
    assert run.attrs["viscosity_m2_per_s"] == pytest.approx(1e-6)
    assert run.attrs["seed"] == 11
    assert run.attrs["experiment"] == "shaker_sweep"
    assert STOPPED not in run.attrs
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_a_computed_run_is_a_recording_that_moves_more_than_its_dry_mass(tmp_path, run_and_shares):
    run, _ = run_and_shares
    write_virtual_run(run, tmp_path / "run.nc")
    read = read_recording(tmp_path / "run.nc")
    force, acceleration = total_force_n(read), read["acceleration_control"].values
    apparent_kg = float(force @ acceleration / (acceleration @ acceleration))
    assert 0.62 < apparent_kg < 0.61 + 2 * 0.1243  # m_l is 0.1243 kg


def test_repeats_differ_in_liquid_and_motion_but_not_in_plan(rig, run_and_shares):
    run, _ = run_and_shares
    again = virtual_shaker_run(rig, duration_s=5.0, acceleration_g=2.0, seed=12, numerical=COARSE)
    assert not np.allclose(total_force_n(again), total_force_n(run), atol=0.1)
    differing = {name for name in run.attrs if run.attrs[name] != again.attrs[name]}
    assert differing == {"seed", "run_id"}


def test_a_run_that_becomes_unstable_is_a_shorter_recording(rig, monkeypatch):
    from acquisition.numerical_tank.computed_force import ComputedForce

    def unstable(*arguments, **options):
        return ComputedForce(np.zeros(700), 1.0, "numerical tank: too fast at 1.4 s")

    monkeypatch.setattr("acquisition.virtual_laboratory.numerical_liquid.computed_force", unstable)
    run = virtual_shaker_run(rig, duration_s=5.0, numerical=COARSE, lost=(1.0, 600))
    assert run.sizes["time"] == 700
    assert run.attrs[STOPPED] == "numerical tank: too fast at 1.4 s"
    assert run.attrs["sweep_duration_s"] == 5.0
    assert int(np.isnan(run["force_cell_1"].values).sum()) == 700 - 512


def test_a_run_without_one_valid_sample_is_refused(rig, monkeypatch):
    from acquisition.numerical_tank.computed_force import ComputedForce

    def unstable(*arguments, **options):
        return ComputedForce(np.zeros(0), 1.0, "too fast at 0.01 s")

    monkeypatch.setattr("acquisition.virtual_laboratory.numerical_liquid.computed_force", unstable)
    with pytest.raises(InputError, match=r"not one sample: got too fast at 0\.01 s"):
        virtual_shaker_run(rig, duration_s=5.0, numerical=COARSE)


@pytest.mark.parametrize("fill_level", ["0.0", "1.0", "1.2"])
def test_no_liquid_and_no_gas_are_refused(fill_level):
    with pytest.raises(InputError, match="fill_level"):
        Rig.from_toml_text(rig_text(0.5).replace("fill_level = 0.50", f"fill_level = {fill_level}"))


def test_the_harmonics_of_the_shaker_know_nothing_of_the_liquid():
    """The law's rig ties them to the phase of its blows, ±0.6 rad; here they are anywhere."""
    drawn = [Imperfections.drawn(np.random.default_rng(seed), impact_phase_rad=None) for seed in range(60)]
    angles = np.array([[angle for _, _, angle in imperfections.harmonics] for imperfections in drawn])
    assert np.abs(np.exp(1j * angles).mean(axis=0)).max() < 0.35
    tied = [Imperfections.drawn(np.random.default_rng(seed)) for seed in range(60)]
    tied_angles = np.array([[angle for _, _, angle in imperfections.harmonics] for imperfections in tied])
    assert np.abs(np.exp(1j * tied_angles).mean(axis=0)).min() > 0.8


def test_a_sudden_start_is_a_cosine_from_the_first_instant(rig):
    """ü = a₀ cos Ωt for t ≥ 0; displacement and velocity start from rest at −A."""
    motion = shaken(SweepPlan(3.0, "constant", 11.4, 11.4, 5.0), Imperfections.drawn(np.random.default_rng(1)))
    time_s = np.linspace(0.0, 5.0, 4001)
    moved, omega = motion.at(time_s), 2 * np.pi * 11.4
    np.testing.assert_allclose(moved.acceleration, 3 * 9.81 * np.cos(omega * time_s), atol=1e-7)
    assert moved.velocity[0] == pytest.approx(0.0, abs=1e-9)
    assert moved.displacement[0] == pytest.approx(-3 * 9.81 / omega**2)
    run = virtual_shaker_run(
        rig, experiment="sudden_start", configuration="frozen", start_hz=11.4, duration_s=5.0, numerical=COARSE
    )
    assert run.attrs["experiment"] == "other"
    assert run.attrs["sweep_law"] == "constant"
    assert run.attrs["sweep_start_hz"] == run.attrs["sweep_stop_hz"] == 11.4
    assert run["acceleration_control"].values[0] == pytest.approx(3 * 9.81, rel=0.02)


def test_a_sudden_start_beyond_the_stroke_is_refused():
    highest_g = STROKE_LIMIT_M * (2 * np.pi * 8.0) ** 2 / 9.81
    SweepPlan(0.999 * highest_g, "constant", 8.0, 8.0)
    with pytest.raises(InputError, match=r"stroke: got 12\.51 mm for .*; allowed: at most 12\.5 mm, that is 3\.2"):
        SweepPlan(1.001 * highest_g, "constant", 8.0, 8.0)
    SweepPlan(1.999 * highest_g, "constant", 8.0, 8.0, stroke_limit_m=2 * STROKE_LIMIT_M)
    with pytest.raises(InputError, match=r"allowed: at most 25 mm, that is 6\.4"):
        SweepPlan(2.001 * highest_g, "constant", 8.0, 8.0, stroke_limit_m=2 * STROKE_LIMIT_M)
    with pytest.raises(InputError, match="one frequency"):
        SweepPlan(0.1, "constant", 8.0, 9.0)


def test_a_law_belongs_to_its_experiment(rig):
    with pytest.raises(InputError, match="law: got 'constant'; allowed: octave, linear, stepped"):
        virtual_shaker_run(rig, law="constant", duration_s=5.0)


def test_the_laboratory_of_a_computed_run_is_the_same_as_ever(rig):
    laboratory = Laboratory.drawn(3)
    by_law = virtual_shaker_run(rig, configuration="empty", duration_s=5.0, laboratory=laboratory)
    computed = virtual_shaker_run(
        rig, configuration="empty", duration_s=5.0, laboratory=laboratory, numerical=COARSE
    )
    for run in (by_law, computed):
        acceleration = run["acceleration_control"].values / laboratory.gain["acceleration_control"]
        gain = laboratory.gain["force_cell_1"] / 2 + laboratory.gain["force_cell_2"] / 2
        apparent = total_force_n(run) @ acceleration / (acceleration @ acceleration)
        assert apparent == pytest.approx(0.61 * laboratory.dry_mass_factor * gain, rel=2e-3)
