import json
import math

import numpy as np
import pytest
import xarray as xr
from swept_tank import RATE_HZ, swept_tank

from sloshlab.conditioning.redundancy import agreement, redundant_accelerometers, require_equal_signs
from sloshlab.errors import AnalysisError

ROOF_1, ROOF_2, CONTROL = "acceleration_roof_1", "acceleration_roof_2", "acceleration_control"


@pytest.mark.parametrize("delay_s", [0.0, 1e-5, -1e-4, 2e-3])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_gain_and_delay_of_a_sensor_are_found(delay_s, noise):
    run = swept_tank(gains={ROOF_2: 0.985}, delays_s={ROOF_2: delay_s}, noise=noise)
    (pair,) = agreement(run, [ROOF_1, ROOF_2]).pairs
    # noise of 1 % leaves 1 % · √(2/60000) · a few = 1e-4 in gain, and that over ω = 60 rad/s in delay
    assert pair.gain_ratio == pytest.approx(0.985, rel=2e-4 if noise else 1e-5)
    assert pair.delay_s == pytest.approx(delay_s, abs=3e-6 if noise else 2e-8 + 1e-4 * abs(delay_s))
    assert pair.phase_error_at_20_hz_rad == pytest.approx(-2 * math.pi * 20 * pair.delay_s)
    assert pair.sign == 1


def test_rms_disagreement_of_independent_noise_gain_and_offset():
    run = swept_tank(noise=0.01)
    run[ROOF_2] += 3.0
    (pair,) = agreement(run, [ROOF_1, ROOF_2]).pairs
    assert pair.rms_disagreement == pytest.approx(0.01 * math.sqrt(2), rel=0.02)
    (pair,) = agreement(swept_tank(gains={ROOF_2: 1.03}), [ROOF_1, ROOF_2]).pairs
    assert pair.rms_disagreement == pytest.approx(0.03, rel=1e-9)


@pytest.mark.parametrize("wrong", [ROOF_1, ROOF_2, CONTROL])
def test_one_wrong_sign_among_three_is_named_whichever_is_the_reference(wrong):
    run = swept_tank(gains={wrong: -1.01}, noise=0.01)
    names = redundant_accelerometers(run)
    assert sorted(names) == sorted([ROOF_1, ROOF_2, CONTROL])
    for reference in names:
        agreed = agreement(run, names, reference)
        assert agreed.wrong_sign == (wrong,)
        with pytest.raises(AnalysisError, match=rf"^{wrong}: sign: .*remedy: set sign = -1 for {wrong}"):
            require_equal_signs(agreed)


def test_two_that_disagree_are_both_named():
    agreed = agreement(swept_tank(gains={ROOF_2: -1.0}), [ROOF_1, ROOF_2])
    with pytest.raises(AnalysisError, match=f"{ROOF_1} or {ROOF_2}: sign: got moves against each other"):
        require_equal_signs(agreed)


def test_agreeing_sensors_pass():
    agreed = agreement(swept_tank(), [ROOF_1, ROOF_2, CONTROL])
    assert agreed.wrong_sign == ()
    require_equal_signs(agreed)


def test_lost_samples_cost_only_their_block():
    run = swept_tank(gains={ROOF_2: 0.985}, delays_s={ROOF_2: 1e-4})
    run[ROOF_1][30000:30100] = np.nan
    run[ROOF_2][5] = np.nan
    (pair,) = agreement(run, [ROOF_1, ROOF_2]).pairs
    assert (pair.gain_ratio, pair.delay_s) == pytest.approx((0.985, 1e-4), rel=1e-3)
    assert math.isfinite(pair.rms_disagreement)


def test_as_data_set_and_dictionary():
    agreed = agreement(swept_tank(gains={ROOF_2: 0.98}), [ROOF_1, ROOF_2, CONTROL])
    table = agreed.to_dataset()
    assert table["gain_ratio"].sel(sensor=ROOF_2).item() == pytest.approx(0.98, rel=1e-5)
    assert (table.attrs["reference"], table["delay_s"].attrs["units"]) == (ROOF_1, "s")
    assert json.loads(json.dumps(agreed.to_dict()))["pairs"][1]["name"] == CONTROL


@pytest.mark.parametrize(
    ("names", "reference", "message"),
    [
        ([ROOF_1], None, "two or more"),
        ([ROOF_1, ROOF_1], None, "two or more"),
        ([], None, "got none"),
        ([ROOF_1, "force_cell_1"], None, "of one quantity"),
        ([ROOF_1, ROOF_2], CONTROL, "reference sensor"),
        ([ROOF_1, "acceleration_9"], None, "not in the recording"),
    ],
)
def test_what_cannot_be_compared_is_refused(names, reference, message):
    with pytest.raises(AnalysisError, match=message):
        agreement(swept_tank(duration_s=2.0), names, reference)


def test_too_short_and_too_lossy_recordings_are_refused():
    with pytest.raises(AnalysisError, match="length of the recording"):
        agreement(swept_tank(duration_s=0.1), [ROOF_1, ROOF_2])
    run = swept_tank(duration_s=10.0)
    run[ROOF_1][:: int(RATE_HZ / 4)] = np.nan
    with pytest.raises(AnalysisError, match="lost samples in every block"):
        agreement(run, [ROOF_1, ROOF_2])


def test_a_dead_sensor_gives_nan_not_a_number():
    run = swept_tank(duration_s=10.0)
    run[ROOF_1][:] = 0.0
    (pair,) = agreement(run, [ROOF_1, ROOF_2]).pairs
    assert math.isnan(pair.gain_ratio)
    assert math.isnan(pair.delay_s)


def test_noise_is_no_wrong_sign():
    """Sensors without a common motion have nothing to be opposite in."""
    rng = np.random.default_rng(12)
    names = ["acceleration_roof_1", "acceleration_roof_2", "acceleration_control"]
    for _ in range(20):
        variables = {
            name: ("time", rng.standard_normal(5000), {"units": "m s-2", "quantity": "acceleration"})
            for name in names
        }
        run = xr.Dataset(variables, {"time": np.arange(5000) / 500.0}, {"sampling_rate_hz": 500.0})
        assert agreement(run, names).wrong_sign == ()
