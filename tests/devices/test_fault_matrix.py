"""Each fault on each transport in its intensities: every sample right or flagged, and the recording goes on."""

from __future__ import annotations

import dataclasses

import netCDF4
import numpy as np
import pytest
from fault_matrix import played_and_recorded, problems
from matrix_cases import FAULTS, TRANSPORTS, Case, Intensity, cases
from matrix_recordings import NAMES, Motion, Pattern
from matrix_verdict import verdict

SERIAL = tuple(name for name, transport in TRANSPORTS.items() if transport.kind == "serial")
CAN = tuple(name for name in TRANSPORTS if name not in SERIAL)


def usual(fault: str) -> Intensity:
    """The one of its intensities that is tried each time."""
    return FAULTS[fault][0 if fault in ("none", "restart", "swapped sensors") else 1]


def quick_cases() -> set[tuple[str, str, str]]:
    """A diagonal of the matrix: the usual intensity of each fault on a serial and on a CAN transport, in turn."""
    return {
        (fault, usual(fault).label, transports[number % len(transports)])
        for number, fault in enumerate(FAULTS)
        for transports in (SERIAL, CAN)
    }


def is_slow(case: Case) -> bool:
    return (case.fault, case.intensity.label, case.transport.name) not in quick_cases()


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


def test_each_fault_and_each_transport_is_tried_every_time():
    quick = [case for case in cases() if case.exists and not is_slow(case)]
    assert {(case.fault, case.transport.kind == "serial") for case in quick} == {
        (fault, is_serial) for fault in FAULTS for is_serial in (True, False)
    }
    for transport in TRANSPORTS:
        assert len({case.fault for case in quick if case.transport.name == transport}) >= 4, transport


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


def exchange(counts, quality, lost):
    kept = np.flatnonzero(~lost)
    counts[kept[5]], counts[kept[6]] = counts[kept[6]], counts[kept[5]]


def off_by_one(counts, quality, lost):
    counts[np.flatnonzero(~lost)[7]] += 1


def lose(counts, quality, lost):
    counts[np.flatnonzero(~lost)[7]] = counts[np.flatnonzero(lost)[0]]
    quality[np.flatnonzero(~lost)[7]] = 1


def lose_unflagged(counts, quality, lost):
    quality[np.flatnonzero(lost)[3]] = 0


def invent(counts, quality, lost):
    counts[np.flatnonzero(lost)[3]] = 5


def suspect(counts, quality, lost):
    quality[np.flatnonzero(~lost)[9]] = 16


@pytest.fixture(scope="module")
def lossy(tmp_path_factory):
    """A recording with a tenth of the frames dropped."""
    return played_and_recorded(
        Case("drop", FAULTS["drop"][1], TRANSPORTS["serial socket"]), tmp_path_factory.mktemp("lossy")
    )


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (exchange, "some readings are silently wrong"),
        (off_by_one, "some readings are silently wrong"),
        (lose, "too many readings that were sent are lost"),
        (lose_unflagged, "rows with lost readings are not flagged"),
        (invent, "some readings are invented"),
        (suspect, "flagged as stuck without cause"),
    ],
)
def test_the_judge_sees_what_is_done_to_a_file(lossy, tmp_path, damage, said):
    assert problems(lossy) == []
    path = tmp_path / "run.nc"
    path.write_bytes(lossy.recorded.path.read_bytes())
    with netCDF4.Dataset(path, "a") as file:
        file.set_auto_maskandscale(False)
        counts, quality = file["force_cell_2"][:], file["quality"][:]
        damage(counts, quality, counts == file["force_cell_2"].getncattr("_FillValue"))
        file["force_cell_2"][:], file["quality"][:] = counts, quality
    recorded = dataclasses.replace(lossy.recorded, path=path)
    found = problems(dataclasses.replace(lossy, recorded=recorded, verdict=verdict(recorded)))
    assert said in "; ".join(found)
