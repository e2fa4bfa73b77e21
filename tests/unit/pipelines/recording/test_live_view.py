"""What the live view shows, on a terminal, in a pipe, and when the terminal goes away."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from acquisition.recorder.statistics import ChannelLevel, Drift
from acquisition.recorder.status import Event, RecorderStatus, SourceState, SourceStatus
from acquisition.samples.delivery import TroubleKind
from pipelines.recording.live_view import LiveView, rendered

FORCE = ChannelLevel("force_cell_1", "N", 5.0, 10.0, 20.0, 0, 0, False)
CLIPPED = ChannelLevel("force_cell_2", "N", 9.0, 20.0, 20.0, 131, 4, True)
UNKNOWN = ChannelLevel("acceleration_control", "m s-2", None, float("nan"), 50.0, 0, 0, False)
DAQ = SourceStatus(
    device="daq",
    url="serial:/dev/ttyUSB0",
    state=SourceState.RUNNING,
    sampling_rate_hz=51_200.0,
    measured_rate_hz=51_199.34,
    n_samples=6_553_600,
    n_lost=1042,
    levels=(FORCE, CLIPPED, UNKNOWN),
    troubles={TroubleKind.CORRUPT_FRAME: 3, TroubleKind.GARBAGE: 1234},
    drift=Drift(-12.71, 0.83),
    queue_fill=0.95,
    error=None,
)
STATUS = RecorderStatus(128.2, 52.4, 84_000_000, False, (DAQ,))


def shown(status: RecorderStatus, n_bytes_free: int | None = 812_000_000, height: int = 50) -> list[str]:
    console = Console(record=True, width=100, file=io.StringIO(), force_terminal=True)
    console.print(rendered(status, n_bytes_free, height))
    return console.export_text().splitlines()


def test_everything_is_shown_within_the_width() -> None:
    heading, _, source, remarks, _, force, clipped, unknown = shown(STATUS)
    assert heading.split("   ")[:4] == ["recording 2:08", "0:52 left", "on disk 84.0 MB", "free 812.0 MB"]
    assert source.split("  ") == [
        "daq", "running", "6 553 600 samples", "51199.3 of 51200 Hz", "lost 1 042", "drift -12.7 ± 0.8 ppm",
        "buffer 95%",
    ]  # fmt: skip
    assert remarks.strip() == "corrupt frames 3, bytes of garbage 1 234"
    # 28 cells to the limit: 5 N of 20 N are 7, 10 N are 14
    assert force.split() == ["force_cell_1", "5", "10", "N", "█" * 7 + "▒" * 7 + "·" * 14 + "▏", "0"]
    assert clipped.split() == [
        "force_cell_2",
        "9",
        "20",
        "N",
        "█" * 13 + "▒" * 15 + "▌!",
        *["131", "+", "4", "missing"],
    ]
    assert unknown.split()[:3] == ["acceleration_control", "–", "–"]
    assert max(map(len, shown(STATUS))) <= 100


def test_what_is_unknown_is_left_out() -> None:
    quiet = replace(DAQ, measured_rate_hz=None, drift=None, troubles={}, state=SourceState.WAITING)
    lines = shown(replace(STATUS, remaining_s=None, sources=(quiet,)), None)
    assert "left" not in lines[0]
    assert "free" not in lines[0]
    assert "waiting for samples" in lines[2]
    assert "  51200 Hz" in lines[2]
    assert "drift" not in lines[2]


def test_a_recording_that_waits_says_for_what() -> None:
    heading = shown(replace(STATUS, waiting_for="force_cell_1>2 or mark"))[0]
    assert heading.startswith("waiting for force_cell_1>2 or mark 2:08")


def test_many_channels_fit_the_height() -> None:
    many = replace(DAQ, levels=tuple(replace(FORCE, name=f"force_cell_{k}") for k in range(100)))
    lines = shown(replace(STATUS, sources=(many, many)), height=40)
    assert len(lines) <= 40
    assert "… 86 more" in "\n".join(lines)


def test_nothing_from_a_device_is_obeyed_by_the_terminal() -> None:
    hostile = replace(
        DAQ, device="\x1b[2Jdaq", error="\x1b]0;title\x07[bold]", levels=(replace(FORCE, units="\x9b"),)
    )
    text = "\n".join(shown(replace(STATUS, sources=(hostile,))))
    assert not any(character in text for character in "\x1b\x07\x9b")
    assert "[bold]" in text


class Clock:
    def __init__(self) -> None:
        self.now_ns = 0

    def __call__(self) -> int:
        return self.now_ns


def terminal() -> Console:
    return Console(file=io.StringIO(), force_terminal=True, width=100, height=40, _environ={})


def test_updated_at_most_five_times_per_second(monkeypatch: pytest.MonkeyPatch) -> None:
    updates, clock = [], Clock()
    with LiveView(Path(), 1, terminal(), monotonic_ns=clock, free_bytes=lambda _: 10**9) as view:
        monkeypatch.setattr(view._live, "update", lambda *_, **__: updates.append(clock.now_ns))
        for _ in range(100):
            view.status(STATUS)
            clock.now_ns += 10_000_000
    assert updates == [0, 200_000_000, 400_000_000, 600_000_000, 800_000_000]


def test_events_stand_above_the_view() -> None:
    console = terminal()
    with LiveView(Path(), 2, console, free_bytes=lambda _: 10**9) as view:
        view.status(STATUS)
        view.event(Event(0, "daq: the connection was lost", is_failure=False))
    assert "daq: the connection was lost" in console.file.getvalue()


def test_a_pipe_is_told_only_of_failures_while_others_go_on() -> None:
    console = Console(file=io.StringIO(), force_terminal=False, width=40)
    with LiveView(Path(), 2, console) as view:
        view.status(STATUS)
        view.event(Event(0, "daq: the connection was lost", is_failure=False))
        assert console.file.getvalue() == ""
        view.event(Event(0, "source serial:/dev/ttyUSB0: got an unplugged cable", is_failure=True))
        # the command itself ends with the last failure, and with that of the disk
        view.event(Event(1, "source can:x: got nothing", is_failure=True))
        view.event(Event(None, "journal: full", is_failure=True))
    assert console.file.getvalue() == "source serial:/dev/ttyUSB0: got an unplugged cable\n"


class ClosedTerminal(io.StringIO):
    def write(self, text: str) -> int:
        raise OSError(5, "Input/output error")

    def flush(self) -> None:
        raise OSError(5, "Input/output error")


def test_a_terminal_that_goes_away_does_not_end_the_recording() -> None:
    console = terminal()
    with LiveView(Path(), 1, console, free_bytes=lambda _: 10**9) as view:
        view.status(STATUS)
        console.file = ClosedTerminal()
        view.event(Event(0, "news", is_failure=False))
        view.status(STATUS)
        view.event(Event(0, "news", is_failure=True))
        console.file = io.StringIO()


def test_a_folder_that_cannot_be_asked_does_not_end_the_recording() -> None:
    def fail(_: Path) -> int:
        raise OSError("stale")

    console = terminal()
    with LiveView(Path(), 1, console, free_bytes=fail) as view:
        view.status(STATUS)
    assert "recording 2:08" in console.file.getvalue()
    assert "free" not in console.file.getvalue()
