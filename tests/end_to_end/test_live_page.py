"""The live page as a person uses it: a browser, a device that is unplugged, and what may go wrong beside."""

from __future__ import annotations

import contextlib
import json
import os
import re
import resource
import shutil
import signal
import socket
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import netCDF4
import numpy as np
import pytest
from browser_that_is_there import opened_browser
from live_commands import (
    RATE_HZ,
    Command,
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
from short_runs import DONE_BUT_FLAGGED, INPUT_IS_BAD, USAGE, assert_one_line, refusal

from pipelines.command_line import run

pytestmark = [
    pytest.mark.skipif(os.name != "posix", reason="needs pseudo-terminals and signals"),
    pytest.mark.usefixtures("programs_are_forks"),
]
pytest.importorskip("uvicorn", reason="needs the extra live")
pytest.importorskip("starlette", reason="needs the extra live")
pytest.importorskip("websockets", reason="needs the extra live")

N_SAMPLES = 4096


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory, repository: Path) -> Path:
    """Folder with ``run.nc``, 8 s of a measured sweep, ``long.nc``, all of it, and ``rig.toml``."""
    folder = tmp_path_factory.mktemp("bench")
    campaign = repository / "raw_data" / "shaker"
    cut_recording(campaign / "fill_0.50_sweep_3.00g.nc", folder / "run.nc", N_SAMPLES)
    shutil.copy(campaign / "fill_0.50_sweep_3.00g.nc", folder / "long.nc")
    shutil.copy(campaign / "rig_fill_0.50.toml", folder / "rig.toml")
    return folder


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    folder = tmp_path / "lab"
    folder.mkdir()
    return folder


def arguments(sources: list[str], bench: Path, lab: Path, *options: str) -> list[str]:
    return ["record", *sources, "--rig", str(bench / "rig.toml"), "-o", str(lab / "new.nc"), "--page", *options]


def url_of(recorder: Command) -> str:
    """Address of the page, as soon as it is announced."""

    def announced() -> str | None:
        assert not recorder.poll(), recorder.stderr
        found = re.search(r"^page (http://\S+)\n", recorder.stdout, re.MULTILINE)
        return found and found[1]

    return str(wait_until(announced, "the page"))


def test_a_port_in_use_is_one_line_and_no_device_is_touched(bench: Path, lab: Path, capsys: Any) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        source = ["--source", f"file:{bench / 'run.nc'}"]
        refusal(
            capsys, arguments(source, bench, lab, "--page-port", port), lab,
            f"--page on 127.0.0.1:{port}", "in use", "--page-port",
        )  # fmt: skip


def test_an_address_of_another_computer_is_one_line(bench: Path, lab: Path, capsys: Any) -> None:
    # TEST-NET-1, which belongs to nobody
    source = ["--source", f"file:{bench / 'run.nc'}"]
    refusal(capsys, arguments(source, bench, lab, "--page-host", "192.0.2.1"), lab, "--page on 192.0.2.1:0")


def test_a_missing_package_is_one_line_that_names_the_extra(
    bench: Path, lab: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    source = ["--source", f"file:{bench / 'run.nc'}"]
    refusal(capsys, arguments(source, bench, lab), lab, "the live page needs uvicorn", "sloshlab[live]")


@pytest.mark.parametrize(
    "options", [["--trigger", "mark"], ["--pre-seconds", "1"]], ids=["a mark without a page", "before no trigger"]
)
def test_options_that_need_another_are_usage_errors(
    options: list[str], bench: Path, lab: Path, capsys: Any
) -> None:
    given = arguments(["--source", f"file:{bench / 'run.nc'}"], bench, lab, *options)
    given.remove("--page")
    assert run(given) == USAGE
    assert options[0] in capsys.readouterr().err
    assert visible(lab) == []


@pytest.mark.slow
def test_an_exposed_page_is_warned_of(bench: Path, lab: Path) -> None:
    source = ["--source", f"file:{bench / 'run.nc'}"]
    with running(arguments(source, bench, lab, "--page-host", "0.0.0.0"), lab) as recorder:
        assert recorder.exit_code() == 0, recorder.stderr
        assert without_progress(recorder.stderr).startswith("page exposed on 0.0.0.0")
        assert without_progress(recorder.stderr).count("\n") == 1
    assert samples_that_agree(bench / "run.nc", lab / "new.nc") == N_SAMPLES


def opened_socket(url: str) -> socket.socket:
    """A browser of few bytes: a WebSocket that nobody reads."""
    parts = urlsplit(url)
    assert parts.hostname is not None
    raw = socket.socket()
    raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    raw.settimeout(30)
    raw.connect((parts.hostname, int(parts.port or 0)))
    raw.sendall(
        f"GET {parts.path}live HTTP/1.1\r\nHost: {parts.netloc}\r\nOrigin: http://{parts.netloc}\r\n"
        "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n".encode()
    )
    assert b" 101 " in raw.recv(64)
    return raw


@pytest.mark.slow
def test_browsers_that_go_away_or_read_nothing_cost_no_sample(bench: Path, lab: Path) -> None:
    """Some are closed, some cut off, some stay and take nothing; the page is asked by others meanwhile."""
    with (
        playing(bench / "run.nc", lab, "pty") as devices,
        running(arguments(devices.sources, bench, lab, "--json"), lab) as recorder,
        contextlib.ExitStack() as stuck,
    ):
        url = url_of(recorder)
        for _ in range(3):
            stuck.callback(opened_socket(url).close)
        for _ in range(3):
            gone = opened_socket(url)
            # closing with a reset, as a computer that is switched off
            gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
            gone.close()
        with urllib.request.urlopen(url, timeout=30) as answer:
            assert b"sloshlab" in answer.read()
        assert recorder.exit_code() == 0, recorder.stderr
        assert without_progress(recorder.stderr) == ""
        assert recorder.summary["flags"] == []
    assert samples_that_agree(bench / "run.nc", lab / "new.nc") == N_SAMPLES


def pages_of(recorder: Command) -> list[int]:
    """Processes that serve the page of a recorder."""
    children = Path(f"/proc/{recorder.process.pid}/task/{recorder.process.pid}/children").read_text()
    return [
        int(child) for child in children.split() if b"page_process" in Path(f"/proc/{child}/cmdline").read_bytes()
    ]


@pytest.mark.slow
def test_a_page_that_dies_is_one_line_and_the_recording_goes_on(bench: Path, lab: Path) -> None:
    with (
        playing(bench / "run.nc", lab, "pty") as devices,
        running(arguments(devices.sources, bench, lab, "--json"), lab) as recorder,
    ):
        url_of(recorder)
        [page] = wait_until(lambda: pages_of(recorder), "the process of the page")
        os.kill(page, signal.SIGKILL)
        assert recorder.exit_code() == 0, recorder.stderr
        assert without_progress(recorder.stderr) == "live page: its process has ended; the recording goes on\n"
    assert samples_that_agree(bench / "run.nc", lab / "new.nc") == N_SAMPLES


@pytest.mark.slow
def test_a_page_that_takes_nothing_holds_nobody_up(bench: Path, lab: Path) -> None:
    """Its process is stopped: the pipe fills, the recorder's thread that feeds it waits, and no other."""
    with (
        playing(bench / "run.nc", lab, "pty") as devices,
        running(arguments(devices.sources, bench, lab, "--json"), lab) as recorder,
    ):
        url_of(recorder)
        [page] = wait_until(lambda: pages_of(recorder), "the process of the page")
        os.kill(page, signal.SIGSTOP)
        assert recorder.exit_code() == 0, recorder.stderr
        assert without_progress(recorder.stderr) == ""
        assert not Path(f"/proc/{page}").exists()
    assert samples_that_agree(bench / "run.nc", lab / "new.nc") == N_SAMPLES


def test_a_recorder_that_is_killed_takes_its_page_along(bench: Path, lab: Path) -> None:
    with (
        playing(bench / "run.nc", lab, "pty") as devices,
        running(arguments(devices.sources, bench, lab), lab) as recorder,
    ):
        url_of(recorder)
        [page] = wait_until(lambda: pages_of(recorder), "the process of the page")
        recorder.send(signal.SIGKILL)
        assert recorder.exit_code() == -signal.SIGKILL
        wait_until(lambda: not Path(f"/proc/{page}").exists(), "the end of the page")


@pytest.mark.slow
def test_a_full_disk_is_one_line_and_nothing_is_lost(bench: Path, lab: Path) -> None:
    source = ["--source", f"file:{bench / 'run.nc'}?speed=10"]

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000))

    with running(arguments(source, bench, lab), lab, preexec_fn=limit) as recorder:
        assert recorder.exit_code() == INPUT_IS_BAD
        assert_one_line(recorder.stderr, "File too large", "sloshlab recover", str(lab / "new.journal"))
        _, _, typed = without_progress(recorder.stderr).strip().partition("sloshlab recover ")
    assert visible(lab) == ["new.journal"]
    assert run(["recover", *typed.split()]) == DONE_BUT_FLAGGED
    assert 400 <= samples_that_agree(bench / "run.nc", lab / "new.nc") < N_SAMPLES


def test_a_trigger_by_the_command(bench: Path, lab: Path) -> None:
    """The first sample above the level, found in the file that was played; and what came before it, exactly."""
    original = stored(bench / "run.nc")
    force = original["force_cell_1"].values * original["force_cell_1"].attrs["scale_factor"]
    level = 0.9 * float(force[2000:].max())
    beyond, below = np.flatnonzero(force > level), np.flatnonzero(force <= level)
    at = int(beyond[beyond > below[0]][0])
    assert at > 700
    given = arguments(["--source", f"file:{bench / 'run.nc'}"], bench, lab, "--json")
    given.remove("--page")
    assert run([*given, "--trigger", f"force_cell_1 > {level}", "--pre-seconds", "1"]) == 0
    found = stored(lab / "new.nc")
    assert found["time"].values[512] == 0
    for name in ("force_cell_1", "force_cell_2", "acceleration_roof_1"):
        np.testing.assert_array_equal(found[name].values, original[name].values[at - 512 :])


@pytest.mark.slow
def test_a_mark_of_the_page_starts_a_recording(bench: Path, lab: Path) -> None:
    """By the messages of the page itself; what came before the mark is there, and time 0 is where it was set."""
    from websockets.sync.client import connect

    given = ["--trigger", "mark", "--pre-seconds", "0.5", "--json"]
    with (
        playing(bench / "long.nc", lab, "pty") as devices,
        running(arguments(devices.sources, bench, lab, *given), lab) as recorder,
    ):
        parts = urlsplit(url_of(recorder))
        with connect(f"ws://{parts.netloc}{parts.path}live", origin=f"http://{parts.netloc}") as page:  # type: ignore[arg-type]

            def status() -> dict[str, Any]:
                return dict(json.loads(page.recv(60))["status"])

            wait_until(
                lambda: status().get("waiting_for") == "mark" and status()["sources"][0]["n_samples"] > 512, "it"
            )
            assert n_bytes(lab / "new.nc") == 0
            page.send(json.dumps({"mark": "go"}))
            wait_until(
                lambda: status()["waiting_for"] == "" and status()["sources"][0]["n_samples"] > 512, "samples"
            )
        recorder.send(signal.SIGINT)
        assert recorder.exit_code() == 0, recorder.stderr
        trigger = recorder.summary["report"]["trigger"]
    found, original = stored(lab / "new.nc"), stored(bench / "long.nc")
    start = trigger["counter"] - 256
    assert found["time"].values[256] == 0
    for name in ("force_cell_1", "acceleration_control"):
        expected = original[name].values[start : start + found.sizes["time"]]
        np.testing.assert_array_equal(found[name].values, expected)
    with netCDF4.Dataset(lab / "new.nc") as file:
        [mark] = json.loads(file.marks)
    # the newest sample that had come when it was set; a loaded computer may be late with either
    assert mark["text"] == "go"
    assert abs(mark["time_s"]) < 2


@pytest.fixture
def browser() -> Iterator[Any]:
    with opened_browser() as opened:
        yield opened


def pixels_like(page: Any, colour: str) -> int:
    """Pixels of the first curve that have a colour of the style sheet."""
    return int(
        page.evaluate(
            """(name) => {
              const canvas = document.querySelector("#curves canvas");
              const probe = document.createElement("canvas").getContext("2d");
              probe.fillStyle = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
              probe.fillRect(0, 0, 1, 1);
              const [r, g, b] = probe.getImageData(0, 0, 1, 1).data;
              const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
              let n = 0;
              for (let k = 0; k < data.length; k += 4) {
                n += data[k] === r && data[k + 1] === g && data[k + 2] === b;
              }
              return n;
            }""",
            colour,
        )
    )


def test_a_browser_sees_a_device_go_and_come_back(bench: Path, lab: Path, browser: Any) -> None:
    (lab / "faults.toml").write_text("[[disconnect]]\nat_s = 12.0\nfor_s = 6.0\n", encoding="utf-8")
    seen = browser.new_page(viewport={"width": 1400, "height": 900})
    wrong: list[str] = []
    seen.on("pageerror", lambda error: wrong.append(str(error)))
    seen.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    with (
        playing(bench / "long.nc", lab, "pty", options=["--faults", lab / "faults.toml"]) as devices,
        running(arguments(devices.sources, bench, lab, "--json"), lab) as recorder,
    ):
        seen.goto(url_of(recorder))
        seen.set_default_timeout(60_000)
        seen.wait_for_selector("#curves canvas")
        wait_until(lambda: pixels_like(seen, "curve") > 200, "a curve")
        seen.wait_for_selector("#state.bad:has-text('a device is missing')")
        # the right edge goes on without it
        wait_until(lambda: pixels_like(seen, "lost") > 200, "the gap in the curve")
        seen.wait_for_selector("#state.good:has-text('recording')")
        seen.fill("#mark-text", "after the cable")
        seen.click("#mark button")
        seen.wait_for_selector("#events .mark:has-text('mark: after the cable')")
        wait_until(lambda: pixels_like(seen, "mark") > 20, "the mark in the curve")
        events = seen.inner_text("#events")
        assert "the connection was lost" in events
        assert "the connection came back" in events
        shown = int(seen.inner_text("#figures").partition("lost")[2].split("samples")[0].replace(" ", ""))
        recorder.send(signal.SIGINT)
        seen.wait_for_selector("#state:has-text('ended')")
        assert recorder.exit_code() == DONE_BUT_FLAGGED
        assert recorder.summary["sources"][0]["n_lost"] == shown > 0
    assert wrong == []
    seen.close()
    found, original = stored(lab / "new.nc"), stored(bench / "long.nc")
    n_samples = found.sizes["time"]
    is_lost = found["quality"].values != 0
    assert 5.9 < is_lost.sum() / RATE_HZ < 40
    np.testing.assert_array_equal(
        found["force_cell_1"].values[~is_lost], original["force_cell_1"].values[:n_samples][~is_lost]
    )
    with netCDF4.Dataset(lab / "new.nc") as file:
        [mark] = json.loads(file.marks)
    assert mark["text"] == "after the cable"
    # set after it had come back
    assert np.flatnonzero(is_lost)[-1] / RATE_HZ < mark["time_s"] < n_samples / RATE_HZ
