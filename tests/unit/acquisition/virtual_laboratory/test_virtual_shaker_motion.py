"""The virtual shaker moves as told: law, stroke limit, consistent derivatives, stated imperfections."""

import math

import numpy as np
import pytest

from acquisition.virtual_laboratory.shaker import Imperfections, SweepPlan, shaken
from sloshlab.errors import InputError


def moved(motion, time_s):
    """u, u̇ and ü."""
    kinematics = motion.at(time_s)
    return kinematics.displacement, kinematics.velocity, kinematics.acceleration


def upward_crossings(time_s, values):
    """Times where values go from negative to positive, linear between samples."""
    at = np.nonzero((values[:-1] < 0) & (values[1:] >= 0))[0]
    return time_s[at] - values[at] * (time_s[at + 1] - time_s[at]) / (values[at + 1] - values[at])


def test_the_octave_sweep_has_the_published_cycle_boundaries():
    # (1.14): t_n = log2(2πn R ln2/Ω_i)/R; the 240 s sweep holds the cycles n = 866 … 3462
    motion = shaken(SweepPlan(acceleration_g=1.0))
    rate = 1 / 120
    numbers = np.array([866, 1500, 2400, 3462])
    times = np.log2(2 * np.pi * numbers * rate * math.log(2) / (2 * np.pi * 5)) / rate
    assert motion.phase(times) / (2 * np.pi) == pytest.approx(numbers, abs=1e-6)
    ends = motion.phase(np.array([0.0, 240.0])) / (2 * np.pi)
    assert ends[1] - ends[0] == pytest.approx(2596.85, abs=0.01)


@pytest.mark.parametrize("law", ["octave", "linear", "stepped", "vfa"])
def test_velocity_and_acceleration_are_the_derivatives(law):
    faults = Imperfections.drawn(np.random.default_rng(5))
    motion = shaken(SweepPlan(acceleration_g=3.0, law=law, duration_s=30.0), faults)
    time_s = np.linspace(3.0, 28.0, 4001)
    step = 1e-4
    u = {k: moved(motion, time_s + k * step)[0] for k in (-2, -1, 1, 2)}
    velocity, acceleration = moved(motion, time_s)[1:]
    slope = (8 * (u[1] - u[-1]) - (u[2] - u[-2])) / (12 * step)
    bend = (16 * (u[1] + u[-1]) - (u[2] + u[-2]) - 30 * moved(motion, time_s)[0]) / (12 * step**2)
    assert velocity == pytest.approx(slope, abs=1e-6 * np.abs(velocity).max())
    assert acceleration == pytest.approx(bend, abs=1e-5 * np.abs(acceleration).max())


def test_a_high_level_starts_on_the_stroke_limit_and_joins_its_iso_acceleration_line():
    motion = shaken(SweepPlan(acceleration_g=6.0))
    time_s = np.arange(0, 240, 1 / 2048)
    u, _, acceleration = moved(motion, time_s)
    assert np.abs(u).max() <= 0.0125
    early = time_s < 20
    assert np.abs(u[early]).max() == pytest.approx(0.0125, rel=1e-4)
    late = time_s > 200
    assert np.abs(acceleration[late]).max() == pytest.approx(6 * 9.81, rel=1e-3)
    # the two lines cross where 0.0125 (2πf)² = 6 g, at 10.92 Hz: less than 4 % is lost in the joint
    crossing = 120 * math.log2(math.sqrt(6 * 9.81 / 0.0125) / (2 * math.pi) / 5)
    about = np.abs(time_s - crossing) < 0.5
    assert 0.96 * 6 * 9.81 < np.abs(acceleration[about]).max() < 6 * 9.81


def test_a_shaker_of_longer_stroke_reaches_a_level_at_lower_frequencies():
    time_s = np.arange(0, 60, 1 / 2048)
    reached = {}
    for stroke_limit_m in (0.0125, 0.03):
        plan = SweepPlan(6.0, start_hz=8.2, stop_hz=8.4, duration_s=60.0, stroke_limit_m=stroke_limit_m)
        u, _, acceleration = moved(shaken(plan), time_s)
        reached[stroke_limit_m] = np.abs(u).max(), np.abs(acceleration).max()
    assert reached[0.0125][0] == pytest.approx(0.0125, rel=1e-4)
    assert reached[0.03][1] == pytest.approx(6 * 9.81, rel=1e-3)  # 0.0222 m at 8.2 Hz


@pytest.mark.parametrize(
    ("plan", "expected_hz"),
    [
        (SweepPlan(1.0, start_hz=20.0, stop_hz=5.0, duration_s=60.0), lambda t: 20 * 4 ** (-t / 60)),
        (SweepPlan(1.0, law="linear", duration_s=60.0), lambda t: 5 + 15 * t / 60),
        (SweepPlan(1.0, law="octave", duration_s=60.0), lambda t: 5 * 4 ** (t / 60)),
    ],
    ids=["down", "linear", "up"],
)
def test_the_frequency_follows_its_law(plan, expected_hz):
    motion = shaken(plan)
    time_s = np.arange(0, 60, 1 / 4096)
    crossings = upward_crossings(time_s, moved(motion, time_s)[1])
    measured = 1 / np.diff(crossings)
    # within a cycle the frequency changes; its mean is that of the middle to second order
    assert measured == pytest.approx(expected_hz((crossings[1:] + crossings[:-1]) / 2), rel=2e-4)


def test_a_stepped_run_dwells_on_frequencies_in_equal_ratios():
    motion = shaken(SweepPlan(1.0, law="stepped", duration_s=60.0, n_steps=6))
    middles = 5.0 + 10.0 * np.arange(6)
    frequency = motion.at(middles).omega_rad_per_s / (2 * np.pi)
    assert frequency == pytest.approx(5 * 4 ** (np.arange(6) / 5), rel=1e-6)
    assert motion.at(middles + 2.0).omega_rad_per_s == pytest.approx(motion.at(middles).omega_rad_per_s, rel=1e-6)


def test_a_vfa_run_visits_the_whole_plane_slowly():
    motion = shaken(SweepPlan(6.0, law="vfa"))
    time_s = np.arange(0, 240, 0.05)
    frequency = motion.at(time_s).omega_rad_per_s / (2 * np.pi)
    acceleration_g = motion.at(time_s).amplitude_m * (2 * np.pi * frequency) ** 2 / 9.81
    counts, _, _ = np.histogram2d(
        np.log2(frequency), acceleration_g, bins=(4, 4), range=((np.log2(5), np.log2(20)), (0.25, 6.0))
    )
    possible = 0.0125 * (2 * np.pi * 5 * 4 ** ((np.arange(4) + 1) / 4)) ** 2 / 9.81
    for row, highest in zip(counts, possible, strict=True):
        reachable = 0.25 + 5.75 / 4 * np.arange(4) < highest - 0.7
        assert np.all(row[reachable] > 20)
    assert np.abs(np.diff(np.log2(frequency)) / 0.05).max() < 0.07  # octave/s
    assert np.abs(np.diff(acceleration_g) / 0.05).max() < 0.6  # g/s


def test_imperfections_are_seen_and_stay_small():
    faults = Imperfections.drawn(np.random.default_rng(11))
    plan = SweepPlan(2.0, start_hz=16.0, stop_hz=16.0, duration_s=120.0)
    motion, ideal = shaken(plan, faults), shaken(plan)
    time_s = np.arange(0, 120, 1 / 1024)
    acceleration = moved(motion, time_s)[2]
    assert np.abs(acceleration[:20]).max() < 0.02 * 2 * 9.81  # it starts from rest
    assert np.abs(acceleration[-20:]).max() < 0.05 * 2 * 9.81
    middle = acceleration[4096:-4096].reshape(-1, 64)  # one cycle a row, nearly
    lines = np.abs(np.fft.rfft(middle, axis=1)) / 32
    relative = lines[:, 1] / (2 * 9.81)
    assert 0.002 < np.std(relative) < 0.012
    assert np.abs(relative - 1).max() < 0.03
    assert 0.004 < (lines[:, 2] / lines[:, 1]).mean() < 0.02
    assert 0.002 < (lines[:, 3] / lines[:, 1]).mean() < 0.02
    missed = motion.phase(time_s) - ideal.phase(time_s)
    assert 0.02 < np.std(missed) < 0.6
    assert np.abs(motion.at(time_s).omega_rad_per_s / (2 * np.pi * 16) - 1).max() < 0.005


@pytest.mark.parametrize(
    ("settings", "match"),
    [
        ({"acceleration_g": 0.0}, "acceleration_g"),
        ({"acceleration_g": math.nan}, "acceleration_g"),
        ({"acceleration_g": 1.0, "start_hz": -5.0}, "start_hz"),
        ({"acceleration_g": 1.0, "duration_s": 1e9}, "duration_s"),
        ({"acceleration_g": 1.0, "law": "sideways"}, "law"),
        ({"acceleration_g": 1.0, "n_steps": 1}, "n_steps"),
        ({"acceleration_g": 1.0, "stroke_limit_m": 0.0}, "stroke_limit_m: got 0; allowed: > 0 and ≤ 0.5"),
        ({"acceleration_g": 1.0, "stroke_limit_m": math.nan}, "stroke_limit_m"),
        ({"acceleration_g": 1.0, "stroke_limit_m": 25.0}, "stroke_limit_m"),
    ],
)
def test_impossible_plans_are_refused(settings, match):
    with pytest.raises(InputError, match=match):
        SweepPlan(**settings)
