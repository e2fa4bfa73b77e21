"""A burst of noise is nothing that a simulation lacks; what lasts is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import pytest

from sloshlab.diagnosis.free_run_problem import rms_without_bursts


@dataclass
class Spectra:
    """As much of an observation as has times and bands."""

    spectra: np.ndarray
    informative: np.ndarray


def observed(n_times: int, n_bands: int = 30) -> Spectra:
    return Spectra(np.zeros((n_times, n_bands)), np.ones((n_times, n_bands), bool))


def test_loud_times_up_to_a_quarter_do_not_count() -> None:
    residual = np.ones((16, 30))
    residual[[2, 7, 8, 9]] = 50.0
    assert rms_without_bursts(cast(Any, [observed(16)]), residual.ravel()) == pytest.approx(1.0)


def test_what_lasts_longer_counts_with_its_size() -> None:
    residual = np.ones((16, 30))
    residual[4:] = 3.0
    # four quiet times and eight of the twelve loud ones
    expected = np.sqrt((4 * 1.0 + 8 * 9.0) / 12)
    assert rms_without_bursts(cast(Any, [observed(16)]), residual.ravel()) == pytest.approx(expected)


def test_channels_have_their_own_quiet_times_and_bands_without_information_do_not_count() -> None:
    first, second = observed(8), observed(8)
    second.informative[:, 10:] = False
    one, other = np.full((8, 30), 2.0), np.full((8, 30), 1.0)
    one[0], other[5], other[:, 10:] = 9.0, 9.0, 9.0
    found = rms_without_bursts(cast(Any, [first, second]), np.concatenate([one.ravel(), other.ravel()]))
    assert found == pytest.approx(np.sqrt((6 * 30 * 4.0 + 6 * 10 * 1.0) / (6 * 40)))
