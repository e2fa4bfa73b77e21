"""A simulation that leaves what its tank model was trained on: when, where, and in whose units."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis
from sloshlab.reduced_order_model.regressors import Delays
from sloshlab.reduced_order_model.validity_domain import MotionCycles, ValidityDomain
from sloshlab.rig import Rig
from sloshlab.twin.excitation import Excitation, recorded
from sloshlab.twin.reduced_order_model_domain import departures, without_domain
from sloshlab.twin.reduced_order_model_force import term_of
from sloshlab.twin.simulation import Simulation
from sloshlab.twin.twin import Twin

HEIGHT_M, RATE_HZ = 0.0272, 1000.0
TRAINED = ValidityDomain.of(
    [MotionCycles(np.zeros(40), np.linspace(7.0, 14.0, 40).repeat(1), np.tile([0.2, 0.6], 20))]
)


def rig(height_m: float = HEIGHT_M) -> Rig:
    return Rig.from_toml_text(
        f"[tank]\nheight_m = {height_m}\nlength_m = 0.1172\nwidth_m = 0.078\ndry_mass_kg = 0.3\n"
        "[liquid]\ndensity_kg_per_m3 = 1000.0\nfill_level = 0.5\n"
    )


def model(**more: object) -> ReducedOrderModel:
    facts = {"fill_level": 0.5, "tank_height_m": HEIGHT_M, "liquid_mass_kg": rig().liquid_mass_kg, **more}
    return ReducedOrderModel(NormalisedRadialBasis(2, 2), np.zeros(6), Delays.tapped(2), Scaling(), 170.0, facts)


def moved(velocity: np.ndarray, *, height_m: float = HEIGHT_M, rate_hz: float = RATE_HZ) -> Simulation:
    run: Excitation = recorded(rate_hz, velocity=velocity)
    tank = rig(height_m)
    return Twin(None, (term_of(model(domain=TRAINED.facts()), tank),)).simulate(run).require_done()


def tone(frequency_hz: float, speeds: list[float], dwell_s: float = 2.0, rate_hz: float = RATE_HZ) -> np.ndarray:
    """Speeds one after the other, the changes at zero crossings."""
    time = np.arange(round(dwell_s * rate_hz * len(speeds))) / rate_hz
    return np.array(speeds)[(time / dwell_s).astype(int)] * np.sin(2 * np.pi * frequency_hz * time)


def test_a_motion_inside_is_not_flagged() -> None:
    assert departures(moved(tone(10.0, [0.2, 0.4, 0.6]))) == []


def test_when_and_where_a_motion_is_too_strong() -> None:
    (left,) = departures(moved(tone(10.0, [0.4, 0.9, 0.4])))
    assert left.reason == "too strong"
    assert left.start_s == pytest.approx((2.0,), abs=0.11)
    assert left.stop_s == pytest.approx((4.0,), abs=0.11)
    assert left.duration_s == pytest.approx(2.0, abs=0.2)
    omega = 2 * math.pi * 10.0
    assert left.omega_bar == pytest.approx(omega / math.sqrt(9.81 / HEIGHT_M), rel=1e-2)
    assert left.u_bar == pytest.approx(0.9 / omega / HEIGHT_M, rel=0.02)
    assert left.acceleration_g == pytest.approx(0.9 * omega / 9.81, rel=0.02)
    assert str(left).startswith("tank model outside its domain of validity, stronger than any training")
    assert "\n" not in str(left)


def test_a_motion_that_dies_away_is_too_weak_to_the_end() -> None:
    time = np.arange(6000) / RATE_HZ
    (left,) = departures(moved(0.5 * np.exp(-2 * time) * np.sin(2 * np.pi * 10 * time)))
    assert left.reason == "too weak"
    # a tenth below the weakest is still inside
    assert left.start_s[0] == pytest.approx(math.log(0.5 / (0.2 / 1.1)) / 2, abs=0.11)
    assert left.stop_s == pytest.approx((6.0,))


def test_frequencies_that_no_training_had() -> None:
    (left,) = departures(moved(tone(20.0, [0.4])))
    assert left.reason == "frequency"
    assert left.omega_bar == pytest.approx(2 * math.pi * 20.0 / math.sqrt(9.81 / HEIGHT_M), rel=1e-2)


def test_a_tank_four_times_as_high_is_judged_in_similarity() -> None:
    """Frequencies are halved and speeds doubled there; times and ū are those of the other tank."""
    inside = moved(tone(5.0, [0.8]), height_m=4 * HEIGHT_M)
    assert departures(inside) == []
    (left,) = departures(moved(tone(5.0, [0.8, 1.8, 0.8]), height_m=4 * HEIGHT_M))
    omega = 2 * math.pi * 5.0
    assert left.reason == "too strong"
    assert left.start_s == pytest.approx((2.0,), abs=0.21)
    assert left.stop_s == pytest.approx((4.0,), abs=0.21)
    assert left.omega_bar == pytest.approx(omega / math.sqrt(9.81 / (4 * HEIGHT_M)), rel=1e-2)
    assert left.u_bar == pytest.approx(1.8 / omega / (4 * HEIGHT_M), rel=0.02)
    assert left.acceleration_g == pytest.approx(1.8 * omega / 9.81, rel=0.02)


def test_a_ripple_that_the_model_cannot_see_makes_no_cycles() -> None:
    """400 Hz is far above half of the 170 Hz of the model, and strong enough to cross zero."""
    time = np.arange(4000) / RATE_HZ
    ripple = 0.1 * np.sin(2 * np.pi * 400 * time)
    assert departures(moved(tone(10.0, [0.4, 0.4]) + ripple)) == []


def test_a_model_without_a_domain_is_known_as_such() -> None:
    run = recorded(RATE_HZ, velocity=tone(10.0, [0.4]))
    silent = Twin(None, (term_of(model(), rig()),)).simulate(run)
    assert departures(silent) == []
    assert without_domain(silent)
    told = term_of(model(domain=TRAINED.facts()), rig())
    assert not without_domain(Twin(None, (told,)).simulate(run))
    gaps = replace(TRAINED, weakest_m_per_s=(math.nan, *TRAINED.weakest_m_per_s[1:]))
    assert not without_domain(Twin(None, (term_of(model(domain=gaps.facts()), rig()),)).simulate(run))
