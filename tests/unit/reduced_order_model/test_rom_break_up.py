"""Break-up of the liquid: closed forms, recovery of a known one from what it does, gaps, files, scaling."""

from dataclasses import fields, replace

import numpy as np
import pytest

from sloshlab.errors import AnalysisError, InputError
from sloshlab.reduced_order_model.break_up import BreakUp
from sloshlab.reduced_order_model.break_up_fit import _in_phase, with_break_up
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.networks.radial_basis import NormalisedRadialBasis
from sloshlab.reduced_order_model.regressors import Delays, Run
from sloshlab.reduced_order_model.storage import load_model, save_model
from sloshlab.reduced_order_model.tank_scaling import TankScaling, scaled_to

RATE_HZ, G = 200.0, 9.81
TRUE = BreakUp(growth_per_s=30.0, exponent=0.5, calming_s=1.5, at_rest=0.01)


def test_pulled_down_at_once_it_grows_as_a_logistic_curve():
    """v = −3 g t: the excess is 2 and b = 1/(1 + (1/b₀ − 1) e^(−κ 2ⁿ t)) without calming."""
    time_s = np.arange(60) / RATE_HZ
    share = replace(TRUE, calming_s=1e5).share(-3 * G * time_s, RATE_HZ)
    grown = np.maximum(time_s - 1 / RATE_HZ, 0.0)  # the first acceleration is known one sample later
    expected = 1 / (1 + 99 * np.exp(-30.0 * np.sqrt(2) * grown))
    np.testing.assert_allclose(share, expected, rtol=1e-4)


@pytest.mark.parametrize("acceleration_g", [0.0, 0.9, 3.0, -0.9])
def test_without_a_pull_beyond_gravity_it_calms_down(acceleration_g):
    """b − b₀ falls as e^(−t/τ); upward acceleration presses the liquid down."""
    time_s = np.arange(300) / RATE_HZ
    pulled = np.minimum(time_s, 0.2) * -4 * G
    velocity = pulled + acceleration_g * G * np.maximum(time_s - 0.2, 0.0)
    share = TRUE.share(velocity, RATE_HZ)
    after = slice(42, None)
    expected = 0.01 + (share[42] - 0.01) * np.exp(-(time_s[after] - time_s[42]) / 1.5)
    assert share[42] > 0.5
    np.testing.assert_allclose(share[after], expected, rtol=1e-9)


def test_it_is_of_the_past_only():
    velocity = np.random.default_rng(1).normal(size=60)
    changed = velocity.copy()
    changed[30] -= 2.0
    before, after = TRUE.share(velocity, RATE_HZ), TRUE.share(changed, RATE_HZ)
    assert np.array_equal(before[:31], after[:31])
    assert before[31] != after[31]


def test_after_a_gap_the_liquid_is_taken_to_be_broken_up():
    velocity = np.zeros(100)
    velocity[50:53] = np.nan
    share = TRUE.share(velocity, RATE_HZ)
    assert share[:51] == pytest.approx(0.01)
    assert share[51:54].tolist() == [1.0, 1.0, 1.0]
    assert share[54] == pytest.approx(0.01 + 0.99 * np.exp(-1 / (1.5 * RATE_HZ)))


def steady_model():
    """Δf = −3 tanh-like in v(k−1)."""
    return ReducedOrderModel(
        NormalisedRadialBasis(1, 2), np.array([-1.0, 1.0, 3.0, -3.0]), Delays((1,)), Scaling(0.0, 0.5), RATE_HZ
    )


def sudden_run(level_g: float, seed: int) -> Run:
    """Rest, a sudden start of 2 s, rest: the force b Δf_model, b integrated in small steps, and noise."""
    time_s = np.arange(-100, 900) / RATE_HZ
    omega = 2 * np.pi * 10.0
    x = np.where((time_s > 0) & (time_s < 2.0), level_g * G / omega * np.sin(omega * time_s), 0.0)
    share, shares = TRUE.at_rest, []
    for k in range(x.size):
        shares.append(share)
        acceleration_g = (x[k] - x[k - 1]) * RATE_HZ / G if k else 0.0
        rate = TRUE.growth_per_s * max(-acceleration_g - 1, 0.0) ** TRUE.exponent
        for _ in range(20):
            share += (rate * share * (1 - share) - (share - TRUE.at_rest) / TRUE.calming_s) / (20 * RATE_HZ)
    # b of sample k + 1 follows from the velocities up to sample k
    force = np.array(shares) * steady_model().simulate(x)
    return Run(x, force + 0.05 * np.random.default_rng(seed).normal(size=x.size))


def test_a_known_break_up_is_recovered():
    runs = [sudden_run(level_g, seed) for seed, level_g in enumerate((1.3, 1.6, 2.0, 3.0, 5.0))]
    found = with_break_up(steady_model(), runs)
    for field_ in fields(BreakUp):
        assert getattr(found.break_up, field_.name) == pytest.approx(getattr(TRUE, field_.name), rel=0.15), (
            field_.name
        )
    unseen = sudden_run(2.5, 9)
    assert np.nanstd(unseen.y - found.simulate(unseen.x)) < 0.07
    assert np.nanstd(unseen.y - steady_model().simulate(unseen.x)) > 0.3
    assert replace(found, break_up=None).simulate(unseen.x)[1:] == pytest.approx(
        steady_model().simulate(unseen.x)[1:], rel=1e-12
    )


def test_a_saved_model_with_break_up_is_the_same(tmp_path):
    model = replace(steady_model(), break_up=TRUE)
    save_model(model, tmp_path / "one.nc")
    again = load_model(tmp_path / "one.nc")
    save_model(again, tmp_path / "two.nc")
    assert again.break_up == TRUE
    assert (tmp_path / "one.nc").read_bytes() == (tmp_path / "two.nc").read_bytes()
    content = (tmp_path / "one.nc").read_bytes()
    (tmp_path / "one.nc").write_bytes(content.replace(b"exponent", b"exponemt"))
    with pytest.raises(InputError, match=r"one\.nc"):
        load_model(tmp_path / "one.nc")
    save_model(steady_model(), tmp_path / "three.nc")
    assert load_model(tmp_path / "three.nc").break_up is None


def test_another_tank_breaks_up_in_its_own_time():
    small = replace(steady_model(), break_up=TRUE)
    large = scaled_to(small, TankScaling(2.0, 2.0, 8.0, 8.0, 16.0))
    v = sudden_run(2.0, 1).x
    np.testing.assert_allclose(large.simulate(2 * v), 8 * small.simulate(v), rtol=1e-9)


def test_what_is_no_break_up_is_refused():
    for name in ("growth_per_s", "calming_s", "exponent", "at_rest"):
        with pytest.raises(InputError, match=f"break-up: {name}"):
            replace(TRUE, **{name: -1.0})
    with pytest.raises(InputError, match="at_rest"):
        replace(TRUE, at_rest=1.0)
    with pytest.raises(InputError, match="one of them"):
        ReducedOrderModel(
            NormalisedRadialBasis(2, 1), np.zeros(3), Delays((1,), (1,)), Scaling(), RATE_HZ, break_up=TRUE
        )
    with pytest.raises(AnalysisError, match="no sample"):
        with_break_up(steady_model(), [Run(np.zeros(5), np.full(5, np.nan))])


def test_only_what_is_in_phase_with_the_velocity_counts():
    """A force 3 v gives 3 √(Σ v²) in each block, one a quarter of a cycle away nothing."""
    phase = 2 * np.pi * np.arange(80) / 20
    v = np.repeat([1.0, 5.0], 40) * np.sin(phase)
    found = _in_phase(3 * v + 7 * np.cos(phase), v, 20, 0.0)
    assert found == pytest.approx(3 * np.sqrt(10) * np.array([1, 1, 5, 5]))
    assert _in_phase(3 * v, v, 20, 0.5) == pytest.approx(
        np.repeat([3 * 10 / np.sqrt(10 + 20 * 0.25), 3 * 250 / np.sqrt(250 + 20 * 0.25)], 2)
    )
