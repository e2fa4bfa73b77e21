"""The generated force does the work of the law and looks like its regime; all measured independently."""

import itertools

import numpy as np
import pytest

from acquisition.virtual_laboratory.campaign import rig_text
from acquisition.virtual_laboratory.liquid_force import REGIMES, LiquidForce, regime, regime_weights
from acquisition.virtual_laboratory.liquid_law import dissipated_work, effective_mass
from acquisition.virtual_laboratory.shaker import Imperfections, SweepPlan, shaken
from sloshlab.rig import Rig

RATE_HZ = 2048
SCALE = np.sqrt(9.81 / 0.0272)


def liquid_on(plan, fill_level, *, seed=3, imperfect=True):
    rig = Rig.from_toml_text(rig_text(fill_level))
    faults = Imperfections.drawn(np.random.default_rng(seed)) if imperfect else None
    return LiquidForce(shaken(plan, faults), rig, seed=seed)


def cycles_of(liquid, duration_s):
    """Per cycle: work of the true force, u₀, Ω and Δf and u phasors, by quadrature and Fourier sums alone."""
    time_s = np.arange(int(duration_s * RATE_HZ)) / RATE_HZ
    moved = liquid.motion.at(time_s)
    u, velocity, acceleration = moved.displacement, moved.velocity, moved.acceleration
    force = liquid.force_n(time_s)
    power = np.concatenate([[0.0], np.cumsum(force[1:] * velocity[1:] + force[:-1] * velocity[:-1]) / 2 / RATE_HZ])
    at = np.nonzero((velocity[:-1] < 0) & (velocity[1:] >= 0))[0]
    share = -velocity[at] / (velocity[at + 1] - velocity[at])
    times = (time_s[at] + share / RATE_HZ)[15:-25]
    # the instantaneous power vanishes with the velocity at the ends: linear interpolation costs nothing
    work = -np.diff(np.interp(times, time_s, power))
    omega = 2 * np.pi / np.diff(times)
    mass = liquid.rig.liquid_mass_kg
    first = np.empty((times.size - 1, 2), dtype=complex)
    for i, (start, end) in enumerate(itertools.pairwise(times)):
        grid = start + (end - start) * np.arange(64) / 64
        rotor = np.exp(-2j * np.pi * np.arange(64) / 64) / 32
        first[i, 0] = np.interp(grid, time_s, force + mass * acceleration) @ rotor
        first[i, 1] = np.interp(grid, time_s, u) @ rotor
    return work, np.abs(first[:, 1]), omega, first[:, 0], first[:, 1]


@pytest.mark.parametrize(("acceleration_g", "fill_level"), [(1.5, 0.50), (3.0, 0.75), (4.0, 0.50), (6.0, 0.25)])
def test_work_and_effective_mass_of_the_true_force_are_the_laws(acceleration_g, fill_level):
    liquid = liquid_on(SweepPlan(acceleration_g, duration_s=120.0), fill_level)
    work, u0, omega, force, displacement = cycles_of(liquid, 120.0)
    mass = 1000 * fill_level * 0.0272 * 0.1172 * 0.0780
    expected = dissipated_work(omega / SCALE, u0 / 0.0272, fill_level) * mass * (u0 * omega) ** 2
    assert work.size > 1200
    assert work.sum() == pytest.approx(expected.sum(), rel=5e-3)
    halves = np.array_split(np.arange(work.size), 4)
    for part in halves:
        assert work[part].sum() == pytest.approx(expected[part].sum(), rel=2e-2)
    beta = (force / (mass * omega**2 * displacement)).real
    assert beta.mean() == pytest.approx(effective_mass(omega / SCALE, u0 / 0.0272, fill_level).mean(), rel=5e-3)


def test_a_calm_liquid_does_almost_no_work():
    liquid = liquid_on(SweepPlan(0.5, duration_s=60.0), 0.5)
    work, u0, omega, _, _ = cycles_of(liquid, 60.0)
    mean = work.sum() / (liquid.rig.liquid_mass_kg * (u0 * omega) ** 2).sum()
    assert abs(mean) < 2e-3


def test_cycles_scatter_more_where_it_is_chaotic():
    spread = []
    for acceleration_g in (0.5, 1.5, 5.0):
        liquid = liquid_on(SweepPlan(acceleration_g, start_hz=12, stop_hz=12, duration_s=40.0), 0.5)
        work, u0, omega, _, _ = cycles_of(liquid, 40.0)
        pairs = (work[: work.size // 2 * 2] / (liquid.rig.liquid_mass_kg * (u0 * omega) ** 2).mean()).reshape(
            -1, 2
        )
        spread.append(pairs.mean(axis=1).std())
    assert spread[0] < 0.02 < spread[1] < 0.6 * spread[2]
    assert spread[2] < 0.5


def test_a_frozen_liquid_is_only_mass():
    rig = Rig.from_toml_text(rig_text(0.5))
    frozen = LiquidForce(shaken(SweepPlan(3.0, duration_s=20.0)), rig, frozen=True)
    time_s = np.linspace(0, 20, 5001)
    expected = -1000 * 0.5 * 0.0272 * 0.1172 * 0.0780 * frozen.motion.at(time_s).acceleration
    assert frozen.force_n(time_s) == pytest.approx(expected, rel=1e-12)


def orders_of(acceleration_g, frequency_hz, fill_level=0.5):
    """Amplitude spectrum of Δf/(m_l a₀) over orders, at constant frequency, and the trace itself."""
    liquid = liquid_on(
        SweepPlan(acceleration_g, start_hz=frequency_hz, stop_hz=frequency_hz, duration_s=40.0),
        fill_level,
        imperfect=False,
    )
    n_cycles, per_cycle = 30 * frequency_hz, 64
    time_s = 4.0 + np.arange(n_cycles * per_cycle) / (per_cycle * frequency_hz)
    trace = liquid.dynamic_force_n(time_s) / (liquid.rig.liquid_mass_kg * acceleration_g * 9.81)
    lines = np.abs(np.fft.rfft(trace)) * np.sqrt(2) / trace.size  # RMS of each line
    return np.arange(lines.size) / n_cycles, lines, trace


def rms_near(orders, lines, centre, width=0.06):
    return np.sqrt(np.sum(lines[np.abs(orders - centre) < width] ** 2))


def test_faraday_waves_answer_at_half_and_three_halves():
    orders, lines, _ = orders_of(0.5, 8)
    half, three_halves = rms_near(orders, lines, 0.5), rms_near(orders, lines, 1.5)
    assert 0.03 < half < 0.2
    assert 0.01 < three_halves < half
    between = rms_near(orders, lines, 0.75)
    assert between < 0.02 * half
    assert rms_near(orders, lines, 4.0) < 0.1 * half


def test_surface_tension_keeps_17_hz_quiet_at_half_a_g():
    orders, lines, _ = orders_of(0.5, 17)
    rest = np.sqrt(np.sum(lines[np.abs(orders - 1) > 0.3] ** 2))
    assert rest < 0.02
    faraday = rms_near(*orders_of(0.5, 13)[:2], 0.5)
    assert rms_near(orders, lines, 0.5) < 0.2 * faraday


def test_impacts_are_spikes_locked_to_the_phase():
    orders, lines, trace = orders_of(1.5, 8)
    comb = np.sqrt(sum(rms_near(orders, lines, order, 0.02) ** 2 for order in range(2, 9)))
    off_comb = (orders > 1.7) & (np.abs(orders - np.round(orders)) > 0.1) & (orders < 9)
    assert comb > 3 * np.sqrt(np.sum(lines[off_comb] ** 2))
    spectrum = np.fft.rfft(trace)
    spectrum[np.abs(orders - 1) < 0.3] = 0
    beside = np.fft.irfft(spectrum, trace.size)  # without the fundamental, which the law owns
    kurtosis = np.mean(beside**4) / np.mean(beside**2) ** 2
    assert kurtosis > 4.0  # a sine has 1.5, Gaussian noise 3
    assert beside.max() > 1.4 * -beside.min()  # the roof is hit harder than the floor, and pushed up


def test_impacts_grow_softer_with_frequency_and_cease_at_17_hz():
    def comb(frequency_hz):
        orders, lines, _ = orders_of(1.5, frequency_hz)
        return np.sqrt(sum(rms_near(orders, lines, order, 0.02) ** 2 for order in range(2, 9)))

    assert comb(9) > 1.3 * comb(13) > 2 * comb(17)


@pytest.mark.parametrize("frequency_hz", [10, 13, 18])
def test_at_3_g_and_more_it_is_broad_band(frequency_hz):
    def between_the_lines(acceleration_g):
        orders, lines, _ = orders_of(acceleration_g, frequency_hz)
        apart = np.abs(2 * orders - np.round(2 * orders)) > 0.2  # neither harmonic nor subharmonic
        return np.sqrt(np.sum(lines[apart & (orders > 0.2) & (orders < 6)] ** 2))

    assert between_the_lines(3.5) > 0.1
    assert between_the_lines(3.5) > 3 * between_the_lines(1.5)


@pytest.mark.parametrize(
    ("acceleration_g", "frequency_hz", "expected"),
    [
        (0.5, 6, "faraday"),
        (0.5, 9, "faraday"),
        (0.5, 13, "faraday"),
        (0.5, 17, "quiet"),
        (1.5, 6, "impacts"),
        (1.5, 9, "impacts"),
        (1.5, 13, "impacts"),
        (1.5, 17, "faraday"),
        (3.0, 6, "chaotic"),
        (3.0, 9, "chaotic"),
        (3.0, 13, "chaotic"),
        (3.0, 17, "chaotic"),
    ],
)
def test_thesis_1_4_1_regimes_of_figure_1_6(acceleration_g, frequency_hz, expected):
    omega_bar = 2 * np.pi * frequency_hz / 18.991
    assert regime(omega_bar, acceleration_g / omega_bar**2, 0.5) == expected


def test_regime_weights_are_shares():
    omega, u = np.meshgrid(np.linspace(0, 7, 80), np.linspace(0, 0.5, 80))
    weights = regime_weights(omega, u, 0.3)
    assert weights.shape == (len(REGIMES), 80, 80)
    assert weights.min() >= 0
    assert weights.sum(axis=0) == pytest.approx(1.0)
