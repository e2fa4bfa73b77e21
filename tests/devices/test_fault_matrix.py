"""Each fault on each transport in its intensities: every sample right or flagged, and the recording goes on."""

from __future__ import annotations

import numpy as np
import pytest
from fault_matrix import played_and_recorded, problems
from matrix_cases import FAULTS, TRANSPORTS, Case, cases
from matrix_recordings import NAMES, Motion, Pattern

QUICK = ("serial socket", "CAN FD over slcan")
"""Transports on which all intensities are tried each time; on the others one of each fault is."""


def is_slow(case: Case) -> bool:
    if case.intensity.speed != "max":
        return True
    chosen = FAULTS[case.fault][0 if case.fault in ("none", "restart") else 1]
    return case.intensity is not chosen and (
        case.transport.name not in QUICK or case.fault in ("disconnect", "restart")
    )


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, id=case.name, marks=[pytest.mark.slow] if is_slow(case) else [])
        for case in cases()
        if case.exists
    ],
)
def test_every_sample_is_right_or_flagged(case, tmp_path):
    assert problems(played_and_recorded(case, tmp_path)) == []


def test_each_fault_is_tried_on_each_transport_every_time():
    quick = {(case.fault, case.transport.name) for case in cases() if case.exists and not is_slow(case)}
    assert quick == {(fault, transport) for fault in FAULTS for transport in TRANSPORTS} - {
        ("swapped sensors", name) for name, transport in TRANSPORTS.items() if transport.kind == "can"
    }


@pytest.mark.parametrize("n_samples", [1024, 2048])
def test_the_truth_tells_every_place_of_a_sample(n_samples):
    counts = Pattern(n_samples).counts(np.arange(n_samples))
    for column, name in enumerate(NAMES):
        assert len(np.unique(counts[:, column])) == n_samples, name
    assert np.abs(counts[:, :4]).max() < 2**15
    assert np.abs(counts[:, 4]).max() < 2**23


def test_the_smallest_error_of_a_clock_shows_in_the_motion():
    truth = Motion(2048)
    places = np.arange(100, 1948)
    for shifted in (places + 0.005 * 512, places * (1 + 1e-4)):
        off = np.abs(truth.counts(shifted) - truth.counts(places)).max(axis=0)
        assert (off > 20 * truth.tolerance()).all()
