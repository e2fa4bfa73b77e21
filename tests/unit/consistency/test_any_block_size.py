"""Windows, maps, findings and qualities do not depend on the blocks that a recording is gone through in."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
import xarray as xr
from shaken_tank import RATE_HZ, tank_run

from pipelines.sweep.shaker import ShakerSettings, analyse_shaker
from pipelines.sweep.stages import not_measured
from sloshlab import out_of_core, returned_values
from sloshlab.conditioning import block_spectra
from sloshlab.conditioning.gaps import gaps, sample_is_usable
from sloshlab.conditioning.quality import quality_of, sample_statistics
from sloshlab.consistency.examination import examined
from sloshlab.consistency.force_response import quiet_start
from sloshlab.recording import CLIPPED, LOST
from sloshlab.sweep import cycles, motion_phase

N_OF_BLOCK = 1000


@contextlib.contextmanager
def small_blocks(monkeypatch):
    """Every array on the disk, and blocks of two seconds, of which most cut something in two."""
    with monkeypatch.context() as changed:
        changed.setattr(out_of_core, "LARGEST_IN_MEMORY_BYTES", 0)
        changed.setattr(returned_values, "LARGEST_IN_MEMORY_BYTES", 0)
        changed.setattr(out_of_core, "BLOCK_SAMPLES", N_OF_BLOCK)
        changed.setattr(motion_phase, "BLOCK_SAMPLES", N_OF_BLOCK)
        changed.setattr(motion_phase, "_KNOTS_AT_ONCE", 37)
        changed.setattr(cycles, "_CYCLES_AT_ONCE", 23)
        changed.setattr(block_spectra, "_BLOCKS_AT_ONCE", 3)
        yield


def results_of(recordings, rig):
    settings = ShakerSettings.checked(p=6, m=24, boundaries="measured", allow_incomplete=True, has_report=False)
    return analyse_shaker(recordings, [rig], settings)


@pytest.mark.parametrize(
    ("fill", "names"),
    [
        pytest.param("0.25", ["sweep_1.00g"], marks=pytest.mark.slow),
        ("0.50", ["empty_3.00g", "frozen_3.00g", "sweep_3.00g"]),
        pytest.param("0.75", ["sweep_6.00g"], marks=pytest.mark.slow),
    ],
)
def test_recordings_of_every_fill_give_the_same_in_blocks(fill, names, repository, monkeypatch):
    folder = repository / "raw_data" / "shaker"
    runs = [folder / f"fill_{fill}_{run}.nc" for run in names]
    rig = next(path for path in folder.glob("*.toml") if fill in path.name)
    whole = results_of(runs, rig)
    with small_blocks(monkeypatch):
        streamed = results_of(runs, rig)
    assert whole.windows.sizes["window"] > 50
    same(streamed.windows, whole.windows)
    same(streamed.maps, whole.maps)
    assert streamed.all_flags == whole.all_flags
    assert repr([e.findings for e in streamed.examinations]) == repr([e.findings for e in whole.examinations])
    assert [repr(run.quality) for run in streamed.runs] == [repr(run.quality) for run in whole.runs]


def same(one: xr.Dataset, other: xr.Dataset) -> None:
    assert set(one.variables) == set(other.variables)
    for name, variable in one.variables.items():
        if variable.dtype.kind == "f":
            scale = np.fmax.reduce(np.abs(other[name].values), axis=None, initial=0.0)
            np.testing.assert_allclose(variable.values, other[name].values, rtol=1e-12, atol=1e-12 * scale)
        else:
            assert (variable.values == other[name].values).all(), name


def damaged_run():
    """A sweep with everything that may be wrong with samples, over the borders of blocks."""
    run = tank_run(duration_s=60.0)
    cell, other = run["force_cell_1"].values.copy(), run["force_cell_2"].values.copy()
    roof = run["acceleration_roof_1"].values.copy()
    flags = np.zeros(cell.size, np.uint8)
    lost = slice(3 * N_OF_BLOCK - 4, 3 * N_OF_BLOCK + 5)
    cell[lost] = np.nan
    flags[lost] = LOST
    # flagged, but nobody's: lost in all channels
    flags[5 * N_OF_BLOCK - 2 : 5 * N_OF_BLOCK + 2] = LOST
    flags[7 * N_OF_BLOCK - 1 : 7 * N_OF_BLOCK + 1] |= CLIPPED
    roof[8 * N_OF_BLOCK] += 40.0
    held = slice(10 * N_OF_BLOCK - 30, 10 * N_OF_BLOCK + 40)
    other[held] = other[held.start]
    filled = slice(12 * N_OF_BLOCK - 40, 12 * N_OF_BLOCK + 60)
    roof[filled] = np.linspace(roof[filled.start], roof[filled.stop], 100)
    limit = 0.97 * np.nanmax(cell)
    cell = np.minimum(cell, limit)
    changed = run.assign(quality=("time", flags))
    for name, values in (("force_cell_1", cell), ("force_cell_2", other), ("acceleration_roof_1", roof)):
        changed[name] = ("time", values, run[name].attrs)
    changed["force_cell_1"].attrs |= {"range_min": -1e3, "range_max": float(limit)}
    return changed


def test_damages_over_the_borders_of_blocks_are_found_as_in_the_whole(monkeypatch):
    run = damaged_run()

    def found():
        quality, examination = quality_of(run), examined(run)
        return (
            quality,
            gaps(run),
            sample_is_usable(run),
            not_measured(run, ["force_cell_1"], quality),
            examination,
            examination.measured_only(run)["acceleration_roof_1"].values,
        )

    whole = found()
    with small_blocks(monkeypatch):
        streamed = found()
    assert [gap.n_samples for gap in whole[1]] == [9, 4]
    checks = {finding.check for finding in whole[4].findings}
    assert {"spikes", "held samples", "filled samples"} <= checks
    assert repr(streamed[0]) == repr(whole[0])
    assert streamed[1] == whole[1]
    assert (streamed[2] == whole[2]).all()
    # flagged in the recording, or at the end of the stated range, and nothing else
    flagged = run["quality"].values != 0
    at_the_end = run["force_cell_1"].values >= run["force_cell_1"].attrs["range_max"] * (1 - 1e-6)
    assert at_the_end[~flagged].any()
    assert (whole[3] == flagged | at_the_end).all()
    assert (streamed[3] == whole[3]).all()
    assert repr(streamed[4].findings) == repr(whole[4].findings)
    assert streamed[4].wrong_samples.keys() == whole[4].wrong_samples.keys()
    assert all((streamed[4].wrong_samples[k] == mask).all() for k, mask in whole[4].wrong_samples.items())
    np.testing.assert_array_equal(streamed[5], whole[5])


def test_running_sums_over_blocks_are_those_of_numpy(monkeypatch):
    rng = np.random.default_rng(5)
    values = 1e4 + rng.standard_normal(3 * N_OF_BLOCK + 17)
    values[[0, N_OF_BLOCK, -1]] = np.nan
    with small_blocks(monkeypatch):
        n, least, most, mean, deviation = sample_statistics(values)
    assert n == values.size - 3
    assert (least, most) == (np.nanmin(values), np.nanmax(values))
    assert mean == pytest.approx(np.nanmean(values), rel=1e-14)
    assert deviation == pytest.approx(np.nanstd(values), rel=1e-11)


def test_twelve_cycles_are_counted_over_blocks(monkeypatch):
    """A sine passes a tenth of its amplitude upward for the thirteenth time twelve periods after the first."""
    time = np.arange(round(20 * RATE_HZ)) / RATE_HZ
    growing = np.minimum(time / 2.0, 1.0)
    with small_blocks(monkeypatch):
        stretch = quiet_start(2.0 * growing * np.sin(2 * np.pi * 5.0 * time))
    # the first cycle passes a tenth when it has grown so much: within the first period, as those after it
    assert stretch is not None
    assert stretch.stop / RATE_HZ == pytest.approx(12 / 5.0, abs=0.21)
    assert stretch.stop % (RATE_HZ / 5) < 0.1 * RATE_HZ / 5
