"""Where a result is to go is looked at before any work: a file where a folder is made, and the other way round."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from short_runs import INPUT_IS_BAD, assert_one_line

from pipelines.command_line import application, run

RUN, RIG = ["absent.nc"], ["--rig", "absent.toml"]
FOLDERS: dict[str, list[str]] = {
    "shaker -o": ["shaker", *RUN, *RIG],
    "analyse -o": ["analyse", *RUN, *RIG],
    "work -o": ["work", *RUN, "--force", "f", "--acceleration", "a"],
    "beam -o": ["beam", *RUN, *RIG],
    "ball -o": ["ball", *RUN, *RIG],
    "ball-network -o": ["ball-network", *RUN, *RIG, "--ball", "absent_ball.toml"],
    "validate -o": ["validate", "absent_rom.nc", *RUN, *RIG],
    "study -o": ["study", *RUN, *RUN, *RIG],
    "diagnose -o": ["diagnose", "absent"],
    "benchmark -o": ["benchmark", "silverbox", "--data", "absent"],
    "flutter -o": ["flutter", "absent.toml", "--from", "60", "--to", "180"],
    "aircraft -o": ["aircraft", "absent.toml"],
    "wing -o": ["wing", "absent.toml", "--rom", "absent_rom.nc"],
    "campaign -o": ["campaign", "absent"],
    "trial seal -o": ["trial", "seal", "--key", "absent.key"],
    "trial score -o": ["trial", "score", "absent"],
    "virtual campaign -o": ["virtual", "campaign"],
    "virtual flight -o": ["virtual", "flight", "--model", "absent.toml"],
    "virtual --checkpoints": ["virtual", "shaker_sweep", "-o", "run.nc"],
}
FILES: dict[str, list[str]] = {
    "import -o": ["import", "absent.csv", "--map", "absent.toml"],
    "train -o": ["train", *RUN, *RUN, *RIG],
    "simulate -o": ["simulate", *RIG, "--input", *RUN],
    "simulate --save-twin": ["simulate", *RIG, "--input", *RUN, "-o", "run.nc"],
    "virtual -o": ["virtual", "shaker_sweep", *RIG],
    "virtual --checkpoint": ["virtual", "shaker_sweep", *RIG, "-o", "run.nc"],
    "record -o": ["record", "--source", "sim:shaker_sweep", *RIG],
    "recover -o": ["recover", "absent.journal"],
    "replay --truth": ["replay", *RUN, "--as", "serial:pty"],
}
NAMES = {"-o": "--output"}


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a file and a folder that are not empty."""
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("a letter")
    Path("folder").mkdir()
    Path("folder/kept").write_text("kept")


def listed() -> list[str]:
    return sorted(str(path) for path in Path().rglob("*"))


def refused(arguments: list[str], capsys: Any, *fragments: str) -> None:
    """Exit 1, one line; neither an input that is absent was missed nor anything written."""
    before = listed()
    assert run(arguments) == INPUT_IS_BAD
    captured = capsys.readouterr()
    assert captured.out == ""
    assert_one_line(captured.err, *fragments)
    assert listed() == before
    assert Path("file").read_text() == "a letter"


def option_of(name: str) -> str:
    return name.rpartition(" ")[2]


@pytest.mark.parametrize("name", list(FOLDERS))
def test_a_file_where_a_folder_is_made(name: str, capsys: Any) -> None:
    option = option_of(name)
    said = f"{NAMES.get(option, option)} file: got a file in the way"
    refused([*FOLDERS[name], option, "file"], capsys, said, "remedy: choose another folder")


@pytest.mark.parametrize("name", list(FILES))
def test_a_folder_where_a_file_is_written(name: str, capsys: Any) -> None:
    option = option_of(name)
    said = f"{NAMES.get(option, option)} folder: got a folder in the way"
    refused([*FILES[name], option, "folder"], capsys, said, "remedy: choose another name")


@pytest.mark.parametrize("name", [*FOLDERS, *FILES])
def test_a_file_as_a_folder_above(name: str, capsys: Any) -> None:
    option, arguments = option_of(name), {**FOLDERS, **FILES}[name]
    said = f"{NAMES.get(option, option)} file/deep/out: got {Path('file').absolute()}, which is a file"
    refused([*arguments, option, "file/deep/out"], capsys, said, "allowed: a folder")


def test_a_folder_above_that_does_not_exist_is_made(laboratory: Path, capsys: Any) -> None:
    """As every command makes it; two commands demanded it to be there."""
    virtual = ["virtual", "shaker_sweep", "--rig", str(laboratory / "rig.toml"), "--duration-s", "12"]
    assert run([*virtual, "-o", "new/deep/run.nc"]) == 0
    assert Path("new/deep/run.nc").is_file()


def options_that_write() -> Iterator[str]:
    command: Any = typer.main.get_command(application())
    trial = command.commands["trial"].commands
    for name, sub in {**command.commands, **{f"trial {key}": sub for key, sub in trial.items()}}.items():
        for parameter in sub.params:
            words = getattr(parameter, "help", None) or ""
            if any(
                word in words for word in ("Folder for results", "to write", "Save ", "Write what", "is saved")
            ):
                yield f"{name} {parameter.opts[0]}"


def test_no_option_that_writes_is_forgotten_here() -> None:
    # of one command with several kinds of runs
    known = {
        name.replace("virtual campaign", "virtual").replace("virtual flight", "virtual")
        for name in {**FOLDERS, **FILES}
    }
    assert set(options_that_write()) == known


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["diagnose", "absent"], "case absent: got no such folder"),
        (["diagnose", "absent", "--twin", "twin.py"], "case absent: got no such folder"),
        (["diagnose", "file"], "case file: got a file"),
        (["diagnose", "folder"], "case folder: got no rig.toml"),
        (["trial", "run", "absent"], "trial absent: got no such folder"),
        (["trial", "score", "file", "-o", "out"], "trial file: got a file"),
        (["trial", "score", "folder", "-o", "out"], "trial folder: got no commitments.json"),
    ],
)
def test_folders_that_are_none(arguments: list[str], said: str, capsys: Any) -> None:
    refused(arguments, capsys, said)
