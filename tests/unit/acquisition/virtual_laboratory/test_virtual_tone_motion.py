"""Random motion and two tones of the virtual shaker: spectrum, level, consistency, stroke."""

import numpy as np
import pytest

from acquisition.virtual_laboratory.campaign import rig_text
from acquisition.virtual_laboratory.numerical_liquid import NumericalLiquid
from acquisition.virtual_laboratory.shaker import STROKE_LIMIT_M
from acquisition.virtual_laboratory.shaker_run import virtual_shaker_run
from acquisition.virtual_laboratory.tone_motion import RAMP_S, random_motion, two_tone_motion
from sloshlab.errors import InputError
from sloshlab.rig import Rig

COARSE = NumericalLiquid(layers_per_height=8)
RATE_HZ = 1000.0


@pytest.fixture(scope="module")
def rig():
    return Rig.from_toml_text(rig_text(0.5))


def test_random_motion_has_its_level_in_its_band_only():
    duration_s = 40.0
    time_s = np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
    steady = (time_s > RAMP_S) & (time_s < duration_s - RAMP_S)
    moved = random_motion(1.2, 8.0, 20.0, duration_s, seed=3).at(time_s).acceleration[steady] / 9.81
    assert np.std(moved) == pytest.approx(1.2, rel=0.03)
    power = np.abs(np.fft.rfft(moved * np.hanning(moved.size))) ** 2
    frequency_hz = np.fft.rfftfreq(moved.size, 1 / RATE_HZ)
    outside = (frequency_hz < 7.8) | (frequency_hz > 20.2)
    assert power[outside].sum() < 1e-6 * power.sum()
    thirds = [power[(frequency_hz >= low) & (frequency_hz < low + 4)].sum() for low in (8, 12, 16)]
    assert np.array(thirds) / np.mean(thirds) == pytest.approx(1.0, abs=0.35)  # 160 tones each: 8 % and windows
    kurtosis = np.mean(moved**4) / np.mean(moved**2) ** 2
    assert kurtosis == pytest.approx(3.0, abs=0.3)


@pytest.mark.parametrize(
    "motion", [random_motion(1.0, 8.0, 20.0, 6.0, seed=1), two_tone_motion(2.0, 9.3, 12.1, 6.0, seed=1)]
)
def test_the_motion_starts_and_ends_at_rest_and_belongs_together(motion):
    time_s = np.linspace(0.0, 6.0, 60_001)
    moved = motion.at(time_s)
    for values in (moved.displacement, moved.velocity):
        assert values[[0, -1]] == pytest.approx(0.0, abs=1e-6)
    step_s = time_s[1]
    by_differences = np.gradient(moved.displacement, step_s)[1:-1]
    np.testing.assert_allclose(by_differences, moved.velocity[1:-1], atol=1e-4 * np.ptp(moved.velocity))
    by_differences = np.gradient(moved.velocity, step_s)[1:-1]
    np.testing.assert_allclose(by_differences, moved.acceleration[1:-1], atol=1e-4 * np.ptp(moved.acceleration))


def test_two_tones_are_two_of_the_same_acceleration():
    time_s = np.arange(1500, 4500) / RATE_HZ
    acceleration = two_tone_motion(2.0, 9.3, 12.1, 6.0, seed=5).at(time_s).acceleration
    angles = 2 * np.pi * np.outer(time_s, [9.3, 12.1])
    basis = np.concatenate([np.cos(angles), np.sin(angles)], axis=1)
    found, residual, _, _ = np.linalg.lstsq(basis, acceleration, rcond=None)
    assert np.hypot(found[:2], found[2:]) == pytest.approx(2.0 * 9.81, rel=1e-3)
    assert residual[0] < 1e-4 * np.sum(acceleration**2)


def test_seeds_differ_and_repeat():
    time_s = np.linspace(0, 5, 1000)
    first, again, other = (
        random_motion(1.0, 8.0, 20.0, 5.0, seed=seed).at(time_s).acceleration for seed in (1, 1, 2)
    )
    assert np.array_equal(first, again)
    assert abs(np.corrcoef(first, other)[0, 1]) < 0.3


def test_what_the_shaker_cannot_do_is_refused(rig):
    with pytest.raises(InputError, match=f"random motion: stroke: .*at most {1e3 * STROKE_LIMIT_M:g} mm"):
        random_motion(2.0, 5.0, 20.0, 30.0, seed=1)
    with pytest.raises(InputError, match="two tones: stroke"):
        two_tone_motion(4.0, 7.0, 9.0, 10.0, seed=1)
    with pytest.raises(InputError, match=r"random motion: stroke: .*at most 20 mm"):
        random_motion(2.0, 5.0, 20.0, 30.0, seed=1, stroke_limit_m=0.02)
    longer = two_tone_motion(4.0, 7.0, 9.0, 10.0, seed=1, stroke_limit_m=0.04)
    time_s = np.linspace(0, 10, 20_000)
    assert 0.0125 < np.abs(longer.at(time_s).displacement).max() <= 0.04
    with pytest.raises(InputError, match="start_hz and stop_hz"):
        two_tone_motion(1.0, 12.0, 9.0, 10.0, seed=1)
    with pytest.raises(InputError, match="no law"):
        virtual_shaker_run(rig, experiment="shaker_random", start_hz=8.0, duration_s=6.0)


@pytest.mark.parametrize("experiment", ["shaker_random", "shaker_two_tone"])
def test_a_recording_says_what_moved_it(rig, experiment):
    run = virtual_shaker_run(
        rig, experiment=experiment, configuration="frozen", acceleration_g=1.0, start_hz=9.0, stop_hz=15.0,
        duration_s=6.0, numerical=COARSE, seed=4,
    )  # fmt: skip
    assert run.attrs["experiment"] == "other"
    assert run.attrs["sweep_law"] == experiment.removeprefix("shaker_")
    assert (run.attrs["sweep_start_hz"], run.attrs["sweep_stop_hz"]) == (9.0, 15.0)
    force = sum(run[f"force_cell_{cell}"].values for cell in (1, 2))
    acceleration = run["acceleration_control"].values
    mass_kg = np.sum(force * acceleration) / np.sum(acceleration**2)
    assert mass_kg == pytest.approx(rig.tank.dry_mass_kg + rig.liquid_mass_kg, rel=0.03)  # gains
