"""Runs of the virtual beam and guided tank: recordings in the format, with the physics that they should show."""

import math
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from acquisition.numerical_tank.computed_force import ComputationInterruptedError
from acquisition.numerical_tank.instability import STOPPED
from acquisition.virtual_laboratory import structure_run
from acquisition.virtual_laboratory.base_motion import RandomBaseMotion
from acquisition.virtual_laboratory.numerical_liquid import NumericalLiquid, numerical_setup
from acquisition.virtual_laboratory.shaker_run import write_virtual_run
from acquisition.virtual_laboratory.structure_computation import (
    StructureTask,
    computed_structure,
    n_steps_of,
    sampled_from_release,
)
from acquisition.virtual_laboratory.structure_rig import StructureLaboratory, structure_rig
from acquisition.virtual_laboratory.structure_run import virtual_structure_run
from sloshlab.errors import InputError
from sloshlab.recording import channels, read_recording, run_attributes
from sloshlab.rig import Rig

G = 9.81
BEAM_TEXT = """
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.30
[liquid]
density_kg_per_m3 = 1000.0
kinematic_viscosity_m2_per_s = 1.0e-6
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
"""
SDOF_TEXT = """
[tank]
height_m = 0.06
length_m = 0.10
width_m = 0.06
dry_mass_kg = 2.061
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
[structure]
kind = "sdof"
mass_kg = 2.061
stiffness_n_per_m = 3808.8
coulomb_force_n = 0.37
damping_kg_per_s = 1.58
"""
BEAM, SDOF = Rig.from_toml_text(BEAM_TEXT), Rig.from_toml_text(SDOF_TEXT)
COARSE = NumericalLiquid(layers_per_height=8)


@pytest.fixture(scope="module")
def sloshing() -> xr.Dataset:
    return virtual_structure_run(
        BEAM, experiment="beam_free", duration_s=1.0, numerical=COARSE, imperfect=False, seed=3
    )


def frozen(rig: Rig = BEAM, **settings) -> xr.Dataset:  # type: ignore[no-untyped-def]
    return virtual_structure_run(rig, configuration="frozen", numerical=COARSE, imperfect=False, **settings)


def test_a_recording_that_its_readers_take(tmp_path: Path, sloshing: xr.Dataset) -> None:
    write_virtual_run(sloshing, tmp_path / "run.nc")
    run = read_recording(tmp_path / "run.nc")
    attributes = run_attributes(run)
    assert (attributes.experiment, attributes.configuration) == ("beam_free", "sloshing")
    assert attributes.initial_displacement_m == -0.0146
    assert channels(run, "force") == ["force_interface"]
    assert channels(run, "displacement") == ["displacement_tank"]
    places = {name: run[name].attrs["x_m"] for name in channels(run, "acceleration")}
    assert places == {
        "acceleration_beam_1": 0.185,
        "acceleration_beam_2": 0.37,
        "acceleration_beam_3": 0.555,
        "acceleration_root": 0.0,
        "acceleration_tip": 0.74,
    }
    assert run["force_interface"].attrs["block_from"] == "beam"
    assert run["force_interface"].attrs["block_to"] == "tank"
    assert run.sizes["time"] == 1024
    np.testing.assert_allclose(run["force_interface"], sloshing["force_interface"], rtol=1e-6)


def test_release_is_at_time_zero(sloshing: xr.Dataset) -> None:
    """u(0) is the deflection; frozen, the first mode alone gives ω² u₀ = 6.9 g."""
    run = frozen(experiment="beam_free", duration_s=1.0)
    for each in (run, sloshing):
        assert float(each["displacement_tank"][0]) == pytest.approx(-0.0146, rel=2e-3)
    late = run["acceleration_tip"].values[400:]
    decay = math.exp(-0.0032 * 2 * math.pi * 10.87 * 0.5)
    assert np.abs(late).max() / G == pytest.approx(6.94 * decay, rel=0.15)


def test_forces_balance_at_the_tank() -> None:
    """Frozen: F = (M_dry + m_l) ü; empty: M_dry ü; both upward positive and without weight."""
    for configuration, mass_kg in (("frozen", 0.30 + 0.12433), ("empty", 0.30)):
        run = virtual_structure_run(
            BEAM,
            experiment="beam_free",
            configuration=configuration,  # type: ignore[arg-type]
            duration_s=0.5,
            numerical=COARSE,
            imperfect=False,
        )
        force, acceleration = run["force_interface"].values, run["acceleration_tip"].values
        step = float(run["force_interface"].encoding["scale_factor"])
        assert np.abs(force - mass_kg * acceleration).max() < 2 * step


def test_acceleration_and_displacement_belong_together() -> None:
    run = frozen(SDOF, experiment="sdof_free", duration_s=1.0)
    u, a = run["displacement_tank"].values, run["acceleration_tip"].values
    second = (u[:-16] - 2 * u[8:-8] + u[16:]) * 128.0**2  # over 8 samples, (ωτ)²/12 = 1 % too small
    assert np.abs(1.009 * second - a[8:-8]).max() < 0.01 * np.abs(a).max()


def test_guided_tank_of_table_2_1_frozen() -> None:
    """6.56 Hz; amplitude falls by b₁ and b₀ as energy says: d(½kA²) = −(½ b₁ ω²A² T + 4 b₀ A) per cycle."""
    run = frozen(SDOF, experiment="sdof_free", duration_s=3.0)
    u = run["displacement_tank"].values
    peaks = np.flatnonzero((u[1:-1] > u[:-2]) & (u[1:-1] >= u[2:])) + 1
    assert float(u[0]) == pytest.approx(0.064, rel=1e-3)
    assert 1024 / np.diff(peaks).mean() == pytest.approx(6.56, rel=2e-3)
    amplitude, k, mass = 0.064, 3808.8, 2.241
    for peak in peaks[:12]:
        for _ in range(100):
            amplitude -= (math.pi * 1.58 * math.sqrt(k / mass) * amplitude + 4 * 0.37) / k / 100
        assert u[peak] == pytest.approx(amplitude, rel=0.01)


def test_speed_of_sound_follows_the_experiment(sloshing: xr.Dataset) -> None:
    """64 mm at 6.56 Hz are 2.6 m/s: at least 26 m/s; c₀/4h over 2 · 226.5 Hz on the beam: 24.6 m/s."""
    run = virtual_structure_run(
        SDOF, experiment="sdof_free", duration_s=0.3, numerical=NumericalLiquid(10), imperfect=False
    )
    assert 26 <= run.attrs["speed_of_sound_m_per_s"] <= 28
    assert sloshing.attrs["speed_of_sound_m_per_s"] == 25
    with pytest.raises(InputError, match=r"speed_of_sound_m_per_s: got 20; allowed: at least 2\d\.\d, ten times"):
        virtual_structure_run(SDOF, experiment="sdof_free", duration_s=0.3, speed_of_sound_m_per_s=20.0)


def test_a_stiffer_liquid_moves_the_beam_alike(sloshing: xr.Dataset) -> None:
    """Before the liquid breaks up, its artificial compressibility must not be seen: at 12 m/s it is."""
    stiffer = virtual_structure_run(
        BEAM,
        experiment="beam_free",
        duration_s=0.25,
        numerical=COARSE,
        imperfect=False,
        seed=3,
        speed_of_sound_m_per_s=36.0,
    )
    difference = stiffer["displacement_tank"].values[:250] - sloshing["displacement_tank"].values[:250]
    assert np.abs(difference).max() < 0.01 * 0.0146


def test_sloshing_damps_the_beam(sloshing: xr.Dataset) -> None:
    late = {
        name: np.abs(run["displacement_tank"].values[-100:]).max()
        for name, run in (
            ("sloshing", sloshing),
            ("frozen", frozen(experiment="beam_free", duration_s=1.0)),
        )
    }
    assert late["sloshing"] < 0.6 * late["frozen"]


def test_same_seed_same_run_other_seed_other_run(sloshing: xr.Dataset) -> None:
    settings = {"experiment": "beam_free", "duration_s": 1.0, "numerical": COARSE, "imperfect": False}
    assert virtual_structure_run(BEAM, seed=3, **settings).identical(sloshing)  # type: ignore[arg-type]
    other = virtual_structure_run(BEAM, seed=4, **settings)  # type: ignore[arg-type]
    assert not np.array_equal(other["force_interface"], sloshing["force_interface"])


def test_random_run_has_the_asked_root_motion_and_the_beam_amplifies_it() -> None:
    run = frozen(experiment="beam_random", duration_s=20.0, rms_g=0.1, seed=5)
    root, tip = run["acceleration_root"].values, run["acceleration_tip"].values
    assert root.std() / G == pytest.approx(0.1, rel=0.02)
    assert tip.std() > 5 * root.std()
    spectrum = np.abs(np.fft.rfft(tip * np.hanning(tip.size))) ** 2
    assert np.fft.rfftfreq(tip.size, 1 / 1024)[spectrum.argmax()] == pytest.approx(10.87, abs=0.1)
    assert run_attributes(run).initial_displacement_m is None
    again = virtual_structure_run(
        BEAM, experiment="beam_random", configuration="empty", duration_s=20.0, rms_g=0.1, seed=5, imperfect=False
    )
    np.testing.assert_allclose(again["acceleration_root"], root, atol=2e-3)


def test_base_motion_is_gaussian_about_its_centre_and_consistent() -> None:
    """Spectrum (2.30), RMS, and the acceleration as second difference of the displacement."""
    motion = RandomBaseMotion(200.0, 2.0, 11.0, 2.0, seed=1)
    acceleration, displacement = motion.in_middle_of_steps(200_000)
    assert acceleration.std() == pytest.approx(2.0, rel=0.01)
    power = np.abs(np.fft.rfft(acceleration)) ** 2
    f = np.fft.rfftfreq(acceleration.size, 1e-3)
    centre = float((f * power).sum() / power.sum())
    width = math.sqrt(float(((f - centre) ** 2 * power).sum() / power.sum()))
    assert (centre, width) == (pytest.approx(11.0, abs=0.15), pytest.approx(2.0, abs=0.15))
    second = (displacement[:-2] - 2 * displacement[1:-1] + displacement[2:]) * 1e6
    assert np.abs(second - acceleration[1:-1]).max() < 0.01
    assert abs(displacement[0]) < 1e-9
    coarse = motion.in_middle_of_steps(66_666)[0]
    times = (np.arange(66_666) + 0.5) * 200 / 66_666
    fine = np.interp(times, (np.arange(200_000) + 0.5) * 1e-3, acceleration)
    assert np.abs(coarse - fine)[:-2].max() < 0.03


def test_sampling_keeps_phase_and_stops_what_would_fold() -> None:
    setup = numerical_setup(BEAM, layers_per_height=8, seed=0, sampling_rate_hz=512.0)
    time_s = (np.arange(n_steps_of(setup, 300)) + 0.5) * setup.step_s
    samples = np.arange(300) / 512.0
    for hz in (5.0, 40.0):
        kept = sampled_from_release(np.cos(2 * math.pi * hz * time_s), setup, 300)
        assert kept == pytest.approx(np.cos(2 * math.pi * hz * samples), abs=0.01)
    folded = sampled_from_release(np.cos(2 * math.pi * 460.0 * time_s), setup, 300)
    assert np.abs(folded).max() < 1e-3


def test_laboratory_differs_from_what_it_believes() -> None:
    drawn, perfect = StructureLaboratory.drawn(1, BEAM), StructureLaboratory.perfect(BEAM)
    assert all(1e-5 < abs(factor - 1) <= 0.02 for factor in drawn.frequency_factors)
    assert all(1e-4 < abs(factor - 1) <= 0.2 for factor in drawn.damping_factors)
    true, believed = structure_rig(BEAM, drawn), structure_rig(BEAM, perfect)
    believed_hz = believed.structure.with_mass_at_tank(BEAM.liquid_mass_kg).natural_frequencies_hz()
    assert believed_hz == pytest.approx([10.87, 78.31, 226.5], rel=1e-9)
    true_hz = true.structure.with_mass_at_tank(BEAM.liquid_mass_kg).natural_frequencies_hz()
    assert true_hz / believed_hz == pytest.approx(drawn.frequency_factors, rel=1e-9)


def test_gains_and_noise_of_the_sensors() -> None:
    """The same structure read by perfect and by drawn sensors: slope is the gain, scatter the noise."""
    perfect = StructureLaboratory.perfect(BEAM)
    drawn = replace(perfect, sensors=replace(StructureLaboratory.drawn(2, BEAM).sensors, dry_mass_factor=1.0))
    settings = {"experiment": "beam_free", "configuration": "frozen", "duration_s": 0.5}
    true = virtual_structure_run(BEAM, laboratory=perfect, imperfect=False, **settings)  # type: ignore[arg-type]
    read = virtual_structure_run(BEAM, laboratory=drawn, **settings)  # type: ignore[arg-type]
    for name in ("force_interface", "acceleration_tip", "displacement_tank"):
        gain, offset = np.polyfit(true[name].values, read[name].values, 1)
        noise = read[name].attrs["noise_std"]
        assert gain == pytest.approx(drawn.sensors.gain[name], abs=2e-5)
        assert offset == pytest.approx(drawn.sensors.offset_share[name] * read[name].attrs["range_max"], abs=noise)
        # the converter rounds to counts of 1/0.6 noise
        scatter = float(np.std(read[name].values - gain * true[name].values))
        assert scatter == pytest.approx(noise * math.sqrt(1 + (1 / 0.6) ** 2 / 12), rel=0.15)


class TestStopping:
    def test_interrupted_run_goes_on_to_the_same_bytes(self, tmp_path: Path, sloshing: xr.Dataset) -> None:
        saved = tmp_path / "run.checkpoint"

        def run(progress=None) -> xr.Dataset:  # type: ignore[no-untyped-def]
            return virtual_structure_run(
                BEAM,
                experiment="beam_free",
                duration_s=1.0,
                numerical=NumericalLiquid(8, saved, progress),
                imperfect=False,
                seed=3,
            )

        def interrupt(share: float) -> None:
            if share > 0.4:
                signal.raise_signal(signal.SIGTERM)

        with pytest.raises(ComputationInterruptedError, match=r"run\.checkpoint keeps"):
            run(interrupt)
        shares: list[float] = []
        finished = run(shares.append)
        assert shares[0] > 0.4
        assert shares[-1] == 1.0
        write_virtual_run(finished, tmp_path / "again.nc")
        write_virtual_run(sloshing, tmp_path / "through.nc")
        assert (tmp_path / "again.nc").read_bytes() == (tmp_path / "through.nc").read_bytes()

    def test_checkpoint_is_written_meanwhile_and_belongs_to_its_run(self, tmp_path: Path) -> None:
        setup = numerical_setup(BEAM, layers_per_height=8, seed=0, sampling_rate_hz=1024.0)
        structure = structure_rig(BEAM, StructureLaboratory.perfect(BEAM)).structure
        base = np.zeros(n_steps_of(setup, 200))
        task = StructureTask(setup, structure, base, 0.005, "sloshing", 200)
        ticks = iter(range(1000))
        whole = computed_structure(
            task, checkpoint=tmp_path / "c", saved_every_s=0.5, monotonic_s=lambda: float(next(ticks))
        )
        again = computed_structure(task, checkpoint=tmp_path / "c")
        assert again.liquid_force_n.tobytes() == whole.liquid_force_n.tobytes()
        other = StructureTask(setup, structure, base, 0.006, "sloshing", 200)
        with pytest.raises(InputError, match="checkpoint of another run"):
            computed_structure(other, checkpoint=tmp_path / "c")

    def test_unstable_run_says_so_and_keeps_what_is_valid(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def violent(self: RandomBaseMotion, n_steps: int) -> tuple[np.ndarray, np.ndarray]:
            base = np.zeros(n_steps)
            base[n_steps // 2 :] = 1e6
            return base, np.zeros(n_steps)

        monkeypatch.setattr(structure_run, "_largest_speed_m_per_s", lambda *_: 1.0)
        monkeypatch.setattr(RandomBaseMotion, "in_middle_of_steps", violent)
        run = virtual_structure_run(
            BEAM, experiment="beam_random", duration_s=1.0, numerical=COARSE, imperfect=False
        )
        assert "moves faster than sound" in run.attrs[STOPPED]
        assert 400 < run.sizes["time"] < 600
        assert np.isfinite(run["force_interface"]).all()


@pytest.mark.parametrize(
    ("rig", "settings", "what"),
    [
        (BEAM, {"experiment": "shaker_sweep"}, "experiment"),
        (BEAM, {"experiment": "sdof_free"}, "structure.kind"),
        (SDOF, {"experiment": "beam_free"}, "structure.kind"),
        (BEAM, {"experiment": "beam_free", "configuration": "boiling"}, "configuration"),
        (BEAM, {"experiment": "beam_free", "seed": -1}, "seed"),
        (BEAM, {"experiment": "beam_free", "duration_s": 0.0}, "duration_s"),
        (BEAM, {"experiment": "beam_free", "duration_s": math.nan}, "duration_s"),
        (BEAM, {"experiment": "beam_free", "sampling_rate_hz": 10.0}, "sampling_rate_hz"),
        (BEAM, {"experiment": "beam_free", "duration_s": 3000.0}, "length of the run"),
        (BEAM, {"experiment": "beam_free", "initial_displacement_m": 0.0}, "initial_displacement_m"),
        (BEAM, {"experiment": "beam_free", "initial_displacement_m": 0.3}, "speed of the tank"),
        (BEAM, {"experiment": "beam_random", "initial_displacement_m": 0.01}, "initial_displacement_m"),
        (BEAM, {"experiment": "beam_random", "rms_g": 0.0}, "base motion, rms"),
        (BEAM, {"experiment": "beam_random", "rms_g": 50.0}, "speed of the tank"),
        (BEAM, {"experiment": "beam_random", "spectrum_width_hz": -1.0}, "base motion, width_hz"),
        (BEAM, {"experiment": "beam_free", "numerical": NumericalLiquid(2)}, "layers of particles"),
        (Rig.from_toml_text(BEAM_TEXT.split("[structure]")[0]), {"experiment": "beam_free"}, "structure"),
        (Rig.from_toml_text(BEAM_TEXT.replace("width_m = 0.10\n", "")), {"experiment": "beam_free"}, "width_m"),
        (Rig.from_toml_text(BEAM_TEXT.replace("[10.87", "[40.0")), {"experiment": "beam_free"}, "frequencies_hz"),
        (
            Rig.from_toml_text(BEAM_TEXT.replace("[0.8956", "[0.1")),
            {"experiment": "beam_free"},
            "modal masses without the liquid",
        ),
        (
            Rig.from_toml_text(SDOF_TEXT.replace("\nmass_kg = 2.061", "\nmass_kg = 3.0")),
            {"experiment": "sdof_free"},
            "dry_mass_kg",
        ),
    ],
)
def test_impossible_input_is_refused_in_one_line(rig: Rig, settings: dict, what: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(InputError, match=what) as caught:
        virtual_structure_run(rig, **settings)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("rig", "experiment", "deflection_m", "duration_s"),
    [
        # a weight of 7 kg pulls the beam down by so much, says the source
        (BEAM, "beam_free", -0.0146, 8.0),
        # the guided tank is held 64 mm above its rest (chapter 2)
        (SDOF, "sdof_free", 0.064, 6.0),
    ],
)
def test_a_release_begins_where_the_source_lets_go(
    rig: Rig, experiment: str, deflection_m: float, duration_s: float
) -> None:
    run = virtual_structure_run(rig, experiment=experiment, configuration="frozen", imperfect=False)
    assert run.attrs["initial_displacement_m"] == deflection_m
    assert run.sizes["time"] == duration_s * run.attrs["sampling_rate_hz"]
    assert float(run["displacement_tank"][0]) == pytest.approx(deflection_m, rel=2e-3)


def test_liquid_and_gas_have_no_speed_of_sound() -> None:
    gas = NumericalLiquid(8, with_gas=True)
    with pytest.raises(InputError, match="speed_of_sound_m_per_s: got 20 for liquid and gas"):
        virtual_structure_run(BEAM, experiment="beam_free", numerical=gas, speed_of_sound_m_per_s=20.0)


def test_liquid_and_gas_are_computed_in_steps_that_the_beam_allows(tmp_path: Path) -> None:
    """Its third mode, 226.5 Hz with the frozen liquid, moves by less than 0.4 rad in a step."""
    gas = NumericalLiquid(8, tmp_path / "kept", with_gas=True)
    run = virtual_structure_run(BEAM, experiment="beam_free", duration_s=0.1, numerical=gas, imperfect=False)
    assert run.attrs["liquid"] == "two_phase_tank"
    assert 2 * math.pi * 226.5 * run.attrs["step_s"] < 0.4
    assert float(run["displacement_tank"][0]) == pytest.approx(-0.0146, rel=2e-3)
    # in the first tenth of a second the liquid is carried along as a mass
    frozen_run = frozen(experiment="beam_free", duration_s=0.1)
    np.testing.assert_allclose(run["displacement_tank"], frozen_run["displacement_tank"], atol=0.02 * 0.0146)
