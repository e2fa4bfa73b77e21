"""What faults of sensors make of signals whose answer is known in closed form, and whether they can be undone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recorded_oscillators import decays, driven, effect, rig, surroundings
from scipy.signal import butter, sosfilt

from sloshlab.identification.rig_model import RigModel
from sloshlab.missing_physics import effects
from sloshlab.missing_physics.candidate import Candidate, known_effects
from sloshlab.missing_physics.extension import SensorFault
from sloshlab.missing_physics.update_rates import update_rates_hz

assert effects.__all__
RATE, N = 1000.0, 4000
T = np.arange(N) / RATE
OMEGA = 2 * np.pi * 7.3
AMPLITUDE, PHASE = 3.0, 0.4
SIGNAL = AMPLITUDE * np.cos(OMEGA * T + PHASE)
CHANNEL = "acceleration_tip"


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> RigModel:
    folder = tmp_path_factory.mktemp("sensors")
    return RigModel(rig(folder), folder, driven())


def fault(model: RigModel, name: str, numbers: Mapping[str, float], channel: str = CHANNEL) -> SensorFault:
    [found] = Candidate(effect(f"sensor.{name}"), surroundings(model), channel).extension(numbers).faults
    return found


def read(sensor_fault: SensorFault, values: np.ndarray, recorded: np.ndarray | None = None) -> np.ndarray:
    return sensor_fault.reading(values, RATE, {}, values if recorded is None else recorded)


def test_gain_makes_the_reading_larger_by_its_ratio(model: RigModel) -> None:
    sensor_fault = fault(model, "sensor_gain", {"ratio": 0.07})
    np.testing.assert_allclose(read(sensor_fault, SIGNAL), 1.07 * SIGNAL)
    assert sensor_fault.undone is not None
    np.testing.assert_allclose(sensor_fault.undone(1.07 * SIGNAL, RATE, {}, SIGNAL), SIGNAL)


@pytest.mark.parametrize("delay_s", [0.0043, -0.0021])
def test_a_delayed_channel_shows_what_was_there_earlier(model: RigModel, delay_s: float) -> None:
    sensor_fault = fault(model, "sensor_delay", {"delay_s": delay_s})
    expected = AMPLITUDE * np.cos(OMEGA * (T - delay_s) + PHASE)
    np.testing.assert_allclose(read(sensor_fault, SIGNAL)[200:-200], expected[200:-200], atol=2e-3 * AMPLITUDE)
    assert sensor_fault.undone is not None
    np.testing.assert_allclose(
        sensor_fault.undone(expected, RATE, {}, SIGNAL)[200:-200], SIGNAL[200:-200], atol=6e-3
    )


@pytest.mark.parametrize(
    ("delay_samples", "known"),
    [(3.0, slice(7, None)), (-3.0, slice(None, -7)), (0.25, slice(2, None)), (0.0, slice(None))],
)
def test_what_was_before_a_delayed_channel_is_not_known(
    model: RigModel, delay_samples: float, known: slice
) -> None:
    """A held tank reads nothing before it is released, and filters make of the jump what they will."""
    sensor_fault = fault(model, "sensor_delay", {"delay_s": delay_samples / RATE})
    recorded = SIGNAL + 100.0
    reading = read(sensor_fault, SIGNAL, recorded)
    is_known = np.zeros(SIGNAL.size, bool)
    is_known[known] = True
    expected = AMPLITUDE * np.cos(OMEGA * (T - delay_samples / RATE) + PHASE)
    np.testing.assert_allclose(reading[is_known], expected[is_known], atol=0.02 * AMPLITUDE)
    if abs(delay_samples) >= 1.0:
        np.testing.assert_allclose(reading[~is_known], recorded[~is_known])
    lost = np.full(SIGNAL.size, np.nan)
    assert np.isfinite(read(sensor_fault, SIGNAL, lost)).all()


def test_a_discharging_sensor_leads_and_loses_low_frequencies(model: RigModel) -> None:
    """jωτ/(1 + jωτ) after the charge of the first sample has leaked away."""
    tau = 0.03
    sensor_fault = fault(model, "sensor_high_pass", {"time_constant_s": tau})
    factor = 1j * OMEGA * tau / (1 + 1j * OMEGA * tau)
    steady = AMPLITUDE * np.real(factor * np.exp(1j * (OMEGA * T + PHASE)))
    np.testing.assert_allclose(read(sensor_fault, SIGNAL, steady)[400:], steady[400:], atol=2e-3 * AMPLITUDE)


@pytest.mark.parametrize("charge", [0.0, 2.0, -5.0])
def test_a_sensor_that_was_charged_before_the_run_is_no_misfit(model: RigModel, charge: float) -> None:
    tau = 0.2
    sensor_fault = fault(model, "sensor_high_pass", {"time_constant_s": tau})
    factor = 1j * OMEGA * tau / (1 + 1j * OMEGA * tau)
    steady = AMPLITUDE * np.real(factor * np.exp(1j * (OMEGA * T + PHASE)))
    recorded = steady + charge * np.exp(-T / tau)
    np.testing.assert_allclose(read(sensor_fault, SIGNAL, recorded), recorded, atol=4e-3 * AMPLITUDE)


@pytest.mark.parametrize("n", [3930, 3970])
def test_a_discharge_is_undone_but_for_a_constant_wherever_a_run_ends(model: RigModel, n: int) -> None:
    """What has leaked away by then is no zero of the recorder: taken for one it left a ramp of an amplitude."""
    tau, signal = 0.2, SIGNAL[:n]
    sensor_fault = fault(model, "sensor_high_pass", {"time_constant_s": tau})
    factor = 1j * OMEGA * tau / (1 + 1j * OMEGA * tau)
    steady = AMPLITUDE * np.real(factor * np.exp(1j * (OMEGA * T[:n] + PHASE)))
    recorded = steady + 2.0 * np.exp(-T[:n] / tau) + 0.7
    recorded[1000] = np.nan
    assert sensor_fault.undone is not None
    found = sensor_fault.undone(recorded, RATE, {}, recorded)
    assert np.isnan(found[1000])
    left = np.delete(found - signal, 1000)
    np.testing.assert_allclose(left - left.mean(), 0.0, atol=0.04 * AMPLITUDE)


def test_undoing_is_the_inverse_of_what_a_twin_reads(model: RigModel) -> None:
    """To rounding, but for a constant and the trend that eight whole cycles have."""
    sensor_fault = fault(model, "sensor_high_pass", {"time_constant_s": 0.05})
    signal = AMPLITUDE * np.cos(2 * np.pi * 8.0 * T)
    found = sensor_fault.undone(read(sensor_fault, signal, np.full(N, np.nan)), RATE, {}, signal)
    left = found - signal
    np.testing.assert_allclose(left - np.polyval(np.polyfit(T, left, 1), T), 0.0, atol=1e-10 * AMPLITUDE)


def test_a_charge_that_has_leaked_away_before_the_first_known_sample_is_none(model: RigModel) -> None:
    sensor_fault = fault(model, "sensor_high_pass", {"time_constant_s": 1.0 / RATE})
    recorded = np.where(T[-1] - 4.0 / RATE > T, np.nan, SIGNAL)
    assert np.isfinite(read(sensor_fault, SIGNAL, recorded)).all()


def test_clipping_stops_at_the_limit_of_the_channel(model: RigModel) -> None:
    sensor_fault = fault(model, "sensor_clipping", {"limit": 2.5})
    reading = read(sensor_fault, SIGNAL)
    assert reading.max() == 2.5
    assert reading.min() == -2.5
    inside = np.abs(SIGNAL) < 2.5
    np.testing.assert_array_equal(reading[inside], SIGNAL[inside])
    assert sensor_fault.undone is None


def test_drift_adds_its_rate_every_second(model: RigModel) -> None:
    reading = read(fault(model, "sensor_drift", {"rate": -0.15}), SIGNAL)
    np.testing.assert_allclose(np.diff(reading - SIGNAL), -0.15 / RATE)
    assert reading[0] == SIGNAL[0]


def test_a_drift_of_runs_adds_to_every_run_its_own(tmp_path: Path) -> None:
    pair = RigModel(rig(tmp_path), tmp_path, decays(duration_s=1.5))
    runs = tuple(run.name for run in pair.runs)
    drift = effect("sensor.drift_of_runs").of_runs(runs)
    candidate = Candidate(drift, replace(surroundings(pair), runs=runs), CHANNEL)
    rates = {"rate in decay_0": 0.7, "rate in decay_1": -0.2}
    for run, rate in zip(pair.runs, rates.values(), strict=True):
        plain = pair.simulate(run, pair.believed, candidate.extension(dict.fromkeys(rates, 0.0)))
        drifted = pair.simulate(run, pair.believed, candidate.extension(rates))
        expected = rate * np.arange(plain[CHANNEL].size) / run.attributes.sampling_rate_hz
        np.testing.assert_allclose(drifted[CHANNEL] - plain[CHANNEL], expected, atol=1e-12)
        np.testing.assert_array_equal(drifted["displacement_tank"], plain["displacement_tank"])


def test_a_rate_of_updates_does_not_grow_with_the_size_of_a_step(model: RigModel) -> None:
    """A hold is met within a cycle over the run; a step of its size would leave that place."""
    at = replace(surroundings(model), update_rates_hz={CHANNEL: (61.7,)})
    hold = Candidate(effect("sensor.sample_and_hold"), at, CHANNEL)
    [start] = hold.starts()
    assert hold.sized(start, 1.5) == start
    gain = Candidate(effect("sensor.sensor_gain"), at, CHANNEL)
    assert list(gain.sized(gain.starts()[0], 1.5).values()) == [1.5 * v for v in gain.starts()[0].values()]


@pytest.mark.parametrize(
    ("name", "line_hz"), [("mains_hum", 50.04), ("mains_hum", 49.93), ("mains_hum_60", 60.02)]
)
def test_hum_finds_the_phase_and_the_frequency_of_the_mains(model: RigModel, name: str, line_hz: float) -> None:
    line = 0.2 * np.cos(2 * np.pi * line_hz * T + 1.9)
    sensor_fault = fault(model, name, {"amplitude": 0.2})
    np.testing.assert_allclose(read(sensor_fault, SIGNAL, SIGNAL + line) - SIGNAL, line, atol=0.03 * 0.2)
    half = fault(model, name, {"amplitude": 0.1})
    np.testing.assert_allclose(read(half, SIGNAL, SIGNAL + line) - SIGNAL, 0.5 * line, atol=0.03 * 0.1)
    assert sensor_fault.undone is not None
    np.testing.assert_allclose(sensor_fault.undone(SIGNAL + line, RATE, {}, SIGNAL + line), SIGNAL, atol=0.06)


def test_no_hum_where_the_recording_is_too_slow_for_it(model: RigModel) -> None:
    sensor_fault = fault(model, "mains_hum", {"amplitude": 0.2})
    np.testing.assert_array_equal(sensor_fault.reading(SIGNAL, 90.0, {}, SIGNAL), SIGNAL)


def test_a_fast_clock_shows_later_instants(model: RigModel) -> None:
    ratio = 8e-4
    sensor_fault = fault(model, "clock_skew", {"ratio": ratio})
    expected = AMPLITUDE * np.cos(OMEGA * (1 + ratio) * T + PHASE)
    np.testing.assert_allclose(read(sensor_fault, SIGNAL)[:-10], expected[:-10], atol=2e-3 * AMPLITUDE)
    assert sensor_fault.undone is not None
    np.testing.assert_allclose(
        sensor_fault.undone(expected, RATE, {}, SIGNAL)[:-10], SIGNAL[:-10], atol=4e-3 * AMPLITUDE
    )


def held(update_rate_hz: float, phase: float, values: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Readings at every sample of what was there at the last update; updates at (k + phase)/rate."""
    last = np.floor(T * update_rate_hz - phase + 1e-9)
    return values((last + phase) / update_rate_hz)


def wave(t: np.ndarray) -> np.ndarray:
    return AMPLITUDE * np.cos(OMEGA * t + PHASE)


def test_a_held_sine_has_images_about_the_update_rate(model: RigModel) -> None:
    """Eight samples an update: lines at f and 125 ± f of A |sin 8x/(8 sin x)|, x = π f'/1000; 3.5 samples late."""
    line_hz, n = 7.25, 8
    signal = AMPLITUDE * np.cos(2 * np.pi * line_hz * T)
    recorded = np.repeat(signal[::n], n)
    reading = read(fault(model, "sample_and_hold", {"update_rate_hz": 125.0}), signal, recorded)[n:]
    time = T[n:]
    for found_hz in (line_hz, 125.0 - line_hz, 125.0 + line_hz):
        x = np.pi * found_hz / RATE
        # a whole number of cycles of every line is 3984 samples less what makes it up
        amplitude = 2 * np.mean((reading * np.exp(-2j * np.pi * found_hz * time)) * np.hanning(time.size)) * 2
        assert abs(amplitude) == pytest.approx(AMPLITUDE * abs(np.sin(n * x) / (n * np.sin(x))), rel=2e-3)
        if found_hz == line_hz:
            assert np.angle(amplitude) == pytest.approx(-2 * np.pi * line_hz * 3.5 / RATE, abs=2e-3)


@pytest.mark.parametrize(
    ("update_rate_hz", "phase"), [(61.7, 0.37), (200.0, 0.9), (143.3, 0.0), (50.0, 0.55), (100.0, 0.31)]
)
def test_a_held_reading_is_told_to_a_part_of_a_sample(
    model: RigModel, update_rate_hz: float, phase: float
) -> None:
    recorded = held(update_rate_hz, phase, wave)
    reading = read(fault(model, "sample_and_hold", {"update_rate_hz": update_rate_hz}), SIGNAL, recorded)
    # an update that falls next to a sample may be taken for the one after it
    right = np.abs(reading - recorded) < 5e-3 * AMPLITUDE
    assert right.mean() > 0.98
    assert np.abs(reading - recorded).max() < 1.1 * AMPLITUDE * OMEGA / update_rate_hz


@pytest.mark.parametrize("update_rate_hz", [61.7, 143.3, 200.0])
def test_the_rate_of_updates_is_read_from_a_noisy_recording(update_rate_hz: float) -> None:
    noise = 0.01 * AMPLITUDE * np.random.default_rng(3).standard_normal(N)
    found = update_rates_hz([held(update_rate_hz, 0.4, wave) + noise], RATE, 20.0)
    # a tenth of an update over the run
    assert min(abs(rate - update_rate_hz) for rate in found) < 0.1 * RATE / N


@pytest.mark.parametrize("noise", [0.01, 0.03])
def test_the_rate_is_read_beside_lines_of_the_motion(noise: float) -> None:
    """Steps are higher where the motion is faster: lines at twice its frequency, and beside the rate at as much.

    With little noise those beside the rate are stronger than its own, with more the line of the motion is nearly
    all of the power of the squared differences, and says nothing of the noise.
    """
    motion_hz, sampling_rate_hz = 9.4, 400.0
    update_rate_hz = 0.56 * sampling_rate_hz + 0.37
    time = np.arange(N) / sampling_rate_hz
    updates = (np.floor(time * update_rate_hz - 0.3) + 0.3) / update_rate_hz
    own = noise * np.random.default_rng(3).standard_normal(N)
    signal = [np.sin(2 * np.pi * motion_hz * at) + own for at in (updates, time)]
    found, of_none = (update_rates_hz([each], sampling_rate_hz, 2.5 * motion_hz) for each in signal)
    assert min((abs(rate - update_rate_hz) for rate in found), default=np.inf) < 0.1 * sampling_rate_hz / N
    assert of_none == ()


@pytest.mark.parametrize("noise", [1e-3, 0.01, 0.1])
def test_a_reading_that_is_not_held_has_no_rate(noise: float) -> None:
    generator = np.random.default_rng(4)
    found = [update_rates_hz([SIGNAL + noise * generator.standard_normal(N)], RATE, 20.0) for _ in range(20)]
    assert found.count(()) == 20


def test_the_rate_is_read_behind_the_filter_of_a_recorder_from_several_decays() -> None:
    """Steps of a decay are largest in its first cycle, a filter at a third of the sampling rate rounds them."""
    sampling_rate_hz, update_rate_hz, motion_hz = 1024.0, 421.15, 11.0
    filter_ = butter(2, 0.35, fs=1.0, output="sos")
    generator, time = np.random.default_rng(5), np.arange(4096) / sampling_rate_hz

    def recorded(at: np.ndarray) -> np.ndarray:
        decay = 20.0 * np.exp(-0.8 * at) * np.cos(2 * np.pi * motion_hz * at)
        return np.asarray(sosfilt(filter_, decay) + 0.15 * generator.standard_normal(time.size))

    shares = (0.0, 0.2, 0.4, 0.6)
    recordings = [recorded((np.floor(time * update_rate_hz - each) + each) / update_rate_hz) for each in shares]
    found = update_rates_hz(recordings, sampling_rate_hz, 2.5 * motion_hz)
    assert min((abs(rate - update_rate_hz) for rate in found), default=np.inf) < 0.1 * sampling_rate_hz / 4096
    # in this noise no run alone shows it
    assert [update_rates_hz([each], sampling_rate_hz, 2.5 * motion_hz) for each in recordings] == [()] * 4
    assert update_rates_hz([recorded(time) for _ in shares], sampling_rate_hz, 2.5 * motion_hz) == ()
    assert update_rates_hz(recordings, sampling_rate_hz, 0.6 * sampling_rate_hz) == ()
    # a run at rest has no motion by which the slowest rate is known
    assert update_rates_hz([np.zeros(time.size)], sampling_rate_hz, 0.0) == ()


def test_a_hold_is_sought_where_a_recording_shows_one(model: RigModel) -> None:
    at = surroundings(model)
    hold = effect("sensor.sample_and_hold")
    assert list(hold.places(at)) == []
    shown = replace(at, update_rates_hz={CHANNEL: (61.7, 123.4)})
    assert list(hold.places(shown)) == [CHANNEL]
    starts = Candidate(hold, shown, CHANNEL).starts()
    assert [list(start.values()) for start in starts] == [[61.7], [123.4]]
    # in steps that slip a part of an update over the longest run
    assert Candidate(hold, shown, CHANNEL).scale("update_rate_hz") == pytest.approx(1 / at.longest_run_s)


def test_cross_talk_adds_a_share_of_the_other_channel(model: RigModel) -> None:
    other = np.sin(3 * T)
    sensor_fault = fault(model, "cross_talk", {"ratio": 0.25}, f"{CHANNEL}<acceleration_root")
    assert sensor_fault.channel == CHANNEL
    np.testing.assert_allclose(
        sensor_fault.reading(SIGNAL, RATE, {"acceleration_root": other}, SIGNAL), SIGNAL + 0.25 * other
    )
    assert sensor_fault.undone is not None
    back = sensor_fault.undone(SIGNAL + 0.25 * other, RATE, {"acceleration_root": other}, SIGNAL)
    np.testing.assert_allclose(back, SIGNAL)


def test_a_fast_clock_keeps_the_size_of_what_has_seven_samples_per_cycle(model: RigModel) -> None:
    """Straight lines between samples would take a tenth of it; a lost sample loses its neighbours only."""
    fast = np.cos(2 * np.pi * 150.0 * T)
    sensor_fault = fault(model, "clock_skew", {"ratio": 8e-4})
    expected = np.cos(2 * np.pi * 150.0 * (1 + 8e-4) * T)
    np.testing.assert_allclose(read(sensor_fault, fast)[10:-20], expected[10:-20], atol=5e-3)
    gappy = np.where(T[2000] == T, np.nan, fast)
    found = read(sensor_fault, gappy)
    assert 1 <= np.isnan(found).sum() <= 2
    np.testing.assert_array_equal(np.isnan(read(sensor_fault, np.full(N, np.nan))), True)


def test_a_leak_from_what_moves_alike_is_a_gain_and_is_not_sought(model: RigModel) -> None:
    """On a shaker all accelerometers read one motion and all cells one force; on a structure they do not."""
    channels = {"acceleration_roof_1": 9.0, "acceleration_roof_2": 9.0, "force_cell_1": 4.0, "force_cell_2": 4.0}
    carried = replace(surroundings(model), channels=channels)
    shaken = replace(carried, twin=replace(carried.twin, structure=None))
    leaks = effect("sensor.cross_talk")
    assert "acceleration_roof_1<acceleration_roof_2" in leaks.places(carried)
    assert sorted(leaks.places(shaken)) == sorted(
        f"{to}<{source}"
        for motion in ("acceleration_roof_1", "acceleration_roof_2")
        for force in ("force_cell_1", "force_cell_2")
        for to, source in ((motion, force), (force, motion))
    )


def test_at_one_frequency_the_base_leaks_only_into_what_it_does_not_move_alike(model: RigModel) -> None:
    """A tank at its resonance moves at one frequency, the base that drives it need not."""
    channels = {"acceleration_tip": 9.0, "displacement_tank": 1e-3, "acceleration_root": 2.0}
    at = replace(surroundings(model), channels=channels, has_one_frequency=True)
    leaks = effect("sensor.cross_talk")
    into_the_base = {"acceleration_root<acceleration_tip", "acceleration_root<displacement_tank"}
    assert set(leaks.places(at)) == into_the_base
    unlike = replace(at, incoherent_with_base=frozenset({"acceleration_tip"}))
    assert set(leaks.places(unlike)) == into_the_base | {"acceleration_tip<acceleration_root"}


@pytest.mark.parametrize(
    ("place", "most"),
    [
        ("acceleration_tip<acceleration_root", 0.2 * 9.0 / 2.0),
        ("acceleration_root<acceleration_tip", 0.1),
        ("acceleration_tip<displacement_tank", 0.1 * 9.0 / 1e-3),
        ("acceleration_root<displacement_tank", 0.1 * 2.0 / 1e-3),
    ],
)
def test_a_leak_adds_a_tenth_of_a_reading_and_a_fifth_from_a_channel_of_its_kind(
    model: RigModel, place: str, most: float
) -> None:
    """Of what the base itself reads a tenth, or of what leaks into it where it rests."""
    channels = {"acceleration_tip": 9.0, "displacement_tank": 1e-3, "acceleration_root": 2.0}
    leak = Candidate(effect("sensor.cross_talk"), replace(surroundings(model), channels=channels), place)
    [ratio] = leak.effect.parameters
    assert leak.bounds(ratio) == (pytest.approx(-most), pytest.approx(most))


def test_a_leak_of_the_base_shows_in_the_readings_of_the_tip(model: RigModel) -> None:
    candidate = Candidate(effect("sensor.cross_talk"), surroundings(model), f"{CHANNEL}<acceleration_root")
    [run] = model.runs
    before = model.simulate(run, model.believed, Candidate.extension(candidate, {"ratio": 0.0}))[CHANNEL]
    after = model.simulate(run, model.believed, candidate.extension({"ratio": 0.1}))[CHANNEL]
    np.testing.assert_allclose(after - before, 0.1 * run.recording["acceleration_root"].values, atol=1e-12)


def test_starts_are_of_the_size_of_their_channel(model: RigModel) -> None:
    """So that a hum of micrometres and one of volts are both begun with two per cent."""
    at = surroundings(model)
    for name in ("acceleration_tip", "acceleration_root"):
        [start] = Candidate(effect("sensor.mains_hum"), at, name).starts()
        assert list(start.values()) == [pytest.approx(0.02 * at.channels[name])]
        limits = [
            value
            for start in Candidate(effect("sensor.sensor_clipping"), at, name).starts()
            for value in start.values()
        ]
        assert limits == pytest.approx([at.peaks[name], 0.97 * at.peaks[name], 0.8 * at.peaks[name]])


def test_a_channel_that_alone_drives_is_offered_only_faults_that_can_be_undone(model: RigModel) -> None:
    at = surroundings(model)
    assert at.driving == ("acceleration_root",)
    for known_effect in known_effects():
        if (
            known_effect.block != "sensor"
            or known_effect.name == "cross_talk"
            or not known_effect.extension.__module__.startswith("sloshlab.")
        ):
            continue
        if known_effect.name == "sample_and_hold":  # see the test of its places
            continue
        if any(parameter.each_run for parameter in known_effect.parameters) and not at.runs:
            continue
        [made] = Candidate(known_effect, at, CHANNEL).extension(dict(known_effect.starts(at)[0])).faults
        assert ("acceleration_root" in known_effect.places(at)) == (made.undone is not None), known_effect.name


def test_a_fault_of_the_base_accelerometer_changes_what_drives(model: RigModel) -> None:
    """A reading too small by a tenth stands for a base that moves 1/0.9 as much, and so does the tip."""
    [run] = model.runs
    candidate = Candidate(effect("sensor.sensor_gain"), surroundings(model), "acceleration_root")
    before = model.simulate(run, model.believed, candidate.extension({"ratio": 0.0}))[CHANNEL]
    after = model.simulate(run, model.believed, candidate.extension({"ratio": -0.1}))[CHANNEL]
    np.testing.assert_allclose(after, before / 0.9, atol=1e-6 * np.abs(before).max())


def test_a_fault_changes_its_own_channel_and_no_other(tmp_path: Path) -> None:
    pair = RigModel(rig(tmp_path), tmp_path, decays((0.01,), 1.0))
    at = replace(surroundings(pair), runs=("decay_0",))
    [run] = pair.runs
    before = pair.simulate(
        run, pair.believed, Candidate(effect("sensor.sensor_gain"), at, CHANNEL).extension({"ratio": 0.0})
    )
    for known_effect in known_effects():
        if (
            known_effect.block != "sensor"
            or known_effect.name == "cross_talk"
            or not known_effect.extension.__module__.startswith("sloshlab.")
        ):
            continue
        candidate = Candidate(known_effect.of_runs(at.runs), at, CHANNEL)
        numbers = {name.rpartition(".")[2]: value for name, value in candidate.starts()[-1].items()}
        if known_effect.name == "sensor_clipping":
            numbers = {"limit": 0.5 * at.peaks[CHANNEL]}
        after = pair.simulate(run, pair.believed, candidate.extension(numbers))
        assert not np.array_equal(after[CHANNEL], before[CHANNEL]), known_effect.name
        np.testing.assert_array_equal(after["displacement_tank"], before["displacement_tank"])
