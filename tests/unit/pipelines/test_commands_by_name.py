"""A command loads the module that defines it and those of no other command; together they are all."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import typer.main

from pipelines.command_line import application
from pipelines.commands import case, trial

REPOSITORY = Path(__file__).resolve().parents[3]
TOLD = (
    "import sys; from pipelines.command_line import run; code = run(sys.argv[1:]);"
    "print(*(name.split('.')[2] for name in sys.modules if name.startswith('pipelines.commands.')))"
)


def loaded(*words: str) -> set[str]:
    """Modules of `pipelines.commands` that a command has loaded by its end."""
    path = os.pathsep.join(filter(None, (str(REPOSITORY), os.environ.get("PYTHONPATH"))))
    done = subprocess.run(
        [sys.executable, "-c", TOLD, *words],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        check=True,
    )
    return set(done.stdout.decode().splitlines()[-1].split())


def test_every_module_of_commands_is_found_by_the_names_of_its_commands() -> None:
    folder = REPOSITORY / "pipelines" / "commands"
    shared = {"__init__", "application", "command_help", "completion", "completion_scripts", "examples"}
    modules = {file.stem for file in folder.glob("*.py")} - shared
    app = application()
    functions = [command.callback for command in app.registered_commands]
    assert {function.__module__.rpartition(".")[2] for function in functions if function} | {
        "case",
        "trial",
    } == modules
    assert [group.typer_instance for group in app.registered_groups] == [case.case, trial.trial]
    for command in app.registered_commands:
        assert command.callback is not None
        name = command.name or command.callback.__name__
        asked = application([name])
        assert name in typer.main.get_command(asked).commands, name  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("words", "own"), [(("check", "absent.nc"), "recordings"), (("trial", "--help"), "trial")]
)
def test_a_command_loads_its_own_module(words: tuple[str, ...], own: str) -> None:
    kept = loaded(*words) - {"application", "command_help", "completion", "completion_scripts", "examples"}
    assert kept == {own}


def test_the_help_lists_all_in_one_order_whatever_ran_before() -> None:
    application(["trial"])
    first = list(typer.main.get_command(application()).commands)  # type: ignore[attr-defined]
    assert {"demo", "check", "case", "trial", "info"} <= set(first)
    assert first == list(typer.main.get_command(application()).commands)  # type: ignore[attr-defined]
