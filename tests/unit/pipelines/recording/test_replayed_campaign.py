"""The judge of `make replay` sees every difference, and a process that fails is an error, not a recording."""

import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import xarray as xr

from acquisition.sources.urls import parse_url
from pipelines.recording import replayed_campaign as campaign
from pipelines.recording.replayed_campaign import Way, differences, window_differences
from sloshlab.errors import InputError, RecordingError, SourceError

ATTRIBUTES = {"run_id": "r", "rig": "rig.toml", "sampling_rate_hz": 500.0}


def recording():
    """Stored counts as they are, without decoding."""
    scale = {"scale_factor": 0.5, "units": "N", "quantity": "force"}
    return xr.Dataset(
        {
            "force_1": ("time", np.arange(6, dtype=np.int16), dict(scale)),
            "force_2": ("time", np.arange(6, 12, dtype=np.int16), dict(scale)),
        },
        {"time": ("time", np.arange(6) / 500.0)},
        dict(ATTRIBUTES),
    )


def nothing(run):
    return run


def with_quality(run):
    return run.assign(quality=("time", np.zeros(6, np.uint8))).assign_attrs(acquisition="{}")


def one_count(run):
    run["force_2"].values[3] += 1
    return run


def exchanged(run):
    return run.assign(force_1=run["force_2"], force_2=run["force_1"])


def shifted_time(run):
    return run.assign_coords(time=run["time"] + 1e-6)


def shorter(run):
    return run.isel(time=slice(0, 5))


def without(run):
    return run.drop_vars("force_2")


def wider(run):
    return run.assign(force_1=run["force_1"].astype(np.int32).assign_attrs(run["force_1"].attrs))


def rescaled(run):
    run["force_1"].attrs["scale_factor"] = 0.25
    return run


def flagged(run):
    return run.assign(quality=("time", np.array([0, 0, 1, 0, 0, 0], np.uint8)))


def invented(run):
    return run.assign(force_3=run["force_1"])


def other_run(run):
    return run.assign_attrs(run_id="another")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (nothing, []),
        (with_quality, []),
        (one_count, ["force_2 differs"]),
        (exchanged, ["force_1 differs", "force_2 differs"]),
        (shifted_time, ["time differs"]),
        (shorter, ["force_1 differs", "force_2 differs", "time differs"]),
        (without, ["force_2 is missing"]),
        (wider, ["force_1 is stored as int32 instead of int16"]),
        (rescaled, ["force_1: scale_factor is np.float64(0.25) instead of np.float64(0.5)"]),
        (flagged, ["quality flags samples that are good"]),
        (invented, ["force_3 is invented"]),
        (other_run, ["attribute run_id is 'another' instead of 'r'"]),
    ],
)
def test_every_difference_of_a_recording_is_named(tmp_path, change, said):
    for name, run in (("run.nc", recording()), ("new.nc", change(recording()))):
        run.to_netcdf(tmp_path / name, encoding={"time": {"_FillValue": None}})
    assert sorted(differences(tmp_path / "run.nc", tmp_path / "new.nc")) == said


def windows():
    return xr.Dataset(
        {"work_j": ("window", np.array([1.0, np.nan, 3.0]))}, attrs={"inputs": "a", "sloshlab_format": "1"}
    )


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda found: found.assign_attrs(inputs="b"), []),
        # of other files it is another result, with the same numbers
        (lambda found: found.assign_attrs(result_id="b"), []),
        (lambda found: found.drop_attrs(), ["attribute sloshlab_format differs"]),
        (lambda found: found.assign(work_j=("window", np.array([1.0, np.nan, 3.0 + 5e-16]))), ["work_j differs"]),
        (lambda found: found.assign(more=found["work_j"]), ["more is only in one of them"]),
    ],
)
def test_windows_are_compared_bit_by_bit(change, said):
    assert window_differences(windows(), change(windows())) == said


def python(monkeypatch, tmp_path, script):
    """Every process that is started runs this script instead."""
    path = tmp_path / "python"
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(path))


def test_a_device_that_fails_after_it_was_ready_is_an_error(monkeypatch, tmp_path):
    python(monkeypatch, tmp_path, "echo ready serial:tty\necho it broke >&2\nexit 5")
    with (
        pytest.raises(SourceError, match="exit code 5: it broke"),
        campaign._playing(["replay"], 1, 600.0) as playing,
    ):
        assert playing.urls == ("serial:tty?open_timeout_s=600.0",)


def test_a_process_that_does_not_end_is_an_error(monkeypatch, tmp_path):
    python(monkeypatch, tmp_path, "exec sleep 60")
    with pytest.raises(SourceError, match=r"sloshlab record: got no end within 0\.1 s"):
        campaign._run(["record"], 0.1)


@pytest.mark.parametrize(
    ("least_s", "start_took_s", "expected_s"),
    [(30.0, 1.5, 30.0), (30.0, 20.0, 200.0), (30.0, 500.0, 600.0), (120.0, 1.5, 120.0)],
)
def test_patience_grows_with_the_load(least_s, start_took_s, expected_s):
    assert campaign._patience_s(least_s, start_took_s) == expected_s


def test_sources_wait_ten_times_as_long_as_the_devices_took_to_start(monkeypatch, tmp_path):
    python(monkeypatch, tmp_path, "sleep 0.3\necho ready serial:tty\necho 'ready can:socketcand?port=7&dbc=a.dbc'")
    with campaign._playing(["replay"], 2, 0.1) as playing:
        assert playing.patience_s >= 3.0
    patience = f"open_timeout_s={playing.patience_s:.1f}"
    assert playing.urls == (f"serial:tty?{patience}", f"can:socketcand?port=7&dbc=a.dbc&{patience}")
    for url in playing.urls:
        assert parse_url(url).options["open_timeout_s"] == f"{playing.patience_s:.1f}"


@pytest.mark.parametrize("by_device", [False, True])
def test_a_failure_is_one_message_not_nested(monkeypatch, tmp_path, by_device):
    """The line of the process that met the trouble, once, and where it met it."""
    told = "source serial:tty: got no answer within 30 s; remedy: check that the device is switched on"
    recorder = "exit 0" if by_device else f"echo 'sloshlab: {told}' >&2; exit 1"
    device = f"echo 'sloshlab: {told}' >&2; exit 1" if by_device else "exec sleep 60"
    lines = f'if [ "$3" = record ]; then {recorder}; fi\necho ready serial:tty\n{device}'
    python(monkeypatch, tmp_path, lines)
    recording().to_netcdf(tmp_path / "run.nc")
    with pytest.raises(SourceError) as error:
        campaign.recorded(tmp_path / "run.nc", tmp_path / "out", Way("serial", ("serial",)))
    assert str(error.value) == f"run.nc by serial: {told}"


@pytest.mark.parametrize("patience_s", [0.0, -1.0, 601.0, float("nan")])
def test_patience_that_no_source_takes_is_refused(tmp_path, patience_s):
    recording().to_netcdf(tmp_path / "run.nc")
    with pytest.raises(InputError, match="--patience"):
        campaign.replayed_campaign(tmp_path, tmp_path / "out", least_patience_s=patience_s)


def test_the_first_failure_ends_all(monkeypatch, tmp_path):
    begun, is_shut = [], threading.Event()

    class Pool(ThreadPoolExecutor):
        def shutdown(self, *arguments, **options):
            super().shutdown(wait=False, cancel_futures=options.get("cancel_futures", False))
            is_shut.set()

    def fails(run, folder, way, least_patience_s):
        begun.append(run)
        if run.stem != "0":
            is_shut.wait(60)
        raise RecordingError(f"recording {run}", got="nothing")

    monkeypatch.setattr(campaign, "recorded", fails)
    monkeypatch.setattr(campaign, "ThreadPoolExecutor", Pool)
    runs = [(Way("serial", ("serial",)), tmp_path / f"{k}.nc") for k in range(50)]
    with pytest.raises(RecordingError, match="nothing"):
        campaign._replayed_differences(runs, tmp_path)
    assert len(begun) <= 3  # the first, and the one that each of two threads was at
