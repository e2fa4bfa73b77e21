"""`record`, `replay` and `recover` as a person uses them: devices and recorder are two processes."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_commands import (
    FORCES,
    RATE_HZ,
    ROOF,
    Devices,
    cut_recording,
    n_bytes,
    playing,
    running,
    samples_that_agree,
    stored,
    visible,
    wait_until,
)
from progress_lines import without_progress
from short_runs import DONE_BUT_FLAGGED, INPUT_IS_BAD, INTERRUPTED, USAGE, assert_one_line, refusal

import pipelines.recording.record
from pipelines.command_line import run

pytestmark = pytest.mark.usefixtures("programs_are_forks")

resource = pytest.importorskip("resource", reason="needs pseudo-terminals and signals")

N_SAMPLES = 4096
LOST = 1


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory, repository: Path) -> Path:
    """Folder with ``run.nc``, 8 s of a measured sweep, and its ``rig.toml``; tests do not change it."""
    folder = tmp_path_factory.mktemp("bench")
    campaign = repository / "raw_data" / "shaker"
    cut_recording(campaign / "fill_0.50_sweep_3.00g.nc", folder / "run.nc", N_SAMPLES)
    shutil.copy(campaign / "rig_fill_0.50.toml", folder / "rig.toml")
    return folder


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    """An empty folder in which nothing may be left that was not asked for."""
    folder = tmp_path / "lab"
    folder.mkdir()
    return folder


def record_arguments(devices: Devices | list[str], bench: Path, output: Path, *options: str) -> list[str]:
    sources = devices.sources if isinstance(devices, Devices) else devices
    return ["record", *sources, "--rig", str(bench / "rig.toml"), "-o", str(output), *options]


def test_four_transports_at_once(bench: Path, lab: Path) -> None:
    """Each carries some of the channels; together they are the recording again, sample by sample."""
    channels = [FORCES[0], FORCES[1], ",".join(ROOF), "acceleration_control"]
    options = ["--speed", "max", "--json", *(part for names in channels for part in ("--channels", names))]
    with (
        playing(bench / "run.nc", lab, "pty", "socket", "socketcand", "slcan", options=options) as devices,
        running(record_arguments(devices, bench, lab / "new.nc", "--align", "counter", "--json"), lab) as recorder,
    ):
        assert recorder.exit_code() == 0, recorder.stderr
        assert devices.command.exit_code() == 0, devices.command.stderr
        assert without_progress(recorder.stderr) == devices.command.stderr == ""
        summary, played = recorder.summary, devices.command.summary
    assert samples_that_agree(bench / "run.nc", lab / "new.nc") == N_SAMPLES
    assert summary["flags"] == []
    assert summary["reason"] == "end"
    assert [source["n_samples"] for source in summary["sources"]] == [N_SAMPLES] * 4
    sent = [device["samples_sent"] for device in played["devices"].values()]
    assert sent == [N_SAMPLES] * 4
    # the journal is gone, so are the links of the pseudo-terminals
    assert visible(lab) == ["new.nc", "slcan.dbc", "socketcand.dbc"]


@pytest.mark.slow
def test_losses_end_in_exit_3_and_are_told_twice(bench: Path, lab: Path) -> None:
    """Frames that a TCP device never sends; which ones is what the device itself wrote down."""
    (lab / "faults.toml").write_text("[drop]\nat_counters = [100, 2000]\n", encoding="utf-8")
    options = ["--speed", "max", "--faults", lab / "faults.toml", "--truth", lab / "truth.json"]
    with (
        playing(bench / "run.nc", lab, "socket", options=[*options, "--samples-per-frame", "16"]) as devices,
        running(record_arguments(devices, bench, lab / "new.nc", "--json"), lab) as recorder,
    ):
        assert recorder.exit_code() == DONE_BUT_FLAGGED
        flagged = without_progress(recorder.stderr).splitlines()
        assert flagged
        assert all(line.startswith("flagged: ") for line in flagged)
        assert [f"flagged: {flag}" for flag in recorder.summary["flags"]] == flagged
        assert recorder.summary["sources"][0]["n_lost"] == 32
        assert devices.command.exit_code() == 0
    places = json.loads((lab / "truth.json").read_text())["device_1"]["places"]
    is_lost = np.zeros(N_SAMPLES, bool)
    for place in places:
        assert place["fault"] == "drop"
        is_lost[place["counter"] : place["counter"] + place["n_samples"]] = True
    assert np.flatnonzero(is_lost).tolist() == [*range(96, 112), *range(2000, 2016)]
    expected, found = stored(bench / "run.nc"), stored(lab / "new.nc")
    np.testing.assert_array_equal(found["quality"].values, np.where(is_lost, LOST, 0))
    for name in (*FORCES, *ROOF):
        np.testing.assert_array_equal(found[name].values[~is_lost], expected[name].values[~is_lost])
        assert (found[name].values[is_lost] == found[name].attrs["_FillValue"]).all()


def test_a_duration_is_one_of_samples(bench: Path, lab: Path, capsys) -> None:
    """At four times the speed 2.5 s of samples are there after a quarter of that."""
    source = ["--source", f"file:{bench / 'run.nc'}?speed=4"]
    assert run(record_arguments(source, bench, lab / "new.nc", "--duration", "2.5", "--json")) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["reason"] == "duration"
    n_samples = samples_that_agree(bench / "run.nc", lab / "new.nc")
    # what had been read when the duration was full is kept
    assert 2.5 * RATE_HZ <= n_samples < 2.5 * RATE_HZ + 4 * RATE_HZ


@pytest.mark.slow
def test_ctrl_c_ends_a_recording_and_keeps_it(bench: Path, lab: Path) -> None:
    with (
        playing(bench / "run.nc", lab, "pty") as devices,
        running(record_arguments(devices, bench, lab / "new.nc", "--json", "--keep-journal"), lab) as recorder,
    ):
        wait_until(lambda: n_bytes(lab / "new.journal") > 10_000, "samples in the journal")
        recorder.send(signal.SIGINT)
        assert recorder.exit_code() == 0, recorder.stderr
        assert without_progress(recorder.stderr) == ""
        assert recorder.summary["reason"] == "requested"
        n_samples = recorder.summary["report"]["n_samples"]
        assert devices.command.exit_code() == 0
    # each sample takes 20 bytes in the journal
    assert samples_that_agree(bench / "run.nc", lab / "new.nc") == n_samples >= 400
    assert n_samples < N_SAMPLES
    assert visible(lab) == ["new.journal", "new.nc"]


def test_kill_9_and_recover(bench: Path, lab: Path, capsys) -> None:
    with (
        playing(bench / "run.nc", lab, "socket") as devices,
        running(record_arguments(devices, bench, lab / "new.nc"), lab) as recorder,
    ):
        wait_until(lambda: n_bytes(lab / "new.journal") > 10_000, "samples in the journal")
        recorder.send(signal.SIGKILL)
        assert recorder.exit_code() == -signal.SIGKILL
        n_written = n_bytes(lab / "new.journal")
        devices.command.send(signal.SIGTERM)
        assert devices.command.exit_code() == 0
    assert visible(lab) == ["new.journal"]
    journal = (lab / "new.journal").read_bytes()
    assert run(["recover", str(lab / "new.journal"), "-o", str(lab / "new.nc"), "--json"]) == DONE_BUT_FLAGGED
    said = capsys.readouterr().out
    assert json.loads(said.splitlines()[-1])["flags"]
    assert "not closed" in said
    # 20 bytes per sample and at most 100 for each of the frames, of which there are some ten per second
    n_samples = samples_that_agree(bench / "run.nc", lab / "new.nc")
    assert n_samples > n_written / 60
    assert (lab / "new.journal").read_bytes() == journal
    first = (lab / "new.nc").read_bytes()
    assert run(["recover", str(lab / "new.journal"), "-o", str(lab / "again.nc")]) == DONE_BUT_FLAGGED
    assert samples_that_agree(lab / "new.nc", lab / "again.nc") == n_samples
    assert run(["recover", str(lab / "new.journal"), "-o", str(lab / "new.nc")]) == INPUT_IS_BAD
    assert (lab / "new.nc").read_bytes() == first
    assert run(["recover", str(lab / "new.journal"), "-o", str(lab / "new.nc"), "--overwrite"]) == DONE_BUT_FLAGGED
    assert (lab / "new.nc").read_bytes() == first


@pytest.mark.slow
def test_a_device_that_dies(bench: Path, lab: Path) -> None:
    """Killed in the middle: what it had sent is a recording, and the exit code says that it is not all."""
    with (
        playing(bench / "run.nc", lab, "socketcand") as devices,
        running(
            record_arguments([f"{part}&reconnect=no" if "?" in part else part for part in devices.sources],
                             bench, lab / "new.nc", "--json", "--keep-journal"), lab,
        ) as recorder,
    ):  # fmt: skip
        wait_until(lambda: n_bytes(lab / "new.journal") > 20_000, "samples in the journal")
        devices.command.send(signal.SIGKILL)
        assert recorder.exit_code() == DONE_BUT_FLAGGED, recorder.stderr
        assert recorder.summary["reason"] == "sources_failed"
        assert "the connection was lost" in recorder.summary["sources"][0]["error"]
    assert 400 <= samples_that_agree(bench / "run.nc", lab / "new.nc") < N_SAMPLES


@pytest.mark.slow
def test_ctrl_c_while_a_device_is_away(bench: Path, lab: Path) -> None:
    """By default a recorder waits for a device that has vanished; a person who does not gets what there is."""
    with (
        playing(bench / "run.nc", lab, "pty") as devices,
        running(record_arguments(devices, bench, lab / "new.nc", "--json"), lab) as recorder,
    ):
        wait_until(lambda: n_bytes(lab / "new.journal") > 10_000, "samples in the journal")
        devices.command.send(signal.SIGKILL)
        devices.command.exit_code()
        size = wait_until(lambda: n_bytes(lab / "new.journal"), "a journal")
        wait_until(lambda: n_bytes(lab / "new.journal") > size or "vanished" in recorder.stderr, "word of it")
        recorder.send(signal.SIGINT)
        assert recorder.exit_code() == DONE_BUT_FLAGGED, recorder.stderr
        assert recorder.summary["sources"][0]["troubles"] == {"DISCONNECTED": 1}
    assert 400 <= samples_that_agree(bench / "run.nc", lab / "new.nc") < N_SAMPLES


@pytest.mark.parametrize("name", ["assemble", "_require_readable"])
def test_ctrl_c_while_the_recording_is_assembled(name: str, bench: Path, lab: Path, monkeypatch, capsys) -> None:
    """All samples are in the journal then; the one line says so, and what it says to type works."""

    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patches:
        patches.setattr(pipelines.recording.record, name, interrupted)
        source = ["--source", f"file:{bench / 'run.nc'}"]
        assert run(record_arguments(source, bench, lab / "new.nc")) == INTERRUPTED
    captured = capsys.readouterr()
    assert captured.out == ""
    assert_one_line(captured.err, "interrupted", "every sample is in", str(lab / "new.journal"))
    _, _, typed = without_progress(captured.err).strip().partition("sloshlab recover ")
    assert run(["recover", *typed.split()]) == 0
    assert samples_that_agree(bench / "run.nc", lab / "new.nc") == N_SAMPLES


@pytest.mark.slow
def test_a_signal_while_the_recording_is_assembled(bench: Path, lab: Path) -> None:
    """The same with a real signal; the assembly of this process waits for it."""
    program = (
        "import sys, pathlib, time, pipelines.recording.record;"
        "pipelines.recording.record.assemble ="
        " lambda *_, **__: (pathlib.Path(sys.argv.pop()).touch(), time.sleep(60));"
        "from pipelines.command_line import run; sys.exit(run(sys.argv[1:-1]))"
    )
    arguments = record_arguments(["--source", f"file:{bench / 'run.nc'}"], bench, lab / "new.nc")
    begun = lab.parent / "assembling"
    process = subprocess.Popen([sys.executable, "-c", program, *arguments, str(begun)], stderr=subprocess.PIPE)
    try:
        wait_until(lambda: begun.exists() or process.poll() is not None, "the assembly")
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == INTERRUPTED
    assert_one_line(stderr.decode(), "interrupted", f"sloshlab recover {lab / 'new.journal'} -o {lab / 'new.nc'}")
    assert visible(lab) == ["new.journal"]


def limited(n_bytes: int) -> Callable[[], None]:
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, n_bytes))


def test_a_journal_that_may_not_grow(bench: Path, lab: Path) -> None:
    """The system refuses to write on: exit 1, and what is in the journal is got out by what the line says."""
    source = ["--source", f"file:{bench / 'run.nc'}?speed=10"]
    arguments = record_arguments(source, bench, lab / "new.nc")
    with running(arguments, lab, preexec_fn=limited(30_000)) as recorder:
        assert recorder.exit_code() == INPUT_IS_BAD
        assert_one_line(recorder.stderr, "File too large", "sloshlab recover", str(lab / "new.journal"))
        assert recorder.stdout == ""
        _, _, typed = without_progress(recorder.stderr).strip().partition("sloshlab recover ")
    assert visible(lab) == ["new.journal"]
    assert run(["recover", *typed.split()]) == DONE_BUT_FLAGGED
    assert 400 <= samples_that_agree(bench / "run.nc", lab / "new.nc") < N_SAMPLES


@pytest.mark.slow
def test_no_space_for_the_recording(bench: Path, lab: Path) -> None:
    """The journal is complete; the recording does not fit, neither then nor when it is recovered."""
    arguments = record_arguments(["--source", f"file:{bench / 'run.nc'}"], bench, lab / "new.nc")
    limit = limited(50_000)
    with running(arguments, lab, preexec_fn=limit) as recorder:
        assert recorder.exit_code() == INPUT_IS_BAD
        assert_one_line(recorder.stderr, "cannot be written", "every sample is in", "sloshlab recover")
    assert visible(lab) == ["new.journal"]
    recovery = ["recover", str(lab / "new.journal"), "-o", str(lab / "new.nc")]
    with running(recovery, lab, preexec_fn=limit) as recorder:
        assert recorder.exit_code() == INPUT_IS_BAD
        assert_one_line(recorder.stderr, "cannot be written", "space")
    assert visible(lab) == ["new.journal"]
    assert run(recovery) == 0
    assert samples_that_agree(bench / "run.nc", lab / "new.nc") == N_SAMPLES


@pytest.mark.slow
def test_a_full_disk(bench: Path, lab: Path) -> None:
    """A file system of 40 KiB, mounted for the recorder alone."""
    disk = lab.parent / "disk"
    disk.mkdir()
    program = str(Path(sys.executable).with_name("sloshlab"))
    mounted = 'mount -t tmpfs -o size=40k none "$1" || exit 77; disk=$1 lab=$2; shift 2'
    script = f'{mounted}; "$@"; code=$?; cp "$disk"/* "$lab"; exit $code'
    arguments = record_arguments(["--source", f"file:{bench / 'run.nc'}?speed=10"], bench, disk / "new.nc")
    command = ["unshare", "-Urm", "sh", "-c", script, "sh", str(disk), str(lab), program, *arguments]
    if shutil.which("unshare") is None:
        pytest.skip("no unshare here")
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    if ended.returncode not in (INPUT_IS_BAD, 0):
        pytest.skip(f"no file system may be mounted here: {ended.stderr.strip()[:100]}")
    assert ended.returncode == INPUT_IS_BAD
    assert_one_line(ended.stderr, "No space left on device", "sloshlab recover")
    assert visible(lab) == ["new.journal"]
    assert run(["recover", str(lab / "new.journal"), "-o", str(lab / "new.nc")]) == DONE_BUT_FLAGGED
    assert 400 <= samples_that_agree(bench / "run.nc", lab / "new.nc") < N_SAMPLES


@pytest.mark.parametrize(
    "arguments",
    [
        ["record"],
        ["record", "--source", "file:RUN.nc", "-o", "NEW.nc"],
        ["record", "--source", "file:RUN.nc", "--rig", "RIG.toml"],
        ["record", "--rig", "RIG.toml", "-o", "NEW.nc"],
        ["record", "--source", "file:RUN.nc", "--rig", "RIG.toml", "-o", "NEW.nc", "--duration", "soon"],
        ["recover", "RUN.journal"],
        ["recover", "-o", "NEW.nc"],
        ["replay", "RUN.nc"],
        ["replay", "--as", "serial:tty"],
        ["replay", "RUN.nc", "--as", "serial:tty", "--wait-clients", "0"],
        ["record", "--no-such-option"],
    ],
    ids=" ".join,
)
def test_usage_errors_exit_2(arguments: list[str], lab: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(lab)
    assert run(arguments) == USAGE
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err
    assert "Traceback" not in captured.err
    assert visible(lab) == []


REFUSED_RECORDINGS = {
    "no scheme": (["--source", "{bench}/run.nc"], ("no scheme", "file:")),
    "unknown scheme": (["--source", "tcp:127.0.0.1:7000"], ("'tcp'", "serial")),
    "unknown option": (["--source", "serial:tty?baud=9600"], ("baud", "baudrate")),
    "no such port": (["--source", "serial:{lab}/tty"], ("no such port",)),
    "nobody listens": (["--source", "serial:socket://127.0.0.1:1"], ("127.0.0.1:1", "refused")),
    "no socketcand": (["--source", "can:socketcand?port=1&dbc={bench}/run.nc"], ("run.nc",)),
    "no DBC file": (["--source", "can:socketcand?port=1"], ("dbc",)),
    "no such recording": (["--source", "file:{lab}/none.nc"], ("none.nc",)),
    "one of two": (["--source", "file:{bench}/run.nc", "--source", "serial:{lab}/tty"], ("no such port",)),
    "no such rig": (["--source", "file:{bench}/run.nc", "--rig", "{lab}/none.toml"], ("none.toml",)),
    "a duration of nothing": (["--source", "file:{bench}/run.nc", "--duration", "0"], ("--duration", "0")),
    "an endless duration": (["--source", "file:{bench}/run.nc", "--duration", "inf"], ("--duration", "inf")),
    "unknown alignment": (["--source", "file:{bench}/run.nc", "--align", "guess"], ("--align", "'guess'")),
    "clocks that are not there": (
        ["--source", "file:{bench}/run.nc", "--source", "file:{bench}/run.nc?speed=10", "--align", "device"],
        ("no device clock", "--align host"),
    ),
    "a pair of one device": (
        ["--source", "file:{bench}/run.nc", "--redundant", "acceleration_roof_1:acceleration_roof_2"],
        ("acceleration_roof_1:acceleration_roof_2", "one of another"),
    ),
    "another rate": (
        ["--source", "file:{bench}/run.nc", "--attribute", "sampling_rate_hz=1000"],
        ("sampling_rate_hz", "512"),
    ),
    "a folder that is a file": (
        ["--source", "file:{bench}/run.nc", "-o", "{bench}/run.nc/new.nc"],
        ("which is a file",),
    ),
    "an existing recording": (["--source", "file:{bench}/run.nc", "-o", "{bench}/run.nc"], ("--overwrite",)),
}


@pytest.mark.parametrize("name", list(REFUSED_RECORDINGS))
def test_a_recording_that_cannot_begin(name: str, bench: Path, lab: Path, capsys) -> None:
    options, fragments = REFUSED_RECORDINGS[name]
    known = [option.format(bench=bench, lab=lab) for option in options]
    known += [] if "--rig" in known else ["--rig", str(bench / "rig.toml")]
    known += [] if "-o" in known else ["-o", str(lab / "new.nc")]
    refusal(capsys, ["record", *known], lab, *fragments)
    assert visible(bench) == ["rig.toml", "run.nc"]


def test_an_existing_journal_is_not_overwritten(bench: Path, lab: Path, capsys) -> None:
    (lab / "new.journal").write_bytes(b"of a recording that was cut short")
    arguments = record_arguments(["--source", f"file:{bench / 'run.nc'}"], bench, lab / "new.nc")
    refusal(capsys, arguments, lab, "new.journal", "recover", "--overwrite")


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is unwritable for this user")
def test_a_folder_that_may_not_be_written(bench: Path, lab: Path, capsys) -> None:
    lab.chmod(0o500)
    try:
        arguments = record_arguments(["--source", f"file:{bench / 'run.nc'}"], bench, lab / "new.nc")
        refusal(capsys, arguments, lab, "cannot be written")
    finally:
        lab.chmod(0o700)


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="no folder that nobody can write")
def test_a_folder_that_takes_no_file(bench: Path, lab: Path, capsys) -> None:
    """The permissions of this one promise that it can be written."""
    arguments = record_arguments(["--source", f"file:{bench / 'run.nc'}"], bench, Path("/proc/new.nc"))
    assert run(arguments) == INPUT_IS_BAD
    assert_one_line(capsys.readouterr().err, "/proc/new.journal", "No such file or directory")


@pytest.mark.parametrize("content", [b"", b"not a journal at all\n" * 400, b"\0" * 5000, None])
def test_nothing_to_recover(content: bytes | None, bench: Path, lab: Path, capsys) -> None:
    """An empty file, text, zeros, and a recording that is whole."""
    journal = lab / "old.journal"
    journal.write_bytes((bench / "run.nc").read_bytes() if content is None else content)
    refusal(capsys, ["recover", str(journal), "-o", str(lab / "new.nc")], lab, "old.journal")


@pytest.mark.parametrize("options", [["--align", "guess"], ["--redundant", "a"]], ids=" ".join)
def test_a_journal_cannot_be_aligned_by_anything(options: list[str], lab: Path, capsys) -> None:
    refusal(capsys, ["recover", str(lab / "old.journal"), "-o", str(lab / "new.nc"), *options], lab, options[0])


@pytest.mark.parametrize("options", [[], ["--overwrite"]], ids=" ".join)
def test_no_journal_to_recover(options: list[str], bench: Path, lab: Path, capsys) -> None:
    if options:
        shutil.copy(bench / "run.nc", lab / "new.nc")
    arguments = ["recover", str(lab / "none.journal"), "-o", str(lab / "new.nc"), *options]
    refusal(capsys, arguments, lab, "none.journal", "no such file", "a journal of sloshlab record")


@pytest.mark.parametrize(
    ("name", "fragment"), [("folder", "a folder in the way"), ("file/new.nc", "which is a file")]
)
def test_a_recovered_recording_needs_a_place(name: str, fragment: str, lab: Path, capsys) -> None:
    (lab / "folder").mkdir()
    (lab / "file").touch()
    arguments = ["recover", str(lab / "old.journal"), "-o", str(lab / name), "--overwrite"]
    refusal(capsys, arguments, lab, fragment)


REFUSED_DEVICES = {
    "no such recording": (["{lab}/none.nc", "--as", "serial:{lab}/tty"], ("none.nc",)),
    "no scheme": (["{bench}/run.nc", "--as", "{lab}/tty"], ("no scheme",)),
    "no device": (["{bench}/run.nc", "--as", "sim:shaker"], ("'sim'", "serial, can")),
    "no DBC file": (["{bench}/run.nc", "--as", "can:socketcand?port=0"], ("dbc",)),
    "not this computer": (["{bench}/run.nc", "--as", "serial:socket://0.0.0.0:0"], ("0.0.0.0", "--expose")),
    "no speed": (["{bench}/run.nc", "--as", "serial:{lab}/tty", "--speed", "warp"], ("--speed", "'warp'")),
    "no such channel": (["{bench}/run.nc", "--as", "serial:{lab}/tty", "--channels", "force_9"], ("force_9",)),
    "no faults": (["{bench}/run.nc", "--as", "serial:{lab}/tty", "--faults", "{lab}/none.toml"], ("none.toml",)),
    "a port that is a file": (["{bench}/run.nc", "--as", "serial:{bench}/rig.toml"], ("rig.toml",)),
}


@pytest.mark.parametrize("name", list(REFUSED_DEVICES))
def test_a_device_that_cannot_appear(name: str, bench: Path, lab: Path, capsys) -> None:
    options, fragments = REFUSED_DEVICES[name]
    arguments = [option.format(bench=bench, lab=lab) for option in options]
    refusal(capsys, ["replay", *arguments], lab, *fragments)
    assert visible(bench) == ["rig.toml", "run.nc"]


@pytest.mark.slow
def test_the_installed_commands_refuse_in_one_line(bench: Path, lab: Path) -> None:
    arguments = record_arguments(["--source", f"serial:{lab / 'tty'}"], bench, lab / "new.nc", "--json")
    with (
        running(arguments, lab) as recorder,
        running(["recover", lab / "x", "-o", lab / "new.nc"], lab) as recovery,
    ):
        for command in (recorder, recovery):
            assert command.exit_code() == INPUT_IS_BAD
            assert command.stdout == ""
            assert_one_line(command.stderr)
    assert visible(lab) == []
