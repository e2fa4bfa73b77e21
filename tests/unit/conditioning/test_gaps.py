import itertools

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from sloshlab.conditioning.gaps import (
    Gap,
    gaps,
    longest_whole_stretch,
    runs,
    sample_is_usable,
    sampling_step_s,
)
from sloshlab.errors import AnalysisError

NAN = np.nan


def recording(quality=None, **values):
    n = len(next(iter(values.values())))
    variables = {name: ("time", np.array(row), {"quantity": "force"}) for name, row in values.items()}
    if quality is not None:
        variables["quality"] = ("time", np.array(quality, dtype=np.uint8))
    return xr.Dataset(variables, coords={"time": 0.5 + 0.1 * np.arange(n)})


def test_gaps_are_listed_with_times_and_counts():
    run = recording(force_cell_1=[NAN, 1, 2, NAN, NAN, 5], force_cell_2=[0, 1, 2, 3, NAN, NAN])
    found = gaps(run)
    assert [gap.n_samples for gap in found] == [1, 3]
    assert [gap.start_s for gap in found] == pytest.approx([0.5, 0.8])
    assert [gap.stop_s for gap in found] == pytest.approx([0.5, 1.0])
    assert gaps(run, ["force_cell_2"]) == (Gap(run["time"].values[4], run["time"].values[5], 2),)


def test_no_gaps():
    assert gaps(recording(force_cell_1=[1.0, 2.0])) == ()


def test_a_flag_without_nan_costs_every_channel_and_one_with_nan_only_the_nan():
    run = recording(quality=[0, 1, 1, 2], force_cell_1=[0.0, 1, NAN, 3], force_cell_2=[0.0, 1, 2, 3])
    assert sample_is_usable(run, ["force_cell_1"]).tolist() == [True, False, False, True]
    assert sample_is_usable(run, ["force_cell_2"]).tolist() == [True, False, True, True]


def test_single_precision_channels():
    run = recording(force_cell_1=np.array([0, NAN, 2], dtype=np.float32))
    assert sample_is_usable(run).tolist() == [True, False, True]


def test_the_longest_stretch_is_the_first_of_equals_and_empty_without_any():
    assert longest_whole_stretch(np.array([True, True, False, True, True, False])) == slice(0, 2)
    assert longest_whole_stretch(np.array([True, False, True, True, True])) == slice(2, 5)
    assert longest_whole_stretch(np.zeros(3, bool)) == slice(0, 0)


def test_a_missing_channel_is_named_with_those_there_are():
    with pytest.raises(AnalysisError, match=r"force_cell_9: got not in the recording; allowed: force_cell_1"):
        sample_is_usable(recording(force_cell_1=[0.0]), ["force_cell_9"])


def test_one_sample_has_no_step():
    with pytest.raises(AnalysisError, match="number of samples: got 1"):
        sampling_step_s(recording(force_cell_1=[0.0]))


@given(st.lists(st.booleans(), max_size=60), st.booleans())
def test_runs_rebuild_the_mask(mask, value):
    rebuilt = [not value] * len(mask)
    stretches = runs(np.array(mask, dtype=bool), value)
    for start, stop in stretches:
        assert start < stop
        rebuilt[start:stop] = [value] * (stop - start)
    assert rebuilt == mask
    assert all(a[1] < b[0] for a, b in itertools.pairwise(stretches))
