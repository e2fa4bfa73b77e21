"""The size of an effect in noise floors."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from sloshlab.diagnosis.inference.scored_model import strength

SHAPE = (40, 30)


def left_by(*channels: np.ndarray) -> Any:
    """A model that leaves these residuals in the channels of one run; the first half of it is informative."""
    informative = np.zeros(SHAPE, bool)
    informative[: SHAPE[0] // 2] = True
    observed = [SimpleNamespace(informative=informative) for _ in channels]
    return cast(Any, SimpleNamespace(runs=[SimpleNamespace(observed=observed, residual=list(channels))]))


def test_a_size_is_that_of_what_is_added_where_recordings_stand_out() -> None:
    noise = np.random.default_rng(1).normal(size=(2, *SHAPE))
    added = np.zeros((2, *SHAPE))
    added[0, : SHAPE[0] // 2], added[1, SHAPE[0] // 2 :] = 0.6, 5.0
    # The floor is three times the noise here; what is added is as large as it is.
    before, after = left_by(*(noise / 3 + added)), left_by(*(noise / 3))
    assert strength(before, after) == pytest.approx(0.6)
