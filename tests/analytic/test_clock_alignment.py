"""Two devices, 100 ppm and 50 ms apart: the aligned recording against the truth.

The motion is known in closed form at any instant, so that the truth needs no interpolation: where each
sample lies, and the work π c ω A² per cycle of F = M ü + c u̇.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from two_devices import (
    RATE_HZ,
    Truth,
    counts_of,
    laboratory,
    octave_sweep,
    write_direct,
    write_journal,
)

from acquisition.recorder.assembly import AssemblyOptions, AssemblySummary, assemble, options_of
from acquisition.recorder.journal import read_journal
from acquisition.virtual_laboratory.sensors import Laboratory
from acquisition.virtual_laboratory.shaker import SweepPlan
from acquisition.virtual_laboratory.shaker_run import virtual_shaker
from pipelines.sweep.shaker import ShakerSettings, analyse_shaker
from sloshlab.recording import LOST, read_recording
from sloshlab.rig import Rig

RIG = """
[tank]
height_m = 0.0272
length_m = 0.1172
width_m = 0.0780
dry_mass_kg = 0.61
[liquid]
density_kg_per_m3 = 1000.0
fill_level = 0.5
"""
MASS_KG, DAMPING_N_S_PER_M = 0.7343, 4.0
LARGEST_ALIGNMENT_ERROR_S = 20e-6
LARGEST_WORK_ERROR = 0.003


@dataclass(frozen=True)
class Aligned:
    summary: AssemblySummary
    recording: xr.Dataset
    path: Path
    rig: Path
    folder: Path
    truth: Truth


def virtual_tank() -> Truth:
    plan = SweepPlan(acceleration_g=3.0, law="octave", start_hz=5.0, stop_hz=20.0, duration_s=60.1)
    shaker = virtual_shaker(
        Rig.from_toml_text(RIG), plan, seed=5, imperfect=False, laboratory=Laboratory.perfect()
    )

    def at(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        moved = shaker.motion.at(t)
        return shaker.external_force_n(t, moved), moved.acceleration

    return at


TRUTHS = {"closed form": lambda: octave_sweep(MASS_KG, DAMPING_N_S_PER_M), "virtual tank": virtual_tank}


@pytest.fixture(scope="module", params=TRUTHS)
def aligned(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Aligned:
    folder = tmp_path_factory.mktemp("aligned")
    rig = folder / "rig.toml"
    rig.write_text(RIG)
    truth = TRUTHS[request.param]()
    write_journal(folder / "run.journal", laboratory(), truth, seed=11)
    with read_journal(folder / "run.journal") as journal:
        summary = assemble(journal, folder / "run.nc")
    return Aligned(summary, read_recording(folder / "run.nc"), folder / "run.nc", rig, folder, truth)


def true_places_s() -> np.ndarray:
    """When the second device took its samples, on the time base of the first."""
    first, second = laboratory()
    return second.instants_s() * (1 + 1e-6 * first.drift_ppm)


def stated_places_s(recording: xr.Dataset) -> np.ndarray:
    counts = recording["counts_acceleration_roof_1"]
    return counts.attrs["first_sample_s"] + counts.attrs["sample_step_s"] * np.arange(counts.size)


def work_of(path: Path, rig: Path) -> xr.Dataset:
    settings = ShakerSettings.checked(p=6, m=24, boundaries="measured", allow_incomplete=True)
    return analyse_shaker([path], [rig], settings).windows


def test_two_devices_are_aligned_to_twenty_microseconds(aligned: Aligned) -> None:
    error_s = np.abs(stated_places_s(aligned.recording) - true_places_s()).max()
    stated = aligned.summary.record["alignment"]["can"]
    assert stated["method"] == "signals"
    assert error_s < LARGEST_ALIGNMENT_ERROR_S
    assert error_s < stated["error_s"] < LARGEST_ALIGNMENT_ERROR_S
    assert stated["phase_error_at_20_hz_rad"] == pytest.approx(2 * np.pi * 20 * stated["error_s"])


def test_drift_and_offset_are_stated(aligned: Aligned) -> None:
    counts = aligned.recording["counts_acceleration_roof_1"].attrs
    # 60 ppm faster than true time on a base 40 ppm slower than true time: 100 ppm between the devices
    assert 1 / (counts["sample_step_s"] * RATE_HZ) - 1 == pytest.approx(100e-6, abs=1e-6)
    assert counts["first_sample_s"] == pytest.approx(0.05, abs=LARGEST_ALIGNMENT_ERROR_S)


def test_work_from_the_aligned_recording_is_within_three_per_mille(aligned: Aligned) -> None:
    first, _ = laboratory()
    lost = np.isnan(aligned.recording["acceleration_roof_1"].values)
    write_direct(aligned.folder / "direct.nc", aligned.truth, first.drift_ppm, lost)
    direct = work_of(aligned.folder / "direct.nc", aligned.rig)
    measured = work_of(aligned.path, aligned.rig)
    np.testing.assert_allclose(measured.frequency_hz, direct.frequency_hz, rtol=1e-3)
    assert measured.sizes["window"] >= 20
    assert float(measured.w_bar.mean()) == pytest.approx(float(direct.w_bar.mean()), rel=LARGEST_WORK_ERROR)


@pytest.mark.parametrize("aligned", ["closed form"], indirect=True)
def test_work_is_that_of_the_damper(aligned: Aligned) -> None:
    measured = work_of(aligned.path, aligned.rig)
    omega = 2 * np.pi * measured.frequency_hz
    work = np.pi * DAMPING_N_S_PER_M * omega * measured.amplitude_m**2
    assert float(measured.work_j.mean()) == pytest.approx(float(work.mean()), rel=LARGEST_WORK_ERROR)


def test_counts_of_both_devices_are_untouched(aligned: Aligned) -> None:
    first, _ = laboratory()
    counts = counts_of(first, aligned.truth, np.random.default_rng(11), 0.6)
    step = first.channels[0].scale_factor
    np.testing.assert_array_equal(
        aligned.recording["force_cell_1"].values, (counts[:, 0] * step).astype(np.float32)
    )
    np.testing.assert_array_equal(aligned.recording.time.values, np.arange(first.n_samples) / RATE_HZ)
    assert aligned.recording["counts_acceleration_roof_1"].dtype == np.int16
    assert (aligned.recording["counts_acceleration_roof_1"].values != -32768).all()


def test_what_the_second_device_did_not_cover_is_lost_and_flagged(aligned: Aligned) -> None:
    values = aligned.recording["acceleration_roof_1"].values
    lost = np.flatnonzero(np.isnan(values))
    # it began 25.6 steps later, and a kernel needs 24 samples to each side
    assert lost[lost < 1000].max() in (48, 49, 50)
    assert (aligned.recording.quality.values[lost] & LOST).all()
    assert not np.isnan(aligned.recording["force_cell_1"].values).any()


@pytest.mark.parametrize("aligned", ["closed form"], indirect=True)
def test_resampled_values_are_those_of_the_motion(aligned: Aligned) -> None:
    first, _ = laboratory()
    _, truth = aligned.truth(first.instants_s())
    error = aligned.recording["acceleration_roof_1"].values - truth
    # noise of 0.6 counts and rounding (1/√12 counts), nothing else
    expected = np.hypot(0.6, 1 / np.sqrt(12)) * 50 / 448
    assert float(np.nanstd(error)) == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("aligned", ["closed form"], indirect=True)
def test_without_real_time_the_signals_alone_align(aligned: Aligned, tmp_path: Path) -> None:
    write_journal(tmp_path / "fast.journal", laboratory(), aligned.truth, seed=11, speed=40.0)
    with read_journal(tmp_path / "fast.journal") as journal:
        summary = assemble(journal, tmp_path / "fast.nc")
    clocks = summary.record["clocks"]
    assert [clock[0]["status"] for clock in clocks.values()] == ["not_real_time", "not_real_time"]
    error_s = np.abs(stated_places_s(read_recording(tmp_path / "fast.nc")) - true_places_s()).max()
    assert error_s < LARGEST_ALIGNMENT_ERROR_S


@pytest.mark.parametrize("aligned", ["closed form"], indirect=True)
def test_arrivals_alone_leave_a_flag_and_an_honest_error(aligned: Aligned, tmp_path: Path) -> None:
    with read_journal(aligned.folder / "run.journal") as journal:
        noted = options_of(journal)
        options = AssemblyOptions(attributes={**noted.attributes, "experiment": "other"})
        summary = assemble(journal, tmp_path / "host.nc", options)
    stated = summary.record["alignment"]["can"]
    assert stated["method"] == "host"
    assert any("arrival times alone" in flag for flag in summary.flags)
    error_s = np.abs(stated_places_s(read_recording(tmp_path / "host.nc")) - true_places_s()).max()
    # 1 ms of shortest latency on the serial side cannot be seen in arrivals
    assert error_s < stated["error_s"] + 1.1e-3
    assert error_s > LARGEST_ALIGNMENT_ERROR_S
