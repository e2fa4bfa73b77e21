"""Virtual runs are valid recordings, repeatable to the byte, and hold the physics that made them."""

import numpy as np
import pytest

from acquisition.virtual_laboratory.campaign import rig_text
from acquisition.virtual_laboratory.sensors import Laboratory
from acquisition.virtual_laboratory.shaker import SweepPlan
from acquisition.virtual_laboratory.shaker_run import virtual_shaker, virtual_shaker_run, write_virtual_run
from sloshlab.errors import InputError
from sloshlab.recording import channels, read_recording, run_attributes
from sloshlab.rig import Rig

CHANNELS = [
    "acceleration_control",
    "acceleration_roof_1",
    "acceleration_roof_2",
    "force_cell_1",
    "force_cell_2",
]


@pytest.fixture(scope="module")
def rig():
    return Rig.from_toml_text(rig_text(0.5))


def force_and_acceleration(run):
    force = run["force_cell_1"].values + run["force_cell_2"].values
    acceleration = sum(run[name].values for name in CHANNELS[:3]) / 3
    return force - np.nanmean(force), acceleration - np.nanmean(acceleration)


def test_a_run_is_a_complete_recording(rig, tmp_path):
    run = virtual_shaker_run(rig, acceleration_g=3.0, duration_s=20.0, lost=(7.0, 33), n_clipped=5, seed=4)
    write_virtual_run(run, tmp_path / "run.nc")
    back = read_recording(tmp_path / "run.nc")
    assert channels(back) == CHANNELS
    for name in CHANNELS:
        # 16-bit counts are read as float32: one rounding of the scale and one of the product; no count is lost
        np.testing.assert_allclose(back[name].values, run[name].values, rtol=2.0**-22)
        step = back[name].attrs["adc_step"]
        np.testing.assert_array_equal(np.round(back[name].values / step), np.round(run[name].values / step))
        assert back[name].attrs["range_max"] == -back[name].attrs["range_min"] > 0
        assert back[name].attrs["noise_std"] > 0
    assert back["force_cell_1"].attrs["block_from"] == "shaker"
    assert back["force_cell_1"].attrs["block_to"] == "tank"
    np.testing.assert_array_equal(back["time"].values, np.arange(20 * 512) / 512)
    attributes = run_attributes(back)
    assert attributes.experiment == "shaker_sweep"
    assert attributes.sweep_start_hz == 5.0
    assert attributes.sweep_rate_octave_per_s == pytest.approx(2 / 20)
    assert back.attrs["sweep_stop_hz"] == 20.0
    assert back.attrs["sweep_law"] == "octave"
    lost = np.isnan(back["force_cell_2"].values)
    assert np.nonzero(lost)[0].tolist() == list(range(7 * 512, 7 * 512 + 33))
    np.testing.assert_array_equal((back["quality"].values & 1) == 1, lost)
    clipped = (back["quality"].values & 2) == 2
    assert 1 <= clipped.sum() <= 30
    limit = back["force_cell_1"].attrs["range_max"]
    assert np.abs(back["force_cell_1"].values[clipped]) == pytest.approx(limit)


def test_samples_are_stored_as_scaled_int16(rig, tmp_path):
    import netCDF4

    write_virtual_run(virtual_shaker_run(rig, duration_s=5.0), tmp_path / "run.nc")
    with netCDF4.Dataset(tmp_path / "run.nc") as stored:
        stored.set_auto_maskandscale(False)
        for name in CHANNELS:
            assert stored[name].dtype == np.int16
            assert stored[name].scale_factor > 0
            assert stored[name].filters()["complevel"] == 9


def test_the_same_seed_gives_the_same_bytes(rig, tmp_path):
    for name, seed in (("a", 5), ("b", 5), ("c", 6)):
        write_virtual_run(virtual_shaker_run(rig, duration_s=10.0, seed=seed), tmp_path / f"{name}.nc")
    first, second, other = ((tmp_path / f"{name}.nc").read_bytes() for name in "abc")
    assert first == second
    assert first != other


@pytest.mark.parametrize(("configuration", "liquid_mass_kg"), [("empty", 0.0), ("frozen", 0.12433)])
def test_empty_and_frozen_runs_weigh_what_rests_on_the_cells(rig, configuration, liquid_mass_kg):
    laboratory = Laboratory.drawn(9)
    run = virtual_shaker_run(
        rig, configuration=configuration, acceleration_g=3.0, duration_s=30.0, laboratory=laboratory
    )
    force, acceleration = force_and_acceleration(run)
    weighed = (force @ acceleration) / (acceleration @ acceleration)
    truth = 0.61 * laboratory.dry_mass_factor + liquid_mass_kg
    gain = laboratory.gain
    of_force = (gain["force_cell_1"] + gain["force_cell_2"]) / 2  # shares within 3 %, gains within 1 %
    of_acceleration = sum(gain[name] for name in CHANNELS[:3]) / 3
    assert weighed == pytest.approx(truth * of_force / of_acceleration, rel=1e-3)


def test_the_cells_see_the_work_that_the_liquid_dissipates(rig):
    plan = SweepPlan(4.0, start_hz=11.0, stop_hz=11.0, duration_s=20.0)
    run = virtual_shaker_run(
        rig,
        acceleration_g=4.0,
        start_hz=11.0,
        stop_hz=11.0,
        duration_s=20.0,
        imperfect=False,
        sampling_rate_hz=1408.0,
    )
    truth = virtual_shaker(rig, plan, imperfect=False)
    time_s = run["time"].values
    whole = slice(128 * 11, 128 * 187)  # whole cycles: 128 samples each
    moved = truth.motion.at(time_s)
    force, _ = force_and_acceleration(run)
    supplied = np.mean((force * moved.velocity)[whole])
    dissipated = -np.mean((truth.liquid.force_n(time_s) * moved.velocity)[whole])
    assert dissipated > 0
    assert supplied == pytest.approx(dissipated, rel=1e-3)


def test_downward_linear_stepped_and_vfa_runs_say_what_they_are(rig):
    down = virtual_shaker_run(rig, direction="down", duration_s=10.0)
    assert (down.attrs["sweep_start_hz"], down.attrs["sweep_stop_hz"]) == (20.0, 5.0)
    assert down.attrs["sweep_rate_octave_per_s"] == pytest.approx(-0.2)
    for law in ("linear", "stepped"):
        run = virtual_shaker_run(rig, law=law, duration_s=10.0, n_steps=5)
        assert run.attrs["sweep_law"] == law
        assert "sweep_rate_octave_per_s" not in run.attrs
    vfa = virtual_shaker_run(rig, experiment="shaker_vfa", acceleration_g=6.0, duration_s=10.0)
    assert vfa.attrs["experiment"] == "shaker_vfa"
    assert vfa.attrs["sweep_law"] == "vfa"


@pytest.mark.parametrize(
    ("settings", "match"),
    [
        ({"experiment": "beam_free"}, "experiment"),
        ({"configuration": "half_full"}, "configuration"),
        ({"direction": "sideways"}, "direction"),
        ({"sampling_rate_hz": 100.0}, "sampling_rate_hz"),
        ({"sampling_rate_hz": 9e5, "duration_s": 7000.0}, "length of the run"),
        ({"lost": (3.0, -1)}, "lost"),
        ({"lost": (9.0, 10)}, "lost"),
        ({"n_clipped": -2}, "n_clipped"),
        ({"seed": -1}, "seed"),
    ],
)
def test_wrong_arguments_are_refused(rig, settings, match):
    with pytest.raises(InputError, match=match):
        virtual_shaker_run(rig, **{"duration_s": 5.0, **settings})
