"""Parameters of a ball: non-dimensional form, rig files, refusals."""

from __future__ import annotations

import dataclasses

import pytest
from bouncing_rigs import GUIDED_TANK, guided_tank, shaker, table_2_2

from sloshlab.bouncing_ball.ball import BouncingBall, NonDimensionalBall
from sloshlab.bouncing_ball.search_space import BOUNDS, SearchSpace
from sloshlab.errors import InputError, RigError
from sloshlab.rig import Rig

TABLE_2_3 = NonDimensionalBall(0.3342, 25.28, 3.34, 52.12, 0.0021)


def test_dimensions_of_a_non_dimensional_ball_worked_out_by_hand() -> None:
    """ρ g S = 1000 · 9.81 · 0.1172 · 0.078 = 89.679696 N/m, ρ S √(gh) = 9.1416 · 0.516558 = 4.72217 kg/s."""
    ball = BouncingBall.from_non_dimensional(TABLE_2_3, shaker(), 4.0)
    assert ball.radius_m == pytest.approx(0.3342 * 0.0272, rel=1e-12)
    assert ball.stiffness_n_per_m == pytest.approx(25.28 * 89.679096 * 16, rel=1e-6)
    assert ball.damping_kg_per_s == pytest.approx(3.34 * 4.72217 * 4, rel=1e-5)
    assert ball.hardening_per_m == pytest.approx(52.12 / 0.0272, rel=1e-12)


def test_non_dimensional_form_and_back() -> None:
    rig, ball = guided_tank(), table_2_2(1.0)
    again = BouncingBall.from_non_dimensional(ball.non_dimensional(rig, 3.2), rig, 3.2, damping_in_flight=1.0)
    assert dataclasses.astuple(again) == pytest.approx(dataclasses.astuple(ball), rel=1e-12)


def test_the_written_table_is_read_as_the_same_ball() -> None:
    ball = table_2_2(1.0)
    assert BouncingBall.from_rig(Rig.from_toml_text(GUIDED_TANK + ball.twin_table())) == ball


def test_a_rig_without_a_ball_is_told_so() -> None:
    with pytest.raises(RigError, match="allowed: bouncing_ball; remedy: identify one"):
        BouncingBall.from_rig(guided_tank())


def test_a_ball_larger_than_its_tank_is_refused_in_one_line() -> None:
    ball = dataclasses.replace(table_2_2(), radius_m=0.031)
    with pytest.raises(
        InputError, match=r"radius_m: got 0\.031 in a tank 0\.06 m high; allowed: less than half"
    ) as error:
        ball.in_tank(guided_tank())
    assert "\n" not in str(error.value)


def test_a_decay_needs_a_structure() -> None:
    with pytest.raises(RigError, match=r"no \[structure\]"):
        table_2_2().on_structure(shaker())


@pytest.mark.parametrize("omega_bar", [0.0, -1.0, float("nan")])
def test_impossible_frequency(omega_bar: float) -> None:
    with pytest.raises(InputError, match="omega_bar"):
        table_2_2().non_dimensional(guided_tank(), omega_bar)


def test_the_unit_box_holds_the_published_balls_and_maps_back() -> None:
    rig = guided_tank()
    space = SearchSpace(rig, 41.2, 1.0)
    point = space.point(table_2_2())
    assert (point > 0).all()
    assert (point < 1).all()
    again = space.ball(point)
    assert dataclasses.astuple(again)[:5] == pytest.approx(dataclasses.astuple(table_2_2())[:5], rel=1e-9)
    assert again.damping_in_flight == 1.0


def test_the_corners_of_the_unit_box_are_the_bounds() -> None:
    """√(k/m)/Ω, c/(2√(km)) and αh at both ends, by their definitions."""
    space = SearchSpace(shaker(), 76.0)
    for end, share in (("low", 0.0), ("high", 1.0)):
        ball = space.ball([share] * 5)
        mass = (1 - ball.beta) * shaker().liquid_mass_kg
        radius, ratio, damping, hardening, beta = (getattr(bound, end) for bound in BOUNDS)
        assert ball.radius_m / 0.0272 == pytest.approx(radius)
        assert (ball.stiffness_n_per_m / mass) ** 0.5 / 76.0 == pytest.approx(ratio)
        assert ball.damping_kg_per_s / (2 * (ball.stiffness_n_per_m * mass) ** 0.5) == pytest.approx(damping)
        assert ball.hardening_per_m * 0.0272 == pytest.approx(hardening)
        assert ball.beta == pytest.approx(beta)


def test_the_damper_acts_in_flight_or_not() -> None:
    with pytest.raises(InputError, match="allowed: 0 or 1"):
        SearchSpace(shaker(), 76.0, 0.5)
