"""What all commands share: the application, exit codes, options of one name and one meaning, the last lines."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from pipelines.commands.command_help import Application
from pipelines.commands.completion import SHELLS, completion_script, install_completion, one_of
from pipelines.report.free_place import require_free_file, require_free_folder
from pipelines.report.terminal import complain, say
from sloshlab.file_structure import require_recording_file

INPUT_IS_BAD, USAGE, DONE_BUT_FLAGGED, INTERRUPTED = 1, 2, 3, 130

app = Application(
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


def require_recordings(files: list[Path]) -> None:
    """Refuse what is no file, before the libraries that read it are loaded."""
    for file in files:
        require_recording_file(file)


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
GeneralisedForceCache = Annotated[
    Path | None,
    typer.Option(
        "--cache",
        metavar="FOLDER",
        help="Keeps generalised forces of the doublet lattice.",
        show_default=False,
        callback=free_folder,
    ),
]
Redundant = Annotated[
    list[str] | None,
    typer.Option(
        "--redundant", metavar="A:B", help="Channels of two devices that show the same motion.", show_default=False
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        metavar="WHERE",
        help="tcp://HOST:PORT of a Dask scheduler, or slurm; this machine if not given.",
        show_default=False,
    ),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace a file that is there.")]
NoReport = Annotated[bool, typer.Option("--no-report", help="Write windows.nc and maps.nc only.")]


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", help="Print version, commit and those of the dependencies, and exit.")
    ] = False,
    install: Annotated[
        str | None,
        typer.Option(
            "--install-completion",
            metavar="[SHELL]",
            help=f"Install completion for the shell around, or for one of {', '.join(SHELLS)}.",
            show_default=False,
            autocompletion=one_of(SHELLS),
        ),
    ] = None,
    show: Annotated[
        str | None,
        typer.Option(
            "--show-completion",
            metavar="[SHELL]",
            help="Print the completion script instead.",
            show_default=False,
            autocompletion=one_of(SHELLS),
        ),
    ] = None,
) -> None:
    if version:
        from pipelines.report.installation import version_lines

        for line in version_lines():
            say(line)
        raise typer.Exit
    if install is not None:
        finish({"lines": install_completion(install)}, as_json=False)
        raise typer.Exit
    if show is not None:
        # a script of many lines for a shell, with control characters that are meant
        sys.stdout.write(completion_script(show))
        raise typer.Exit
    if context.invoked_subcommand is None:
        context.fail("Missing command.")


def finish(summary: dict[str, Any], as_json: bool) -> None:
    """Say what a command has to say: ``lines`` for people; ``flags`` make the exit code 3, ``defects`` 1."""
    for line in summary.pop("lines", []):
        say(line)
    defects = summary.get("defects", [])
    for defect in defects:
        complain(f"sloshlab: {defect}")
    flags = summary.get("flags", [])
    for flag in flags:
        complain(f"flagged: {flag}", "flag")
    if as_json:
        say(json.dumps(summary, sort_keys=True, default=str))
    if defects:
        raise typer.Exit(INPUT_IS_BAD)
    if flags:
        raise typer.Exit(DONE_BUT_FLAGGED)


def command_as_given() -> str:
    """The command as it was typed, folders left out."""
    return " ".join(["sloshlab", *(Path(word).name if os.sep in word else word for word in sys.argv[1:])])
