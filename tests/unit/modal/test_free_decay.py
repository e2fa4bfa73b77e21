"""What a free decay marks and refuses."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.errors import AnalysisError
from sloshlab.modal.free_decay import analyse_free_decay
from sloshlab.modal.instantaneous_damping import Trust

RATE_HZ = 500.0
TIME_S = np.arange(3000) / RATE_HZ
DECAY = 50.0 * np.exp(-0.8 * TIME_S) * np.cos(2 * np.pi * 10.0 * TIME_S)


def test_ringing_after_the_release_is_marked_and_kept() -> None:
    ringing = 20.0 * np.exp(-TIME_S / 0.06) * np.cos(2 * np.pi * 83.0 * TIME_S)
    decay = analyse_free_decay(DECAY + ringing, RATE_HZ)
    clean = analyse_free_decay(DECAY, RATE_HZ)
    assert clean.release.transient_end_s == clean.release.release_s == 0.0
    # e^{-t/0.06} falls from 20 to 2 % of the mode's amplitude of 50 in 0.06 ln 20 = 0.18 s: two cycles, or three
    assert decay.release.transient_end_s == pytest.approx(0.2, abs=0.11)
    for reading, without in zip(decay.readings, clean.readings, strict=True):
        assert reading.trust[0] == Trust.RELEASE
        assert reading.trust.size == without.trust.size
        assert not (reading.trust[reading.time_s > 0.6] == Trust.RELEASE).any()


def test_what_lies_before_the_release_is_left_out() -> None:
    held = np.random.default_rng(1).normal(0, 0.05, 700)
    decay = analyse_free_decay(np.concatenate([held, DECAY]), RATE_HZ)
    assert decay.release.release_s == pytest.approx(1.4, abs=0.01)
    assert all(reading.time_s.min() > 1.4 for reading in decay.readings)
    fit = decay.local_sine_fit
    assert fit.damping_ratio[fit.used] == pytest.approx(0.8 / np.hypot(0.8, 20 * np.pi), rel=0.05)


def test_the_end_in_noise_is_marked() -> None:
    noisy = DECAY + np.random.default_rng(2).normal(0, 2.0, DECAY.size)
    for reading in analyse_free_decay(noisy, RATE_HZ).readings:
        assert (reading.trust[reading.time_s > 5.0] != Trust.USED).all()
        assert (reading.trust == Trust.USED).sum() > 3


def test_edges_of_the_envelope_are_marked() -> None:
    envelope = analyse_free_decay(DECAY, RATE_HZ).envelope
    assert envelope.trust[0] == envelope.trust[-1] == Trust.EDGE


def test_displacement_is_turned_into_acceleration() -> None:
    as_displacement = analyse_free_decay(DECAY, RATE_HZ, motion="displacement").local_sine_fit
    as_acceleration = analyse_free_decay(DECAY, RATE_HZ).local_sine_fit
    ratio = as_displacement.acceleration_amplitude_m_per_s2 / as_acceleration.acceleration_amplitude_m_per_s2
    assert ratio == pytest.approx((20 * np.pi) ** 2, rel=1e-6)


@pytest.mark.parametrize(
    ("signal", "match"),
    [
        (np.cos(2 * np.pi * 10.0 * TIME_S), "an amplitude that falls"),
        (DECAY[::-1].copy(), "an amplitude that falls"),
        (np.random.default_rng(3).normal(size=3000), "free decay"),
        (np.zeros(3000), "a constant signal"),
        (DECAY[:120], "at least 5 cycles"),
        (np.where(TIME_S == 1.0, np.nan, DECAY), "1 samples missing"),
        (1e-120 * DECAY, r"a range of 9\.804e-119; allowed"),
        (1e120 * DECAY, r"a range of 9\.804e\+121; allowed"),
    ],
)
def test_what_is_no_decay_is_refused_in_one_line(signal: np.ndarray, match: str) -> None:
    with pytest.raises(AnalysisError, match=match) as error:
        analyse_free_decay(signal, RATE_HZ)
    assert "\n" not in str(error.value)


def test_a_steady_motion_in_noise_is_no_decay() -> None:
    """By chance it falls a little in half of the cases; that is no decay before it exceeds its interval."""
    generator = np.random.default_rng(7)
    refused = 0
    for _ in range(20):
        steady = np.cos(2 * np.pi * 10.0 * TIME_S[:1500]) + generator.normal(0, 0.1, 1500)
        try:
            analyse_free_decay(steady, RATE_HZ)
        except AnalysisError:
            refused += 1
    assert refused >= 17


def test_a_motion_that_is_driven_again_is_no_decay() -> None:
    envelope = np.interp(TIME_S, [0.0, 4.0, 6.0], [0.0, -2.0, 0.2])
    with pytest.raises(AnalysisError, match="an amplitude that falls"):
        analyse_free_decay(np.exp(envelope) * np.cos(2 * np.pi * 10.0 * TIME_S), RATE_HZ)


def held_by_friction(offset: float) -> tuple[np.ndarray, float]:
    """A motion of 10 Hz from 50 under dry friction, and when it ends: half cosines about ±`offset`, then nothing.

    The acceleration over −ω² is the distance from the side's equilibrium; it falls by 2 `offset` per half cycle.
    """
    half = np.floor(20.0 * TIME_S)
    sign = np.where(half % 2 == 0, 1.0, -1.0)
    left = 50.0 - offset - 2 * offset * half
    end_s = np.ceil((50.0 / offset - 1) / 2) / 20.0
    return np.where(left > 0, sign * left * np.cos(2 * np.pi * 10.0 * TIME_S - np.pi * half), 0.0), float(end_s)


@pytest.mark.parametrize("level", [0.0, 0.3])
def test_a_motion_that_friction_holds_is_read_until_there(level: float) -> None:
    """At level 0 all samples after it are exactly 0, and a parabola through them has no curvature."""
    motion, end_s = held_by_friction(0.9)
    decay = analyse_free_decay(motion + level, RATE_HZ)
    assert decay.release.rest_s == pytest.approx(end_s, abs=1.5 / RATE_HZ)
    for reading in decay.readings:
        assert reading.used.any()
        assert reading.time_s.max() <= end_s
        for values in (
            reading.damping_ratio_std,
            reading.frequency_hz_std,
            reading.acceleration_amplitude_m_per_s2,
        ):
            assert np.isfinite(values).all()
        # friction of a constant force takes 4 X x_f per cycle: ζ = 2 x_f/(π X), to first order in x_f/X
        clear = reading.used & (reading.acceleration_amplitude_m_per_s2 > 20.0)
        assert reading.damping_ratio[clear] == pytest.approx(
            2 * 0.9 / (np.pi * reading.acceleration_amplitude_m_per_s2[clear]), rel=0.06
        )


def test_where_the_phase_asks_for_an_extremum_that_is_not_there_the_decrement_is_marked() -> None:
    """At the end of a decay over six decades the edge of the record moves the phase by half a cycle."""
    time = np.arange(4680) / 1024.0
    motion = 65.0 * np.exp(-0.0415 * 2 * np.pi * 10.86 * time) * np.cos(2 * np.pi * 10.86 * time)
    reading = analyse_free_decay(motion, 1024.0).log_decrement
    assert reading.damping_ratio[reading.used] == pytest.approx(0.0415 / np.hypot(1, 0.0415), rel=0.01)
    assert Trust.NO_EXTREMUM in reading.trust
    assert (reading.time_s[reading.trust == Trust.NO_EXTREMUM] > 4.3).all()


def test_a_sensor_that_is_silent_for_a_while_is_no_division_by_zero() -> None:
    """A parabola through zeros has no curvature."""
    silent = np.where((TIME_S > 2.0) & (TIME_S < 2.6), 0.0, DECAY)
    for reading in analyse_free_decay(silent, RATE_HZ).readings:
        assert np.isfinite(reading.damping_ratio_std).all()
        assert np.isfinite(reading.frequency_hz_std).all()


def test_a_mode_that_is_not_there_is_not_taken_for_the_foot_of_another() -> None:
    with pytest.raises(AnalysisError, match="got 10 Hz; allowed: 14 … 20 Hz, where the mode is looked for"):
        analyse_free_decay(DECAY, RATE_HZ, frequency_range_hz=(14.0, 20.0))


def test_stretches_longer_than_the_decay_are_refused() -> None:
    with pytest.raises(AnalysisError, match=r"got 60\.0 cycles of 10 Hz; allowed: at least 61, one stretch"):
        analyse_free_decay(DECAY, RATE_HZ, n_cycles=61)


def test_a_burst_within_the_decay_spoils_only_itself() -> None:
    burst = np.where((TIME_S > 1.2) & (TIME_S < 2.0), 60.0, 0.0)
    disturbed = DECAY + burst * np.random.default_rng(4).normal(size=DECAY.size)
    fit = analyse_free_decay(disturbed, RATE_HZ).local_sine_fit
    later = (fit.time_s > 2.3) & (fit.time_s < 5.5)
    assert fit.frequency_hz[later] == pytest.approx(10.0, rel=1e-6)


def test_a_range_without_lines_is_refused() -> None:
    with pytest.raises(AnalysisError, match="frequency range of the mode"):
        analyse_free_decay(DECAY, RATE_HZ, frequency_range_hz=(900.0, 950.0))


def test_data_sets_carry_units_from_the_table() -> None:
    for method, dataset in analyse_free_decay(DECAY, RATE_HZ).to_dataset().items():
        assert dataset.damping_ratio.dims == ("decay_time_s",)
        assert dataset.acceleration_amplitude_m_per_s2.attrs["units"] == "m s-2"
        assert dataset.modal_frequency_hz_std.attrs["units"] == "Hz"
        assert str(dataset.decay_method.values) == method


def test_two_cycles_per_stretch_are_the_fewest() -> None:
    fit = analyse_free_decay(DECAY, RATE_HZ, n_cycles=2).local_sine_fit
    assert fit.used.all()
    assert (fit.coverage_factor < 1.7).all()
    with pytest.raises(AnalysisError, match="at least 2 cycles"):
        analyse_free_decay(DECAY, RATE_HZ, n_cycles=1)
