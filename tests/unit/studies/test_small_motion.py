"""The study of small motion: motions with and without zero crossings, errors that are known, weights, filters."""

import json
from pathlib import Path

import numpy as np
import pytest

from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from sloshlab.reduced_order_model.regressors import Run
from studies.small_motion import errors
from studies.small_motion.__main__ import KEPT
from studies.small_motion.campaign import MODEL_RATE_HZ, TESTS, runs
from studies.small_motion.errors import (
    Judged,
    crossing_ratio,
    estimated,
    excess,
    floor,
    relative_error,
    step_at_g,
    work_ratio,
)
from studies.small_motion.figures import amplitude_figure, offset_figure
from studies.small_motion.motion import (
    BEAM_HZ,
    CARRIED,
    CARRIER_RATIO,
    LEVELS_G,
    RANDOM_TESTS,
    SLOW,
    SMALL,
    random_on_beam,
    stages,
)
from studies.small_motion.networks import N_DELAYS, LinearFirst, filtered, small_motion_filter
from studies.small_motion.recorded import mean_of
from studies.small_motion.scaled import fit_scaled, load_scaled, save_scaled, scaled_regressors
from studies.small_motion.tables import all_tables, amplitude_table, carried_table, damping_table, parts
from studies.small_motion.windows import lacks_crossing

REPOSITORY = Path(__file__).parents[3]
MOTIONS = (SLOW, SMALL, *RANDOM_TESTS, CARRIED)


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda motion: motion.name)
def test_acceleration_is_the_slope_of_the_velocity_and_the_tank_begins_at_rest(motion):
    time = np.arange(0, 10, 1e-3)
    velocity, acceleration = motion.velocity_m_per_s(time), motion.acceleration_m_per_s2(time)
    slope = (velocity[2:] - velocity[:-2]) / 2e-3
    # second difference of tones up to 40 Hz: (2π 40 · 1e-3)²/6 = 1 %
    assert np.abs(slope - acceleration[1:-1]).max() < 0.011 * np.abs(acceleration).max()
    assert motion.velocity_m_per_s([-1.0, 0.0]).tolist() == [0, 0]


def test_random_motion_has_its_level_and_most_of_it_at_the_frequency_of_the_beam():
    motion = random_on_beam("", 60.0, 0.7, 3)
    values = motion.acceleration_m_per_s2(np.arange(0, 60, 1 / 256))
    assert np.std(values) / 9.81 == pytest.approx(0.7, rel=0.03)
    power = np.abs(np.fft.rfft(values)) ** 2
    frequency = np.fft.rfftfreq(values.size, 1 / 256)
    assert frequency[np.argmax(power)] == pytest.approx(BEAM_HZ, abs=0.5)
    assert power[(frequency < 2.9) | (frequency > 41)].sum() < 1e-3 * power.sum()


def test_carried_motion_has_the_same_acceleration_and_no_zero_crossings():
    time = np.arange(0, CARRIED.duration_s, 1 / 256)
    velocity, acceleration = CARRIED.velocity_m_per_s(time), CARRIED.acceleration_m_per_s2(time)
    level, is_carried = stages(256, time.size)
    for level_g in LEVELS_G:
        here = level == level_g
        alone, carried = (acceleration[here & (is_carried == on)] for on in (False, True))
        # the slow acceleration is R f_s/f of the fast one
        assert np.std(carried) == pytest.approx(np.std(alone), rel=(CARRIER_RATIO * 0.5 / 9) ** 2)
        assert lacks_crossing(velocity)[here & ~is_carried].mean() == 0
        # |R sin| > 1 in two thirds of the time
        assert lacks_crossing(velocity)[here & is_carried].mean() == pytest.approx(2 / 3, abs=0.07)


def test_what_judges_trains_nothing():
    names = [run.name for run in runs("two_phase")]
    assert len(set(names)) == len(names)
    assert sum(run.motion in TESTS for run in runs("two_phase")) == 2 * len(TESTS)


def judged(amplitude_g, error, n=3840, truths=1, rng=None):
    """A harmonic motion of given amplitudes, a damper as the liquid, and a network that errs by a given share."""
    time = np.arange(n) / MODEL_RATE_HZ
    omega = 2 * np.pi * 8.0
    velocity = amplitude_g * 9.81 / omega * np.sin(omega * time)
    acceleration = amplitude_g * np.cos(omega * time)
    force = -3.0 * velocity
    noise = np.zeros((truths, n)) if rng is None else rng.normal(size=(truths, n))
    counts = np.ones(n, bool)
    return Judged(velocity, acceleration, force + noise, np.atleast_2d(force * (1 + error)), counts)


def test_relative_errors_and_works_are_those_that_were_put_in():
    run = judged(2.0, 0.3)
    sums = run.sums(np.ones(3840, bool))
    assert estimated(sums, relative_error).value == pytest.approx(0.3)
    assert estimated(sums, work_ratio).value == pytest.approx(1.3)


def test_what_two_liquids_do_not_share_is_the_floor_and_is_taken_from_the_error():
    run = judged(2.0, 0.0, n=38400, truths=2, rng=np.random.default_rng(1))
    sums = run.sums(np.ones(38400, bool))
    mean_square = float(np.mean(run.truths_n**2))
    # two noises of size 1: each differs from a perfect network by 1, half the square of their difference is 1
    assert estimated(sums, floor).value == pytest.approx(1 / mean_square**0.5, rel=0.02)
    assert estimated(sums, relative_error).value == pytest.approx(1 / mean_square**0.5, rel=0.02)
    assert abs(estimated(sums, excess).value) < 0.1 * estimated(sums, floor).value


def test_the_error_of_a_mean_is_that_of_the_textbook():
    values = np.random.default_rng(2).normal(size=50)
    sums = {"n": np.ones(50), "x": values}
    found = estimated(sums, lambda totals: totals["x"] / totals["n"])
    assert found.value == pytest.approx(values.mean())
    assert found.error == pytest.approx(values.std(ddof=1) / 50**0.5, rel=1e-9)
    # two networks that differ by 2: √(2/2) more, in squares
    two = {"n": np.ones(50), "x": np.stack([values, values + 2])}
    found = estimated(two, lambda totals: totals["x"] / totals["n"])
    assert found.error == pytest.approx(np.hypot(values.std(ddof=1) / 50**0.5, 1.0), rel=1e-9)


def test_errors_without_a_crossing_are_compared_at_the_same_amplitude():
    rng = np.random.default_rng(3)
    parts = []
    for amplitude in (0.3, 3.0):
        run = judged(amplitude, 0.0)
        offset = np.where(np.arange(3840) % 960 < 480, 0.0, 2 * np.abs(run.velocity_m_per_s).max())
        velocity = run.velocity_m_per_s + offset
        # errors grow with the amplitude, and are twice as large where the velocity does not cross zero
        size = amplitude * np.where(lacks_crossing(velocity), 2.0, 1.0)
        networks = run.truths_n + size * rng.normal(size=(2, 3840))
        parts.append(Judged(velocity, run.acceleration_g, run.truths_n, networks, run.counts))
    found = crossing_ratio(parts, "velocity")
    assert found.value == pytest.approx(4, abs=3 * found.error)
    assert found.error < 0.4
    assert crossing_ratio(parts, "velocity", "force").value == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("step", [0.0, 0.5])
def test_a_step_at_g_is_told_from_a_slope(step):
    levels = 1.25 ** (np.arange(-3, 3) + 0.5)
    parts = [judged(level, level**-0.7 * np.exp(step * (level > 1))) for level in levels]
    assert step_at_g(parts).value == pytest.approx(step, abs=0.02)


def test_a_linear_force_of_small_motion_is_found_and_taken_from_the_rest():
    rng = np.random.default_rng(5)
    taps = np.zeros(N_DELAYS)
    taps[:2] = (3.0, -3.0)
    velocity = 0.01 * rng.normal(size=4000)
    force = np.concatenate([np.zeros(2), 3.0 * (velocity[1:-1] - velocity[:-2])])
    found = small_motion_filter([Run(velocity, force)])
    # at samples of noise all directions are there
    assert found - found.mean() == pytest.approx(taps, abs=1e-6)
    assert filtered(found + 1.0, velocity + 5.0)[N_DELAYS:] == pytest.approx(force[N_DELAYS:], abs=1e-9)

    class Nothing:
        def simulate(self, x):
            return np.zeros_like(x)

    assert LinearFirst(found, Nothing()).simulate(velocity)[N_DELAYS:] == pytest.approx(force[N_DELAYS:], abs=1e-9)


def test_networks_see_an_offset_that_the_liquid_does_not():
    n = 1280
    velocity = np.sin(2 * np.pi * 8 * np.arange(n) / MODEL_RATE_HZ)
    signals = LiquidSignals(velocity, -velocity, 2 * np.pi * 8 * np.gradient(velocity), MODEL_RATE_HZ, "run")

    class Damper:
        def simulate(self, x):
            return -x

    inside = slice(400, 1000)
    exact = Judged.of([signals], [Damper()])
    assert exact.networks_n[0, inside] == pytest.approx(exact.truths_n[0, inside], abs=1e-12)
    shifted = Judged.of([signals], [Damper()], 0.5)
    assert shifted.networks_n[0, inside] - shifted.truths_n[0, inside] == pytest.approx(-0.5, abs=1e-6)
    assert not shifted.counts[: round(errors.BEGINNING_S * MODEL_RATE_HZ)].any()


def test_means_of_starts():
    found = mean_of([1.0, 3.0, float("nan")])
    assert (found.value, found.error) == (2.0, pytest.approx(1.0))


def cells(row):
    """Numbers of a row of Markdown, however its first cell names it and whether they are bold."""
    return tuple(cell.strip(" *") for cell in row.strip().strip("|").split("|")[1:])


def test_the_page_has_the_kept_numbers():
    results = json.loads(KEPT.read_bytes())
    page = (REPOSITORY / "docs/reduced_order_model.md").read_text(encoding="utf-8")
    section = page.partition("### Small motion")[2].partition("\n### ")[0]
    shown = {cells(row) for row in section.splitlines() if row.startswith("|")}
    computed, recorded = parts(results).values()
    rows = [*amplitude_table(computed)[2:], *amplitude_table(recorded)[2:], *carried_table(results)[2:6]]
    # of candidates without a random run and of those with copies the page has words only
    left_out = {"slow run and copies with an offset", "Galilean, weighted", "Galilean, slow and small runs"}
    wanted = [row for row in rows if row.split("|")[1].strip() not in left_out]
    assert len(wanted) == 12 + 7 + 4
    assert [row for row in wanted if cells(row) not in shown] == []
    damping = [cells(row) for row in damping_table(results)[2:]]
    assert {row[:3] for row in shown if len(row) == 4} >= set(damping)


def test_tables_and_pictures_are_made_of_the_kept_numbers():
    results = json.loads(KEPT.read_bytes())
    assert all_tables(results)
    assert amplitude_figure(results)[:4] == offset_figure(results)[:4] == b"\x89PNG"


def amplitudes(n=6000, seed=0):
    """Two tones whose level goes over two decades, and a force that is the same share of them at every level."""
    t = np.arange(n) + 1000.0 * seed
    level = 10 ** (-1 + np.sin(2 * np.pi * t / 1500))
    velocity = level * (np.sin(0.5 * t) + 0.3 * np.sin(0.83 * t + 0.4))
    force = np.concatenate([[0.0, 0.0], 3.0 * (velocity[1:-1] - velocity[:-2])])
    return Run(velocity, force), level


def test_scaled_regressors_of_a_sine_have_the_size_that_was_wanted_at_every_level():
    past = np.sin(2 * np.pi * np.arange(16)[:, None] / 16 + np.arange(5)[None, :]) * np.array([1, 2, 4, 8, 16.0])
    scale, regressors = scaled_regressors(past + 3.0, np.array([0.0, 1.0, 1.0]))
    # a whole cycle: RMS 1/√2 of the amplitude, whatever the constant velocity
    assert scale == pytest.approx(np.array([1, 2, 4, 8, 16]) / 2**0.5, rel=1e-3)
    assert (regressors[:16] ** 2).sum(axis=0) == pytest.approx(4.0, rel=1e-3)
    assert regressors[16] == pytest.approx(np.log(scale))


def test_a_scaled_network_errs_by_the_same_share_at_all_levels_and_not_with_an_offset(tmp_path):
    (training, _), (validation, _), (test, level) = (amplitudes(seed=seed) for seed in (0, 3, 7))
    model = fit_scaled([training], [validation], n_delays=8, n_neurons=8, n_epochs=15, seed=0)
    error = model.simulate(test.x) - test.y
    small, large = level < 0.05, level > 0.5
    shares = [np.sqrt(np.nanmean(error[at] ** 2) / np.mean(test.y[at] ** 2)) for at in (small, large)]
    assert max(shares) < 0.1
    save_scaled(model, tmp_path / "model.npz")
    again = load_scaled(tmp_path / "model.npz")
    assert again.simulate(test.x + 5.0)[8:] == pytest.approx(model.simulate(test.x)[8:], abs=1e-9)
    gap = test.x.copy()
    gap[100] = np.nan
    assert np.isnan(again.simulate(gap)[101:109]).all()
    assert again.simulate(gap)[109:120] == pytest.approx(model.simulate(test.x)[109:120])
