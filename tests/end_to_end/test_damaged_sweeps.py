"""One empty, one frozen and one 3 g sweep, damaged in ways that moved W̄ or β and said nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from slow_cases import slow_but

from sloshlab.recording import read_recording
from studies.consistency_sensitivity.damages import DAMAGES, FORCES, Case, changed
from studies.consistency_sensitivity.measurement import analysed

FOLDER = Path(__file__).parents[2] / "raw_data" / "shaker"
DAMAGE = {damage.name: damage for damage in DAMAGES}
SILENT_ONCE = [
    ("forces late", 1.0),
    ("forces early", 1.0),
    ("forces late, no dry runs", 1.0),
    ("forces early, no dry runs", 1.0),
    ("one cell late", 1.0),
    ("samples dropped from the forces", 20.0),
    ("samples dropped from one cell", 3.0),
    ("forces clipped", 0.7),
    ("forces compressed (tanh)", 1.0),
    ("one cell weak", 0.5),
    ("forces strong", 1.05),
    ("accelerations strong", 1.05),
    ("one roof accelerometer strong", 1.04),
    ("a cell stuck", 10.0),
    ("a gap of the forces filled with zeros", 2.0),
    ("a gap of all filled with zeros", 2.0),
    ("spikes in the forces", 400.0),
    ("sampling rate wrong", 1.0),
    ("dry mass of the rig file, no dry runs", 1.05),
    ("noise on the forces", 1.0),
    ("acceleration_g", 5 / 3),
]
QUICK = [
    ("forces early", 1.0),
    ("one cell late", 1.0),
    ("samples dropped from the forces", 20.0),
    ("forces clipped", 0.7),
    ("forces strong", 1.05),
    ("a cell stuck", 10.0),
    ("sampling rate wrong", 1.0),
    ("dry mass of the rig file, no dry runs", 1.05),
]
"""One of each kind: time, a cell alone, lost samples, range, gain, a sensor that stands still, attributes, rig."""


@pytest.fixture(scope="module")
def case():
    read = [
        read_recording(FOLDER / f"fill_0.50_{name}.nc") for name in ("sweep_3.00g", "empty_3.00g", "frozen_3.00g")
    ]
    # the first two minutes: 5 to 10 Hz, where W̄ is largest
    cut = [recording.isel(time=slice(0, 61_440)) for recording in read]
    for recording in cut:
        recording.attrs = {name: value for name, value in recording.attrs.items() if name != "sweep_duration_s"}
    return Case(*cut, 0.61, 0.5)


@pytest.fixture(scope="module")
def clean(case, tmp_path_factory):
    """The undamaged sweep, analysed once."""
    return analysed(case, tmp_path_factory.mktemp("clean"), allow_incomplete=True)


def said(case, folder):
    """Flags of the analysis, or the refusal."""
    from sloshlab.errors import InputError

    try:
        return list(analysed(case, folder, allow_incomplete=True).all_flags)
    except InputError as error:
        return [str(error)]


@pytest.mark.parametrize("alone", [False, True])
def test_the_undamaged_sweep_is_not_flagged(case, clean, tmp_path, alone):
    # its last cycles are cut by the end of the two minutes
    flags = said(case.alone(), tmp_path) if alone else clean.all_flags
    assert [flag for flag in flags if "sweep stops" not in flag] == []


@pytest.mark.parametrize(
    "damage", slow_but(QUICK, SILENT_ONCE), ids=[f"{name} {size:g}" for name, size in SILENT_ONCE]
)
def test_a_damage_is_flagged_or_refused(case, tmp_path, damage):
    name, size = damage
    damaged = DAMAGE[name].apply(case, size, np.random.default_rng(1))
    assert said(damaged, tmp_path)


def test_what_was_not_measured_is_left_out(case, clean, tmp_path):
    """Spikes, a stuck cell and a filled gap cost their cycles: the others keep their W̄."""
    for name, size in (
        ("a cell stuck", 2.0),
        ("spikes in one cell", 40.0),
        ("a gap of all filled with zeros", 2.0),
    ):
        damaged = DAMAGE[name].apply(case, size, np.random.default_rng(2))
        windows = analysed(damaged, tmp_path, allow_incomplete=True).windows
        there = np.interp(windows["time_s"], clean.windows["time_s"], clean.windows["w_bar"])
        error = np.abs(windows["w_bar"] - there)
        # of what is left, only the scatter of the cycles that are missing
        assert float(np.max(error / (windows["w_bar_std"] + 0.02))) < 5, name


def test_damages_change_a_copy(case):
    before = case.sloshing["force_cell_1"].values.copy()
    changed(case, FORCES, lambda values, _: 0 * values, np.random.default_rng(0))
    np.testing.assert_array_equal(case.sloshing["force_cell_1"].values, before)
    assert replace(case).alone().empty is None
