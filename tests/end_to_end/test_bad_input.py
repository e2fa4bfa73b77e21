"""Bad input ends in exit 1 and one line that names what is wrong; nothing is written."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
from short_runs import RATE_HZ, cut_out, edited, refusal, shaker_arguments, short_run
from slow_cases import slow_but

from acquisition.virtual_laboratory.campaign import rig_text
from acquisition.virtual_laboratory.shaker_run import write_virtual_run
from pipelines.command_line import run

Edit = Callable[[netCDF4.Dataset], Any]


def remove(attribute: str, channel: str = "") -> Edit:
    return lambda source: (source[channel] if channel else source).delncattr(attribute)


def put(attribute: str, value: Any, channel: str = "") -> Edit:
    return lambda source: (source[channel] if channel else source).setncattr(attribute, value)


def jitter(source: netCDF4.Dataset) -> None:
    """Every hundredth sample comes late, one of them by 0.013 steps."""
    source["time"][100::100] += 0.006 / RATE_HZ
    source["time"][4300] += 0.007 / RATE_HZ


def skipped(source: netCDF4.Dataset) -> None:
    """Seven samples are missing and the file does not say so."""
    source["time"][9000:] += 7 / RATE_HZ


def backwards(source: netCDF4.Dataset) -> None:
    source["time"][:] = source["time"][:][::-1]


def lost_time(source: netCDF4.Dataset) -> None:
    source["time"][500] = np.nan


def unflagged_block(source: netCDF4.Dataset) -> None:
    channel = source["acceleration_roof_1"]
    channel[12000:12064] = channel.getncattr("_FillValue")


def reversed_channel(name: str) -> Edit:
    def edit(source: netCDF4.Dataset) -> None:
        counts = source[name][:]
        source[name][:] = np.where(counts == source[name].getncattr("_FillValue"), counts, -counts)

    return edit


def constant(name: str, value: int = 0) -> Edit:
    def edit(source: netCDF4.Dataset) -> None:
        source[name][:] = value

    return edit


def renamed(old: str, new: str) -> Edit:
    return lambda source: source.renameVariable(old, new)


BAD_RECORDINGS: dict[str, tuple[Edit, tuple[str, ...]]] = {
    "units are missing": (remove("units", "force_cell_1"), ("force_cell_1", "units", "got nothing", "remedy")),
    "units are empty": (put("units", "", "force_cell_1"), ("force_cell_1", "units", "''")),
    "units of another quantity": (put("units", "m s-1", "force_cell_2"), ("force_cell_2", "'m s-1'", "N")),
    "units are no units": (put("units", "newtonne", "force_cell_1"), ("force_cell_1", "'newtonne'")),
    "g is the gram": (put("units", "g", "acceleration_roof_1"), ("acceleration_roof_1", "gram", "gravity")),
    "units of time": (put("units", "ms", "time"), ("units of time", "'ms'", "'s'")),
    "quantity is missing": (remove("quantity", "force_cell_1"), ("force_cell_1", "quantity")),
    "quantity is unknown": (put("quantity", "forces", "force_cell_1"), ("force_cell_1", "quantity", "'forces'")),
    "quantity against the name": (put("quantity", "voltage", "force_cell_1"), ("force_cell_1",)),
    "jitter": (jitter, ("time is not uniform", "jitter of 0.013 steps", "sample 4300", "1e-06 steps")),
    "hidden gap": (skipped, ("time is not uniform", "jitter of 7 steps", "sample 9000")),
    "time runs backwards": (backwards, ("sampling_rate_hz",)),
    "time is lost": (lost_time, ("time", "NaN or infinity")),
    "another sampling rate": (put("sampling_rate_hz", 500.0), ("sampling_rate_hz", "500 Hz", "0.001953125 s")),
    "NaN block without flags": (
        unflagged_block,
        ("acceleration_roof_1", "64 NaN samples", "23.4375 s", "quality"),
    ),
    "sign of a force cell": (
        reversed_channel("force_cell_2"),
        ("force_cell_2: sign", "apparent mass", "sign = -1"),
    ),
    "sign of a roof accelerometer": (reversed_channel("acceleration_roof_2"), ("acceleration_roof_2", "sign")),
    "sign of the control": (reversed_channel("acceleration_control"), ("acceleration_control", "sign")),
    "dead force cell": (constant("force_cell_1"), ("force_cell_1", "constant at 0")),
    "dead accelerometer": (constant("acceleration_roof_2", 17), ("acceleration_roof_2", "constant")),
    "no sloshlab_format": (remove("sloshlab_format"), ("sloshlab_format", "got nothing")),
    "another format": (put("sloshlab_format", "2"), ("sloshlab_format", "'2'", "'1'")),
    "format is a number": (put("sloshlab_format", np.int32(1)), ("sloshlab_format",)),
    "no run_id": (remove("run_id"), ("run_id", "got nothing")),
    "run_id is a number": (put("run_id", 7.5), ("run_id", "7.5", "string")),
    "run_id is empty": (put("run_id", ""), ("run_id",)),
    "rate is text": (put("sampling_rate_hz", "512"), ("sampling_rate_hz", "'512'", "number")),
    "rate is an array": (put("sampling_rate_hz", np.array([512.0, 512.0])), ("sampling_rate_hz",)),
    "rate is zero": (put("sampling_rate_hz", 0.0), ("sampling_rate_hz", "greater than 0")),
    "rate is negative": (put("sampling_rate_hz", -512.0), ("sampling_rate_hz", "greater than 0")),
    "rate is NaN": (put("sampling_rate_hz", np.nan), ("sampling_rate_hz", "nan")),
    "start time is no time": (put("start_time_utc", "yesterday"), ("start_time_utc", "'yesterday'", "ISO 8601")),
    "start time is a number": (put("start_time_utc", 20260131), ("start_time_utc", "20260131")),
    "sweep start is text": (put("sweep_start_hz", "5 Hz"), ("sweep_start_hz", "'5 Hz'")),
    "repeat is a fraction": (put("repeat", 1.5), ("repeat", "1.5")),
    "unknown experiment": (put("experiment", "shaker"), ("experiment", "'shaker'", "shaker_sweep")),
    "another experiment": (put("experiment", "beam_free"), ("experiment", "'beam_free'", "sloshlab work")),
    "unknown configuration": (put("configuration", "full"), ("configuration", "'full'", "sloshing")),
    "range is text": (put("range_max", "200 N", "force_cell_1"), ("force_cell_1", "range_max", "'200 N'")),
    "scale is text": (put("scale_factor", "0.1", "force_cell_1"), ("force_cell_1", "scale_factor")),
    "scale is infinite": (put("scale_factor", np.inf, "force_cell_1"), ("force_cell_1", "scale_factor", "inf")),
    "scale is an array": (put("scale_factor", [0.1, 0.2], "force_cell_1"), ("force_cell_1", "scale_factor")),
    "noise is negative": (put("noise_std", -1.0, "force_cell_1"), ("force_cell_1", "noise_std", "-1.0")),
}


QUICK_RECORDINGS = (
    "units are missing",
    "units of another quantity",
    "units of time",
    "quantity is unknown",
    "jitter",
    "hidden gap",
    "time runs backwards",
    "another sampling rate",
    "NaN block without flags",
    "sign of a force cell",
    "dead force cell",
    "another format",
    "run_id is a number",
    "rate is text",
    "rate is NaN",
    "start time is no time",
    "repeat is a fraction",
    "unknown experiment",
    "unknown configuration",
    "range is text",
    "scale is infinite",
    "noise is negative",
)
"""Of each attribute and each check of the samples one; tests/unit has all of what a recording may not be."""


@pytest.mark.parametrize("name", slow_but(QUICK_RECORDINGS, BAD_RECORDINGS))
def test_bad_recording_is_refused_in_one_line(name: str, laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    edit, fragments = BAD_RECORDINGS[name]
    bad = edited(laboratory / "sweep_3g.nc", tmp_path / "bad.nc", edit)
    arguments = shaker_arguments([bad], [laboratory / "rig.toml"], tmp_path / "out")
    refusal(capsys, arguments, tmp_path / "out", "bad.nc", *fragments)


def noisy_times(source: netCDF4.Dataset) -> None:
    rng = np.random.default_rng(1)
    source["time"][:] += 0.02 / RATE_HZ * rng.uniform(-1, 1, source["time"].size)


@pytest.mark.parametrize("edit", [jitter, noisy_times])
def test_import_and_check_name_one_jitter_of_one_file(
    edit: Edit, laboratory: Path, tmp_path: Path, capsys: Any
) -> None:
    """The size is by hand: the largest distance from the grid that begins at the first sample."""
    bad = edited(laboratory / "sweep_3g.nc", tmp_path / "bad.nc", edit)
    with netCDF4.Dataset(bad) as source:
        time_s = np.asarray(source["time"][:])
    off_steps = np.abs((time_s - time_s[0]) * RATE_HZ - np.arange(time_s.size))
    said = f"jitter of {off_steps.max():.3g} steps ({off_steps.max() / RATE_HZ:.3g} s) at sample"
    (tmp_path / "map.toml").write_text(
        '[run]\nexperiment = "other"\nconfiguration = "frozen"\n[channels.force_cell_1]\ncolumn = "force_cell_1"\n'
    )
    importing = ["import", str(bad), "--map", str(tmp_path / "map.toml"), "-o", str(tmp_path / "out.nc")]
    samples = set()
    for arguments in (["check", str(bad)], importing):
        line = refusal(capsys, arguments, tmp_path / "out", "time is not uniform", said)
        samples.add(int(line.split(" at sample ")[1].split()[0].rstrip(";")))
    (sample,) = samples
    assert off_steps[sample] == pytest.approx(off_steps.max(), rel=1e-3)


def test_results_of_an_earlier_run_stay_as_they_were(laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    bad = edited(laboratory / "sweep_3g.nc", tmp_path / "bad.nc", jitter)
    out = tmp_path / "out"
    assert run(shaker_arguments([laboratory / "sweep_3g.nc"], [laboratory / "rig.toml"], out)) == 0
    runs = [laboratory / "sweep_1.5g.nc", bad]
    refusal(capsys, shaker_arguments(runs, [laboratory / "rig.toml"], out), out, "time is not uniform")


def test_dead_force_cell_in_the_empty_run_is_named(laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    bad = edited(laboratory / "empty.nc", tmp_path / "bad.nc", constant("force_cell_2"))
    runs = [laboratory / "sweep_3g.nc", bad]
    arguments = shaker_arguments(runs, [laboratory / "rig.toml"], tmp_path / "out")
    refusal(capsys, arguments, tmp_path / "out", "bad.nc", "force_cell_2: constant at 0")


@pytest.mark.parametrize("channel", ["force_cell_1", "acceleration_roof_1"])
def test_wrong_sign_in_the_empty_run_is_named(channel: str, laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    bad = edited(laboratory / "empty.nc", tmp_path / "bad.nc", reversed_channel(channel))
    runs = [laboratory / "sweep_3g.nc", bad]
    arguments = shaker_arguments(runs, [laboratory / "rig.toml"], tmp_path / "out")
    refusal(capsys, arguments, tmp_path / "out", "bad.nc", channel, "sign")


@pytest.mark.parametrize(
    ("missing", "fragments"),
    [
        (("force_cell_1", "force_cell_2"), ("force on the tank", "force_cell_1")),
        (
            ("acceleration_roof_1", "acceleration_roof_2", "acceleration_control"),
            ("acceleration of the tank", "none"),
        ),
    ],
)
def test_missing_channels(missing, fragments, laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    write_virtual_run_without(missing, tmp_path / "bad.nc")
    arguments = shaker_arguments([tmp_path / "bad.nc"], [laboratory / "rig.toml"], tmp_path / "out")
    refusal(capsys, arguments, tmp_path / "out", *fragments)


def write_virtual_run_without(missing: tuple[str, ...], path: Path) -> None:
    kept = short_run().drop_vars(list(missing))
    kept.to_netcdf(path, engine="netcdf4")


def test_no_channel_at_all(laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    run = short_run()
    run.drop_vars(list(run.data_vars)).to_netcdf(tmp_path / "bad.nc", engine="netcdf4")
    arguments = shaker_arguments([tmp_path / "bad.nc"], [laboratory / "rig.toml"], tmp_path / "out")
    refusal(capsys, arguments, tmp_path / "out", "channels", "none")


def stopped(at_s: float, recording):
    """The shaker stops and the recorder goes on: only noise is left."""
    spoiled = recording.copy(deep=True)
    rest = spoiled["time"].values >= at_s
    rng = np.random.default_rng(20260131)
    for name, variable in spoiled.data_vars.items():
        noise = spoiled[name].attrs["noise_std"]
        spoiled[name].values[rest] = noise * rng.standard_normal(int(rest.sum())) + variable.values.mean()
        spoiled[name].encoding = recording[name].encoding
    return spoiled


def test_the_shaker_stops_and_the_recorder_goes_on(laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    write_virtual_run(stopped(30.0, short_run()), tmp_path / "bad.nc")
    arguments = shaker_arguments([tmp_path / "bad.nc"], [laboratory / "rig.toml"], tmp_path / "out")
    line = refusal(capsys, arguments, tmp_path / "out", "stops early", "--allow-incomplete", "until 48.0 s")
    stop_s = float(line.split(" s to ")[1].split(" s")[0])
    assert stop_s == pytest.approx(30.0, abs=0.3)  # a window of phase covers two cycles of 0.08 s


def test_the_file_ends_before_the_stated_sweep(laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    write_virtual_run(cut_out(short_run(), 0.0, 36.0), tmp_path / "bad.nc")
    arguments = shaker_arguments([tmp_path / "bad.nc"], [laboratory / "rig.toml"], tmp_path / "out")
    refusal(
        capsys,
        arguments,
        tmp_path / "out",
        "stops early",
        "motion from 0.2 s to 35.9 s (14.09 Hz)",
        "until 48.0 s",
    )


def test_two_rigs_mixed_under_one(laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    write_virtual_run(short_run(fill_level=0.25, rig_name="rig_25.toml", run_id="other"), tmp_path / "other.nc")
    runs = [laboratory / "sweep_3g.nc", tmp_path / "other.nc"]
    arguments = shaker_arguments(runs, [laboratory / "rig.toml"], tmp_path / "out")
    refusal(capsys, arguments, tmp_path / "out", "different rigs", "rig.toml", "rig_25.toml", "--rig")


def test_rigs_with_different_tanks(laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    (tmp_path / "tall.toml").write_text(rig_text(0.5).replace("0.0272", "0.0544"), encoding="utf-8")
    rigs = [laboratory / "rig.toml", tmp_path / "tall.toml"]
    arguments = shaker_arguments([laboratory / "sweep_3g.nc"], rigs, tmp_path / "out")
    refusal(capsys, arguments, tmp_path / "out", "tall.toml", "another tank")


def test_a_run_given_twice(laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    runs = [laboratory / "sweep_3g.nc", laboratory / "empty.nc", laboratory / "sweep_3g.nc"]
    arguments = shaker_arguments(runs, [laboratory / "rig.toml"], tmp_path / "out")
    refusal(capsys, arguments, tmp_path / "out", "run_id", "sweep_3g.nc")


RIGS: dict[str, tuple[bytes, tuple[str, ...]]] = {
    "empty tank": (rig_text(0.0).encode(), ("liquid.fill_level", "0.0", "0 < fill_level < 1")),
    "full tank": (rig_text(1.0).encode(), ("liquid.fill_level", "1.0", "0 < fill_level < 1")),
    "negative fill level": (rig_text(-0.5).encode(), ("liquid.fill_level", "-0.5")),
    "fill level in percent": (rig_text(50.0).encode(), ("liquid.fill_level", "50.0")),
    "fill level is text": (rig_text(0.5).replace("0.50", "'half'").encode(), ("liquid.fill_level", "'half'")),
    "fill level is true": (rig_text(0.5).replace("0.50", "true").encode(), ("liquid.fill_level", "True")),
    "fill level is NaN": (rig_text(0.5).replace("0.50", "nan").encode(), ("liquid.fill_level", "nan")),
    "no fill level": (rig_text(0.5).replace("fill_level", "level").encode(), ("liquid.fill_level", "nothing")),
    "no tank": (rig_text(0.5).split("[liquid]")[1].encode(), ("tank", "nothing")),
    "infinite height": (rig_text(0.5).replace("0.0272", "inf").encode(), ("tank.height_m", "inf")),
    "tank is a number": (b"tank = 3\n[liquid]\n", ("tank", "3")),
    "not TOML": (b"height: 0.0272\n", ("not TOML",)),
    "binary": (bytes(range(256)) * 20, ("UTF-8",)),
    "empty file": (b"", ("tank", "nothing")),
    "two megabytes": (b"#" * 2_000_000, ("2000000 bytes", "1000000")),
}


@pytest.mark.parametrize("name", list(RIGS))
def test_bad_rig(name: str, laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    content, fragments = RIGS[name]
    (tmp_path / "rig_bad.toml").write_bytes(content)
    arguments = shaker_arguments([laboratory / "sweep_3g.nc"], [tmp_path / "rig_bad.toml"], tmp_path / "out")
    refusal(capsys, arguments, tmp_path / "out", "rig_bad.toml", *fragments)


def test_rig_that_is_missing_or_a_folder(laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    for rig, reason in ((tmp_path / "absent.toml", "No such file"), (laboratory, "directory")):
        arguments = shaker_arguments([laboratory / "sweep_3g.nc"], [rig], tmp_path / "out")
        refusal(capsys, arguments, tmp_path / "out", rig.name, reason)


SHARES = (0.0, 1e-5, 0.001, 0.02, 0.1, 0.3, 0.5, 0.8, 0.97, 0.9999)


@pytest.mark.parametrize("share", slow_but([1e-5, 0.02, 0.9999], SHARES))
@pytest.mark.parametrize("command", ["shaker", "work", "check"])
def test_file_cut_in_the_middle(share: float, command: str, laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    whole = (laboratory / "sweep_3g.nc").read_bytes()
    (tmp_path / "cut.nc").write_bytes(whole[: int(share * len(whole))])
    refusal(
        capsys,
        arguments_of(command, tmp_path / "cut.nc", laboratory, tmp_path / "out"),
        tmp_path / "out",
        "cut.nc",
    )


def arguments_of(command: str, recording: Path, laboratory: Path, output: Path) -> list[str]:
    if command == "shaker":
        return shaker_arguments([recording], [laboratory / "rig.toml"], output)
    if command == "work":
        options = ["--force", "force_cell_1", "--acceleration", "acceleration_roof_1", "-o", str(output)]
        return ["work", str(recording), *options, "--no-report"]
    return ["check", str(recording)]


@pytest.mark.parametrize("command", ["shaker", "work", "check"])
@pytest.mark.parametrize(
    "kind", ["text", "zip", "empty", "folder", "absent", "classic netCDF", "HDF5 of another kind"]
)
def test_not_a_recording(kind: str, command: str, laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    path = tmp_path / "wrong.nc"
    if kind == "text":
        path.write_text("time;force\n0;1\n" * 100)
    elif kind == "zip":
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("run.csv", "1,2,3\n" * 500)
    elif kind == "empty":
        path.touch()
    elif kind == "folder":
        path.mkdir()
    elif kind == "classic netCDF":
        with netCDF4.Dataset(path, "w", format="NETCDF3_CLASSIC") as file:
            file.createDimension("x", 3)
    elif kind == "HDF5 of another kind":
        with netCDF4.Dataset(path, "w") as file:
            file.createGroup("run").createDimension("time", 100)
    refusal(capsys, arguments_of(command, path, laboratory, tmp_path / "out"), tmp_path / "out", "wrong.nc")


def declared(path: Path, n_samples: int) -> Path:
    """A tiny file whose time dimension has `n_samples`; none of them is written."""
    with netCDF4.Dataset(path, "w") as file:
        file.createDimension("time", None if n_samples == 0 else n_samples)
        file.setncatts({key: value for key, value in short_run().attrs.items()})
        chunk = {} if n_samples == 0 else {"chunksizes": (min(n_samples, 4096),)}
        file.createVariable("time", "f8", ("time",), zlib=True, **chunk).units = "s"
        for name, units in (("force_cell_1", "N"), ("acceleration_roof_1", "m s-2")):
            channel = file.createVariable(name, "f8", ("time",), zlib=True, **chunk)
            channel.setncatts({"units": units, "quantity": name.partition("_")[0]})
    return path


def test_no_samples(laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    arguments = shaker_arguments([declared(tmp_path / "bad.nc", 0)], [laboratory / "rig.toml"], tmp_path / "out")
    refusal(capsys, arguments, tmp_path / "out", "bad.nc", "0 samples", "≥ 2 samples")


def test_one_sample(laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    arguments = shaker_arguments([declared(tmp_path / "bad.nc", 1)], [laboratory / "rig.toml"], tmp_path / "out")
    refusal(capsys, arguments, tmp_path / "out", "bad.nc", "1 sample", "≥ 2 samples")


@pytest.mark.parametrize("command", ["shaker", "work", "check"])
def test_a_billion_samples_declared(command: str, laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    bad = declared(tmp_path / "bad.nc", 10**9)
    assert bad.stat().st_size < 1e6
    arguments = arguments_of(command, bad, laboratory, tmp_path / "out")
    refusal(capsys, arguments, tmp_path / "out", "bad.nc", "1000000000 samples", "GiB")


def test_too_short_for_a_sweep(laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    run = cut_out(short_run(), 0.0, 0.2)
    run.attrs.pop("sweep_duration_s")
    write_virtual_run(run, tmp_path / "bad.nc")
    arguments = shaker_arguments([tmp_path / "bad.nc"], [laboratory / "rig.toml"], tmp_path / "out")
    refusal(capsys, arguments, tmp_path / "out", "bad.nc", "0.5 s")


def test_only_an_empty_run(laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    arguments = shaker_arguments([laboratory / "empty.nc"], [laboratory / "rig.toml"], tmp_path / "out")
    refusal(capsys, arguments, tmp_path / "out", "no sloshing run")


def test_no_motion(laboratory: Path, tmp_path: Path, capsys: Any) -> None:
    write_virtual_run(stopped(0.0, short_run()), tmp_path / "bad.nc")
    arguments = shaker_arguments([tmp_path / "bad.nc"], [laboratory / "rig.toml"], tmp_path / "out")
    refusal(capsys, arguments, tmp_path / "out", "bad.nc")
