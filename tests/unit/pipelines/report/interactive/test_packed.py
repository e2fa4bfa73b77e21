"""Numbers and names through the text of a page and back."""

from __future__ import annotations

import json

import numpy as np
import pytest
from page_contents import numbers, samples

from pipelines.report.interactive.packed import packed, packed_steps, safe_json


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e12])
def test_values_come_back_to_half_a_step_of_their_range(scale: float) -> None:
    values = scale * np.random.default_rng(3).normal(size=2000)
    # 65 535 codes, the last of them for what is missing: 65 534 steps between the extremes
    half_a_step = 0.5 * (values.max() - values.min()) / 65_534
    np.testing.assert_allclose(numbers(packed(values)), values, rtol=0, atol=1.0001 * half_a_step)


def test_what_is_not_finite_is_missing_and_nothing_else() -> None:
    values = np.array([1.0, np.nan, -2.0, np.inf, -np.inf, 3.0])
    np.testing.assert_allclose(numbers(packed(values)), [1.0, np.nan, -2.0, np.nan, np.nan, 3.0], atol=1e-4)


@pytest.mark.parametrize("values", [[], [np.nan, np.nan], [4.0, 4.0], [0.0], [-1.7e308, 1.7e308]])
def test_no_values_equal_values_and_the_largest_there_are(values: list[float]) -> None:
    back = packed(values)
    json.loads(safe_json(back))
    with np.errstate(over="ignore"):
        shown = numbers(back)
    assert shown.size == len(values)
    if values and np.isfinite(values).all() and max(values) < 1e300:
        np.testing.assert_allclose(shown, values)


@pytest.mark.parametrize(
    "kept", [np.arange(20), np.array([0, 5, 6, 70_000, 200_000]), np.array([3, 4, 65_538]), np.array([], int)]
)
def test_samples_come_back_exactly(kept: np.ndarray) -> None:
    np.testing.assert_array_equal(samples(packed_steps(kept)), kept)


def test_json_has_nothing_that_html_or_a_script_would_obey() -> None:
    name = "</script><!-- & \u2028\u2029 \ud800"
    text = safe_json({name: [name, float("inf"), np.float32("nan"), np.int64(3), {"x": (1.5, True, None)}]})
    assert not set("<>&\u2028\u2029") & set(text)
    back = json.loads(text)
    # half a surrogate pair, as file names may hold, is no character
    same = name.replace("\ud800", "?")
    assert back == {same: [same, None, None, 3, {"x": [1.5, True, None]}]}
