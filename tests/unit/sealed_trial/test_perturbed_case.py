"""Cases recorded almost the same again."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from hand_made_trials import written_recording

from sealed_trial.perturbed_case import perturbed, write_perturbed_case


def test_values_move_by_a_millionth_of_their_rms() -> None:
    """RMS of a sine of amplitude 3 about 4: √(16 + 9/2)."""
    values = 4 + 3 * np.sin(2 * np.pi * (np.arange(20_000) + 0.123) / 20_000)
    moved = perturbed(values, np.random.default_rng(1)) - values
    # the RMS of 20 000 normal deviates is known within 0.5 %
    assert np.sqrt(np.mean(moved**2)) == pytest.approx(1e-6 * np.sqrt(16 + 4.5), rel=0.02)
    assert abs(np.mean(moved)) < 3e-8 * np.sqrt(16 + 4.5)


def test_equal_values_move_equally_and_missing_ones_stay() -> None:
    values = np.array([5.0, 1.0, 5.0, np.nan, 1.0, 5.0])
    moved = perturbed(values, np.random.default_rng(1))
    assert np.isnan(moved[3])
    assert moved[0] == moved[2] == moved[5] != 5.0
    assert moved[1] == moved[4] != 1.0
    assert perturbed(np.zeros(3), np.random.default_rng(1)).tolist() == [0.0] * 3


def test_a_case_is_written_again_with_all_that_is_no_sample_as_it_was(tmp_path) -> None:
    case = tmp_path / "case_001"
    (case / "recordings").mkdir(parents=True)
    (case / "rig.toml").write_text("[tank]\n")
    counts = np.random.default_rng(3).integers(-3000, 3000, 400).astype(np.int16)
    counts[100:140] = 2999
    written_recording(case / "recordings" / "run_01.nc", counts)
    for name, seed in (("a", 5), ("again", 5), ("b", 6)):
        write_perturbed_case(case, tmp_path / name / case.name, seed)
    first, again, other, plain = (
        xr.open_dataset(tmp_path / name / "recordings" / "run_01.nc").load()
        for name in ("a/case_001", "again/case_001", "b/case_001", "case_001")
    )
    assert (tmp_path / "a" / "case_001" / "rig.toml").read_text() == "[tank]\n"
    assert first.identical(again)
    assert not first.force_tank.equals(other.force_tank)
    moved = (first.force_tank - plain.force_tank).values
    rms = float(np.sqrt(np.mean(plain.force_tank.values**2)))
    # about 390 distinct counts: their RMS is known within a tenth
    assert np.sqrt(np.mean(moved**2)) == pytest.approx(1e-6 * rms, rel=0.15)
    # clipped at one count before, at one value now
    assert np.unique(first.force_tank.values[100:140]).size == 1
    assert first.time.identical(plain.time)
    assert first.attrs == plain.attrs
    assert first.force_tank.attrs == {**plain.force_tank.attrs, "adc_step": 0.002}
