"""Tab completion as the shells ask for it: words, paths left to the shell, and the files that are written."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from short_runs import INPUT_IS_BAD

from pipelines.command_line import run
from pipelines.commands import completion
from pipelines.commands.completion_scripts import BASH, FISH, SHELL_FILES, ZSH

REPOSITORY = Path(__file__).resolve().parents[2]
DEMONSTRATIONS = ["friction", "late-sensor", "moving-liquid", "nothing-hidden", "two-at-once"]
ASKED = {
    ("demo", ""): DEMONSTRATIONS,
    ("demo", "mov"): ["moving-liquid"],
    ("trial", "s"): ["score", "seal"],
    ("virtual", "shaker_sweep", "--law", ""): ["linear", "octave", "stepped"],
    ("virtual", "shaker_sweep", "--dur"): ["--duration-s"],
    ("record", "--source", "ser"): ["serial:"],
    ("replay", "run.nc", "--as", "can"): ["can:slcan?", "can:socketcand?"],
    ("train", "run.nc", "--network", "m"): ["multilayer"],
    ("benchmark", "silverbox", "em"): ["emps"],
    # values that are paths are the shell's
    ("check", "r"): [],
    ("shaker", "run.nc", "--rig", ""): [],
}
"""Typed words, and what may follow; sorted."""


@pytest.fixture
def program(tmp_path: Path) -> Path:
    """A command `sloshlab` that runs this checkout."""
    if os.name != "posix":
        pytest.skip("bash, zsh and fish are shells of POSIX systems")
    place = tmp_path / "bin" / "sloshlab"
    place.parent.mkdir()
    place.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m pipelines.command_line "$@"\n')
    place.chmod(0o755)
    return place


def asked(program: Path, shell: list[str], script: str) -> list[str]:
    """Lines that a script of a shell prints."""
    if shutil.which(shell[0]) is None:
        pytest.skip(f"{shell[0]} is not installed")
    path = os.pathsep.join([str(program.parent), os.environ["PATH"]])
    done = subprocess.run(
        [*shell, script],
        cwd=program.parent,
        env={**os.environ, "PATH": path, "PYTHONPATH": str(REPOSITORY), "HOME": str(program.parent)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.stderr == ""
    return done.stdout.splitlines()


@pytest.mark.parametrize("words", ASKED, ids=" ".join)
def test_bash_gets_words(words: tuple[str, ...], program: Path) -> None:
    typed = " ".join(f"'{word}'" for word in ("sloshlab", *words))
    script = (
        f"{BASH}COMP_WORDS=({typed}); COMP_CWORD={len(words)}; compopt() {{ :; }}; _sloshlab_completion sloshlab\n"
    )
    found = asked(program, ["bash", "--norc", "-c"], script + 'printf "%s\\n" "${COMPREPLY[@]}"')
    # names of serial ports follow the scheme where there are some
    assert sorted(word for word in found if word and "/dev/" not in word) == ASKED[words]


def test_bash_puts_no_space_behind_a_scheme(program: Path) -> None:
    script = f'{BASH}compopt() {{ echo "$1 $2"; }}; COMP_WORDS=(sloshlab record --source si); COMP_CWORD=3\n'
    assert asked(program, ["bash", "--norc", "-c"], f"{script}_sloshlab_completion sloshlab") == ["-o nospace"]
    whole = script.replace("--source si", "--ri")
    assert asked(program, ["bash", "--norc", "-c"], f"{whole}_sloshlab_completion sloshlab") == []


@pytest.mark.parametrize("words", [("demo", ""), ("trial", "s"), ("check", "r")], ids=" ".join)
def test_zsh_gets_words_and_leaves_files_to_the_shell(words: tuple[str, ...], program: Path) -> None:
    shown = 'compdef() { :; }\n_arguments() { print -r -- "$2" }\n_files() { print -r -- FILES }\n'
    typed = " ".join(f"'{word}'" for word in ("sloshlab", *words))
    script = f"{shown}{ZSH}words=({typed}); CURRENT={len(words) + 1}; _sloshlab_completion\n"
    found = "\n".join(asked(program, ["zsh", "-f", "-c"], script.replace('"$2"', '"${@[-1]}"')))
    expected = ASKED[words]
    assert ("FILES" in found) == (not expected)
    assert all(f'"{word}"' in found for word in expected)


def test_zsh_completes_at_the_first_press_of_a_session(program: Path) -> None:
    """An autoloaded file that only defines its function gave nothing the first time."""
    folder = program.parent / "functions"
    folder.mkdir()
    (folder / "_sloshlab").write_text(ZSH)
    script = (
        'compdef() { :; }\n_arguments() { print -r -- "${@[-1]}" }\n'
        f"fpath=({folder}); autoload -U _sloshlab\nwords=(sloshlab demo fri); CURRENT=3; _sloshlab\n"
    )
    assert asked(program, ["zsh", "-f", "-c"], script) == ['*: :(("friction"))']


@pytest.mark.parametrize("words", [("demo", ""), ("trial", "s"), ("check", "r")], ids=" ".join)
def test_fish_gets_words(words: tuple[str, ...], program: Path) -> None:
    (program.parent / "run.nc").touch()
    typed = " ".join(("sloshlab", *words))
    found = asked(program, ["fish", "--no-config", "-c"], f'{FISH}complete -C "{typed}"')
    assert sorted(line.split("\t")[0] for line in found) == (ASKED[words] or ["run.nc"])


def test_vocabularies_are_those_of_the_program() -> None:
    """They are repeated for speed; here they are compared with where they stand."""
    from acquisition.devices.appearance import APPEARANCES
    from acquisition.recorder.assembly import ALIGNMENTS
    from acquisition.sources.urls import BACKENDS
    from acquisition.virtual_laboratory.shaker_run import SWEEP_LAWS
    from pipelines.field_benchmarks.catalogue import BENCHMARKS
    from pipelines.recording.virtual import LABORATORIES, LIQUIDS
    from sealed_trial.demonstrations import DEMONSTRATIONS as KNOWN
    from sloshlab.reduced_order_model.network_list import NETWORKS

    assert tuple(KNOWN) == completion.DEMONSTRATIONS
    assert tuple(BENCHMARKS) == completion.BENCHMARKS
    assert NETWORKS.names == completion.NETWORKS
    assert ALIGNMENTS == completion.ALIGNMENTS
    assert SWEEP_LAWS == completion.SWEEP_LAWS
    assert LABORATORIES == completion.LABORATORIES
    assert LIQUIDS == completion.LIQUIDS
    assert {word for word in completion.source_url("") if "/dev/" not in word} == {f"{s}:" for s in BACKENDS.names}
    assert {word.partition(":")[0] for word in completion.device_url("")} == set(APPEARANCES.names)


@pytest.mark.parametrize(("shell", "started_by"), [("bash", ".bashrc"), ("zsh", ".zshrc"), ("fish", "")])
def test_installing_twice_adds_one_line_and_changes_no_other(
    shell: str, started_by: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    if started_by:
        (tmp_path / started_by).write_text("alias x=y  # without an end of line")
    assert run(["--install-completion", shell]) == 0
    assert run(["--install-completion", shell]) == 0
    place = SHELL_FILES[shell].place(tmp_path)
    assert str(place) in capsys.readouterr().out
    assert place.read_text() == SHELL_FILES[shell].script
    if started_by:
        lines = (tmp_path / started_by).read_text().splitlines()
        assert lines == ["alias x=y  # without an end of line", SHELL_FILES[shell].line(place)]


@pytest.mark.parametrize("option", ["--install-completion", "--show-completion"])
def test_an_unknown_shell_is_one_line(
    option: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert run([option, "tcsh"]) == INPUT_IS_BAD
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == (
        "sloshlab: completion: got 'tcsh'; allowed: bash, zsh, fish, powershell, pwsh; "
        "remedy: name the shell after the option\n"
    )
    assert list(tmp_path.iterdir()) == []


def test_the_shell_around_is_meant_where_none_is_named(monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.setattr(completion, "_shell_around", lambda: "fish")
    assert run(["--show-completion"]) == 0
    assert capsys.readouterr().out == FISH
