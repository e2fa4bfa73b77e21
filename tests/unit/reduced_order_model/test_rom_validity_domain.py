"""Cycles of motions in closed form; excursions where they were put."""

import numpy as np
import pytest

from sloshlab.errors import AnalysisError
from sloshlab.reduced_order_model.validity_domain import ValidityDomain, motion_cycles

RATE_HZ = 1000.0


def sine(frequency_hz, speed, duration_s=2.0):
    return speed * np.sin(2 * np.pi * frequency_hz * np.arange(round(duration_s * RATE_HZ)) / RATE_HZ - 0.3)


def test_cycles_of_a_sine():
    cycles = motion_cycles(sine(7.0, 0.4), RATE_HZ)
    assert cycles.frequency_hz == pytest.approx(7.0, rel=1e-3)
    assert cycles.speed_m_per_s == pytest.approx(0.4, rel=1e-2)
    assert cycles.acceleration_g == pytest.approx(0.4 * 2 * np.pi * 7 / 9.81, rel=1e-2)
    assert np.diff(cycles.start_s) == pytest.approx(1 / 7, rel=1e-3)


def test_no_cycle_goes_across_a_gap():
    velocity = sine(10.0, 0.4)
    velocity[1000:1010] = np.nan
    assert (
        motion_cycles(velocity, RATE_HZ).start_s.size == motion_cycles(sine(10.0, 0.4), RATE_HZ).start_s.size - 1
    )


def test_rest_has_no_cycles():
    assert motion_cycles(np.zeros(100), RATE_HZ).start_s.size == 0
    with pytest.raises(AnalysisError, match="not one cycle"):
        ValidityDomain.of([motion_cycles(np.zeros(100), RATE_HZ)])


@pytest.fixture
def domain():
    """9.5 … 10.5 Hz between 0.2 and 0.4 m/s."""
    return ValidityDomain.of([motion_cycles(sine(f, v), RATE_HZ) for f in (9.6, 10.4) for v in (0.2, 0.4)])


def test_inside_there_is_no_excursion(domain):
    assert domain.excursions(motion_cycles(sine(10.0, 0.3), RATE_HZ)) == []


@pytest.mark.parametrize(
    ("frequency_hz", "speed", "reason"),
    [(10.0, 0.6, "too strong"), (10.0, 0.05, "too weak"), (20.0, 0.3, "frequency"), (3.0, 0.3, "frequency")],
)
def test_an_excursion_says_when_where_and_why(domain, frequency_hz, speed, reason):
    motion = np.concatenate([sine(10.0, 0.3), sine(frequency_hz, speed), sine(10.0, 0.3)])
    (excursion,) = [e for e in domain.excursions(motion_cycles(motion, RATE_HZ)) if e.stop_s - e.start_s > 0.5]
    assert excursion.reason == reason
    assert excursion.start_s == pytest.approx(2.0, abs=0.4)
    assert excursion.stop_s == pytest.approx(4.0, abs=0.4)


def test_a_domain_is_made_again_from_its_facts(domain):
    assert ValidityDomain.of_facts(domain.facts()) == domain
