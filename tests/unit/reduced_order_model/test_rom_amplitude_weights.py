"""Weights by the local amplitude: closed forms of harmonic motion, bounds, gaps, and what they do to a fit."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.errors import AnalysisError
from sloshlab.reduced_order_model.amplitude_weights import amplitude_weights, local_amplitude, weighted_runs
from sloshlab.reduced_order_model.liquid_signals import LiquidSignals
from sloshlab.reduced_order_model.regressors import Delays
from sloshlab.reduced_order_model.training import TrainingSettings, fit

RATE_HZ = 128.0


def shaken(levels_g, seconds: float = 4.0, rate_hz: float = RATE_HZ) -> LiquidSignals:
    """Harmonic motion of 8 Hz at levels one after the other; a force of v |v|, of which no line is all."""
    time = np.arange(round(seconds * len(levels_g) * rate_hz)) / rate_hz
    level = np.repeat(levels_g, round(seconds * rate_hz)) * 9.81
    omega = 2 * np.pi * 8.0
    velocity, acceleration = level / omega * np.sin(omega * time), level * np.cos(omega * time)
    return LiquidSignals(velocity, -velocity * np.abs(velocity), acceleration, rate_hz, "run")


def test_local_amplitude_is_that_of_the_samples_before() -> None:
    values = np.concatenate([np.zeros(30), 2 * np.sin(2 * np.pi * np.arange(60) / 10)])
    found = local_amplitude(values, 20)
    assert np.isnan(found[:20]).all()
    # the motion begins with sample 31
    assert found[31] == 0 < found[32]
    # of ten samples of a cycle those nearest to the extremes are at 3/10 … 72°
    assert found[60:] == pytest.approx(2 * np.sin(2 * np.pi * 3 / 10), rel=1e-12)
    assert np.isnan(local_amplitude(np.zeros(3), 4)).all()


@pytest.mark.parametrize(("level_g", "expected"), [(6.0, 1), (2.0, 1), (1.0, 4), (0.8, 6), (0.2, 8)])
def test_weights_are_the_inverse_square_of_the_amplitude_within_their_bounds(level_g, expected) -> None:
    found = amplitude_weights(shaken([level_g]))
    # 16 samples a cycle, so that both extremes are among them: (2/0.8)² = 6.25
    assert set(found) == {expected}


def test_every_sample_counts_as_often_as_its_weight_and_none_that_is_lost() -> None:
    signals = shaken([4.0, 1.0])
    force = signals.dynamic_force_n.copy()
    force[100:110] = np.nan
    signals = LiquidSignals(signals.velocity_m_per_s, force, signals.acceleration_m_per_s2, RATE_HZ, "run")
    runs = weighted_runs(signals)
    counts = sum(np.isfinite(run.y).astype(int) for run in runs)
    assert len(runs) == 4
    assert not counts[100:110].any()
    assert set(counts[110:500]) == {1}
    # half a second holds both levels
    assert set(counts[576:]) == {4}
    for run in runs:
        np.testing.assert_array_equal(run.x, signals.velocity_m_per_s)


def test_where_the_motion_is_not_known_samples_count_once() -> None:
    signals = shaken([0.2])
    lost = np.full(512, np.nan)
    assert set(amplitude_weights(LiquidSignals(lost, lost, lost, RATE_HZ, "run"))) == {1}
    assert set(amplitude_weights(signals)) == {8}


def test_a_rate_without_a_range_is_refused() -> None:
    with pytest.raises(AnalysisError, match=r"8 Hz.*12\.5 Hz and more"):
        amplitude_weights(shaken([1.0], rate_hz=8.0))


def test_a_network_too_small_for_both_errs_less_where_the_motion_is_small() -> None:
    def small_error(weighted: bool) -> float:
        signals = shaken([6.0, 3.0, 0.7])
        runs = weighted_runs(signals) if weighted else [signals.run()]
        model, _ = fit(
            "normalised_rbf", {"n_neurons": 3}, Delays.tapped(2), runs, runs, sampling_rate_hz=RATE_HZ,
            settings=TrainingSettings(n_epochs=20),
        )  # fmt: skip
        error = model.simulate(signals.velocity_m_per_s) - signals.dynamic_force_n
        return float(np.sqrt(np.mean(error[-400:] ** 2)))

    assert small_error(True) < 0.8 * small_error(False)
