"""Two devices, 100 ppm and 50 ms apart, two processes: what alignment leaves in time and in dissipated work.

Measured by other means than those that align: against the recording that was played, channel by channel.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from live_commands import FORCES, RATE_HZ, ROOF, playing, running
from short_runs import DONE_BUT_FLAGGED, shaker_arguments

from pipelines.command_line import run

pytestmark = [
    pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals"),
    pytest.mark.usefixtures("programs_are_forks"),
]

DURATION_S = 64.0
DRIFT_PPM, OFFSET_S = 100.0, 0.05
LARGEST_DELAY_S = 20e-6
LARGEST_WORK_ERROR = 0.003
STRETCH = 4096


def delays_s(original: np.ndarray, aligned: np.ndarray) -> np.ndarray:
    """Delay of one signal against another of the same motion, per 8 s.

    Least squares of r(t) = o(t) − τ·do/dt: of two signals that are microseconds apart nothing else is left.
    """
    rate_of_change = np.gradient(original) * RATE_HZ
    delays = []
    for start in range(0, original.size - STRETCH + 1, STRETCH):
        part = slice(start, start + STRETCH)
        known = np.isfinite(aligned[part])
        slope, residual = rate_of_change[part][known], (aligned - original)[part][known]
        delays.append(-np.sum(residual * slope) / np.sum(slope**2))
    return np.array(delays)


def with_the_same_loss(original: Path, aligned: Path, target: Path) -> Path:
    """The recording that was played, without the samples that the late device could not take.

    Windows are counted in cycles from the first good sample: they lie in the same place then.
    """
    with (
        xr.open_dataset(original, decode_times=False, mask_and_scale=False) as played,
        xr.open_dataset(aligned, decode_times=False) as recorded,
    ):
        reference = played.load()
        for name in ROOF:
            reference[name].values[np.isnan(recorded[name].values)] = reference[name].attrs["_FillValue"]
        reference["quality"] = recorded["quality"].astype(np.uint8)
        reference.to_netcdf(target)
    return target


def windows_of(recording: Path, rig: Path, output: Path) -> xr.Dataset:
    assert run(shaker_arguments([recording], [rig], output)) in (0, DONE_BUT_FLAGGED)
    return xr.load_dataset(output / "windows.nc")


@pytest.mark.slow
@pytest.mark.parametrize("speed", [16, pytest.param(1, marks=pytest.mark.slow)])
def test_two_devices_are_one_recording(speed: int, repository: Path, tmp_path: Path) -> None:
    """In real time host arrival times lead; played faster they mean nothing and the signals do it alone."""
    lab = tmp_path / "lab"
    lab.mkdir()
    rig = Path(shutil.copy(repository / "raw_data" / "shaker" / "rig_fill_0.50.toml", lab / "rig.toml"))
    original = lab / "original.nc"
    assert run(["virtual", "shaker_sweep", "--rig", str(rig), "--duration-s", str(DURATION_S), "--seed", "5",
                "-o", str(original)]) == 0  # fmt: skip
    (lab / "late.toml").write_text(f"[clock]\ndrift_ppm = {DRIFT_PPM}\noffset_s = {OFFSET_S}\n")
    options = ["--speed", str(speed), "--faults", "none", "--faults", str(lab / "late.toml")]
    for names in ((*FORCES, "acceleration_control"), ROOF):
        options += ["--channels", ",".join(names)]
    with playing(original, lab, "pty", "socketcand", options=options) as devices:
        arguments = ["record", *devices.sources, "--rig", rig, "-o", lab / "aligned.nc", "--json"]
        with running([*arguments, *told(original)], lab) as recorder:
            assert recorder.exit_code(DURATION_S / speed) == 0, recorder.stderr
            alignment = recorder.summary["report"]["alignment"]["device_2"]
    assert alignment["method"] == "signals"
    assert alignment["error_s"] < LARGEST_DELAY_S
    assert alignment["start_s"] == pytest.approx(OFFSET_S, abs=LARGEST_DELAY_S)
    assert alignment["step_s"] * RATE_HZ == pytest.approx(1 / (1 + 1e-6 * DRIFT_PPM), abs=3e-7)
    assert_aligned(original, lab / "aligned.nc")
    reference = with_the_same_loss(original, lab / "aligned.nc", lab / "reference.nc")
    expected, found = (
        windows_of(path, rig, lab / path.stem).w_bar.values for path in (reference, lab / "aligned.nc")
    )
    assert expected.size > 20
    rms = np.sqrt(np.mean((found - expected) ** 2) / np.mean(expected**2))
    assert rms < LARGEST_WORK_ERROR, f"W̄: {rms:.2%}"
    assert abs(found.sum() / expected.sum() - 1) < LARGEST_WORK_ERROR


def told(original: Path) -> list[str]:
    """What the operator tells the recorder about the run."""
    with xr.open_dataset(original, decode_times=False) as recording:
        known = {key: value for key, value in recording.attrs.items() if key.startswith("sweep_")}
        known |= {key: recording.attrs[key] for key in ("experiment", "configuration", "acceleration_g", "repeat")}
    return [part for key, value in known.items() for part in ("--attribute", f"{key}={value}")]


def assert_aligned(original: Path, aligned: Path) -> None:
    with (
        xr.open_dataset(original, decode_times=False) as played,
        xr.open_dataset(aligned, decode_times=False) as recorded,
    ):
        for name in (*FORCES, "acceleration_control"):
            np.testing.assert_array_equal(recorded[name].values, played[name].values)
        for name in ROOF:
            delays = delays_s(played[name].values, recorded[name].values)
            assert delays.size == DURATION_S * RATE_HZ / STRETCH
            assert np.abs(delays).max() < LARGEST_DELAY_S, f"{name}: {1e6 * delays.round(8)} µs"
            # the late device begins after the first, and half a filter of samples is not interpolated
            n_missing = np.count_nonzero(np.isnan(recorded[name].values))
            assert OFFSET_S * RATE_HZ <= n_missing < 128
