"""Radial basis functions against a known field: values, standard errors, honest cross-validation."""

from __future__ import annotations

import numpy as np
import pytest

from sloshlab.errors import AnalysisError
from sloshlab.maps.interpolation import CrossValidation, ScatteredField, cross_validation, interpolated

RNG = np.random.default_rng(20260131)
N_RUNS, N_WINDOWS = 9, 25
X = np.tile(np.linspace(0.0, 2.0, N_WINDOWS), N_RUNS)
Y = np.repeat(np.linspace(-2.0, 2.5, N_RUNS), N_WINDOWS)
GROUP = np.repeat(np.arange(N_RUNS), N_WINDOWS)
POINTS = {"plane": np.column_stack([X, Y])}
INSIDE = np.column_stack([RNG.uniform(0.1, 1.9, 400), RNG.uniform(-1.8, 2.3, 400)])


def truth(points):
    return 1.6 * np.exp(-((points[:, 0] - 1.0) ** 2) / 0.8 - (points[:, 1] - 0.7) ** 2 / 1.5)


def field_of(noise, seed=0, std=None):
    scatter = noise * np.random.default_rng(seed).standard_normal(X.size)
    std = np.full(X.size, max(noise, 1e-12)) if std is None else std
    return ScatteredField(POINTS, truth(POINTS["plane"]) + scatter, std, GROUP)


def chosen(smoothing=0.0):
    return CrossValidation(0.0, 0.0, "plane", smoothing)


def test_a_smooth_field_is_reproduced_between_the_runs():
    values, _ = interpolated(field_of(0.0), {"plane": INSIDE}, chosen())
    assert np.sqrt(np.mean((values - truth(INSIDE)) ** 2)) < 0.02 * 1.6


def test_a_plane_is_reproduced_exactly():
    plane = lambda p: 0.3 + 2.0 * p[:, 0] - 0.7 * p[:, 1]  # noqa: E731
    field = ScatteredField(POINTS, plane(POINTS["plane"]), np.full(X.size, 0.1), GROUP)
    for smoothing in (0.0, 0.1):
        np.testing.assert_allclose(
            interpolated(field, {"plane": INSIDE}, chosen(smoothing))[0], plane(INSIDE), atol=1e-8
        )


def test_without_smoothing_the_data_are_met():
    field = field_of(0.05)
    np.testing.assert_allclose(interpolated(field, POINTS, chosen())[0], field.values, atol=1e-8)


@pytest.mark.parametrize("smoothing", [0.0, 0.01])
def test_standard_errors_are_those_of_repeats(smoothing):
    """40 repeats with other noise: the spread at each point is known to 11 %, that of all to a few percent."""
    noise = 0.02 + 0.06 * (X > 1.0)
    repeats, stated = [], None
    for seed in range(40):
        scatter = noise * np.random.default_rng(seed).standard_normal(X.size)
        field = ScatteredField(POINTS, truth(POINTS["plane"]) + scatter, noise, GROUP)
        values, stated = interpolated(field, {"plane": INSIDE[:100]}, chosen(smoothing))
        repeats.append(values)
    ratio = np.std(repeats, axis=0, ddof=1) / stated
    assert 0.92 < np.sqrt(np.mean(ratio**2)) < 1.08
    assert ratio.min() > 0.6
    assert ratio.max() < 1.4


@pytest.mark.parametrize("noise", [0.002, 0.03, 0.1])
def test_cross_validation_tells_the_true_error_within_a_factor_of_two(noise):
    """Left-out windows carry their own noise: what is compared is the error against new noisy windows."""
    field = field_of(noise, seed=4)
    validation = cross_validation(field)
    values, _ = interpolated(field, {"plane": INSIDE}, validation)
    new = truth(INSIDE) + noise * np.random.default_rng(5).standard_normal(INSIDE.shape[0])
    error = np.sqrt(np.mean((values - new) ** 2))
    assert 0.5 < validation.left_out_windows_rms / error < 2.0


def test_leaving_out_runs_costs_more_than_leaving_out_windows():
    validation = cross_validation(field_of(0.002))
    assert validation.left_out_runs_rms > 2 * validation.left_out_windows_rms


def test_noise_is_smoothed_and_exact_data_are_not():
    assert cross_validation(field_of(0.0)).smoothing <= 1e-6
    smooth = cross_validation(field_of(0.1))
    assert smooth.smoothing >= 1e-3
    error = [
        np.sqrt(np.mean((interpolated(field_of(0.1), {"plane": INSIDE}, validation)[0] - truth(INSIDE)) ** 2))
        for validation in (smooth, chosen())
    ]
    assert error[0] < 0.7 * error[1]


def test_the_coordinates_in_which_the_field_is_smooth_are_chosen():
    bent = np.column_stack([X, Y**3])
    value = np.sin(2 * X) + 0.2 * Y
    field = ScatteredField({"bent": bent, "plane": POINTS["plane"]}, value, np.full(X.size, 1e-6), GROUP)
    assert cross_validation(field).coordinates == "plane"


@pytest.mark.parametrize("n", [0, 2])
def test_too_few_windows(n):
    with pytest.raises(AnalysisError, match=f"{n} windows"):
        ScatteredField({"plane": np.zeros((n, 2))}, np.zeros(n), np.zeros(n), np.zeros(n, dtype=int))


def test_one_run_lies_on_a_line_and_still_gives_a_map():
    line = {"plane": np.column_stack([np.arange(10.0), 0 * np.arange(10.0)])}
    field = ScatteredField(line, np.arange(10.0), np.full(10, 0.1), np.zeros(10, dtype=int))
    validation = cross_validation(field)
    assert np.isnan(validation.left_out_runs_rms)
    values, _ = interpolated(field, {"plane": np.array([[4.5, 0.0]])}, chosen())
    assert values[0] == pytest.approx(4.5, abs=1e-6)
