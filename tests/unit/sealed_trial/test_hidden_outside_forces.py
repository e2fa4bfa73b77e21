"""Hidden blows, tones, sliders, actuators, held readings and recorders against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hidden_systems import MASS_KG, OMEGA, RATE_HZ, STIFFNESS_N_PER_M, oscillator, released
from scipy.signal import bessel, freqs

from sealed_trial.case_signals import Laboratory, scales_of
from sealed_trial.hidden_physics.effect import Change
from sealed_trial.hidden_physics.outside_forces import outside_force
from sealed_trial.hidden_physics.sensor_effects import hold
from sealed_trial.hidden_physics.unknown_physics import sticky_sensor
from sealed_trial.laboratory import kernel_layout as at
from sealed_trial.laboratory.hidden_rig import drawn_rig
from sealed_trial.laboratory.prescribed_motion import Motion, acting, at_rest, random_motion
from sealed_trial.laboratory.recorder import Recorder
from sealed_trial.laboratory.system import simulate
from sealed_trial.laboratory.test_plan import drawn_plan


@pytest.mark.parametrize("alternates", [0.0, 1.0])
def test_blows_leave_the_sum_of_their_impulse_responses(alternates: float) -> None:
    """∫ F sin²(πt/w) e^{iωt} dt is F sin(ωw/2) Ω²/(ω (Ω² − ω²)) about the middle of the blow, Ω = 2π/w."""
    force, start, period, width = 5.0, 0.31, 0.4, 0.05
    numbers = {"PULSE_FORCE": force, "PULSE_START": start, "PULSE_PERIOD": period, "PULSE_WIDTH": width}
    time, run = released(oscillator(**numbers, PULSE_ALTERNATES=alternates), 0.0, 1.5)
    big = 2 * np.pi / width
    size = force * np.sin(0.5 * OMEGA * width) * big**2 / (MASS_KG * OMEGA**2 * (big**2 - OMEGA**2))
    middles = start + period * np.arange(3) + 0.5 * width
    signs = np.array([1.0, -1.0, 1.0]) if alternates else np.ones(3)
    for n in (1, 2, 3):
        after = (time > middles[n - 1] + 0.5 * width) & (time < start + n * period)
        expected = sum(
            sign * size * np.sin(OMEGA * (time[after] - middle))
            for sign, middle in zip(signs[:n], middles[:n], strict=True)
        )
        np.testing.assert_allclose(run.seen[after, at.O_DISPLACEMENT], expected, atol=1e-6 * size)
    assert np.abs(run.seen[time < start, at.O_DISPLACEMENT]).max() == 0.0


@pytest.mark.parametrize("at_tank", [0.0, 1.0])
def test_a_tone_on_the_structure_is_no_force_of_the_tank(at_tank: float) -> None:
    """Between structure and tank acts what moves the tank, less what acts on the tank from outside."""
    rate, phase, force = 55.0, 0.8, 2.0
    numbers = {"TONE_FORCE": force, "TONE_RATE": rate, "TONE_PHASE": phase, "OUTSIDE_AT_TANK": at_tank}
    time, run = released(oscillator(**numbers), 0.0, 1.0)
    tone = force * np.sin(rate * time + phase)
    x, a = run.seen[:, at.O_DISPLACEMENT], run.seen[:, at.O_ACCELERATION]
    np.testing.assert_allclose(MASS_KG * a + STIFFNESS_N_PER_M * x, tone, atol=1e-9)
    np.testing.assert_allclose(run.seen[:, at.O_INTERFACE_FORCE], MASS_KG * a - at_tank * tone, atol=1e-9)


@pytest.mark.parametrize(("up_n", "down_n"), [(3.0, 3.0), (4.0, 1.5)])
def test_a_slider_behind_a_play_takes_its_friction_times_its_way(up_n: float, down_n: float) -> None:
    """(F₊ + F₋)(2A − p − (F₊ + F₋)/k) a cycle, for a motion that it does not change: 1e5 kg."""
    play, stiffness, amplitude, heavy = 0.004, 2000.0, 0.02, 1e5
    system = oscillator(SLIDER_UP=up_n, SLIDER_DOWN=down_n, SLIDER_PLAY=play, SLIDER_STIFFNESS=stiffness)
    unity = np.ones((1, 1))
    system = replace(system, mass=heavy * unity, stiffness=heavy * OMEGA**2 * unity, base_kg=np.array([heavy]))
    time, run = released(system, amplitude, 0.7)
    x, v = run.seen[:, at.O_RELATIVE_DISPLACEMENT], run.seen[:, at.O_RELATIVE_VELOCITY]
    energy = 0.5 * heavy * v**2 + 0.5 * heavy * OMEGA**2 * x**2
    period, both = 2 * np.pi / OMEGA, up_n + down_n
    cycle = np.interp([2 * period, 4 * period], time, energy)
    expected = 2 * both * (2 * amplitude - play - both / stiffness)
    # the energy of the mass to 1e-9 a step, of which the slider takes 2e-5
    assert cycle[0] - cycle[1] == pytest.approx(expected, rel=5e-3)
    slides = run.events[run.events[:, 1] == at.D_SLIDER]
    # begins and ends once in every half cycle; it begins at its middle, unpulled
    assert len(slides) == pytest.approx(2 * 2 * 0.7 / period, abs=2)


def test_a_slider_that_never_slips_is_a_spring_with_a_play() -> None:
    numbers = {"SLIDER_UP": 1e6, "SLIDER_DOWN": 1e6, "SLIDER_STIFFNESS": 800.0}
    time, run = released(oscillator(**numbers), 0.01, 0.5)
    rate, rest = OMEGA * np.sqrt(1.25), 0.2 * 0.01  # unpulled where it was released
    np.testing.assert_allclose(
        run.seen[:, at.O_DISPLACEMENT], rest + (0.01 - rest) * np.cos(rate * time), atol=2e-8
    )


def test_what_a_base_does_of_its_command_has_the_describing_function_of_a_saturation() -> None:
    """2/π (asin r + r √(1 − r²)) of the amplitude, r = L/A; a dead zone d before it: of L + d less that of d."""
    step, rate, amplitude, limit, dead_zone = 1 / 4096, 2 * np.pi * 8.0, 3.0, 1.2, 0.5
    time = np.arange(8 * 4096) * step
    table = np.zeros((time.size, 4))
    table[:, 2] = amplitude * np.sin(rate * time)
    moved = acting(Motion(step, table), limit, dead_zone).table
    inner = slice(2 * 4096, 6 * 4096)

    def within(zone: float) -> float:
        r = zone / amplitude
        return 2 / np.pi * (np.arcsin(r) + r * np.sqrt(1 - r**2))

    for column, power in ((2, 0), (1, 1), (0, 2)):
        line = 2 * np.mean((moved[:, column] * np.exp(-1j * rate * time))[inner]) / (-1j * amplitude)
        # half a hertz of fourth order leaves 1/(1 + (0.5/8)⁴) of 8 Hz
        expected = (within(limit + dead_zone) - within(dead_zone)) / (1 + (0.5 / 8) ** 4) / (1j * rate) ** power
        assert line == pytest.approx(expected, rel=2e-4)


def test_displacement_velocity_and_acceleration_of_what_acts_belong_together() -> None:
    motion = random_motion(6.0, 0.1, 6.0, 2.0, np.random.default_rng(1))
    table = acting(motion, 0.6, 0.1).table
    change = table[4096:-4096]
    for column in (0, 1):
        slope = np.gradient(change[:, column], motion.step_s)[2:-2]
        # corners of what acts are rounded over a step
        np.testing.assert_allclose(
            slope, change[2:-2, column + 1], atol=0.02 * np.abs(change[:, column + 1]).max()
        )
    assert np.abs(acting(motion, 1e9, 0.0).table[:, 2] - motion.table[:, 2]).max() < 0.02


@pytest.mark.parametrize("frequency", [0.01, 0.1, 0.3])
def test_a_recorder_passes_what_a_bessel_filter_passes(frequency: float) -> None:
    """Order 4, 1/√2 at 0.35 of the rate, by its transfer function; straight lines between samples lose sinc²."""
    n = np.arange(4000)
    out = Recorder(filters=True).passed(np.sin(2 * np.pi * frequency * n), 0.0)[1000:]
    _, [transfer] = freqs(*bessel(4, 2 * np.pi * 0.35, analog=True, norm="mag"), worN=[2 * np.pi * frequency])
    found = 2 * np.mean(out * np.exp(-2j * np.pi * frequency * n[1000:])) / -1j
    assert found == pytest.approx(transfer * np.sinc(frequency) ** 2, rel=0.06 if frequency > 0.2 else 5e-3)


def test_a_recorder_makes_slow_motion_late_by_its_group_delay() -> None:
    """a₁/a₀ of the denominator, 0.96 samples; what was constant before stays so."""
    _, denominator = bessel(4, 2 * np.pi * 0.35, analog=True, norm="mag")
    delay = denominator[-2] / denominator[-1]
    ramp = np.arange(100.0)
    recorder = Recorder(filters=True)
    np.testing.assert_allclose(recorder.passed(ramp, 0.0)[30:], ramp[30:] - delay, rtol=1e-6)
    assert delay == pytest.approx(0.96, abs=0.01)
    np.testing.assert_allclose(recorder.passed(np.full(50, 3.0), 3.0), 3.0)


def laboratory(plan_name: str, recorder: Recorder) -> Laboratory:
    generator = np.random.default_rng(3)
    rig = replace(drawn_rig(plan_name.partition("_")[0], generator), coulomb_n=0.0, chaos=0.0)
    return Laboratory(rig, drawn_plan(plan_name, rig, generator), 7, recorder)


def test_a_tank_that_is_let_go_between_two_samples_was_held_before() -> None:
    lead = 5.4
    [early, plain] = [laboratory("sdof_decays", Recorder(lead_samples=size)).signals()[0] for size in (lead, 0.0)]
    x, shown = early["displacement_tank"], plain["displacement_tank"]
    assert x.size == shown.size
    np.testing.assert_array_equal(x[:6], x[0])
    assert x[0] == pytest.approx(shown[0], rel=1e-12)
    np.testing.assert_array_equal(early["acceleration_tip"][:6], 0.0)
    assert abs(early["acceleration_tip"][6]) > 10.0
    # the same motion 5.4 samples later, by its Fourier series between samples
    time = np.arange(x.size)
    later = np.interp(time[20:-20] - lead, time, shown)
    np.testing.assert_allclose(x[20:-20], later, atol=0.002 * np.abs(shown).max())
    # what holds the tank pulls as its spring does
    np.testing.assert_allclose(early["force_interface"][:6], plain["force_interface"][0])


def test_a_recorder_makes_all_channels_late_alike() -> None:
    [filtered, plain] = [laboratory("sdof_base", Recorder(filters=it)).signals()[0] for it in (True, False)]
    for name, values in plain.items():
        line = np.gradient(values)
        inner = slice(200, -200)
        late = -float((filtered[name] - values)[inner] @ line[inner]) / float(line[inner] @ line[inner])
        assert late == pytest.approx(0.96, abs=0.03), name


@pytest.mark.slow
def test_what_happens_outside_is_at_another_instant_in_every_run() -> None:
    plain = laboratory("sdof_base", Recorder())
    scales = scales_of(plain, plain.signals())
    for seed in range(8):
        drawn = outside_force("structure", 1.0, scales, np.random.default_rng(seed))
        change = drawn.change(1.0)
        shown = [change.kernel_of_run(number) for number in range(5)]
        assert len({tuple(numbers.values()) for numbers in shown}) == 5
        signals, still = plain.signals([change]), plain.signals()
        differences = [
            run["acceleration_tip"] - other["acceleration_tip"] for run, other in zip(signals, still, strict=True)
        ]
        assert min(np.abs(difference).max() for difference in differences) > 0.0
        assert not np.allclose(differences[0], differences[1], atol=0.1 * np.abs(differences[0]).max())


def test_a_held_reading_shows_what_was_there_at_the_last_update() -> None:
    plain = laboratory("sdof_base", Recorder())
    scales = scales_of(plain, plain.signals())
    drawn = hold(scales, np.random.default_rng(2))
    change = drawn.change(6.0)  # 50 Hz
    time = np.arange(2000) / 512.0
    slope = {name: 3.0 * time + 1.0 for name in scales.rms}
    reading = change.distorted([slope, slope], 512.0)
    for run in reading:
        values = run[drawn.channel]
        steps = np.flatnonzero(np.diff(values) > 1e-12)
        # ten or eleven samples of 512 Hz at 50 Hz, each update 3/50 higher
        assert set(np.diff(steps)) == {10, 11}
        np.testing.assert_allclose(np.diff(values)[steps[1:-1]], 3.0 / 50.0, rtol=1e-6)
        late = (slope[drawn.channel] - values)[100:-100]
        assert late.min() >= -1e-12
        assert late.mean() == pytest.approx(3.0 * 0.5 / 50.0, rel=0.02)
    assert not np.array_equal(reading[0][drawn.channel], reading[1][drawn.channel])


def test_a_sensor_with_play_turns_after_the_motion_has_gone_back_by_it() -> None:
    """Amplitude A and play 2h: the reading reaches A − h, and rests at each turn until the motion is 2h back."""
    plain = laboratory("sdof_base", Recorder())
    scales = scales_of(plain, plain.signals())
    drawn = sticky_sensor(scales, np.random.default_rng(1))
    half = 0.02 * 3.0 * scales.peak[drawn.channel]
    size = 5 * half
    wave = {name: size * np.sin(2 * np.pi * np.arange(4000) / 400) for name in scales.rms}
    [run] = drawn.change(3.0).distorted([wave], 512.0)
    values = run[drawn.channel][400:]
    assert values.max() == pytest.approx(size - half)
    # rests from the turn until A cos φ = A − 2h
    resting = np.mean(np.diff(values) == 0.0)
    assert resting == pytest.approx(2 * np.arccos(1 - 2 * half / size) / (2 * np.pi), abs=0.01)


def test_an_instant_between_samples_is_where_a_run_of_whole_samples_would_be() -> None:
    system = oscillator()
    run = simulate(system, at_rest(1.0), 0.5, RATE_HZ, deflection_m=0.02, first_s=0.3 / RATE_HZ)
    time = (np.arange(run.seen.shape[0]) + 0.3) / RATE_HZ
    np.testing.assert_allclose(run.seen[:, at.O_DISPLACEMENT], 0.02 * np.cos(OMEGA * time), atol=1e-8)
    assert run.start[at.O_DISPLACEMENT] == 0.02


def test_changes_of_no_run_are_none() -> None:
    assert Change({}).kernel_of_run(3) == {}
