"""A run whose force cells ring is analysed as the same run with stiff cells."""

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lsim

from pipelines.structure.stages import loaded
from sloshlab.recording import read_recording
from sloshlab.rig import Rig

BEAM = Path(__file__).resolve().parents[4] / "raw_data" / "numerical_tank" / "beam"
CELL_HZ, ZETA = 180.0, 0.04


def test_the_rig_that_tells_of_its_cells_has_their_ringing_taken_off() -> None:
    text = (BEAM / "rig_beam.toml").read_text(encoding="utf-8")
    told = text.replace("[liquid]", f"cell_frequency_hz = {CELL_HZ}\ncell_damping_ratio = {ZETA}\n\n[liquid]")
    run = read_recording(BEAM / "decay_frozen.nc")
    stiff = loaded(BEAM / "decay_frozen.nc", run, Rig.from_toml_text(text)).recording["force_interface"].values
    time_s, force = run["time"].values, run["force_interface"]
    # the oscillator in time, let go at the first sample
    omega = 2 * np.pi * CELL_HZ
    cells = ([2 * ZETA / omega, 1.0], [1 / omega**2, 2 * ZETA / omega, 1.0])
    fine = np.arange(16 * (time_s.size - 1) + 1) / 16 * (time_s[1] - time_s[0])
    read = lsim(cells, np.interp(fine, time_s, force.values), fine)[1][::16]
    ringing = run.assign(force_interface=force.copy(data=read))
    found = loaded(BEAM / "decay_frozen.nc", ringing, Rig.from_toml_text(told)).recording["force_interface"]
    assert found.attrs["cell_resonance_removed_hz"] == CELL_HZ
    used, size = time_s > 0.05, np.abs(stiff).max()
    before, left = (np.sqrt(np.mean((values - stiff)[used] ** 2)) for values in (read, found.values))
    assert before > 0.003 * size
    # what differs is noise of the sensor beyond twice the resonance, and what lines between samples are short of
    assert left < 0.15 * before
    assert np.abs(found.values - stiff)[used].max() < 0.02 * size
    assert stiff == pytest.approx(force.values)
