"""Text of files and devices on a terminal: shown, never obeyed."""

from __future__ import annotations

import sys
from io import StringIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from pipelines.commands.application import finish
from pipelines.recording.live_view import LiveView
from pipelines.report.progress import amounts, progress
from pipelines.report.terminal import printable, say

# ECMA-48: what begins a control sequence in 7 and in 8 bits, what ends it, what rings
CONTROLS = [*map(chr, range(32)), chr(127), *map(chr, range(0x80, 0xA0))]
# Unicode: directions, what has no width, ends of lines
OBEYED = [*CONTROLS, *"\u202a\u202e\u2066\u2069\u200b\u2028\u2029"]


@pytest.mark.parametrize("character", OBEYED, ids=lambda character: f"U+{ord(character):04X}")
def test_what_terminals_obey_is_written_out(character: str) -> None:
    shown = printable(f"a{character}b")
    assert character not in shown
    assert shown.startswith("a\\")
    assert shown.encode().decode("unicode_escape") == f"a{character}b"


def test_words_of_any_language_and_narrow_spaces_stay() -> None:
    text = "Füllstand ½, ω̄ = 4 · 10⁻³ m² – 12\u202f000 samples, 12\u00a0Hz, 液体, мода"
    assert printable(text) == text


def test_names_of_files_that_are_no_text_can_be_shown() -> None:
    assert printable("run_\udc80.nc").encode() == b"run_\\udc80.nc"


@given(text=st.text())
def test_one_line_stays_one_line(text: str) -> None:
    assert len(f"{printable(text)}|".splitlines()) == 1


def test_lines_and_flags_of_every_command_go_through(capsys: Any) -> None:
    with pytest.raises(Exception, match="3"):
        finish({"lines": ["run \x1b[2J\n0 lost"], "flags": ["\x1b]0;title\x07"], "run": "\x1b[2J"}, as_json=True)
    captured = capsys.readouterr()
    assert "\x1b" not in captured.out + captured.err
    assert captured.out.splitlines()[0] == "run \\x1b[2J\\n0 lost"
    assert captured.err == "flagged: \\x1b]0;title\\x07\n"


def test_said_to_the_stream_that_is_meant(capsys: Any) -> None:
    say("done")
    say("wrong", error=True)
    assert capsys.readouterr() == ("done\n", "wrong\n")


class Terminal(StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("name", ["run\x1b[2J.nc", "run [/bold] 7", "[red]run"])
def test_notes_of_progress_are_shown_as_they_are(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """`[/bold]` was an error of markup that ended the command; `[red]` was not shown."""
    for kind in (amounts, progress):
        terminal = Terminal()
        monkeypatch.setattr(sys, "stderr", terminal)
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setenv("COLUMNS", "200")
        with kind("work", 1) if kind is progress else kind("work") as advance:
            if kind is progress:
                advance(name)
            else:
                advance(1.0, 2.0, name)
        assert printable(name) in terminal.getvalue()
        assert "\x1b[2J" not in terminal.getvalue()


def test_a_pipe_has_a_line_every_half_minute(capsys: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr("pipelines.report.progress.time", SimpleNamespace(monotonic=lambda: now[0]))
    with amounts("diagnosing") as advance:
        for second in range(0, 100, 5):
            now[0] = 100.0 + second
            # two steps of work: one of 20 s, one of 160 s of which a half is done at the end
            advance(*((second, 20.0, "first") if second < 20 else (second - 20.0, 160.0, "one effect: \x1b[2J")))
    assert capsys.readouterr().err.splitlines() == [
        "diagnosing, 30 s so far: one effect: \\x1b[2J, 6 %, about 2 min left of this step",
        "diagnosing, 60 s so far: one effect: \\x1b[2J, 25 %, about 2 min left of this step",
        "diagnosing, 90 s so far: one effect: \\x1b[2J, 44 %, about 90 s left of this step",
        "diagnosing, 95 s: done",
    ]
    with progress("runs", 4) as step:
        step("run_01")
        now[0] += 31.0
        step("run_02")
    assert capsys.readouterr().err == (
        "runs, 31 s so far: run_02, 50 %, about 31 s left of this step\nruns, 31 s: done\n"
    )


def test_the_live_view_writes_out_what_a_device_says() -> None:
    from acquisition.recorder.status import Event

    shown = StringIO()
    view = LiveView(Path(), 2, Console(file=shown, width=200))
    view.event(Event(0, "daq\x1b[2J stopped", is_failure=True))
    assert shown.getvalue() == "daq\\x1b[2J stopped\n"
