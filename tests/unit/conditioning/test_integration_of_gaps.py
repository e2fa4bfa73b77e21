import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from sloshlab.conditioning.integration import (
    displacement,
    integrated,
    integration_error,
    is_away_from_ends,
    velocity,
)
from sloshlab.errors import AnalysisError

RATE_HZ = 1000.0
TIME = np.arange(0, 20, 1 / RATE_HZ)
OMEGA = 2 * np.pi * 8


def test_nan_out_exactly_where_nan_in():
    values = np.cos(OMEGA * TIME)
    values[[0, 5000, 5001, 12345]] = np.nan
    assert np.array_equal(np.isnan(integrated(values, 1 / RATE_HZ)), np.isnan(values))


def test_each_stretch_is_integrated_alone():
    values = np.cos(OMEGA * TIME) + 0.3
    values[8000:8100] = np.nan
    result = integrated(values, 1 / RATE_HZ)
    alone = integrated(values[8100:].copy(), 1 / RATE_HZ)
    assert np.array_equal(result[8100:], alone)
    values[:8000] *= 7
    assert np.array_equal(integrated(values, 1 / RATE_HZ)[8100:], alone)


def test_velocity_is_right_on_both_sides_of_a_gap():
    values = np.cos(OMEGA * TIME) + 0.3
    values[8000:8003] = np.nan
    away = is_away_from_ends(~np.isnan(values), 1 / RATE_HZ)
    result = integrated(values, 1 / RATE_HZ)
    assert np.count_nonzero(away) == TIME.size - 3 - 4 * 2000
    # one corner period from an end what is left of the unknown constant has died down to some per cent
    assert np.abs(result - np.sin(OMEGA * TIME) / OMEGA)[away].max() < 0.01 / OMEGA


def test_islands_too_short_for_the_rule_stay_nan():
    values = np.cos(OMEGA * TIME)
    values[[3000, 3006, 4000, 4007]] = np.nan
    result = integrated(values, 1 / RATE_HZ)
    assert np.isnan(result[3000:3007]).all()
    assert np.isfinite(result[4001:4007]).all()
    values[-6] = np.nan
    assert np.isnan(integrated(values, 1 / RATE_HZ)[-6:]).all()


def test_everything_lost_gives_everything_lost():
    assert np.isnan(integrated(np.full(100, np.nan), 1 / RATE_HZ)).all()


def test_single_precision_in_double_precision_out_and_input_untouched():
    values = np.cos(OMEGA * TIME).astype(np.float32)
    before = values.copy()
    result = integrated(values, 1 / RATE_HZ)
    assert result.dtype == np.float64
    assert np.array_equal(values, before)
    assert result == pytest.approx(integrated(before.astype(np.float64), 1 / RATE_HZ), abs=1e-9)


@settings(max_examples=20, deadline=None)
@given(scale=st.floats(-1e3, 1e3), n=st.integers(6, 3000))
def test_linear_in_the_acceleration(scale, n):
    values = np.cos(OMEGA * TIME[:n]) + 0.2
    expected = scale * integrated(values, 1 / RATE_HZ)
    assert integrated(scale * values, 1 / RATE_HZ) == pytest.approx(expected, rel=1e-6, abs=1e-9)


@settings(max_examples=20, deadline=None)
@given(n=st.integers(6, 6000))
def test_reversal_in_time_reverses_the_velocity_sign(n):
    """No phase error: the reversed record gives the reversed velocity with the opposite sign."""
    values = np.cos(OMEGA * TIME[:n] + 0.7) + 0.1 * TIME[:n]
    rate_hz = 100.0  # one knot per sample, so that the knots too lie symmetrically
    forward = integrated(values, 1 / rate_hz, corner_hz=0.5)
    backward = integrated(values[::-1].copy(), 1 / rate_hz, corner_hz=0.5)[::-1]
    assert forward == pytest.approx(-backward, rel=1e-6, abs=1e-7 * np.abs(forward).max() + 1e-12)


def data_array(quantity):
    return xr.DataArray(
        np.ones(100), dims="time", coords={"time": TIME[:100]}, name="x", attrs={"quantity": quantity}
    )


@pytest.mark.parametrize(("function", "wrong"), [(velocity, "force"), (displacement, "acceleration")])
def test_wrong_quantity_is_refused(function, wrong):
    with pytest.raises(AnalysisError, match=f"got quantity '{wrong}'"):
        function(data_array(wrong))


@pytest.mark.parametrize(
    "settings_", [{"corner_hz": 0.0}, {"corner_hz": -1.0}, {"corner_hz": 500.0}, {"order": 0}, {"order": 4}]
)
def test_impossible_high_passes_are_refused(settings_):
    with pytest.raises(AnalysisError, match=r"corner_hz|order"):
        velocity(data_array("acceleration"), **settings_)


@pytest.mark.parametrize("frequency_hz", [0.0, -1.0, 500.0])
def test_frequencies_without_an_error_statement_are_refused(frequency_hz):
    with pytest.raises(AnalysisError, match="frequency_hz"):
        integration_error(frequency_hz, RATE_HZ)
