"""Case folders: `case new` makes one of a rig file and recordings, `case check` says whether one is good."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipelines.commands.application import Json, app, finish
from pipelines.commands.command_help import Application

case = Application(
    help="Case folders for the diagnosis: made, checked, and what their runs can decide.", no_args_is_help=True
)
app.add_typer(case, name="case")


@case.command()
def new(
    folder: Annotated[Path, typer.Argument(metavar="CASE", help="Folder to make.", show_default=False)],
    more: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[RUN.nc...]", help="More recordings.", show_default=False),
    ] = None,
    *,
    rig: Annotated[
        Path,
        typer.Option("--rig", metavar="RIG.toml", help="Rig, with the twin that is doubted.", show_default=False),
    ],
    recordings: Annotated[
        list[Path],
        typer.Option("--recordings", metavar="RUN.nc...", help="Recordings, or folders.", show_default=False),
    ],
    link: Annotated[bool, typer.Option("--link", help="Link recordings instead of copying them.")] = False,
    as_json: Json = False,
) -> None:
    """Make a case of a rig file and recordings, and say what they can decide."""
    from pipelines.diagnosis.case_builder import new_case

    finish(new_case(folder, rig, [*recordings, *(more or ())], link=link), as_json)


@case.command()
def check(
    folder: Annotated[
        Path, typer.Argument(metavar="CASE", help="Folder with rig.toml and recordings/*.nc.", show_default=False)
    ],
    *,
    as_json: Json = False,
) -> None:
    """Say whether a case can be diagnosed, what its runs can decide, and which are lacking."""
    from pipelines.diagnosis.case_builder import check_case

    finish(check_case(folder), as_json)
