"""Commands that compare simulation and recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipelines.commands.application import Json, app, command_as_given, finish, free_folder


@app.command()
def diagnose(
    case: Annotated[
        Path, typer.Argument(metavar="CASE", help="Folder with rig.toml and recordings/*.nc.", show_default=False)
    ],
    *,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="DIR",
            help="Folder for results; CASE/diagnosis.",
            show_default=False,
            callback=free_folder,
        ),
    ] = None,
    twin: Annotated[
        Path | None,
        typer.Option(
            "--twin",
            metavar="MODULE.py",
            help="A twin of your own instead of that of rig.toml; its code is run.",
            show_default=False,
        ),
    ] = None,
    effects: Annotated[
        list[Path] | None,
        typer.Option(
            "--effects",
            metavar="MODULE.py",
            help="Effects of your own beside the known ones; its code is run. Repeatable.",
            show_default=False,
        ),
    ] = None,
    no_report: Annotated[bool, typer.Option("--no-report", help="Write verdict.json only.")] = False,
    as_json: Json = False,
) -> None:
    """What physics the simulation of a case left out, or that nothing is missing."""
    from pipelines.diagnosis.diagnose import diagnose_case

    finish(
        diagnose_case(
            case, output, command=command_as_given(), report=not no_report, twin=twin, effects=effects or ()
        ),
        as_json,
    )
