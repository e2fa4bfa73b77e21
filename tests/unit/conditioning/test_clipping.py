import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from sloshlab.conditioning.clipping import clipped_samples, clipping, clipping_limits

TIME = np.arange(4000) / 1000
SINE = np.sin(2 * np.pi * 5 * TIME + 0.1)


def channel(values, **attributes):
    values = np.asarray(values)
    coordinates = {"time": np.arange(values.size) / 1000}
    return xr.DataArray(values, dims="time", coords=coordinates, name="force_cell_1", attrs=attributes)


def test_samples_at_the_stated_limits_are_counted_with_runs():
    values = [0.0, 5.0, 5.0, 1.0, -5.0, np.nan, 4.9, 5.0]
    run = channel(values, range_min=-5.0, range_max=5.0)
    assert clipped_samples(run).tolist() == [False, True, True, False, True, False, False, True]
    found = clipping(run)
    assert (found.n_clipped, found.n_runs, found.longest_run) == (4, 3, 2)
    assert found.first_s == pytest.approx(0.001)
    assert found.range_is_stated


def test_margin_is_half_an_adc_step_where_known_and_a_millionth_of_the_range_where_not():
    assert clipping_limits(channel([0.0], range_min=-10.0, range_max=30.0)) == pytest.approx(
        (-10 + 4e-5, 30 - 4e-5)
    )
    stored = channel([0.0], range_min=-10.0, range_max=30.0)
    stored.encoding["scale_factor"] = 0.5
    assert clipping_limits(stored) == (-9.75, 29.75)
    assert clipping_limits(channel([0.0])) == (-np.inf, np.inf)
    assert clipping_limits(channel([0.0], range_max=2.0)) == pytest.approx((-np.inf, 2 - 2e-6))


def test_adc_counts_one_step_below_full_scale_count_as_clipped_only_within_half_a_step():
    step = 10 / 2**15
    run = channel([10.0 - step, 10.0 - 0.4 * step], range_min=-10.0, range_max=10.0, adc_step=step)
    assert clipped_samples(run).tolist() == [False, True]


@pytest.mark.parametrize("side", [1, -1])
def test_flat_top_without_stated_range_is_suspected_on_either_side(side):
    found = clipping(channel(side * np.minimum(SINE, 0.8)))
    assert found.is_suspected
    assert found.n_suspected == np.count_nonzero(SINE >= 0.8)
    assert (found.n_clipped, found.range_is_stated) == (0, False)


@settings(max_examples=60, deadline=None)
@given(bits=st.integers(6, 16), amplitude=st.floats(0.3, 1.0), phase=st.floats(0, 6.28))
def test_a_sine_rounded_to_adc_steps_is_not_suspected(bits, amplitude, phase):
    step = 2.0 ** (1 - bits)
    time = np.arange(20000) / 1000
    sine = amplitude * np.sin(2 * np.pi * 4.337 * time + phase)
    assert not clipping(channel(np.round(sine / step) * step)).is_suspected


def test_a_sine_cut_by_its_adc_is_suspected():
    step = 2 / 2**12
    assert clipping(channel(np.round(np.clip(SINE, -0.9, 0.9) / step) * step)).is_suspected


@pytest.mark.parametrize("values", [np.zeros(50), np.arange(50.0), np.full(50, np.nan)])
def test_constant_rising_and_lost_channels_are_not_suspected(values):
    assert not clipping(channel(values)).is_suspected


def test_single_precision():
    found = clipping(channel(np.minimum(SINE, 0.8).astype(np.float32), range_min=-0.8, range_max=0.8))
    assert found.n_clipped == np.count_nonzero(SINE >= 0.8) + np.count_nonzero(SINE <= -0.8 * (1 - 2e-6))
