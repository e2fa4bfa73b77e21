"""Ctrl-C: exit 130, all outputs or none, no temporary files."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from progress_lines import without_progress
from short_runs import DONE_BUT_FLAGGED, INTERRUPTED, contents, leftovers, shaker_arguments
from slow_cases import slow_but

import pipelines.sweep.outputs
import pipelines.sweep.report
import pipelines.sweep.stages
from pipelines.command_line import run
from sloshlab import atomic_file

pytestmark = pytest.mark.skipif(os.name != "posix", reason="SIGINT is sent to a process of its own")
SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")
PLACES = {
    "after the first run": (pipelines.sweep.stages, "evaluate_windows"),
    "before windows.nc": (pipelines.sweep.outputs, "write_dataset"),
    "while a file is put": (atomic_file.os, "replace"),
    "before the report": (pipelines.sweep.report, "write_report"),
}


def arguments_for(laboratory: Path, output: Path) -> list[str]:
    runs = [laboratory / name for name in ("sweep_1.5g.nc", "sweep_3g.nc", "empty.nc")]
    return [word for word in shaker_arguments(runs, [laboratory / "rig.toml"], output) if word != "--no-report"]


@pytest.mark.parametrize("place", list(PLACES))
@pytest.mark.parametrize("nth_call", slow_but([1], [1, 2]))
def test_interrupted_at_a_known_place(
    place, nth_call, laboratory: Path, tmp_path: Path, monkeypatch, capsys
) -> None:
    module, name = PLACES[place]
    if name == "write_report" and nth_call == 2:
        pytest.skip("the report is written once")
    original, calls = getattr(module, name), []

    def interrupted(*arguments: Any, **options: Any) -> Any:
        calls.append(name)
        if len(calls) == nth_call:
            raise KeyboardInterrupt
        return original(*arguments, **options)

    monkeypatch.setattr(module, name, interrupted)
    assert run(arguments_for(laboratory, tmp_path / "out")) == INTERRUPTED
    captured = capsys.readouterr()
    assert without_progress(captured.err).strip() == "sloshlab: interrupted; nothing half-written"
    assert captured.out == ""
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_ends_early_is_no_interrupt(laboratory: Path, tmp_path: Path, monkeypatch) -> None:
    """typer takes EOFError for Ctrl-D at a question: a damaged file within a command was told as interrupted."""

    def damaged(*arguments: Any, **options: Any) -> None:
        raise EOFError("marshal data too short")

    monkeypatch.setattr(pipelines.sweep.stages, "evaluate_windows", damaged)
    with pytest.raises(EOFError, match="too short"):
        run(arguments_for(laboratory, tmp_path / "out"))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("is_interrupted", [True, False])
def test_an_interrupt_told_as_another_error_is_one(
    is_interrupted, laboratory: Path, tmp_path: Path, monkeypatch
) -> None:
    def failing(*arguments: Any, **options: Any) -> None:
        with contextlib.suppress(KeyboardInterrupt):
            if is_interrupted:
                signal.raise_signal(signal.SIGINT)
        raise SystemError("returned a result with an exception set")

    monkeypatch.setattr(pipelines.sweep.stages, "evaluate_windows", failing)
    if is_interrupted:
        assert run(arguments_for(laboratory, tmp_path / "out")) == INTERRUPTED
    else:
        with pytest.raises(SystemError):
            run(arguments_for(laboratory, tmp_path / "out"))
    assert list(tmp_path.iterdir()) == []


def test_interrupt_leaves_earlier_results_alone(laboratory: Path, tmp_path: Path, monkeypatch: Any) -> None:
    out = tmp_path / "out"
    assert run([*arguments_for(laboratory, out), "--no-report", "--m", "12"]) == 0
    before = contents(out)

    def interrupted(*arguments: Any, **options: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(pipelines.sweep.report, "write_report", interrupted)
    assert run(arguments_for(laboratory, out)) == INTERRUPTED
    assert contents(out) == before
    assert leftovers(tmp_path) == []


@pytest.mark.slow
@pytest.mark.parametrize("signal_name", SIGNALS)
def test_signals_at_many_moments(signal_name: str, laboratory: Path, tmp_path: Path) -> None:
    """Wherever the signal falls, the folder is complete or absent; no moment is assumed to be in any stage."""
    command = [str(Path(sys.executable).with_name("sloshlab"))]
    complete = {"windows.nc", "maps.nc", "report.html"}
    sent, codes = signal.Signals[signal_name], []
    said = "interrupted" if sent == signal.SIGINT else f"ended by {signal_name}"
    for number, delay_s in enumerate((0.9, 1.4, 2.2, 3.0, 4.5)):
        folder = tmp_path / str(number)
        folder.mkdir()
        process = subprocess.Popen(
            command + arguments_for(laboratory, folder / "out"),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        time.sleep(delay_s)
        process.send_signal(sent)
        _, stderr = process.communicate(timeout=60)
        codes.append(process.returncode)
        written = contents(folder / "out")
        assert leftovers(folder) == []
        if process.returncode in (0, DONE_BUT_FLAGGED):
            assert complete <= set(written or {})
        elif process.returncode == 128 + sent:
            assert written is None
            assert without_progress(stderr).strip() == f"sloshlab: {said}; nothing half-written"
        else:  # the interpreter was still loading the command
            assert process.returncode == -sent
            assert written is None
    assert 128 + sent in codes


@pytest.mark.parametrize("signal_name", slow_but(["SIGTERM"], SIGNALS))
def test_a_signal_after_the_command_is_done_changes_nothing(signal_name: str) -> None:
    """The interpreter takes a while to end; what was done has its own exit code and says nothing more."""
    script = (
        "import atexit, os, signal, sys\n"
        "from pipelines.command_line import main\n"
        f"atexit.register(os.kill, os.getpid(), signal.{signal_name})\n"
        "sys.argv = ['sloshlab', '--help']\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
