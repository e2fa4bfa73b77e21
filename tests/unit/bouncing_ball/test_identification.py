"""Search, intervals and flags, on residuals whose answer is known without simulating anything."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from bouncing_rigs import guided_tank, shaker
from scipy.stats import t as student_t

from sloshlab.bouncing_ball.ball import BouncingBall
from sloshlab.bouncing_ball.frequency_error import FrequencyBand, error_by_frequency, summary
from sloshlab.bouncing_ball.from_work_line import work_line
from sloshlab.bouncing_ball.harmonic_response import HarmonicRun, response_map, w_bar_at
from sloshlab.bouncing_ball.identification import IdentifiedBall, SearchSettings, identified
from sloshlab.bouncing_ball.search_space import SearchSpace
from sloshlab.errors import AnalysisError, InputError

FloatArray = npt.NDArray[np.float64]
SETTINGS = SearchSettings(population=6, n_generations=60, n_local_evaluations=200, seed=3)
SPACE = SearchSpace(shaker(), 76.0)


def linear_problem(answer: FloatArray, noise: float) -> tuple[FloatArray, FloatArray, IdentifiedBall]:
    generator = np.random.default_rng(1)
    matrix, error = generator.standard_normal((40, 5)), noise * generator.standard_normal(40)

    def residuals(ball: BouncingBall) -> FloatArray:
        return matrix @ (SPACE.point(ball) - answer) + error

    return matrix, error, identified(residuals, SPACE, SETTINGS)


def test_linear_least_squares_and_its_intervals() -> None:
    """x = x₀ − (JᵀJ)⁻¹Jᵀe, half width t s √diag (JᵀJ)⁻¹, and a profile that is exactly quadratic."""
    answer = np.array([0.4, 0.5, 0.6, 0.45, 0.55])
    matrix, error, found = linear_problem(answer, 0.02)
    inverse = np.linalg.inv(matrix.T @ matrix)
    expected = answer - inverse @ matrix.T @ error
    assert SPACE.point(found.ball) == pytest.approx(expected, abs=2e-5)
    left = error - matrix @ inverse @ matrix.T @ error
    half = student_t.ppf(0.95, 35) * np.sqrt(left @ left / 35 * np.diag(inverse))
    for i, interval in enumerate(found.intervals):
        moved = expected.copy()
        moved[i] = expected[i] + half[i]
        assert interval.high == pytest.approx(SPACE.parameter(i, moved), rel=2e-3)
        assert interval.low < interval.value < interval.high
        assert interval.profile_ratio == pytest.approx(1.0, abs=0.02)
        assert interval.is_determined
    assert found.flags == ()
    assert found.rms == pytest.approx(np.sqrt(left @ left / 40), rel=1e-4)


def test_ends_of_a_curved_interval_are_where_the_sum_of_squares_has_grown() -> None:
    """S = A² (e^{3(x − x₀)} − 1)² + B² Σ (others)² + S₀ with S₀ = 40 e²: ends at x₀ + ln(1 ± t √(S₀/40)/A)/3."""
    answer, a, e = np.array([0.5, 0.5, 0.6, 0.45, 0.55]), 1.0, 0.15

    def residuals(ball: BouncingBall) -> FloatArray:
        off = SPACE.point(ball) - answer
        return np.concatenate([[a * np.expm1(3 * off[0])], 2 * off[1:], np.full(40, e)])

    interval = identified(residuals, SPACE, SETTINGS).intervals[0]
    growth = student_t.ppf(0.95, 40) * e / a
    for end, sign in ((interval.low, -1), (interval.high, 1)):
        moved = answer.copy()
        moved[0] += np.log1p(sign * growth) / 3
        # the root of the growth is met within 5 %
        assert end - interval.value == pytest.approx(SPACE.parameter(0, moved) - interval.value, rel=0.07)
    assert interval.value - interval.low > 1.2 * (interval.high - interval.value)
    assert interval.profile_ratio == pytest.approx(1.0, abs=0.1)


def test_a_parameter_that_the_data_do_not_hold_has_no_ends() -> None:
    generator = np.random.default_rng(2)
    error = 0.1 * generator.standard_normal(40)
    matrix = generator.standard_normal((40, 5)) * [1, 1, 1e-3, 1, 1]

    def residuals(ball: BouncingBall) -> FloatArray:
        return matrix @ (SPACE.point(ball) - 0.5) + error

    intervals = identified(residuals, SPACE, SETTINGS).intervals
    assert [interval.is_determined for interval in intervals] == [True, True, False, True, True]
    assert (intervals[2].low, intervals[2].high) == (-np.inf, np.inf)


def test_a_parameter_at_its_bound_is_one_clear_line() -> None:
    _, _, found = linear_problem(np.array([0.4, 0.5, 0.6, 1.2, 0.55]), 0.0)
    [line] = found.flags
    assert line.startswith("bouncing ball: hardening_per_m sits at the upper bound")
    assert "\n" not in line


def test_balls_that_cannot_be_simulated_do_not_stop_the_search() -> None:
    answer = np.array([0.3, 0.5, 0.6, 0.45, 0.55])

    def residuals(ball: BouncingBall) -> FloatArray:
        point = SPACE.point(ball)
        if point[0] > 0.8 or point[1] > 0.9:
            raise AnalysisError("no such ball")
        return np.concatenate([point - answer, 2 * (point - answer)])

    found = identified(residuals, SPACE, SETTINGS)
    assert SPACE.point(found.ball) == pytest.approx(answer, abs=1e-4)


def test_same_seed_same_ball() -> None:
    first, second = (linear_problem(np.full(5, 0.5), 0.1)[2].ball for _ in range(2))
    assert first == second


def test_as_many_values_as_parameters_are_not_enough() -> None:
    with pytest.raises(InputError, match="got 5 values; allowed: more than 5"):
        identified(lambda ball: np.zeros(5), SPACE, SETTINGS)


def test_settings_are_checked() -> None:
    with pytest.raises(InputError, match="population"):
        SearchSettings(population=1)


def measured_map() -> object:
    import xarray as xr

    omega_bar, u_bar = np.linspace(2.0, 6.0, 9), np.linspace(0.02, 0.4, 20)
    w_bar = omega_bar[:, None] * 10 * u_bar
    w_bar[:, 15:] = np.nan
    return xr.Dataset({"w_bar": (("omega_bar", "u_bar"), w_bar)}, coords={"omega_bar": omega_bar, "u_bar": u_bar})


def test_work_line_is_the_map_between_its_grid_lines() -> None:
    line = work_line(measured_map(), 3.25, 11)  # type: ignore[arg-type]
    assert line.u_bar[[0, -1]] == pytest.approx([0.02, 0.30])
    assert line.w_bar == pytest.approx(32.5 * line.u_bar)


@pytest.mark.parametrize("omega_bar", [1.0, 7.0, float("nan")])
def test_a_frequency_that_the_map_does_not_reach(omega_bar: float) -> None:
    with pytest.raises(AnalysisError, match=r"W̄ line: got ω̄ = .* allowed: ω̄ within 2 … 6"):
        work_line(measured_map(), omega_bar)  # type: ignore[arg-type]


def test_errors_by_frequency_are_those_of_the_windows() -> None:
    """Measured = ball + 0.1 away from the tuned frequency, and equal there."""
    ball, rig = BouncingBall(0.009, 6000.0, 20.0, 100.0, 0.1), shaker()
    run = HarmonicRun(6, 4, 60)
    omega_bar, u_bar = np.array([2.0, 3.0, 4.0, 4.1, 5.0, 6.0]), np.full(6, 0.2)
    simulated = w_bar_at(ball, rig, omega_bar, u_bar, run)
    offset = np.array([0.1, 0.1, 0.0, 0.0, 0.1, 0.1])
    bands, again = error_by_frequency(
        ball,
        rig,
        omega_bar=omega_bar,
        u_bar=u_bar,
        w_bar=simulated - offset,
        tuned_omega_bar=4.0,
        n_bands=2,
        run=run,
    )
    assert again == pytest.approx(simulated)
    tuned = [band for band in bands if band.is_tuned]
    assert [band.n_windows for band in tuned] == [2]
    assert tuned[0].error_rms == pytest.approx(0.0, abs=1e-12)
    others = [band for band in bands if not band.is_tuned]
    assert sum(band.n_windows for band in others) == 4
    assert [band.error_mean for band in others] == pytest.approx([0.1, 0.1])
    assert [band.error_rms for band in others] == pytest.approx([0.1, 0.1])
    first = simulated[:2]
    assert others[0].ball_rms == pytest.approx(np.hypot(*first) / np.sqrt(2))
    assert others[0].measured_rms == pytest.approx(np.hypot(*(first - 0.1)) / np.sqrt(2))


def soft_ball() -> BouncingBall:
    """Strikes so hard, where the tank shakes much, that its weak penalty does not hold it."""
    return BouncingBall(0.026, 1000.0, 1.0, 0.001, 0.1)


def test_where_the_ball_leaves_its_tank_nothing_is_compared() -> None:
    rig, run = guided_tank(), HarmonicRun(4, 2, 100)
    omega_bar, u_bar = np.array([2.0, 4.0, 4.1, 6.0, 6.1]), np.array([0.1, 0.1, 2.0, 0.05, 3.0])
    bands, simulated = error_by_frequency(
        soft_ball(), rig, omega_bar=omega_bar, u_bar=u_bar, w_bar=np.full(5, 0.5), tuned_omega_bar=4.0, n_bands=2,
        run=run,
    )  # fmt: skip
    assert np.isnan(simulated).tolist() == [False, False, True, False, True]
    assert [(band.n_windows, band.n_outside) for band in bands] == [(1, 0), (1, 1), (1, 1)]
    assert all(np.isfinite(band.error_rms) for band in bands)
    assert np.isfinite(summary(bands)).all()
    maps = response_map(soft_ball(), rig, np.array([0.006, 0.12]), np.array([8.0]), run)
    assert np.isnan(maps["loss_factor"].values).tolist() == [[False, True]]


def test_a_band_without_a_window_to_compare_is_not_a_number() -> None:
    bands, _ = error_by_frequency(
        soft_ball(), guided_tank(), omega_bar=np.array([4.0, 6.0]), u_bar=np.array([0.1, 3.0]),
        w_bar=np.full(2, 0.5), tuned_omega_bar=4.0, n_bands=2, run=HarmonicRun(4, 2, 100),
    )  # fmt: skip
    assert [(band.n_windows, band.n_outside) for band in bands] == [(1, 0), (0, 1)]
    assert np.isnan(bands[1].error_rms)
    assert np.isnan(summary(bands)[1])


def test_summary_weighs_bands_by_their_windows() -> None:
    """√((1·0.3² + 3·0.1²)/(1·1² + 3·2²)) = √(0.12/13)."""
    bands = (
        FrequencyBand(1, 2, False, 1, 1.0, 1.0, 0.3, 0.0),
        FrequencyBand(2, 3, True, 5, 2.0, 2.0, 0.1, 0.0),
        FrequencyBand(3, 4, False, 3, 2.0, 2.0, 0.1, 0.0),
    )
    assert summary(bands) == pytest.approx((0.05, np.sqrt(0.12 / 13)))


def test_no_window_at_the_tuned_frequency() -> None:
    ball = BouncingBall(0.009, 6000.0, 20.0, 100.0, 0.1)
    run = HarmonicRun(1, 1, 60)
    with pytest.raises(AnalysisError, match="none within"):
        error_by_frequency(
            ball, shaker(), omega_bar=np.array([2.0]), u_bar=np.array([0.1]), w_bar=np.array([1.0]),
            tuned_omega_bar=4.0, run=run,
        )  # fmt: skip
