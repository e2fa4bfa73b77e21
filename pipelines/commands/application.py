"""What all commands share: the application, exit codes, options of one name and one meaning, the last lines."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from pipelines.report.free_place import require_free_file, require_free_folder
from pipelines.report.terminal import say
from sloshlab import __version__

INPUT_IS_BAD, USAGE, DONE_BUT_FLAGGED, INTERRUPTED = 1, 2, 3, 130

app = typer.Typer(
    name="sloshlab",
    help="Energy, effective mass and damping of shaken, partly filled tanks.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Recordings = Annotated[list[Path], typer.Argument(metavar="RUN.nc...", help="Recordings.", show_default=False)]
RigOption = Annotated[
    list[Path],
    typer.Option("--rig", metavar="RIG.toml", help="Rig description; once per fill level.", show_default=False),
]


def free_folder(option: typer.CallbackParam, folder: Path | None) -> Path | None:
    """The folder of an option, of which is known before any work that it can be filled."""
    if folder is not None:
        require_free_folder(folder, f"{option.opts[-1]} {folder}")
    return folder


def free_file(option: typer.CallbackParam, file: Path | None) -> Path | None:
    """The file of an option, of which is known before any work that it can be written."""
    if file is not None:
        require_free_file(file, f"{option.opts[-1]} {file}")
    return file


OutputFolder = Annotated[
    Path,
    typer.Option(
        "-o", "--output", metavar="OUT", help="Folder for results.", show_default=False, callback=free_folder
    ),
]
OutputFile = Annotated[
    Path,
    typer.Option("-o", "--output", metavar="FILE", help="File to write.", show_default=False, callback=free_file),
]
Json = Annotated[bool, typer.Option("--json", help="Print a machine-readable summary as the last line.")]
HalfWidth = Annotated[int, typer.Option("--p", min=1, help="P: a window averages 2P cycles.")]
Spacing = Annotated[int, typer.Option("--m", min=1, help="M: cycles between the centres of windows.")]
Redundant = Annotated[
    list[str] | None,
    typer.Option(
        "--redundant", metavar="A:B", help="Channels of two devices that show the same motion.", show_default=False
    ),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace a file that is there.")]
NoReport = Annotated[bool, typer.Option("--no-report", help="Write windows.nc and maps.nc only.")]


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    if version:
        say(__version__)
        raise typer.Exit


def finish(summary: dict[str, Any], as_json: bool) -> None:
    """Say what a command has to say: ``lines`` for people; ``flags`` make the exit code 3, ``defects`` 1."""
    for line in summary.pop("lines", []):
        say(line)
    defects = summary.get("defects", [])
    for defect in defects:
        say(f"sloshlab: {defect}", error=True)
    flags = summary.get("flags", [])
    for flag in flags:
        say(f"flagged: {flag}", error=True)
    if as_json:
        say(json.dumps(summary, sort_keys=True, default=str))
    if defects:
        raise typer.Exit(INPUT_IS_BAD)
    if flags:
        raise typer.Exit(DONE_BUT_FLAGGED)


def command_as_given() -> str:
    """The command as it was typed, folders left out."""
    return " ".join(["sloshlab", *(Path(word).name if os.sep in word else word for word in sys.argv[1:])])
