"""The run that a network learns a ball from, and its work in harmonic motion in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from bouncing_rigs import guided_tank, table_2_2

from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.bouncing_ball.harmonic_model import model_loss_factor, model_work_j
from sloshlab.bouncing_ball.pseudo_harmonic import PseudoHarmonic, run_of_ball
from sloshlab.errors import InputError
from sloshlab.reduced_order_model.model import ReducedOrderModel, Scaling
from sloshlab.reduced_order_model.regressors import Delays

MOTION = PseudoHarmonic((0.005, 0.05), (10.0, 60.0), 40.0, 6.0, 500.0, 6.0, 1.7)


def test_velocity_and_acceleration_are_derivatives_of_the_displacement() -> None:
    step = 1e-5
    times = np.linspace(0.1, 5.9, 50)
    inputs = MOTION.excitation().inputs
    assert inputs is not None
    before, at, after = (inputs(times + shift) for shift in (-step, 0.0, step))
    for order in (0, 1):
        slope = (after[:, order] - before[:, order]) / (2 * step)
        assert slope == pytest.approx(at[:, order + 1], abs=1e-4 * np.abs(at[:, order + 1]).max())


def test_motion_keeps_to_its_limits_and_to_its_path() -> None:
    times = np.arange(3000) / 500.0
    inputs = MOTION.excitation().inputs
    assert inputs is not None
    displacement, _, acceleration = inputs(times)[:, :3].T
    # amplitude and frequency change within a cycle, which adds to both a little
    assert np.abs(acceleration).max() < 1.25 * 40.0
    assert np.abs(displacement).max() < 1.02 * 0.05
    amplitude, omega = MOTION.path(times)
    assert amplitude.min() >= 0.005
    assert (amplitude * omega**2).max() <= max(40.0, 0.005 * 60.0**2) + 1e-9
    # zeros of the displacement: half a turn of the phase each
    zeros = np.count_nonzero(np.diff(np.sign(displacement[1:])))
    assert abs(zeros - omega.sum() / 500.0 / np.pi) <= 2


def test_force_of_the_run_is_that_of_the_ball_at_rest_and_in_flight() -> None:
    """Δf = F_S + m_l z̈ with F_S = −m_f (z̈ + g) in flight: Δf − weight = (1 − β) m_l (z̈ + g) there."""
    rig, ball = guided_tank(), table_2_2()
    motion = PseudoHarmonic((0.02, 0.05), (25.0, 50.0), 60.0, 2.0, 1000.0, 2.0, 0.9)
    run = run_of_ball(ball, rig, motion, "run")
    inputs = motion.excitation().inputs
    assert inputs is not None
    _, velocity, acceleration = inputs(np.arange(run.x.size) / 1000.0)[:, :3].T
    assert run.x == pytest.approx(velocity, abs=1e-9)
    inertia = (1 - ball.beta) * rig.liquid_mass_kg * acceleration
    offset = run.y - inertia
    # the ball flies for a part of the time, and Δf then differs from the inertia by a constant weight
    weight = (1 - ball.beta) * rig.liquid_mass_kg * 9.81
    flies = np.minimum(np.abs(offset - weight), np.abs(offset)) < 1e-6
    assert 0.05 < flies.mean() < 0.9


class Delayed:
    """−c v(t − τ), by a network that is a plain product."""

    kind = "delayed"
    n_inputs = n_parameters = 1

    def output(self, xp: Any, theta: Any, phi: Any) -> Any:
        return theta[0] * phi[0]


def test_work_of_a_delayed_damper_is_its_closed_form() -> None:
    """∮ c v(t − τ) v(t) dt = π c A² Ω cos Ωτ, at frequencies whose cycles are no whole samples."""
    rate, damping, delay = 170.0, 3.0, 4
    scaling = Scaling(0.1, 0.5, 0.0, 2.0)
    # −c v = output_scale θ (v − offset)/input_scale + output_offset
    theta = np.array([-damping * 0.5 / 2.0])
    scaling = Scaling(0.1, 0.5, -damping * 0.1, 2.0)
    model = ReducedOrderModel(Delayed(), theta, Delays((delay,)), scaling, rate)  # type: ignore[arg-type]
    for frequency in (0.3, 6.56, 10.87, 50.0):
        omega = 2 * np.pi * frequency
        expected = np.pi * damping * 0.01**2 * omega * np.cos(omega * delay / rate)
        assert model_work_j(model, 0.01, frequency) == pytest.approx(expected, rel=1e-9)
    rig = guided_tank()
    eta = model_loss_factor(model, rig, np.array([0.01, 0.02]), np.array([6.56]))
    # (2.16) of a damper: c cos Ωτ/(m_l Ω), whatever the amplitude
    omega = 2 * np.pi * 6.56
    expected = damping * np.cos(omega * delay / rate) / (rig.liquid_mass_kg * omega)
    assert eta == pytest.approx(np.full((1, 2), expected), rel=1e-9)


def test_a_ball_file_is_read_and_others_are_refused(tmp_path: Any) -> None:
    ball, path = table_2_2(), tmp_path / "ball.toml"
    path.write_text(ball.twin_table(), encoding="utf-8")
    assert BouncingBall.from_toml(path, guided_tank()) == ball
    for text in ("", "[twin]\ntank_model = 7\n", '[twin]\ntank_model = "frozen"\n'):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(InputError) as error:
            BouncingBall.from_toml(path, guided_tank())
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "changes",
    [
        {"amplitude_m": (0.05, 0.005)},
        {"frequency_rad_per_s": (0.0, 60.0)},
        {"largest_acceleration_m_per_s2": -1.0},
        {"duration_s": 1e6},
        {"sampling_rate_hz": 60.0},
    ],
)
def test_impossible_motions_are_refused(changes: dict[str, Any]) -> None:
    wanted = {
        "amplitude_m": (0.005, 0.05),
        "frequency_rad_per_s": (10.0, 60.0),
        "largest_acceleration_m_per_s2": 40.0,
    }
    with pytest.raises(InputError):
        PseudoHarmonic(**{**wanted, **changes})
