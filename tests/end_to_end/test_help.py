"""Help and errors as a person sees them: examples that can be typed, colours, silence, and what is installed."""

from __future__ import annotations

import importlib.metadata
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import typer.main
from progress_lines import without_progress
from short_runs import INPUT_IS_BAD, USAGE

from pipelines.command_line import application, run
from pipelines.commands.examples import EXAMPLES, examples_of
from sloshlab import __version__

REPOSITORY = Path(__file__).resolve().parents[2]
PROGRAM = typer.main.get_command(application())
CHEAP = {
    "sloshlab demo --list",
    "sloshlab benchmark --list",
    "sloshlab info",
    "sloshlab info --json",
    "sloshlab import --describe bench.csv",
    "sloshlab import --describe bench.csv --starter bench.toml",
    "sloshlab virtual shaker_sweep --rig rig.toml --duration-s 6 -o sweep.nc",
    "sloshlab check sweep_3g.nc",
    "sloshlab case new CASE --rig rig.toml --recordings run_1.nc run_2.nc",
}
"""Examples that are run as they stand."""


def commands(group: Any = PROGRAM, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every command with its words, groups and the program itself included."""
    yield path, group
    for name, command in getattr(group, "commands", {}).items():
        yield from commands(command, (*path, name))


COMMANDS = dict(commands())


@pytest.mark.parametrize("path", COMMANDS, ids=" ".join)
def test_every_help_ends_with_examples_as_they_are_typed(
    path: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    """However narrow the terminal, an example is one line that can be copied."""
    monkeypatch.setenv("COLUMNS", "60")
    assert run([*path, "--help"]) == 0
    shown = capsys.readouterr().out.rpartition("Examples:\n")[2].splitlines()
    assert [line.strip() for line in shown if line] == list(examples_of(" ".join(path)))
    assert shown


def test_examples_are_of_commands_that_there_are() -> None:
    steps = {" ".join(path) for path, command in COMMANDS.items() if not hasattr(command, "commands") or not path}
    assert set(EXAMPLES) == steps
    for path, examples in EXAMPLES.items():
        assert all(example.startswith(f"sloshlab {path}".strip()) for example in examples)


@pytest.mark.parametrize("example", [example for shown in EXAMPLES.values() for example in shown])
def test_every_example_can_be_parsed(example: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    program, *words = shlex.split(example)
    assert program == "sloshlab"
    context = PROGRAM.make_context(program, words)
    command: Any = PROGRAM
    while hasattr(command, "commands") and (rest := [*context._protected_args, *context.args]):
        name, command, rest = command.resolve_command(context, rest)
        # refuses options and values that the command does not have
        context = command.make_context(name, rest, parent=context)
    assert not hasattr(command, "commands") or words == ["--install-completion", ""] or words[0].startswith("--")


def test_an_example_with_a_misspelt_option_would_be_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(Exception, match="No such option"):
        test_every_example_can_be_parsed("sloshlab check run.nc --jsno", tmp_path, monkeypatch)


def test_cheap_examples_run(
    laboratory: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig.toml").write_bytes((laboratory / "rig.toml").read_bytes())
    for name in ("sweep_3g", "run_1", "run_2"):
        source = "sweep_1.5g" if name == "run_2" else "sweep_3g"
        (tmp_path / f"{name}.nc").write_bytes((laboratory / f"{source}.nc").read_bytes())
    (tmp_path / "bench.csv").write_text("time [s];force [N]\n0,0;1,5\n0,1;2,5\n0,2;3,5\n")
    known = [example for shown in EXAMPLES.values() for example in shown if example in CHEAP]
    assert set(known) == CHEAP
    for example in known:
        code = run(shlex.split(example)[1:])
        # recordings of a few seconds may be flagged; nothing is refused
        assert code in (0, 3), f"{example}: {capsys.readouterr().err}"


def seen_on_a_terminal(arguments: list[str], **environment: str) -> str:
    """What a command writes to a terminal."""
    pty = pytest.importorskip("pty", reason="needs pseudo-terminals")
    ours, theirs = pty.openpty()
    words = [sys.executable, "-m", "pipelines.command_line", *arguments]
    removed = {"NO_COLOR", "FORCE_COLOR", "TERM"}
    given = {name: value for name, value in os.environ.items() if name not in removed}
    path = {"PYTHONPATH": str(REPOSITORY), "TERM": "xterm", "COLUMNS": "200"}
    with subprocess.Popen(words, stdout=theirs, stderr=theirs, env={**given, **path, **environment}) as process:
        os.close(theirs)
        shown = b""
        while True:
            try:
                part = os.read(ours, 4096)
            except OSError:  # Linux tells the end of a terminal so
                break
            if not part:
                break
            shown += part
        process.wait(timeout=60)
    os.close(ours)
    return shown.decode()


RED = "\x1b[31m\x1b[1m"


@pytest.mark.parametrize(
    ("arguments", "head"), [(["check", "absent.nc"], "sloshlab:"), (["check", "--jsno"], "Error:")]
)
def test_errors_are_red_on_a_terminal(arguments: list[str], head: str) -> None:
    shown = seen_on_a_terminal(arguments)
    assert f"{RED}{head}\x1b[0m" in shown
    assert shown.count("\x1b[") == 3


@pytest.mark.parametrize("without", [{"NO_COLOR": "1"}, {"TERM": "dumb"}], ids=["NO_COLOR", "dumb"])
def test_no_colour_where_none_is_wanted(without: dict[str, str]) -> None:
    assert "\x1b[" not in seen_on_a_terminal(["check", "absent.nc"], **without)


def test_no_colour_in_a_pipe(monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert run(["check", "absent.nc"]) == INPUT_IS_BAD
    assert run(["check", "--jsno"]) == USAGE
    shown = capsys.readouterr().err
    assert "\x1b" not in shown
    assert "sloshlab: recording absent.nc" in shown
    assert "Error: No such option" in shown


def test_quiet_hides_progress_and_nothing_else(
    laboratory: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    now = iter(range(0, 10_000_000, 40))
    # of the progress alone: what waits for a reader of files would otherwise give up after two looks
    monkeypatch.setattr("pipelines.report.progress.time", SimpleNamespace(monotonic=lambda: float(next(now))))
    command = ["check", str(laboratory / "sweep_3g.nc")]
    shaker = ["shaker", str(laboratory / "sweep_3g.nc"), "--rig", str(laboratory / "rig.toml"), "--no-report"]
    run([*shaker, "-o", str(laboratory.parent / "told")])
    told = capsys.readouterr()
    run([*shaker, "-o", str(laboratory.parent / "told"), "--quiet"])
    quiet = capsys.readouterr()
    assert "so far" in told.err
    assert quiet.out == told.out
    assert quiet.err == without_progress(told.err)
    assert run([*command[:1], "absent.nc", "--quiet"]) == INPUT_IS_BAD
    assert "absent.nc" in capsys.readouterr().err


def test_the_version_is_alone_on_its_line(capsys: Any) -> None:
    assert run(["--version"]) == 0
    first, second, third = capsys.readouterr().out.splitlines()
    assert first == __version__
    assert re.fullmatch(r"commit ([0-9a-f]{40}(, changed)?|unknown), Python 3\.\d+\.\d+\S*", second)
    assert f"numpy {importlib.metadata.version('numpy')}" in third


def test_info_says_what_is_installed(capsys: Any) -> None:
    assert run(["info", "--json"]) == 0
    *lines, last = capsys.readouterr().out.splitlines()
    facts = json.loads(last)
    assert lines[0] == f"sloshlab {__version__}, commit {facts['commit']}"
    for package in ("numpy", "scipy", "xarray", "numba", "typer"):
        assert facts["dependencies"][package] == importlib.metadata.version(package)
        assert f"  {package} {facts['dependencies'][package]}" in lines
    assert {"formats", "dev", "trial", "gpu", "peers", "docs"} <= set(facts["extras"])
    assert "pytest" not in facts["extras"]["dev"]
    if (REPOSITORY / ".git").exists():
        head = subprocess.run(["git", "rev-parse", "HEAD"], cwd=REPOSITORY, capture_output=True, text=True).stdout
        assert facts["commit"].removesuffix(", changed") == head.strip()


def test_a_built_package_tells_the_commit_that_it_was_built_from(tmp_path: Path) -> None:
    from pipelines.report.installation import commit

    package = tmp_path / "sloshlab"
    package.mkdir()
    assert commit(package) == "unknown"
    (package / "commit.txt").write_text("0123abcd\n")
    assert commit(package) == "0123abcd"
