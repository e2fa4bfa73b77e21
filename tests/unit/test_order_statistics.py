"""Medians and quantiles of sorted numbers, against NumPy's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sloshlab.order_statistics import median, median_of_sorted, quantile_of_sorted

NUMBERS = arrays(np.float64, st.integers(1, 40), elements=st.floats(-1e6, 1e6))


@given(NUMBERS, st.floats(0.0, 1.0))
def test_quantiles_lie_between_two_values_as_those_of_numpy(values, share):
    largest = np.abs(values).max()
    found = quantile_of_sorted(np.sort(values), share)
    assert found == pytest.approx(np.quantile(values, share), rel=1e-12, abs=1e-12 * largest)


@given(NUMBERS)
def test_medians_are_those_of_numpy_to_the_last_bit(values):
    assert median(values) == median_of_sorted(np.sort(values)) == np.median(values)


def test_a_quantile_divides_the_way_between_its_neighbours():
    # of 11 numbers the quantile 0.05 is half way from the first to the second, 0.98 four fifths to the last
    values = np.concatenate([np.arange(10.0) ** 2, [1000.0]])
    assert quantile_of_sorted(values, 0.05) == 0.5
    assert quantile_of_sorted(values, 0.98) == pytest.approx(81.0 + 0.8 * 919.0)
    assert quantile_of_sorted(values, 1.0) == 1000.0
