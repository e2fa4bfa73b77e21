"""Motion slower than any training is kept from a model; motion of the training passes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sloshlab.aircraft.drifting_tank import DriftFree, corner_of_drift_hz
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis
from sloshlab.reduced_order_model.regressors import Delays
from sloshlab.reduced_order_model.validity_domain import MotionCycles, ValidityDomain

RATE_HZ, CORNER_HZ = 200.0, 0.5


class Echo:
    """Its force is the velocity that it sees."""

    sampling_rate_hz, runs_away = RATE_HZ, False

    def begin(self) -> None:
        self.n_begun = getattr(self, "n_begun", 0) + 1

    def step(self, velocity_m_per_s: float) -> np.ndarray:
        return np.array([velocity_m_per_s, 0.0, 0.0, 0.0])


def seen(velocity: np.ndarray) -> np.ndarray:
    model = DriftFree(Echo(), CORNER_HZ)
    model.begin()
    return np.array([model.step(float(value))[0] for value in velocity])


def test_a_constant_velocity_dies_away_with_the_time_constant_of_the_corner() -> None:
    time = np.arange(400) / RATE_HZ
    # of the value held from each instant on, the first step is over already
    expected = np.exp(-2 * math.pi * CORNER_HZ * (time + 1 / RATE_HZ))
    np.testing.assert_allclose(seen(np.ones(400)), expected, rtol=1e-9)


@pytest.mark.parametrize("frequency_hz", [0.1, 0.5, 4.5])
def test_a_sine_has_the_gain_and_lead_of_a_first_order_filter(frequency_hz: float) -> None:
    """s/(s + ω_c) at s = jω, to the order of the step."""
    time = np.arange(round(40 * RATE_HZ)) / RATE_HZ
    late = time >= 20.0
    wave = np.exp(-2j * math.pi * frequency_hz * time)
    found = 2j * np.mean((seen(np.sin(2 * math.pi * frequency_hz * time)) * wave)[late])
    expected = 1j * frequency_hz / (1j * frequency_hz + CORNER_HZ)
    assert abs(found - expected) < 0.02 * abs(expected) + 1e-3
    if frequency_hz > 4:
        assert 1 - abs(found) < 0.02
        assert 0 < math.degrees(np.angle(found)) < 7


def test_the_corner_is_a_quarter_of_the_lowest_frequency_of_the_training() -> None:
    domain = ValidityDomain.of([MotionCycles(np.zeros(9), np.linspace(8.0, 16.0, 9), np.full(9, 0.3))])
    network = NormalisedRadialBasis(2, 2)
    facts = {"domain": domain.facts()}
    model = ReducedOrderModel(network, np.zeros(6), Delays.tapped(2), Scaling(), 170.0, facts)
    assert corner_of_drift_hz(model) == pytest.approx(2.0)
    assert corner_of_drift_hz(ReducedOrderModel(network, np.zeros(6), Delays.tapped(2), Scaling(), 170.0)) is None


def test_it_begins_at_rest_again() -> None:
    inner = Echo()
    model = DriftFree(inner, CORNER_HZ)
    for _ in range(100):
        model.step(1.0)
    model.begin()
    assert inner.n_begun == 1
    assert model.step(1.0)[0] == pytest.approx(math.exp(-2 * math.pi * CORNER_HZ / RATE_HZ))
    assert not model.runs_away
    assert model.sampling_rate_hz == RATE_HZ
