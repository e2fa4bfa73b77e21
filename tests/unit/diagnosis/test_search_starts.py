"""Where a fit starts from: sizes of an effect that its author did not think of."""

from __future__ import annotations

import pytest

from sloshlab.diagnosis.search import start_numbers

FRICTION = {"structure.coulomb_friction.force_n": 2.0}
TWO_FRICTIONS = {
    "structure.asymmetric_friction.force_up_n": 1.0,
    "structure.asymmetric_friction.force_down_n": 3.0,
}
LEAK = {"sensor.cross_talk.acceleration_tip<acceleration_root.ratio": 0.1}
STOP = {"structure.clearance.gap_m": 0.01, "structure.clearance.stiffness_n_per_m": 500.0}


def test_an_effect_of_one_number_is_looked_at_a_tenth_of_its_size_too() -> None:
    found = start_numbers.with_smaller_ones([FRICTION, STOP, LEAK])
    assert found[:3] == [FRICTION, STOP, LEAK]
    small = [value for start in found[3:] for value in start.values()]
    assert [list(start) for start in found[3:]] == [list(FRICTION), list(LEAK)]
    assert small == pytest.approx([0.2, 0.01])


def test_a_look_alike_starts_from_a_thirtieth_to_three_times_its_size() -> None:
    found = start_numbers.of_many_sizes([FRICTION, LEAK])
    assert [list(start) for start in found] == [list(FRICTION)] * 5 + [list(LEAK)] * 5
    sizes = [value for start in found for value in start.values()]
    assert sizes == pytest.approx([0.06, 0.2, 0.6, 2.0, 6.0, 0.003, 0.01, 0.03, 0.1, 0.3])


def test_a_number_of_another_unit_keeps_its_size() -> None:
    stops = start_numbers.of_many_sizes([STOP])
    assert [start["structure.clearance.stiffness_n_per_m"] for start in stops] == [500.0] * 5
    gaps = [start["structure.clearance.gap_m"] for start in stops]
    assert gaps == pytest.approx([0.0003, 0.001, 0.003, 0.01, 0.03])


def test_two_forces_keep_their_ratio() -> None:
    for one in start_numbers.of_many_sizes([TWO_FRICTIONS]):
        up, down = one.values()
        assert down / up == pytest.approx(3.0)
